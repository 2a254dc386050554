"""Bounds of natural steps for cases in which the engine, which uses the last two terms of a series, can't
tell.

A series may end (free fall without rotation), or have gaps just where the engine looks.
"""

from __future__ import annotations

import math

import numpy as np

_SPARSE = 1.5
"""Largest ratio of the step suggested by the last two terms to that of the terms before, in proportion to an
exponential's terms: 1.5^20 is three digits.
"""
# A motion whose Taylor series ends (free fall without rotation) would have infinite steps. Natural steps are
# of the order of one internal unit, far below this, so that the bound changes no other motion.
_LONGEST_BITS = 30
_SPARE_BITS = 24  # bits of a type's exponents left for the states of order one and their sums


def longest_step(order: int, number: type) -> float:
    """Bound of all steps, internal units.

    Events are found on a step's polynomials, scaled by the powers of its size up to the order: where those
    overflow, as 2^30 to the 10th does in single precision, heyoka silently finds none.
    """
    if not issubclass(number, np.floating):  # quadruple and beyond have far more than a thousand exponents
        return 2.0**_LONGEST_BITS
    return 2.0 ** min(_LONGEST_BITS, (np.finfo(number).maxexp - _SPARE_BITS) // order)


def bound_of_sparse_series(coefficients: np.ndarray) -> float:
    """Bound of a step from all Taylor coefficients (states, order + 1) of any step from there, if it is far
    below that from the last two, which the engine uses; infinity elsewhere.

    From rest under a torque that grows with time, a quaternion's series have every third term only: the last
    two are zero, and the engine would take any step at all.
    """
    sizes = [max(abs(float(x)) for x in column) for column in coefficients.T]
    if not all(map(math.isfinite, sizes)):  # next to a pole of Euler angles: this chart is left
        return math.inf
    order, base = len(sizes) - 1, max(sizes[0], 1.0)  # the engine's errors are absolute below 1

    def radius(term: int) -> float:
        return (base / sizes[term]) ** (1 / term) if sizes[term] > 0 else math.inf

    def of_entire(term: int) -> float:  # terms of an exponential, like those of a rotation
        return math.exp(math.lgamma(term + 1) / term)

    terms = range(order // 2 + 1, order - 1)
    shortest = min((radius(m) for m in terms), default=math.inf)
    expected = min((radius(m) * of_entire(order) / of_entire(m) for m in terms), default=math.inf)
    if min(radius(order), radius(order - 1)) <= _SPARSE * expected:
        return math.inf
    return shortest * math.exp(-2 - 0.7 / (order - 1))  # as heyoka's own (Jorba & Zou 2005)
