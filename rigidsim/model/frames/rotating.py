"""Jacobi's constant, for torques from potentials at rest in a frame that turns with a circular orbit.

H = w . I w / 2 - n o . I w + U is conserved, o the orbit's normal and n its mean motion (Hughes 1986, ch. 9).
U may be that of any number of sources on circles of one plane and one period, plus any potential that the
frame's turning doesn't change, such as that of a uniform field along o.
"""

from __future__ import annotations

from functools import reduce
from operator import add

import heyoka as hy

from rigidsim.model.capabilities import corotating_orbit_of
from rigidsim.model.fixed_axes import keeps, parallel
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.two_part import as_factor
from rigidsim.scene.orbits import KeplerOrbit


def rotating_orbit(m: Mechanics) -> KeplerOrbit | None:
    """An orbit with whose frame all potentials turn; None if there is none."""
    orbits = [orbit for load in m.turning if (orbit := corotating_orbit_of(load)) is not None]
    if not orbits or m.driven_within:
        return None
    context, first = m.scene.context, orbits[0]
    normal = first.normal(context)
    if not all(
        orbit.mean_motion == first.mean_motion and parallel(context, normal, orbit.normal(context))
        for orbit in orbits[1:]
    ):
        return None
    others = [load for load in m.turning if corotating_orbit_of(load) is None]
    if not all(load.conservative for load in others) or not keeps(m, normal, others):
        return None
    return first


def jacobi_constant(m: Mechanics) -> Symbolic:
    """H, internal units of energy."""
    orbit, context = m.carried(rotating_orbit(m)), m.scene.context
    motion = context.ldexp(orbit.mean_motion, m.scaling.time)
    if m.attitude is not None and m.attitude.orbital is not None:
        factor = as_factor(m.number(motion))
        normal_body = m.attitude.orbital.normal
        carried = [factor * (o * x) for o, x in zip(normal_body, m.momentum_body, strict=True)]
    else:
        pairs = zip(orbit.normal(context), m.momentum_space, strict=True)
        carried = [m.number(motion * o) * x for o, x in pairs if o != 0]
    potentials = [m.carried(load.potential(m)) for load in m.turning]
    return m.rotational_energy - hy.sum(carried) + reduce(add, potentials)
