"""What carries angular momentum and kinetic energy beside the body: rotors, a fluid core.

With the body's I w and the momentum h_k of each carrier, all in body axes,

    L = I w + sum of h_k,    T = w . I w / 2 + sum of T_k,

and Euler's equations L' + w x L = torque become

    I w' = (I w) x w + torque + sum of (h_k x w + g_k),

where g_k = -h_k' is the torque that a carrier exerts on the body, a motor's or friction's (Hughes, Spacecraft
Attitude Dynamics, 1986, section 3.4). The body's tensor I then contains what turns with it: of a rotor on a
bearing it includes the mass, but not the moment about the bearing's axis.

A carrier is a load: it brings its states by ``extra_states``, and is registered, configured and reported in
the same way. Motions and formulations that know the body alone ask ``carried_beside``.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol, runtime_checkable

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import Vector, cross, unit_vectors
from rigidsim.scene.scene import Scene


@runtime_checkable
class Carrier(Protocol):
    """A load that carries angular momentum relative to the body, or stores energy: by default, neither."""

    def carried_momentum(self, m: Kinematics) -> list[Term]:
        """Its momentum h, body axes, in internal units of momentum."""
        return []

    def carried_energy(self, m: Kinematics) -> Symbolic | None:
        """Its kinetic energy, internal units; None for none."""
        return None

    def exerted_torque(self, m: Kinematics) -> list[Term]:
        """The torque -h' that it exerts on the body, body axes, in internal units of energy."""
        return []

    def supplied_power(self, m: Kinematics) -> Symbolic | None:
        """The power that its drive feeds in, less what its friction takes, in internal units of energy over
        time; None if it keeps the energy.
        """
        return None

    def carried_at_start(self, scene: Scene) -> tuple[Vector, Any]:
        """Its momentum (mpf, kg m^2/s, body axes) and kinetic energy (mpf, J) at the start."""
        return [scene.context.zero] * 3, scene.context.zero


def carried_beside(loads: Iterable[Load]) -> str:
    """Why more turns than a body of constant moments, for what can't do with that; empty if it doesn't."""
    found = next((load for load in loads if isinstance(load, Carrier)), None)
    if found is None:
        return ""
    return found.changes or f"{found.title} carries angular momentum"


def momentum_terms(carriers: Iterable[Any], m: Kinematics) -> list[Term]:
    """Momentum of all carriers beside the body; what is zero for good is left out."""
    terms = (term for carrier in carriers for term in carrier.carried_momentum(m))
    return [(vector, hy.expression(part)) for vector, part in terms if any(x != 0 for x in vector)]


def inner_torque(carriers: Iterable[Any], m: Kinematics) -> list[Term]:
    """Terms of h x w and of the torques that carriers exert on the body, in internal units of energy."""
    carriers, found = list(carriers), []
    held = [x for x in carriers if not x.loose]
    for vector, expression in momentum_terms(held, m):
        for axis, unit, rate in zip(
            unit_vectors(m.scene.context), m.numbers.rate_units, m.rate_states, strict=True
        ):
            found.append(([x * unit for x in cross(vector, axis)], expression * rate))
    exerted = (term for carrier in carriers for term in carrier.exerted_torque(m))
    return found + [(vector, hy.expression(part)) for vector, part in exerted]
