"""Motions of gyrostats from equations of their own: momentum and rotation matrix, in 113 bits.

With the whole angular momentum M in body axes, momenta h of the rotors about their axes, and R to space,

    M' = M x w + N,    R' = R [w]x,    h' = torque,    w = I_b^-1 (M - sum of h a - sum of fixed J s a).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import heyoka as hy
import mpmath
import numpy as np

BITS = 120
_CONTEXT = mpmath.MPContext()
_CONTEXT.prec = BITS + 20


def exact(text: Any) -> Any:
    """A decimal in the precision of the truth."""
    return hy.real(_CONTEXT.nstr(_CONTEXT.mpf(str(text)), 45), BITS)


@dataclass(frozen=True)
class Wheel:
    """A rotor by texts of its numbers; ``torque`` of (t, w, R) to an expression, None for a free one."""

    axis: Sequence[Any]
    moment: Any
    rate: Any = 0
    torque: Callable[[Any, Any, Any], Any] | None = None
    fixed: bool = False

    @property
    def unit(self) -> list[Any]:
        axis = [_CONTEXT.mpf(str(x)) for x in self.axis]
        return [x / _CONTEXT.sqrt(sum(y * y for y in axis)) for x in axis]


def followed(
    inertia: Any,
    wheels: Sequence[Wheel],
    rates: Sequence[Any],
    matrix: Any,
    times: Any,
    load: Callable[[Any, Any, Any], Any] | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rates (n, 3), matrices (n, 3, 3) and rates of the wheels (n, wheels) at times; 80-bit numbers.

    Args:
        inertia: principal moments, or a tensor, with all wheels locked; numbers or texts.
        matrix: attitude at the start, mpmath or doubles.
        load: torque on the body in body axes, of (t, w, R).
    """
    mp, number = _CONTEXT, exact
    given = mp.diag([mp.mpf(str(x)) for x in inertia]) if np.ndim(inertia) == 1 else mp.matrix(inertia)
    w0 = mp.matrix([mp.mpf(str(x)) for x in rates])
    turning, held = given.copy(), mp.matrix([0, 0, 0])
    start = given * w0
    for wheel in wheels:
        a, moment = mp.matrix(wheel.unit), mp.mpf(str(wheel.moment))
        start += moment * mp.mpf(str(wheel.rate)) * a
        if wheel.fixed:
            held += moment * mp.mpf(str(wheel.rate)) * a
        else:
            turning -= moment * a * a.T
    inverse = turning**-1
    moving = [wheel for wheel in wheels if not wheel.fixed]
    momentum = list(hy.make_vars("m0", "m1", "m2"))
    r = [list(hy.make_vars(*(f"r{i}{j}" for j in range(3)))) for i in range(3)]
    h = [hy.make_vars(f"h{k}") for k in range(len(moving))]
    own = [m - number(held[i]) for i, m in enumerate(momentum)]
    for wheel, state in zip(moving, h, strict=True):
        own = [x - number(a) * state for x, a in zip(own, wheel.unit, strict=True)]
    w = [hy.sum([number(inverse[i, j]) * own[j] for j in range(3)]) for i in range(3)]
    torque = [0.0, 0.0, 0.0] if load is None else load(hy.time, w, r)
    system = [
        (momentum[i], momentum[j] * w[k] - momentum[k] * w[j] + torque[i])
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    ]
    for row in r:
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            system.append((row[i], row[j] * w[k] - row[k] * w[j]))
    initial = [number(x) for x in start] + [number(matrix[i][j]) for i in range(3) for j in range(3)]
    for wheel, state in zip(moving, h, strict=True):
        motor = 0.0 * state if wheel.torque is None else wheel.torque(hy.time, w, r)
        system.append((state, hy.expression(motor)))
        with_body = sum(a * x for a, x in zip(wheel.unit, w0, strict=True))
        initial.append(number(mp.mpf(str(wheel.moment)) * (mp.mpf(str(wheel.rate)) + with_body)))
    grid = [number(x) for x in times]
    engine = hy.taylor_adaptive(system, initial, time=grid[0], fp_type=hy.real, prec=BITS, compact_mode=True)
    states = engine.propagate_grid(np.array(grid))[-1]
    found = np.array([[np.longdouble(str(x)) for x in row] for row in states])
    return _rates(found, wheels, moving, inverse, held)


def _rates(
    states: np.ndarray, wheels: Sequence[Wheel], moving: Sequence[Wheel], inverse: Any, held: Any
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    wide = lambda x: np.longdouble(_CONTEXT.nstr(x, 25))  # noqa: E731
    own = states[:, :3] - np.array([wide(x) for x in held])
    for k, wheel in enumerate(moving):
        own = own - states[:, 12 + k, None] * np.array([wide(x) for x in wheel.unit])
    rates = own @ np.array([[wide(inverse[i, j]) for j in range(3)] for i in range(3)]).T
    spins = []
    for wheel in wheels:
        if wheel.fixed:
            spins.append(np.full(len(states), np.longdouble(str(wheel.rate))))
        else:
            h = states[:, 12 + moving.index(wheel)]
            spins.append(
                h / wide(_CONTEXT.mpf(str(wheel.moment))) - rates @ np.array([wide(x) for x in wheel.unit])
            )
    return rates, states[:, 3:12].reshape(-1, 3, 3), np.array(spins).T.reshape(len(states), len(wheels))
