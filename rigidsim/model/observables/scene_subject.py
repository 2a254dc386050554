"""The kind of scene (planet, nearly axial rotator or other) that decides what is recorded by default.

A planet that precesses has directions and their angles; one that turns nearly about its figure axis has polar
motion, wobble and a rotation angle. Tops and tumbling bodies have neither by default.
"""

from __future__ import annotations

from rigidsim.model.capabilities import Reacting, gradient_source_of, orbit_of, table_of
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.scaling import source_rate
from rigidsim.scene.arithmetic import apply, cross, dot, norm

_AXIAL = 0.1
"""Angle (rad) between spin and figure axis up to which a body turns nearly about it."""
_FAST = 10
"""Ratio of a planet's spin to its sources' rates; a slower body librates or tumbles with its source."""


def _turns_about_its_figure(m: Mechanics) -> bool:
    """Whether the body starts turning nearly about its figure axis (that of largest moment, or of
    symmetry).
    """
    scene, context = m.scene, m.scene.context
    spin, pole = scene.angular_velocity, scene.figure.pole
    if all(w == 0 for w in spin):
        return False
    aligned, across = abs(dot(spin, pole)), norm(context, cross(pole, spin))
    turned = apply(scene.body.inertia, pole)
    principal = norm(context, cross(turned, pole)) <= norm(context, turned) * 1e-12
    return bool(across <= _AXIAL * aligned) and principal


def _moves(load: Load) -> bool:
    source = gradient_source_of(load)
    series = source is not None and source.ephemeris
    return bool(orbit_of(load) or table_of(load) or series or isinstance(load, Reacting))


def is_planet(m: Mechanics) -> bool:
    """Whether the scene is a fast spin that precesses under the gravity gradient of an orbiting or ephemeris
    body.
    """
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
