"""A planet: its globe, its axes, ecliptic and equator, the circle of its precession, where its source is.

The pole's motion is far too small for the globe: it is drawn beside it in a plane of its own.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.look import signals, surroundings
from rigidsim.look.angle_units import angle_unit
from rigidsim.look.readable_time import span_text
from rigidsim.look.stages.bodies import FIELD, Subject, column, direction_of, source_arrows
from rigidsim.look.stages.parts import (
    BODY,
    FAINT,
    FIGURE,
    PALE,
    POLHODE,
    SPACE,
    VELOCITY,
    Array,
    Arrow,
    Camera,
    Color,
    Line,
    Picture,
    Plane,
    Spot,
    Stage,
    Vector,
    circle,
    trail,
)
from rigidsim.look.symbols import globe, graticule

if TYPE_CHECKING:
    from rigidsim.look.rows import Table

_LARGE = 1e5  # m: a smaller body is no globe
_ROUND = 0.9  # of the smallest over the largest semi-axis
_UNKNOWN: Color = (128, 148, 170)
ECLIPTIC: Color = (226, 196, 90)
EQUATOR: Color = (150, 205, 110)
PRECESSION: Color = (190, 150, 255)
_LEADING = (
    "polar_motion",
    "obliquity",
    "node_longitude",
    "wobble_angle",
    "rotation_angle",
    "angular_velocity",
)


def picture(dataset: Table, subject: Subject) -> Picture | None:
    """Of a large, nearly round body that spins about its figure axis but for a little."""
    axes = _semi_axes(subject)
    if axes is None or subject.position is not None or not (signals.near_axis(dataset) or _poles(dataset)):
        return None
    name = str(subject.solids[0].get("name", ""))
    known = next((one for one in surroundings.GLOBES if one.name.lower() == name), None)
    half = axes / axes.max()
    mesh = globe(half, known.color if known else _UNKNOWN)
    subject = replace(subject, meshes=[mesh], reach=float(axes.max()))
    figure = signals.figure_direction(dataset)
    stage = replace(subject.stage([], []), title=name.capitalize() or "Planet", axis_length=0.0)
    stage.lines.extend(
        [
            Line(f"graticule/{k}", (20, 24, 30), line, BODY, 0.8, 0.55)
            for k, line in enumerate(graticule(half))
        ]
    )
    # the prime meridian stands out, so that the rotation shows
    stage.lines.append(Line("prime_meridian", PALE, graticule(half, 180.0, 1.006)[0], BODY, 1.6))
    stage.lines.append(Line("equator", EQUATOR, circle(1.01, figure), BODY, 1.8, 1.0, "equator"))
    notes: list[str] = []
    planes = _pole_planes(dataset, notes)
    if subject.attitude is None:
        _in_its_own_axes(dataset, stage, figure, notes)
        stage = replace(stage, camera=_eye(np.array([0.0, 0.0, 0.3]), 1.75))
        return Picture(f"rotation of {_article(name)}", [stage], planes, _LEADING, notes)
    pole = signals.body_direction(dataset, figure)
    assert pole is not None
    stage.arrows.append(Arrow("figure_axis", "figure axis", FIGURE, 1.45 * pole, False, "figure axis"))
    _orbit_plane(stage)
    _precession(dataset, stage, pole, notes)
    stage.arrows.extend(source_arrows(dataset, subject, 1.75))
    step = _largest_turn(dataset)
    if step > 1.0:
        notes.append(
            f"samples are {step:.3g} rad of rotation apart: the globe's turning isn't seen between them"
        )
    stage = replace(stage, camera=_eye(np.array([0.0, 0.0, 0.05]), 1.95))
    return Picture(f"rotation of {_article(name)} in space", [stage], planes, _LEADING, notes)


def _largest_turn(dataset: Table) -> float:
    """Rotation (rad) from one row to the next, on the mean; 0 where the rate isn't known."""
    rates, seconds = column(dataset, "angular_velocity", 3), signals.seconds(dataset)
    if rates is None or len(seconds) < 2:
        return 0.0
    return float(np.nanmean(np.linalg.norm(rates, axis=1)) * np.abs(np.diff(seconds)).mean())


def _article(name: str) -> str:
    return {"": "a planet", "earth": "the Earth", "moon": "the Moon"}.get(name, name.capitalize())


def _semi_axes(subject: Subject) -> Array | None:
    if len(subject.solids) != 1 or subject.solids[0].get("solid") not in ("ellipsoid", "sphere"):
        return None
    sizes = subject.solids[0].get("dimensions", {})
    axes = np.atleast_1d(np.asarray(sizes.get("semi_axes", sizes.get("radius", 0.0)), dtype=float))
    axes = np.full(3, axes[0]) if axes.shape == (1,) else axes
    if axes.shape != (3,) or not axes.min() > _LARGE or axes.min() < _ROUND * axes.max():
        return None
    return np.asarray(axes)


def _poles(dataset: Table) -> bool:
    return "obliquity" in dataset or "polar_motion" in dataset


def _eye(target: Array, radius: float) -> Camera:
    direction = direction_of(np.deg2rad(22.0), np.deg2rad(-52.0))
    return Camera(target + radius / np.sin(FIELD / 2) * direction, target, np.array([0.0, 0.0, 1.0]))


def _in_its_own_axes(dataset: Table, stage: Stage, figure: Array, notes: list[str]) -> None:
    """Figure axis and spin axis, their angle enlarged until it is seen."""
    notes.append("no attitude was recorded: the body is shown in its own axes and doesn't turn")
    stage.vectors.append(
        Vector("figure_axis", "figure axis", FIGURE, figure, 0.55 * figure, BODY, "figure axis", 0.014)
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
    words = "spin axis" if factor == 1.0 else f"spin axis, {_times(factor)} farther from the figure axis"
    stage.arrows.append(Arrow("spin_axis", "spin axis", VELOCITY, shown, True, words))
    stage.trails.append(trail("polar_motion", POLHODE, shown, in_body=True, words="path of the spin axis"))
    notes.append(f"the angle between spin axis and figure axis is drawn {_times(factor)} too large")


def _times(factor: float) -> str:
    return f"{factor:,.0f} times"


def _orbit_plane(stage: Stage) -> None:
    stage.lines.extend(
        [
            Line(
                "ecliptic/rim",
                ECLIPTIC,
                circle(1.75, np.array([0.0, 0.0, 1.0])),
                SPACE,
                1.8,
                0.9,
                "plane of reference",
            ),
            Line("ecliptic/inner", ECLIPTIC, circle(1.3, np.array([0.0, 0.0, 1.0])), SPACE, 0.8, 0.35),
        ]
    )
    for k in range(6):
        way = direction_of(0.0, np.pi * k / 6)
        stage.lines.append(
            Line(f"ecliptic/spoke{k}", ECLIPTIC, np.stack([-1.75 * way, 1.75 * way]), SPACE, 0.7, 0.22)
        )
    stage.lines.append(Line("normal", FAINT, np.array([[0, 0, -1.5], [0, 0, 1.75]]), SPACE, 1.0))
    stage.spots.append(Spot("normal", "normal", FAINT, np.array([0.0, 0.0, 1.78])))


def _precession(dataset: Table, stage: Stage, pole: Array, notes: list[str]) -> None:
    """The circle that the pole goes about the normal, once in how long."""
    tilt = float(np.nanmean(np.arctan2(np.hypot(pole[:, 0], pole[:, 1]), pole[:, 2])))
    if not 1e-3 < tilt < np.pi - 1e-3:
        return
    ring = circle(1.45 * np.sin(tilt), np.array([0.0, 0.0, 1.0]), np.array([0, 0, 1.45 * np.cos(tilt)]))
    words = "precession of the pole"
    found = signals.orientation(dataset, "figure")
    seconds = signals.seconds(dataset)
    if found is not None and len(seconds) > 8:
        rate = np.polyfit(seconds - seconds[0], found[1], 1)[0]
        span = seconds[-1] - seconds[0]
        if abs(rate) > 0 and abs(rate) * span > 1e-9:
            words += f": once in {span_text(2 * np.pi / abs(rate), 3)}"
            notes.append(f"the pole's longitude moves by {rate:.6g} rad/s on the mean (straight line)")
    stage.lines.append(Line("precession", PRECESSION, ring, SPACE, 2.0, 1.0, words))


def _pole_planes(dataset: Table, notes: list[str]) -> list[Plane]:
    """Polar motion in the body, and the pole in space less its mean motion."""
    planes = []
    momentum = signals.steady_momentum(dataset) if "quaternion" in dataset else None
    found = signals.orientation(dataset, "figure") if momentum is None else None
    if found is not None and np.isfinite(found[0]).all() and len(found[0]) > 8:
        seconds = signals.seconds(dataset)
        tilt, node = (x - np.polyval(np.polyfit(seconds, x, 1), seconds) for x in found)
        across = node * np.sin(np.mean(found[0]))
        path = np.stack([across, tilt], axis=1)
        if np.abs(path).max() > 0:
            planes.append(
                _plane("nutation_path", "Nutation of the pole", FIGURE, path, ("longitude", "obliquity"), "")
            )
    motion = signals.polar_motion(dataset)
    if motion is not None and np.nanmax(np.abs(motion)) > 0:
        planes.append(_plane("polar_motion_path", "Polar motion", POLHODE, motion, ("m1", "m2"), "F"))
    return planes


def _plane(key: str, title: str, color: Color, path: Array, names: tuple[str, str], middle: str) -> Plane:
    size = float(np.nanmax(np.linalg.norm(path, axis=1)))
    unit = angle_unit(size)
    shown = path * unit.per_radian
    reach = size * unit.per_radian
    power = 10.0 ** np.floor(np.log10(reach))
    step = next(s for s in (5, 2, 1, 0.5) if s * power <= 0.75 * reach) * power
    rings = tuple((k * step, f"{k * step:.3g} {unit.symbol}") for k in (1, 2) if k * step < 1.6 * reach)
    return Plane(key, f"{title} [{unit.symbol}]", color, shown, rings=rings, names=names)
