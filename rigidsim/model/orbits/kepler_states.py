"""A prescribed Kepler orbit carried as states, so that no angle grows with time.

cos(n t) of a growing time loses digits (engine-notes: 1e-5 rad after 1e5 radians). Here the eccentric
anomaly E enters through c = cos E and s = sin E, which are states:

    E' = n / (1 - e c),   c' = -E' s,   s' = E' c,   r = a (1 - e c),

and so do a moving node and periapsis, each as a pair that turns uniformly. (Kepler; Danby 1988, ch. 6.)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.state_blocks import StateBlock
from rigidsim.model.two_part import as_factor
from rigidsim.scene.orbits import KeplerOrbit


@dataclass(frozen=True)
class OrbitStates:
    """The part of a system of equations that carries an orbit; vectors in space axes."""

    block: StateBlock  # its norms stay 1, since each pair of states is a cosine and a sine
    direction: list[Symbolic]  # unit vector towards the attracting body
    normal: list[Symbolic]  # of the plane; the attracting body moves about it directly
    inverse_distance: Symbolic  # semi-major axis over distance, 1 for a circle


def orbit_states(
    orbit: KeplerOrbit, tag: str, time_unit: Any, start: Any, context: Any, number: Rounder
) -> OrbitStates:
    """Carry a Kepler orbit as states, whose names end with a tag; start and unit of time in s (mpf)."""
    names: list[str] = []
    derivatives: list[Symbolic] = []
    initial: list[Any] = []
    norms: list[Symbolic] = []

    def constant(value: Any) -> Symbolic:
        return as_factor(number(value))  # exact 0 and 1 vanish from products

    def pair(name: str, angle: Any, rate: Symbolic | None) -> tuple[Symbolic, Symbolic]:
        """Cosine and sine of an angle: constants if it is fixed, two states if it moves."""
        if rate is None:
            return constant(context.cos(angle)), constant(context.sin(angle))
        c, s = hy.make_vars(f"cos_{name}{tag}", f"sin_{name}{tag}")
        names.extend((str(c), str(s)))
        derivatives.extend((-(rate * s), rate * c))
        initial.extend((context.cos(angle), context.sin(angle)))
        norms.append(hy.sqrt(c * c + s * s))
        return c, s

    def uniform(rate: Any) -> Symbolic | None:
        return None if rate == 0 else constant(rate * time_unit)

    e = orbit.eccentricity
    anomaly = orbit.eccentric_anomaly(context, start)
    motion = constant(orbit.mean_motion * time_unit)
    if orbit.circular:
        c, s = pair("anomaly", anomaly, motion)
        inverse = hy.expression(1.0)
        along, across = c, s
    else:
        c = hy.make_vars(f"cos_anomaly{tag}")
        inverse = 1.0 / (1.0 - number(e) * c)
        c, s = pair("anomaly", anomaly, motion * inverse)
        along = (c - number(e)) * inverse
        across = number(context.sqrt(1 - e * e)) * s * inverse
    w_c, w_s = pair(
        "periapsis", orbit.periapsis + orbit.periapsis_rate * start, uniform(orbit.periapsis_rate)
    )
    n_c, n_s = pair("node", orbit.ascending_node + orbit.node_rate * start, uniform(orbit.node_rate))
    i_c, i_s = constant(context.cos(orbit.inclination)), constant(context.sin(orbit.inclination))
    # R3(node) R1(inclination) R3(periapsis) (cos, sin, 0) of the true anomaly
    x = w_c * along - w_s * across
    y = w_s * along + w_c * across
    direction = [n_c * x - n_s * (i_c * y), n_s * x + n_c * (i_c * y), i_s * y]
    normal = [n_s * i_s, -(n_c * i_s), i_c]
    return OrbitStates(StateBlock(names, derivatives, initial, norms), direction, normal, inverse)
