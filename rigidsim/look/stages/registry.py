"""The picture of a scene: kinds that have stages of their own, a free body's by Poinsot, any other's.

The tip of a free body's angular velocity keeps to the ellipsoid of energy, sum I_i w_i^2 = 2 T of the body's
axes, which touches the plane w . L = 2 T without slipping (Poinsot 1834): it leaves the polhode on the one
and the herpolhode on the other.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import xarray

from rigidsim.look import signals
from rigidsim.look.record import scene_of
from rigidsim.look.solids import ball, graticule
from rigidsim.look.stages import orbits, parts, planet, top
from rigidsim.look.stages.bodies import Subject, source_arrows, vectors_of, with_track
from rigidsim.look.stages.parts import BODY, Array, Arrow, Camera, Line, Picture, Solid, Spot, Stage, Vector
from rigidsim.look.stages.uncertainty import with_cone
from rigidsim.look.stages.wheels import with_wheels

ENERGY: tuple[int, int, int] = (120, 150, 200)


def free(dataset: xarray.Dataset, subject: Subject) -> Picture | None:
    """Picture of a body whose energy and momentum are constant; None for others."""
    constants = signals.energy_and_momentum(dataset)
    rates = signals.values(dataset, "angular_velocity", 3)
    if constants is None or rates is None or subject.position is not None:
        return None
    moments, twice, _ = constants
    radii = np.sqrt(twice / moments)  # of the ellipsoid of energy, rad/s, along the principal axes
    arrows, trails, notes = vectors_of(dataset, subject, paths=subject.attitude is None)
    stage = subject.stage(arrows, trails)
    stages = [stage]
    if subject.attitude is None:
        notes.append("no attitude was recorded: the body is shown in its own axes and doesn't turn")
        stage = _ellipsoid(dataset, stage, 1.6 * radii / float(np.linalg.norm(rates, axis=1).max()))
        return Picture("free rotation", [stage], notes)
    # the principal axis nearest to the first angular velocity
    along = scene_of(dataset).axes @ rates[0]
    k = int(np.abs(along).argmax())
    followed = scene_of(dataset).axes[k] * (1 if along[k] >= 0 else -1)
    tip = np.einsum("tij,j->ti", subject.attitude, 1.15 * followed)
    words = f"trace of the body's {_axis_name(followed)} axis"
    trace = parts.Trail("axis_trace", parts.FIGURE, tip, with_centre=True, words=words)
    if trace.line:  # of samples too far apart it would be a cloud
        stage.trails.append(trace)
    momentum = signals.steady_momentum(dataset)
    if momentum is not None:
        stages.append(_poinsot(dataset, momentum, radii, rates, stage))
        notes.append(
            "Poinsot's construction: the ellipsoid of energy (blue), which turns with the body, rolls on the "
            "invariable plane; the point of contact is the tip of ω"
        )
    return Picture("free rotation", stages, notes)


def _ellipsoid(dataset: xarray.Dataset, stage: Stage, radii: Array) -> Stage:
    """The stage with the ellipsoid of energy, translucent, with its meridians and parallels."""
    turn = scene_of(dataset).axes.T  # principal axes are rows: the rotation from these to body axes
    solid = Solid("energy_ellipsoid", ball(*radii).moved(turn, np.zeros(3)), BODY, ENERGY)
    rings = enumerate(graticule(radii, lift=1.0))
    lines = [Line(f"energy/{k}", ENERGY, ring @ turn.T, BODY, 1.0, 0.5) for k, ring in rings]
    return replace(stage, solids=[*stage.solids, solid], lines=[*stage.lines, *lines])


def _axis_name(axis: Array) -> str:
    k = int(np.abs(axis).argmax())
    if abs(axis[k]) < 1 - 1e-9:
        return "principal"
    return ("" if axis[k] > 0 else "−") + "xyz"[k]


def _poinsot(dataset: xarray.Dataset, along: Array, radii: Array, rates: Array, body: Stage) -> Stage:
    """The ellipsoid with these semi-axes on the plane across the momentum's direction."""
    scale = 1.0 / float(radii.max())
    velocity = next(arrow for arrow in body.arrows if arrow.name == "angular_velocity")
    tip = velocity.vectors * (parts.longest(rates) / parts.ARROW_REACH * scale)
    heights = tip @ along
    reach = float(np.sqrt(max(np.nanmax((tip**2).sum(axis=1) - heights**2), 0.0)))
    size = 1.2 * max(reach, 0.8)
    floor = float(np.nanmean(heights)) * along
    first, second = signals.across(along)
    # With L downwards, as books show it: the plane is the floor that the ellipsoid rolls on.
    eye = -along * 0.55 + first * 1.35 + second * 0.9
    eye = eye / np.linalg.norm(eye) * 2.2 * max(size, 1.0) * 1.2
    center = 0.35 * floor
    on_ellipsoid, on_plane = "polhode, on the ellipsoid of energy", "herpolhode, on the invariable plane"
    start, words = np.zeros(3), "angular momentum L"
    rolling = Stage(
        root="poinsot",
        title="Poinsot's construction",
        unit=1.0,
        quaternion=body.quaternion,
        turns_with=body.root,
        arrows=[
            Arrow("angular_velocity", "", parts.VELOCITY, tip, False, "angular velocity ω", radius=0.014)
        ],
        trails=[
            parts.Trail("polhode", parts.POLHODE, rates * scale, in_body=True, words=on_ellipsoid),
            parts.Trail("herpolhode", (90, 225, 160), tip, words=on_plane),
        ],
        lines=[
            Line("plane/rim", parts.FAINT, parts.circle(size, along, floor), parts.SPACE, 1.6),
            *parts.grid("plane", floor, first, second, size, 4, 0.45, round_=True),
        ],
        vectors=[Vector("momentum", "L", parts.MOMENTUM, start, 1.2 * floor, words=words, radius=0.012)],
        spots=[Spot("plane/label", "invariable plane", parts.PALE, floor - 0.98 * size * second)],
        camera=Camera(center + eye, center, -along),
    )
    return _ellipsoid(dataset, rolling, radii * scale)


KINDS: tuple[Callable[[xarray.Dataset, Subject], Picture | None], ...] = (
    top.picture,
    orbits.free_orbit,
    orbits.flight,
    orbits.satellite,
    planet.picture,
    planet.axes_picture,
    free,
)
"""Functions that return the picture of a scene of their kind, or None for others; the first that has one."""


def build_picture(dataset: xarray.Dataset) -> tuple[Picture, Subject]:
    """Picture of a thinned dataset in memory, and its body; ``ValueError`` for an unreadable ``drawing``."""
    subject = Subject.of(dataset)
    pictures = (kind(dataset, subject) for kind in KINDS)
    found = next((picture for picture in pictures if picture is not None), None) or _any(dataset, subject)
    found = with_cone(dataset, subject, with_wheels(dataset, subject, found))
    found.notes.insert(0, f"lengths are in units of the body's reach: 1 unit = {subject.reach:.6g} m")
    return found, subject


def _any(dataset: xarray.Dataset, subject: Subject) -> Picture:
    """Any scene: the body with its momentum and angular velocity, and its track if it moves far."""
    arrows, trails, notes = vectors_of(dataset, subject, paths=not scene_of(dataset).carries_within)
    if subject.attitude is None:
        notes.append("no attitude was recorded: the body is shown in its own axes and doesn't turn")
    else:
        arrows += source_arrows(dataset, 0.95 * parts.ARROW_REACH)
    stages = with_track(subject, subject.stage(arrows, trails), notes)
    return Picture("motion of a rigid body", stages, notes)
