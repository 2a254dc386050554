"""The correction that puts invariants back, as expressions: of the state, of what was remembered since the
latest one, and of what the integrated equations lack (``rigidsim.solve.projection``).
"""

from collections.abc import Sequence
from typing import Any

import heyoka as hy
import mpmath

from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.system import System
from rigidsim.solve.precision import Scalar


def correction(
    states: Sequence[Symbolic],
    freedoms: Sequence[Symbolic],
    residuals: Sequence[Symbolic],
    lacking: Sequence[Symbolic],
    damping: Scalar,
) -> tuple[list[Symbolic], list[Symbolic]]:
    """What a correction is worked out from, and what comes of it.

    Residuals are (value - initial) / scale of each projected scalar; what is lacking of each state's
    derivative (``lacking_rates``) may be empty. The inputs: states, the time since the latest correction, one
    over the interval that the next is expected within, and of each scalar its residual's integral until then,
    what was put back, and the residual that was left. The outputs: what to take off the states, the
    integrals, what was put back, and the square of the size of the part that puts invariants back.
    """
    m, x = len(residuals), list(states)
    elapsed, pace = hy.make_vars("elapsed", "pace_of_corrections")
    integrals, put_back, then = (
        [hy.make_vars(f"{name}_{j}") for j in range(m)] for name in ("integral", "put_back", "then")
    )
    new_integrals = [
        s + 0.5 * (elapsed * (a + b)) for s, a, b in zip(integrals, residuals, then, strict=True)
    ]
    new_put_back = [c + (a - b) for c, a, b in zip(put_back, residuals, then, strict=True)]
    tensors = hy.diff_tensors(residuals, x, diff_order=1)
    gradients = [
        [tensors[(j, *(int(k == i) for k in range(len(x))))] for i in range(len(x))] for j in range(m)
    ]
    wanted = [r + pace * s for r, s in zip(residuals, new_integrals, strict=True)]
    if lacking:  # along the invariants' level sets: what it would change of them is taken off at once
        across = [hy.sum([g * f for g, f in zip(row, lacking, strict=True)]) for row in gradients]
        wanted = [r + elapsed * a for r, a in zip(wanted, across, strict=True)]
    change = least_correction(
        [[free * g for free, g in zip(freedoms, row, strict=True)] for row in gradients], wanted, damping
    )
    size = hy.sum([c * c for c in change])
    change = [free * c for free, c in zip(freedoms, change, strict=True)]
    if lacking:
        change = [hy.sum([c, -(elapsed * f)]) for c, f in zip(change, lacking, strict=True)]
    return [*x, elapsed, pace, *integrals, *put_back, *then], [*change, *new_integrals, *new_put_back, size]


def freedoms_of(system: System, number: Rounder) -> list[Symbolic]:
    """How far a correction of order one moves each state: as far as 1 rad for an angle in a larger unit, in
    which the same change would look smaller than one of the spin. Not at all where the state stands exactly
    where it began: it has no drift to be put back, and a rate or a direction that is exactly zero for good
    would leave it, to grow about an unstable axis.
    """
    units = [0] * len(system.states)
    for i in system.angle_states:
        units[i] = system.angle_unit
    return [
        hy.select(hy.eq(x, hy.expression(number(start))), hy.expression(0.0), hy.expression(2.0**-unit))
        for x, start, unit in zip(system.variables, system.initial, units, strict=True)
    ]


def lacking_rates(exact: System, integrated: System) -> list[Symbolic]:
    """What integrated equations lack of each derivative, since their coefficients are rounded; empty where
    they have parameters, which change along the motion: orbits by tables, which are rounded themselves. Both
    have the digits of the higher precision, ``integrated`` those of the integration in it.
    """
    pairs = zip(exact.equations, integrated.equations, strict=True)
    if hy.get_params([right for _, right in exact.equations]):
        return []
    return [right - rounded for (_, right), (_, rounded) in pairs]


def damping_between(low: int, high: int, context: mpmath.MPContext) -> mpmath.mpf:
    """Square of the sine between gradients below which a direction is left to itself.

    Residuals are known to some eps_high, so that the correction in a direction of singular value s is
    known to eps_high / s; damped by d it errs by at most eps_high / (2 sqrt d), which is to stay below
    an eighth of eps. The Gram matrix must stay positive after its own rounding.
    """
    two = context.mpf(2)
    return max(two ** (2 * (2 + low - high)), two ** (9 - high))


def least_correction(
    gradients: list[list[Symbolic]], wanted: list[Symbolic], damping: Scalar
) -> list[Symbolic]:
    """Least change of the state that removes residuals, J^T (J J^T + damping)^-1 r, with J of order one."""
    m = len(wanted)
    pairs = [[zip(gradients[a], gradients[b], strict=True) for b in range(m)] for a in range(m)]
    gram = [[hy.sum([x * y for x, y in pair]) for pair in row] for row in pairs]
    for a in range(m):
        gram[a][a] = gram[a][a] + damping
    weights = solve_positive(gram, wanted)
    states = range(len(gradients[0]))
    return [hy.sum([gradients[j][i] * weights[j] for j in range(m)]) for i in states]


def solve_positive(matrix: list[list[Symbolic]], right: list[Symbolic]) -> list[Symbolic]:
    """Solution of a symmetric positive system of expressions, by its L D L^T decomposition."""
    size = len(right)
    lower: list[list[Any]] = [[None] * size for _ in range(size)]
    pivots: list[Any] = []
    for j in range(size):
        known = [-(lower[j][k] * (lower[j][k] * pivots[k])) for k in range(j)]
        pivots.append(hy.sum([matrix[j][j], *known]))
        for i in range(j + 1, size):
            known = [-(lower[i][k] * (lower[j][k] * pivots[k])) for k in range(j)]
            lower[i][j] = hy.sum([matrix[i][j], *known]) / pivots[j]
    solution: list[Any] = []
    for i in range(size):
        solution.append(hy.sum([right[i]] + [-(lower[i][k] * solution[k]) for k in range(i)]))
    solution = [y / d for y, d in zip(solution, pivots, strict=True)]
    for i in reversed(range(size)):
        known = [-(lower[k][i] * solution[k]) for k in range(i + 1, size)]
        solution[i] = hy.sum([solution[i], *known])
    return solution
