"""The kind of rotation: whether a body is a planet or a nearly axial rotator, and how steadily it turns.

The kind decides what is recorded by default: a planet that precesses has directions and their angles; a body
that turns nearly about its figure axis has polar motion, wobble and a rotation angle; other bodies have
neither. How steadily it turns tells the full turns between sparse samples without following the motion.

A body whose momentum keeps near a principal axis of extreme moment, free of torques or a planet under gravity
gradients, advances from sample to sample by its momentary rate times the time between, but for

- what the momentum's direction drifts and its size changes: the torque is at most twice the amplitude U of
  the loads' energy, so that |k'| <= 2 U / G and a rate changes by at most 2 U / G;
- the wobble: the momentum stays within J of the axis. Free of torques the polhode says how far: with
  d_i = |C - I_i| / I_i of the two other moments J_max / J <= sqrt(max d / min d). What the torques force,
  some (2 U / G) / w, is allowed ten times over, and the whole four times.

Where these leave more than half a radian open the turns are counted along the motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import heyoka as hy

from rigidsim.model.frames import plane_drift
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import Steady
from rigidsim.model.rotations import along, constant, length
from rigidsim.model.scaling import loads_amplitude, source_rate
from rigidsim.scene.arithmetic import apply, cross, dot, norm

_FORCED = 10
_SPARE = 4


_AXIAL = 0.1
"""Angle (rad) between spin and figure axis up to which a body turns nearly about it."""
_FAST = 10
"""Ratio of a planet's spin to its sources' rates; a slower body librates or tumbles with its source."""


def _turns_about_its_figure(m: Mechanics) -> bool:
    """Whether the body starts turning nearly about its figure axis, a principal one."""
    scene, context = m.scene, m.scene.context
    spin, pole = scene.angular_velocity, scene.figure.pole
    if all(w == 0 for w in spin):
        return False
    aligned, across = abs(dot(spin, pole)), norm(context, cross(pole, spin))
    turned = apply(scene.body.inertia, pole)
    principal = norm(context, cross(turned, pole)) <= norm(context, turned) * 1e-12
    return bool(across <= _AXIAL * aligned) and principal


def _moves(load: Load) -> bool:
    source = (load.beside or load).gradient_source
    moves = source is not None and source.placement.moves
    return bool(load.orbit or load.table or moves or load.reacts)


def is_planet(m: Mechanics) -> bool:
    """Whether a fast spin precesses under gravity gradients of orbiting or ephemeris bodies."""
    if m.attitude is None or not m.turning:
        return False
    distant = [x for x in m.turning if _moves(x)]
    fast = norm(m.scene.context, m.scene.angular_velocity) >= _FAST * source_rate(m.scene)
    return len(distant) == len(m.turning) and bool(fast) and _turns_about_its_figure(m)


def is_nearly_axial(m: Mechanics) -> bool:
    """Whether a torque-free body or a planet turns nearly, but not exactly, about its figure axis."""
    if m.carriers or (m.torque and not is_planet(m)):
        return False
    scene, pole = m.scene, m.scene.figure.pole
    wobbles = norm(scene.context, cross(pole, scene.angular_velocity)) != 0
    return _turns_about_its_figure(m) and (bool(wobbles) or bool(m.torque))


# --- how steadily it turns ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Bounds:
    """Bounds of a steady rotation; moments in kg m^2, rates in rad/s (mpf)."""

    wobble: Any  # largest angle between momentum and figure axis, rad
    drift: Any  # of the rate at which the momentum's direction turns, and of a rate's change
    polar: Any  # about the figure axis
    equatorial: tuple[Any, Any]


def _bounds(m: Mechanics) -> _Bounds | None:
    """Bounds of the scene's rotation; None if the motion isn't known to be steady."""
    scene, context = m.scene, m.scene.context
    body, pole = scene.body, scene.figure.pole
    momentum = apply(body.inertia, scene.angular_velocity)
    size = norm(context, momentum)
    if size == 0 or m.carriers or (m.torque and not is_planet(m)):
        return None
    turned = apply(body.inertia, pole)
    polar = dot(pole, turned)
    if norm(context, cross(turned, pole)) > polar * 1e-12:  # not principal
        return None
    first, second, _ = sorted(body.principal_moments, key=lambda x: -abs(x - polar))
    ratios = [abs(polar - x) / x if x else context.inf for x in (first, second)]
    if (polar - first) * (polar - second) <= 0 or not min(ratios) > 0:
        return None
    amplitude = loads_amplitude(scene) if m.torque else context.zero
    drift = 2 * amplitude / size
    start = context.atan2(norm(context, cross(momentum, pole)), abs(dot(momentum, pole)))
    wobble = start * context.sqrt(max(ratios) / min(ratios))
    wobble = _SPARE * (wobble + _FORCED * drift / norm(context, scene.angular_velocity))
    return _Bounds(wobble, drift, polar, (first, second))


def steady_directions(m: Mechanics) -> Steady | None:
    """Steadiness of the angles of the figure, spin and momentum axes, whose rates are taken as zero."""
    found, away = _bounds(m), plane_drift(m.scene, m.loads)
    if m.turning_rate is not None and away is not None:
        return Steady([constant(0.0)] * 3, float(m.turning_rate + away), 0.0)
    if found is None or away is None:
        return None
    # the spin leaves the momentum by no more than the ratio of moments times what the figure axis does
    moments = [x for x in (found.polar, *found.equatorial) if x]
    leave = max(moments) / min(moments)
    return Steady([constant(0.0)] * 3, float(found.drift + away), float(2 * found.wobble * leave))


def steady_rotation(m: Mechanics) -> Steady | None:
    """Steadiness of the rotation angle.

    With L the momentum along the axis it advances by (G - L)/A + L/C, 1/A being the mean of both equatorial
    moments' inverses (Deprit 1967, eq. 25: dK/dG + dK/dL).
    """
    found, away = _bounds(m), plane_drift(m.scene, m.loads)
    if found is None or away is None or 0 in found.equatorial:
        return None
    context, inertia = m.scene.context, m.scaling.inertia
    inverse = sum(1 / x for x in found.equatorial) / 2
    apart = abs(1 / found.equatorial[0] - 1 / found.equatorial[1]) / 2
    size = norm(context, apply(m.scene.body.inertia, m.scene.angular_velocity))
    equatorial, polar = (m.number(context.ldexp(x, inertia)) for x in (inverse, 1 / found.polar))
    total = length(m.momentum_body)
    axial = along(m.fixed(m.scene.figure.pole), m.momentum_body)
    axial = hy.sqrt(axial * axial)
    rate = equatorial * (total - axial) + polar * axial
    if apart:
        apart += abs(inverse - 1 / found.polar)  # L varies as well
    changes = size * (1 - context.cos(min(found.wobble, context.pi))) * apart
    return Steady([rate], float(changes + 2 * found.drift + away), float(2 * found.wobble))


def steady_meridian(m: Mechanics) -> Steady | None:
    """Steadiness of the turn about the figure axis, which counts backwards where the spin is retrograde."""
    found = steady_rotation(m)
    if found is None or dot(apply(m.scene.body.inertia, m.scene.angular_velocity), m.scene.figure.pole) > 0:
        return found
    return replace(found, rates=[-rate for rate in found.rates])
