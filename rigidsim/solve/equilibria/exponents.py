"""Exponents by which motions near an equilibrium go on."""

from __future__ import annotations

from typing import Any

from rigidsim.scene.arithmetic import Matrix

_STILL = 1e-9
"""Real part of an exponent, relative to the rate of the motion, up to which it is zero: equal exponents are
known to half of the digits alone.
"""


def exponents_of(
    context: Any, matrix: Matrix, rate: Any, period: Any | None = None
) -> tuple[tuple[tuple[float, float], ...], bool]:
    """Exponents (1/s) of a linear system's matrix, or of its map over a period (s), as of ``FoundStart``, and
    whether none grows.

    Args:
        rate: of the motion in the equilibrium, rad/s.
    """
    values, _ = context.eig(context.matrix(matrix))
    if period is not None:
        values = [context.log(value) / period for value in values]
    found = []
    for value in values:
        real, imaginary = (context.zero if abs(x) <= _STILL * rate else x for x in (value.real, value.imag))
        if imaginary >= 0:
            found.append((float(real), float(imaginary)))
    found.sort(key=lambda pair: (pair[1], pair[0]))
    return tuple(found), all(real <= 0 for real, _ in found)
