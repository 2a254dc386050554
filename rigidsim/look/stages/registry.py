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
from rigidsim.look.stages.bodies import Subject, source_arrows, suited_camera, vectors_of, with_track
from rigidsim.look.stages.parts import BODY, CENTRE, Array, Camera, Part, Picture, Stage, arrow, trail
from rigidsim.look.stages.uncertainty import with_cone
from rigidsim.look.stages.wheels import with_wheels

ENERGY: tuple[int, int, int] = (120, 150, 200)
IN_BODY_AXES = "no attitude was recorded: the body is shown in its own axes and doesn't turn"


def free(dataset: xarray.Dataset, subject: Subject) -> Picture | None:
    """Picture of a body whose energy and momentum are constant; None for others."""
    constants = signals.energy_and_momentum(dataset)
    rates = signals.values(dataset, "angular_velocity", 3)
    if constants is None or rates is None or subject.position is not None:
        return None
    moments, twice, _ = constants
    axes = scene_of(dataset).axes
    radii = np.sqrt(twice / moments)  # of the ellipsoid of energy, rad/s, along the principal axes
    shown, notes = vectors_of(dataset, subject, paths=subject.attitude is None)
    if subject.attitude is None:
        shown += _ellipsoid(axes, 1.6 * radii / float(np.linalg.norm(rates, axis=1).max()))
        return Picture("free rotation", [subject.stage(shown)], [*notes, IN_BODY_AXES])
    # the principal axis nearest to the first angular velocity
    along = axes @ rates[0]
    k = int(np.abs(along).argmax())
    followed = axes[k] * (1 if along[k] >= 0 else -1)
    tip = np.einsum("tij,j->ti", subject.attitude, 1.15 * followed)
    if signals.joined(tip, parts.NEAR):  # of samples too far apart it would be a cloud
        words = f"trace of the body's {_axis_name(followed)} axis"
        shown += trail("axis_trace", parts.FIGURE, tip, words, place=CENTRE)
    stages = [subject.stage(shown)]
    momentum = signals.steady_momentum(dataset)
    if momentum is not None:
        stages.append(_poinsot(subject, axes, momentum, radii, rates))
        notes.append(
            "Poinsot's construction: the ellipsoid of energy (blue), which turns with the body, rolls on the "
            "invariable plane; the point of contact is the tip of ω"
        )
    return Picture("free rotation", stages, notes)


def _ellipsoid(axes: Array, radii: Array) -> list[Part]:
    """The ellipsoid of energy, translucent, along principal axes (rows), its meridians and parallels."""
    mesh = ball(*radii).moved(axes.T, np.zeros(3))
    rings = [ring @ axes for ring in graticule(radii, lift=1.0)]
    around = parts.lines("energy/0", ENERGY, rings, place=BODY, width=1.0, strength=0.5)
    return [parts.solid(parts.around(BODY, "energy_ellipsoid"), mesh, clear=ENERGY), around]


def _axis_name(axis: Array) -> str:
    k = int(np.abs(axis).argmax())
    if abs(axis[k]) < 1 - 1e-9:
        return "principal"
    return ("" if axis[k] > 0 else "−") + "xyz"[k]


def _poinsot(subject: Subject, axes: Array, along: Array, radii: Array, rates: Array) -> Stage:
    """The ellipsoid with these semi-axes on the plane across the momentum's direction."""
    scale = 1.0 / float(radii.max())
    assert subject.attitude is not None
    tip = np.einsum("tij,tj->ti", subject.attitude, rates * scale)
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
    momentum, velocity = "angular momentum L", "angular velocity ω"
    rim, label = parts.circle(size, along, floor), floor - 0.98 * size * second
    shown = [
        arrow("angular_velocity", "", parts.VELOCITY, tip, velocity, radius=0.014),
        *parts.fixed_arrow("momentum", "L", parts.MOMENTUM, np.zeros(3), 1.2 * floor, momentum, radius=0.012),
        *trail("polhode", parts.POLHODE, rates * scale, on_ellipsoid, place=BODY),
        *trail("herpolhode", (90, 225, 160), tip, on_plane),
        parts.lines("plane/rim", parts.FAINT, [rim], width=1.6),
        parts.grid("plane", floor, first, second, size, 4, 0.45, round_=True),
        parts.spot("plane/label", "invariable plane", parts.PALE, label),
        *_ellipsoid(axes, radii * scale),
    ]
    bare = replace(subject, meshes=[], points=np.empty((0, 3)))
    camera, title = Camera(center + eye, center, -along), "Poinsot's construction"
    return bare.stage(shown, title, root="poinsot", unit=1.0, axes=0.0, camera=camera)


KINDS: tuple[Callable[[xarray.Dataset, Subject], Picture | None], ...] = (
    top.picture,
    orbits.free_orbit,
    orbits.flight,
    orbits.satellite,
    planet.picture,
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
    stages = [replace(one, camera=one.camera or suited_camera(one, subject)) for one in found.stages]
    return replace(found, stages=stages), subject


def _any(dataset: xarray.Dataset, subject: Subject) -> Picture:
    """Any scene: the body with its momentum and angular velocity, and its track if it moves far."""
    shown, notes = vectors_of(dataset, subject, paths=not scene_of(dataset).carries_within)
    if subject.attitude is None:
        notes.append(IN_BODY_AXES)
    else:
        shown += source_arrows(dataset, 0.95 * parts.ARROW_REACH)
    return Picture("motion of a rigid body", with_track(subject, shown, notes), notes)
