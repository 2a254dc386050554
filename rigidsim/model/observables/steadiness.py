"""The kind of rotation: whether a body is a planet or a nearly axial rotator.

The kind decides what is recorded by default: a planet that precesses has directions and their angles; a body
that turns nearly about its figure axis has polar motion, wobble and a rotation angle; other bodies have
neither.
"""

from __future__ import annotations

from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.scaling import source_rate
from rigidsim.scene.arithmetic import apply, cross, dot, norm

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
    return bool(load.orbit or load.table or load.placement.moves or load.reacts)


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
