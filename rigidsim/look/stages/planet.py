"""Stage of a planet: its globe and axes, ecliptic and equator, the circle of its precession, and its source.

The pole's motion is far too small for the globe: it is drawn beside it in a plane of its own.
"""

from dataclasses import replace

import numpy as np
import xarray

from rigidsim.look import signals
from rigidsim.look.record import color_of, named_body, scene_of
from rigidsim.look.stages import parts, precession
from rigidsim.look.stages.bodies import Subject, source_arrows
from rigidsim.look.stages.facing import facing
from rigidsim.look.stages.parts import (
    BODY,
    Array,
    Arrow,
    Color,
    Line,
    Picture,
    Solid,
    Stage,
    Trail,
    Vector,
)
from rigidsim.look.symbols import globe, graticule, pictured_globe
from rigidsim.scene.bodies.presets import KNOWN, KnownBody

_LARGE = 1e5  # m: a smaller body is no globe
_ROUND = 0.9  # of the smallest over the largest semi-axis
_ALIKE = 1e-3  # of a radius, for a body to be taken for one that is known
_UNKNOWN: Color = (128, 148, 170)
EQUATOR: Color = (150, 205, 110)
_X_AXIS_WEST = {"earth_rigid": 14.93}  # deg from Greenwich, of presets whose x axis is that of least moment
_SUN, _MOON = 0.11, 0.07  # radii of the balls that stand for sources, in radii of the globe
_AWAY = 0.2  # of an arrow's length, by which its label stands beyond the ball
_OPPOSITE = 1e-6


def picture(dataset: xarray.Dataset, subject: Subject) -> Picture | None:
    """Picture of a large, nearly round body that spins nearly about its figure axis; None for others."""
    axes = _semi_axes(subject)
    poles = signals.near_axis(dataset, exactly=True) or "obliquity" in dataset or "polar_motion" in dataset
    if axes is None or subject.position is not None or not poles:
        return None
    preset = str(subject.solids[0].get("name", ""))
    name = preset.partition("_")[0]
    known = _known(name, float(axes.max()))
    name = name or (known.name.lower() if known else "")
    half, west = axes / axes.max(), _X_AXIS_WEST.get(preset, 0.0)
    mapped = name in ("earth", "moon")
    mesh = pictured_globe(half, name) if mapped else globe(half, color_of(known, _UNKNOWN))
    figure = scene_of(dataset).figure
    turns, averaged = subject.attitude is not None, "angular_velocity" not in dataset
    if not turns and averaged:
        subject = precession.pointed(dataset, subject, figure)
    beside = subject.attitude is None and precession.moving_plane(dataset)
    if beside and averaged:
        subject = precession.pointed(dataset, subject, figure, plane=True)
    subject = replace(subject, meshes=[mesh.moved(_turn(west), np.zeros(3))], reach=float(axes.max()))
    stage = replace(subject.stage([], [], name.capitalize() or "Planet"), axis_length=0.0)
    lines = _lines(half, figure, west, prime=turns or subject.attitude is None)
    stage.lines.extend(lines)
    zero = f"{west:.4g}° west of Greenwich" if west else "at longitude zero"
    notes = [f"continents: Natural Earth; the body's x axis is {zero}"] if name == "earth" else []
    face = facing(dataset, subject, figure)
    faces = []
    if face is not None:
        faces = [replace(face[0], lines=[*lines, *face[0].lines])]
        notes.append(face[1])
    called = {"": "a planet", "earth": "the Earth", "moon": "the Moon"}.get(name, name.capitalize())
    if subject.attitude is None:
        _in_its_own_axes(dataset, stage, figure, notes)
        stage = replace(stage, camera=precession.eye_of_pole(0.3, 1.75))
        return Picture(f"rotation of {called}", [*faces, stage], notes)
    pole = subject.attitude @ figure
    arrow = Arrow(
        "figure_axis", "figure axis", parts.FIGURE, precession.POLE_REACH * pole, False, "figure axis"
    )
    stage.arrows.append(arrow)
    stage = precession.on_reference_plane(dataset, stage)
    precession.circle_of_precession(dataset, stage, pole, "figure", notes)
    if turns:
        arrows = source_arrows(dataset, precession.SOURCE_REACH)
        stage.arrows.extend(arrows)
        stage = _with_balls(stage, arrows)
        if len(arrows) < len(scene_of(dataset).sources) and "source_position" in dataset:
            notes.append(
                "directions are shown of sources whose tide is a thousandth of the strongest or more"
            )
    elif beside:
        notes.append("the plane of reference moves in space: the globe is drawn as seen from it")
    else:
        stage.arrows.extend(precession.followed_sources(dataset, notes))
    if not turns:
        notes.append(precession.standing_note(dataset, "globe"))
    rates, seconds = signals.values(dataset, "angular_velocity", 3), signals.seconds(dataset)
    if rates is not None and len(seconds) > 1:
        step = float(np.nanmean(np.linalg.norm(rates, axis=1)) * np.abs(np.diff(seconds)).mean())
        if step > 1.0:
            words = "the globe's turning isn't seen between them"
            notes.append(f"samples are {step:.3g} rad of rotation apart: {words}")
    stage = replace(stage, camera=precession.eye_of_pole())
    return Picture(f"rotation of {called} in space", [*faces, stage], notes)


def _with_balls(stage: Stage, arrows: list[Arrow]) -> Stage:
    """The sources as small balls at the tips of the arrows to them, the Sun larger; not to scale."""
    frames, solids = dict(stage.frames), list(stage.solids)
    for arrow in arrows:
        way = arrow.vectors / signals.norms(arrow.vectors)[:, None]
        # the least rotation from x to the direction; opposite to x about z
        half = np.stack([1 + way[:, 0], 0 * way[:, 0], -way[:, 2], way[:, 1]], axis=1)
        half[signals.norms(half) < _OPPOSITE] = (0.0, 0.0, 0.0, 1.0)
        name = f"towards_{arrow.name}"
        frames[name] = parts.viewer_quaternion(half)
        radius = _SUN if arrow.label.endswith("Sun") else _MOON
        far = float(np.nanmean(signals.norms(arrow.vectors))) + radius
        ball = globe(np.full(3, radius), arrow.color).moved(np.eye(3), np.array([far, 0.0, 0.0]))
        solids.append(Solid("ball", ball, name))
    away = [replace(arrow, label_at=1.0 + _AWAY) for arrow in arrows]
    kept = [arrow for arrow in stage.arrows if all(arrow is not one for one in arrows)]
    return replace(stage, frames=frames, solids=solids, arrows=[*kept, *away])


def _lines(half: Array, figure: Array, west: float, *, prime: bool) -> list[Line]:
    """Meridians and parallels, the equator, and the prime meridian, which makes the rotation seen."""
    turn = _turn(west)
    lines = [
        Line(f"graticule/{k}", (20, 24, 30), line @ turn.T, BODY, 0.8, 0.55)
        for k, line in enumerate(graticule(half))
    ]
    if prime:
        line = graticule(half, 180.0, 1.006)[0] @ turn.T
        lines.append(Line("prime_meridian", parts.PALE, line, BODY, 1.6, 1.0, "prime meridian"))
    return [*lines, Line("equator", EQUATOR, parts.circle(1.01, figure), BODY, 1.8, 1.0, "equator")]


def _turn(degrees: float) -> Array:
    """Rotation (3, 3) about z."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _known(name: str, radius: float) -> KnownBody | None:
    """The known planet with this name, or else with this equatorial radius (m); None if unknown."""
    if name:
        return named_body(name)
    near = min(KNOWN, key=lambda one: abs(one.radius - radius))
    return near if abs(near.radius / radius - 1) < _ALIKE else None


def _semi_axes(subject: Subject) -> Array | None:
    if len(subject.solids) != 1 or subject.solids[0].get("solid") not in ("ellipsoid", "sphere"):
        return None
    sizes = subject.solids[0].get("dimensions", {})
    axes = np.atleast_1d(np.asarray(sizes.get("semi_axes", sizes.get("radius", 0.0)), dtype=float))
    axes = np.full(3, axes[0]) if axes.shape == (1,) else axes
    if axes.shape != (3,) or not axes.min() > _LARGE or axes.min() < _ROUND * axes.max():
        return None
    return np.asarray(axes)


def _in_its_own_axes(dataset: xarray.Dataset, stage: Stage, figure: Array, notes: list[str]) -> None:
    """Draw figure axis and spin axis, their angle enlarged until it is visible."""
    notes.append("no attitude was recorded: the body is shown in its own axes and doesn't turn")
    stage.vectors.append(
        Vector("figure_axis", "figure axis", parts.FIGURE, figure, 0.55 * figure, BODY, "figure axis", 0.014)
    )
    rates = signals.values(dataset, "angular_velocity", 3)
    if rates is None:
        return
    spin = rates / np.linalg.norm(rates, axis=1, keepdims=True)
    spin = spin * np.sign(spin @ figure)[:, None]
    apart = spin - np.outer(spin @ figure, figure)
    size = float(np.nanmax(np.linalg.norm(apart, axis=1)))
    if not size > 0:
        return
    factor = max(0.32 / size, 1.0)
    power = 10.0 ** np.floor(np.log10(factor))
    factor = max(np.floor(factor / power) * power, 1.0)
    shown = 1.4 * figure + 1.4 * factor * apart
    times = f"{factor:,.0f} times"
    words = "spin axis" if factor == 1.0 else f"spin axis, {times} farther from the figure axis"
    stage.arrows.append(Arrow("spin_axis", "spin axis", parts.VELOCITY, shown, True, words))
    stage.trails.append(
        Trail("polar_motion", parts.POLHODE, shown, in_body=True, words="path of the spin axis")
    )
    notes.append(f"the angle between spin axis and figure axis is drawn {times} too large")
