"""A free body with Poinsot's construction: its ellipsoid of energy rolls on the invariable plane.

The tip of the angular velocity keeps to the ellipsoid sum I_i w_i^2 = 2 T of the body's axes, which touches
the plane w . L = 2 T there without slipping (Poinsot 1834): it leaves the polhode on the one and the
herpolhode on the other.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rigidsim.look import signals
from rigidsim.look.stages.bodies import Subject, column, vectors_of
from rigidsim.look.stages.parts import (
    ARROW_REACH,
    BODY,
    FAINT,
    FIGURE,
    MOMENTUM,
    PALE,
    POLHODE,
    SPACE,
    VELOCITY,
    Array,
    Arrow,
    Camera,
    Line,
    Picture,
    Shell,
    Spot,
    Stage,
    Vector,
    circle,
    longest,
    quaternion_of,
    trail,
)

if TYPE_CHECKING:
    from rigidsim.look.rows import Table

_SPREAD = 1e-5  # of 2 T, up to which it counts as constant: more than rounding in single precision
ENERGY: tuple[int, int, int] = (120, 150, 200)


def picture(dataset: Table, subject: Subject) -> Picture | None:
    """Picture of a body whose energy and momentum are constant; None for others."""
    radii = energy_ellipsoid(dataset)
    rates = column(dataset, "angular_velocity", 3)
    if radii is None or rates is None or subject.position is not None:
        return None
    arrows, trails, notes = vectors_of(dataset, subject, paths=subject.attitude is None)
    if subject.attitude is None:
        notes.append("no attitude was recorded: the body is shown in its own axes and doesn't turn")
        shell = _shell(dataset, 1.6 * radii / float(np.linalg.norm(rates, axis=1).max()))
        stage = subject.stage(arrows, trails)
        stage.shells.append(shell)
        return Picture("free rotation", [stage], [], _LEADING, notes)
    stage = subject.stage(arrows, trails)
    followed = _followed_axis(dataset, rates)
    tip = np.einsum("tij,j->ti", subject.attitude, 1.15 * followed)
    name = _axis_name(followed)
    trace = trail("axis_trace", FIGURE, tip, with_centre=True, words=f"trace of the body's {name} axis")
    if trace.line:  # of samples too far apart it would be a cloud
        stage.trails.append(trace)
    rolling = _poinsot(dataset, subject, radii, rates, stage)
    if rolling is None:
        return Picture("free rotation", [stage], [], _LEADING, notes)
    notes.append(
        "Poinsot's construction: the ellipsoid of energy (blue), which turns with the body, rolls on the "
        "invariable plane; the point of contact is the tip of ω"
    )
    return Picture("free rotation", [stage, rolling], [], _LEADING, notes)


_LEADING = ("angular_velocity", "polar_motion", "nutation_angle")


def energy_ellipsoid(dataset: Table) -> Array | None:
    """Semi-axes (3,), rad/s, along the principal axes; None where energy or momentum aren't constant."""
    moments, rates = signals.moments(dataset), signals.principal_rates(dataset)
    if moments is None or rates is None:
        return None
    rates = signals.finite_rows(rates)
    twice, square = rates**2 @ moments, rates**2 @ moments**2
    for values in (twice, square):
        if not len(values) or values.min() <= 0 or values.max() > (1 + _SPREAD) * values.min():
            return None
    return np.asarray(np.sqrt(twice.mean() / moments))


def _shell(dataset: Table, radii: Array) -> Shell:
    axes = signals.principal_axes(
        dataset
    )  # as rows: the rotation from principal to body axes is its transpose
    turn = quaternion_of(axes.T[None])[0]
    return Shell("energy_ellipsoid", radii, ENERGY, BODY, turn[[1, 2, 3, 0]])


def _followed_axis(dataset: Table, rates: Array) -> Array:
    """The principal axis nearest to the first angular velocity, unit vector in body axes."""
    axes = signals.principal_axes(dataset)
    along = axes @ rates[0]
    k = int(np.abs(along).argmax())
    return np.asarray(axes[k] * (1 if along[k] >= 0 else -1))


def _axis_name(axis: Array) -> str:
    k = int(np.abs(axis).argmax())
    if abs(axis[k]) < 1 - 1e-9:
        return "principal"
    return ("" if axis[k] > 0 else "−") + "xyz"[k]


def _poinsot(dataset: Table, subject: Subject, radii: Array, rates: Array, body: Stage) -> Stage | None:
    along = signals.steady_momentum(dataset)
    moments = signals.moments(dataset)
    if along is None or subject.attitude is None or moments is None:
        return None
    scale = 1.0 / float(radii.max())
    velocity = next(arrow for arrow in body.arrows if arrow.name == "angular_velocity")
    tip = velocity.vectors * (longest(rates) / ARROW_REACH * scale)
    heights = tip @ along
    height = float(np.nanmean(heights))
    reach = float(np.sqrt(max(np.nanmax((tip**2).sum(axis=1) - heights**2), 0.0)))
    size = 1.2 * max(reach, 0.8)
    floor = height * along
    first = np.cross(np.eye(3)[np.abs(along).argmin()], along)
    first /= np.linalg.norm(first)
    second = np.cross(along, first)
    lines = [Line("plane/rim", FAINT, circle(size, along, floor), SPACE, 1.6)]
    for k in range(-4, 5):
        at = 0.25 * k * size
        half = np.sqrt(size**2 - at**2)
        for name, u, v in (("a", first, second), ("b", second, first)):
            points = np.stack([floor + at * u - half * v, floor + at * u + half * v])
            lines.append(Line(f"plane/{name}{k + 4}", FAINT, points, SPACE, 0.7, 0.45))
    # With L downwards, as books show it: the plane is the floor that the ellipsoid rolls on.
    eye = -along * 0.55 + first * 1.35 + second * 0.9
    distance = 2.2 * max(size, 1.0) * 1.2
    eye = eye / np.linalg.norm(eye) * distance
    center = 0.35 * floor
    return Stage(
        root="poinsot",
        title="Poinsot's construction",
        unit=1.0,
        meshes=[],
        points=np.zeros((0, 3)),
        axis_length=0.0,
        quaternion=body.quaternion,
        turns_with=body.root,
        translation=None,
        arrows=[Arrow("angular_velocity", "", VELOCITY, tip, False, "angular velocity ω", radius=0.014)],
        trails=[
            trail(
                "polhode", POLHODE, rates * scale, in_body=True, words="polhode, on the ellipsoid of energy"
            ),
            trail("herpolhode", (90, 225, 160), tip, words="herpolhode, on the invariable plane"),
        ],
        lines=lines,
        vectors=[
            Vector("momentum", "L", MOMENTUM, np.zeros(3), 1.2 * floor, SPACE, "angular momentum L", 0.012)
        ],
        spots=[Spot("plane/label", "invariable plane", PALE, floor - 0.98 * size * second)],
        shells=[_shell(dataset, radii * scale)],
        camera=Camera(center + eye, center, -along),
    )
