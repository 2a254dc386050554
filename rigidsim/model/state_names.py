"""Names that users' expressions read, as expressions of the states in SI units."""

from __future__ import annotations

from collections.abc import Collection

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.rotations import Symbolic, euler_from_matrix
from rigidsim.scene.expressions import ATTITUDE_NAMES, FLIGHT_NAMES, RATE_NAMES


def state_names(m: Kinematics, names: Collection[str]) -> dict[str, Symbolic]:
    """Expressions in SI units of the names that a user's expression reads.

    Raises:
        KeyError: a name that the scene doesn't carry.
    """
    context, scaling = m.scene.context, m.scaling

    def si(expression: Symbolic, exponent: int) -> Symbolic:
        return expression if exponent == 0 else m.number(context.ldexp(context.one, exponent)) * expression

    found: dict[str, Symbolic] = {"t": si(hy.time, scaling.time)}
    for name, state, e in zip(RATE_NAMES, m.rate_states, scaling.rates, strict=True):
        found[name] = si(state, e - scaling.time)
    if m.attitude is not None and set(names) & set(ATTITUDE_NAMES):
        found |= zip(ATTITUDE_NAMES[:4], m.attitude.quaternion, strict=True)
        sequence = m.scene.config.integrator.euler_sequence
        if m.attitude.kind == "euler_angles" and m.attitude.sequence == sequence:
            angles = list(hy.make_vars(*m.attitude.names))
        else:
            angles = euler_from_matrix(sequence, m.matrix)
        found |= zip(ATTITUDE_NAMES[4:], angles, strict=True)
    if m.position is not None and m.velocity is not None:
        found |= {n: si(x, scaling.length) for n, x in zip(FLIGHT_NAMES[:3], m.position, strict=True)}
        found |= {n: si(v, scaling.speed) for n, v in zip(FLIGHT_NAMES[3:], m.velocity, strict=True)}
    return {name: found[name] for name in names}
