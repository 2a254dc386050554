"""The least change of a state that removes given residuals, as expressions."""

from __future__ import annotations

from typing import Any

import heyoka as hy

from rigidsim.model.rotations import Symbolic
from rigidsim.solve.precision import Scalar


def least_correction(
    gradients: list[list[Symbolic]], wanted: list[Symbolic], damping: Scalar
) -> list[Symbolic]:
    """Least change of the state that removes r from the residuals, J^T (J J^T + damping)^-1 r.

    Args:
        gradients: J, one row for each residual, of order one.
        wanted: r.
    """
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
