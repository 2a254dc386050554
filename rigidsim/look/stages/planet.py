"""Stage of a planet: its globe and axes, ecliptic and equator, the circle of its precession, and its source.

The pole's motion is far too small for the globe: it is drawn beside it in a plane of its own.
"""

from dataclasses import replace

import numpy as np
import xarray

from rigidsim.look import signals, surroundings
from rigidsim.look.stages import parts, precession
from rigidsim.look.stages.bodies import Subject, column, source_arrows
from rigidsim.look.stages.parts import BODY, Array, Arrow, Color, Line, Picture, Plane, Stage, Trail, Vector
from rigidsim.look.symbols import earth, globe, graticule
from rigidsim.scene.bodies.presets import KNOWN, KnownBody

_LARGE = 1e5  # m: a smaller body is no globe
_ROUND = 0.9  # of the smallest over the largest semi-axis
_ALIKE = 1e-3  # of a radius, for a body to be taken for one that is known
_UNKNOWN: Color = (128, 148, 170)
EQUATOR: Color = (150, 205, 110)
_LEADING = ("polar_motion", "obliquity", "node_longitude", "wobble_angle", "rotation_angle")


def picture(dataset: xarray.Dataset, subject: Subject) -> Picture | None:
    """Picture of a large, nearly round body that spins nearly about its figure axis; None for others."""
    axes = _semi_axes(subject)
    poles = signals.near_axis(dataset) or "obliquity" in dataset or "polar_motion" in dataset
    if axes is None or subject.position is not None or not poles:
        return None
    name = str(subject.solids[0].get("name", ""))
    known = _known(name, float(axes.max()))
    name = name or (known.name.lower() if known else "")
    half = axes / axes.max()
    mesh = earth(half) if name == "earth" else globe(half, surroundings.color_of(known, _UNKNOWN))
    figure = signals.figure_direction(dataset)
    turns, averaged = subject.attitude is not None, "angular_velocity" not in dataset
    if not turns and averaged:
        subject = precession.pointed(dataset, subject, figure)
    beside = subject.attitude is None and precession.moving_plane(dataset)
    if beside and averaged:
        subject = precession.pointed(dataset, subject, figure, plane=True)
    subject = replace(subject, meshes=[mesh], reach=float(axes.max()))
    stage = replace(subject.stage([], [], name.capitalize() or "Planet"), axis_length=0.0)
    rings = enumerate(graticule(half))
    stage.lines.extend(Line(f"graticule/{k}", (20, 24, 30), line, BODY, 0.8, 0.55) for k, line in rings)
    if turns or subject.attitude is None:  # the prime meridian stands out, so that the rotation shows
        stage.lines.append(Line("prime_meridian", parts.PALE, graticule(half, 180.0, 1.006)[0], BODY, 1.6))
    stage.lines.append(Line("equator", EQUATOR, parts.circle(1.01, figure), BODY, 1.8, 1.0, "equator"))
    notes = ["continents: Natural Earth; the body's x axis is at longitude zero"] if name == "earth" else []
    planes = _pole_planes(dataset)
    called = {"": "a planet", "earth": "the Earth", "moon": "the Moon"}.get(name, name.capitalize())
    if subject.attitude is None:
        _in_its_own_axes(dataset, stage, figure, notes)
        stage = replace(stage, camera=precession.eye_of_pole(0.3, 1.75))
        return Picture(f"rotation of {called}", [stage], planes, _LEADING, notes)
    pole = subject.attitude @ figure
    arrow = Arrow(
        "figure_axis", "figure axis", parts.FIGURE, precession.POLE_REACH * pole, False, "figure axis"
    )
    stage.arrows.append(arrow)
    precession.reference_plane(stage)
    precession.circle_of_precession(dataset, stage, pole, "figure", notes)
    if turns:
        stage.arrows.extend(source_arrows(dataset, subject, precession.SOURCE_REACH))
    elif beside:
        notes.append("the plane of reference moves in space: the globe is drawn as seen from it")
    else:
        stage.arrows.extend(precession.followed_sources(dataset, subject, notes))
    if not turns:
        notes.append(precession.standing_note(dataset, "globe"))
    rates, seconds = column(dataset, "angular_velocity", 3), signals.seconds(dataset)
    if rates is not None and len(seconds) > 1:
        step = float(np.nanmean(np.linalg.norm(rates, axis=1)) * np.abs(np.diff(seconds)).mean())
        if step > 1.0:
            words = "the globe's turning isn't seen between them"
            notes.append(f"samples are {step:.3g} rad of rotation apart: {words}")
    stage = replace(stage, camera=precession.eye_of_pole())
    return Picture(f"rotation of {called} in space", [stage], planes, _LEADING, notes)


def _known(name: str, radius: float) -> KnownBody | None:
    """The known planet with this name, or else with this equatorial radius (m); None if unknown."""
    if name:
        return surroundings.named_body(name)
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
    rates = column(dataset, "angular_velocity", 3)
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


def _pole_planes(dataset: xarray.Dataset) -> list[Plane]:
    """Polar motion in the body, and the pole in space less its mean motion."""
    planes = precession.nutation_planes(dataset, "figure")
    motion = signals.polar_motion(dataset)
    if motion is not None and np.nanmax(np.abs(motion)) > 0:
        planes.append(
            precession.plane_of("polar_motion_path", "Polar motion", parts.POLHODE, motion, ("m1", "m2"))
        )
    return planes
