"""Precession of a pole: the reference plane, the circle about its normal, and the motion beside it.

If no attitude is known but an axis is (in an averaged model, which has no rotation), a body is drawn that
points there and doesn't turn; a body of which nothing else is known has a stage of its own.
"""

from dataclasses import replace

import numpy as np
import xarray

from rigidsim.look import signals
from rigidsim.look.fits import secular
from rigidsim.look.record import scene_of
from rigidsim.look.signals import is_averaged
from rigidsim.look.stages import parts
from rigidsim.look.stages.bodies import Subject, direction_of, eye_at, source_arrows
from rigidsim.look.stages.parts import SPACE, Array, Arrow, Camera, Color, Line, Picture, Spot, Stage
from rigidsim.look.symbols import graticule
from rigidsim.scene.readable import DAY, YEAR, span_text
from rigidsim.scene.rotations import quaternion_of

ECLIPTIC: Color = (226, 196, 90)
PRECESSION: Color = (190, 150, 255)
POLE_REACH = 1.45  # length of a pole's arrow, in units of the body's reach
SOURCE_REACH = 1.75  # length of an arrow to a source
PLANE = "plane"  # frame of the plane of reference, where that isn't XY of space
_MONTH = 27.3 * DAY
_ALMOST_WHOLE = 0.98  # of a revolution, from which it counts as one: the last sample may be short of it
_APART = 0.02  # rad, from which two arrows are told apart
_UPRIGHT = 1e-9  # sine of the tilt, below which a pole has no node
_SPARSE = 1.0  # rad of an orbit from one row to the next, from which a source can't be followed


def picture(dataset: xarray.Dataset, subject: Subject) -> Picture | None:
    """Picture of a body without attitude and rates whose figure axis or momentum is known in space; None for
    others. A tumbling body, known by its momentum alone, isn't drawn.
    """
    if subject.attitude is not None or subject.position is not None or "angular_velocity" in dataset:
        return None
    known = {name: axis_in_space(dataset, name) for name in ("figure", "momentum")}
    axes = {name: axis for name, axis in known.items() if axis is not None}
    if not axes:
        return None
    leading = next(iter(axes))
    if len(axes) == 2 and np.linalg.norm(axes["figure"] - axes["momentum"], axis=1).max() < _APART:
        del axes["momentum"]
    notes: list[str] = []
    subject = pointed(dataset, subject, scene_of(dataset).figure)
    stage = replace(subject.stage([], [], "Axes in space"), axis_length=0.0, camera=eye_of_pole())
    if leading == "figure":
        notes.append(standing_note(dataset, "body"))
    else:
        stage = replace(stage, meshes=[], points=np.empty((0, 3)))
        rings = enumerate(graticule(np.full(3, 0.6), lift=1.0))
        stage.lines.extend(Line(f"directions/{k}", parts.FAINT, line, SPACE, 0.7, 0.4) for k, line in rings)
        notes.append("the body isn't drawn: of its attitude only the momentum's direction is known")
    for name, axis in axes.items():
        color = parts.FIGURE if name == "figure" else parts.MOMENTUM
        shown, words = POLE_REACH * axis, f"{name} axis"
        stage.arrows.append(Arrow(f"{name}_axis", words, color, shown, False, words))
        path = parts.Trail(f"{name}_path", color, shown, words=f"path of the {words}")
        # of samples too far apart it would be a cloud; on the circle of precession it wouldn't be seen
        if path.line and np.ptp(axis[:, 2]) > _APART:
            stage.trails.append(path)
    stage = on_reference_plane(dataset, stage)
    circle_of_precession(dataset, stage, axes[leading], leading, notes)
    stage.arrows.extend(followed_sources(dataset, notes))
    return Picture("axes in space", [stage], notes)


def eye_of_pole(height: float = 0.05, radius: float = 1.95) -> Camera:
    """The eye before a globe or axes, at which it looks at some height."""
    view = float(np.deg2rad(22.0)), float(np.deg2rad(-52.0))
    return eye_at(*view, radius, np.array([0.0, 0.0, height]))


def axis_in_space(dataset: xarray.Dataset, axis: str) -> Array | None:
    """Unit vectors (rows, 3), space axes, of the axis named figure or momentum, as recorded, or from
    obliquity and node longitude if their plane is known and fixed; None where not all are known.
    """
    found = signals.pole(dataset, axis)
    plane = signals.reference_axes(dataset)
    if found is None and plane is not None:
        found = _against_plane(dataset, axis)
        found = None if found is None else found @ plane[0]
    return found if found is not None and np.isfinite(found).all() else None


def moving_plane(dataset: xarray.Dataset) -> bool:
    """Whether obliquity and node longitude refer to a plane that moves, or isn't known from the dataset."""
    return signals.reference_axes(dataset) is None


def _against_plane(dataset: xarray.Dataset, axis: str) -> Array | None:
    """Unit vectors (rows, 3) along the plane's X', Y' and normal, from obliquity and node longitude."""
    if "obliquity" not in dataset or "node_longitude" not in dataset:
        return None
    pair = signals.orientation(dataset, axis)
    if pair is None:
        return None
    tilt, node = pair
    return np.stack([np.sin(tilt) * np.sin(node), -np.sin(tilt) * np.cos(node), np.cos(tilt)], axis=1)


def pointed(dataset: xarray.Dataset, subject: Subject, figure: Array, *, plane: bool = False) -> Subject:
    """The subject with an attitude whose figure axis (3,), body axes, is the recorded one, without rotation
    about it; itself if none is known. With `plane`, relative to the reference plane, which may move in space.
    """
    pole = _against_plane(dataset, "figure") if plane else axis_in_space(dataset, "figure")
    if pole is None or not np.isfinite(pole).all():
        return subject
    node = np.stack([-pole[:, 1], pole[:, 0], np.zeros(len(pole))], axis=1)
    node[np.hypot(pole[:, 0], pole[:, 1]) < _UPRIGHT] = (1.0, 0.0, 0.0)
    node -= np.sum(node * pole, axis=1, keepdims=True) * pole
    node /= np.linalg.norm(node, axis=1, keepdims=True)
    in_body = np.stack([*signals.across(figure), figure], axis=1)
    in_space = np.stack([node, np.cross(pole, node), pole], axis=2)
    attitude = in_space @ in_body.T
    return replace(subject, attitude=attitude, quaternion=quaternion_of(attitude))


def standing_note(dataset: xarray.Dataset, what: str) -> str:
    """Why a body that was `pointed` doesn't turn."""
    why = "every rotation is averaged over" if is_averaged(dataset.attrs) else "no attitude was recorded"
    return f"{why}: the {what} points where its figure axis does, and doesn't turn about it"


def followed_sources(dataset: xarray.Dataset, notes: list[str]) -> list[Arrow]:
    """Directions of sources that advance little enough from row to row for the eye to follow."""
    seconds = signals.seconds(dataset)
    step = float(np.abs(np.diff(seconds)).mean()) if len(seconds) > 1 else 0.0
    orbits = [one.get("orbit", {}) for one in scene_of(dataset).sources]
    rates = {f"source{k}": float(orbit.get("mean_motion", 0.0)) for k, orbit in enumerate(orbits)}
    kept = []
    for arrow in source_arrows(dataset, SOURCE_REACH):
        if abs(rates.get(arrow.name, 0.0)) * step > _SPARSE:
            notes.append(f"the {arrow.words} isn't shown: samples are too far apart to follow it")
        else:
            kept.append(arrow)
    return kept


def on_reference_plane(dataset: xarray.Dataset, stage: Stage) -> Stage:
    """The stage with the plane of reference and its normal, from which it is looked at."""
    axes, words = signals.reference_axes(dataset) or (np.eye(3), "plane of reference")
    if not np.array_equal(axes, np.eye(3)):
        turn = parts.viewer_quaternion(quaternion_of(axes.T[None]))
        turns = np.repeat(turn, dataset.sizes["time"], axis=0)
        stage = replace(stage, frames={**stage.frames, PLANE: turns}, looked_from=PLANE)
    place, up = stage.looked_from, np.array([0.0, 0.0, 1.0])
    rim = Line("ecliptic/rim", ECLIPTIC, parts.circle(1.75, up), place, 1.8, 0.9, words)
    stage.lines.extend([rim, Line("ecliptic/inner", ECLIPTIC, parts.circle(1.3, up), place, 0.8, 0.35)])
    for k in range(6):
        ends = np.outer([-1.75, 1.75], direction_of(0.0, np.pi * k / 6))
        stage.lines.append(Line(f"ecliptic/spoke{k}", ECLIPTIC, ends, place, 0.7, 0.22))
    stage.lines.append(Line("normal", parts.FAINT, np.array([[0, 0, -1.5], [0, 0, 1.75]]), place, 1.0))
    stage.spots.append(Spot("normal", "normal", parts.FAINT, np.array([0.0, 0.0, 1.78]), place))
    return stage


def circle_of_precession(
    dataset: xarray.Dataset, stage: Stage, pole: Array, axis: str, notes: list[str]
) -> None:
    """Put on a stage the circle, with its period, that a pole (rows, 3), space axes, of the axis named figure
    or momentum describes about the normal, if it does.
    """
    if stage.looked_from == PLANE:
        frame = signals.reference_axes(dataset)
        pole = pole if frame is None else pole @ frame[0].T
    tilt = float(np.nanmean(np.arctan2(np.hypot(pole[:, 0], pole[:, 1]), pole[:, 2])))
    if not 1e-3 < tilt < np.pi - 1e-3:
        return
    up, high = np.array([0.0, 0.0, 1.0]), np.array([0, 0, POLE_REACH * np.cos(tilt)])
    ring = parts.circle(POLE_REACH * np.sin(tilt), up, high)
    words = "precession of the pole" if axis == "figure" else f"precession of the {axis}"
    found = signals.orientation(dataset, axis)
    seconds = signals.seconds(dataset)
    if found is not None and len(seconds) > 8:
        mean, span = secular(seconds, found[1]), abs(float(seconds[-1] - seconds[0]))
        advance = abs(mean.rate) * span
        if float(np.abs(found[1] - mean.at(seconds)).max()) > max(advance, 1e-6):
            return  # it strays as far as it advances: it goes about another pole
        if advance > 1e-9 and _whole_revolution(dataset, span):
            words += f": once in {mean.about}{span_text(2 * np.pi / abs(mean.rate), 3)}"
            which = "pole" if axis == "figure" else axis
            notes.append(f"the {which}'s longitude moves by {mean.about}{mean.rate:.6g} rad/s on the mean")
    stage.lines.append(Line("precession", PRECESSION, ring, stage.looked_from, 2.0, 1.0, words))


def _whole_revolution(dataset: xarray.Dataset, span: float) -> bool:
    """Whether a run is as long as a revolution of each source: of less, what a line fits is nutation too."""
    known = {"sun": YEAR, "moon": _MONTH}
    for one in scene_of(dataset).sources:
        rate = (one.get("orbit") or {}).get("mean_motion")
        period = 2 * np.pi / abs(rate) if rate else known.get(str(one.get("ephemeris", "")).lower(), 0.0)
        if span < _ALMOST_WHOLE * period:
            return False
    return True
