"""The error of a secular rate beside something slow that is neither a line nor a polynomial.

Of an exponential, or of a line that makes less than a turn within the samples, lines and polynomial absorb
what they can: next to nothing may be left, while the rate contains the whole slope of it. What such parts
have in common is f''' = k f' (k = 1 / tau^2, or -w^2): from the curvature in the middle and its derivatives
follows the slope that the rate has taken over.
"""

import math

import numpy as np

from rigidsim.analysis.exponentials import Complexes, Reals, Sum
from rigidsim.analysis.windows import hann, positions

_DEGREE = 9  # of the polynomial in the slow part: a line of one turn in the samples to some 1e-4
_NEAR = 30.0  # bins from zero within which lines may be pieces of the slow part
_PIECE = 0.1  # of what is left, above which a line is one of its own; pieces were 1e-4 to 3e-2
_SURE = 4.0  # standard deviations above which something is there
_CELLS = 4096
_STRAIGHT = 1e-3  # k, in half lengths, below which rounding hides how exponentials differ from polynomials
_BENT = 1e-2  # k of an exponential that changes by a tenth of its logarithm in half the length
_LONGEST = 3.0  # half lengths that a slow part may take to change by e, where the samples don't say


def hidden_rate(total: Sum, left: Complexes, noise: float) -> float:
    """What a slow part may have added to the rate of a real signal, per half length; 0 if nothing of it is
    left in the remainder (n,), whose mean has the standard deviation ``noise``, as if it were white.
    """
    c, s = _polynomial(left.real, noise, 3)
    if not np.any(np.abs(c[2:]) > _SURE * s[2:]):
        return 0.0
    bent = float(np.max(np.abs(c[2:])))
    higher, spread = _polynomial(_with_pieces(total, left, bent), noise, _DEGREE)
    if np.any(np.abs(higher[2:4] - c[2:]) > bent + _SURE * spread[2:4]):  # what lines have left, nothing slow
        return abs(float(c[1]))
    return _absorbed(higher, spread)


def _with_pieces(total: Sum, left: Complexes, bent: float) -> Reals:
    """What is left together with lines that are pieces of the same: far less than it bends, (n,)."""
    lines = [
        (f, a)
        for f, a in zip(total.frequencies, total.amplitudes, strict=True)
        if abs(float(f)) * total.count < _NEAR and 2 * abs(complex(a)) < _PIECE * bent
    ]
    values = left.real
    if lines:
        frequencies, amplitudes = zip(*lines, strict=True)
        values = values + 2 * Sum(total.context, total.count, (), frequencies, amplitudes).values().real
    return np.asarray(values)


def _polynomial(values: Reals, noise: float, degree: int) -> tuple[Reals, Reals]:
    """Coefficients of the windowed least squares, and their standard deviations in white noise."""
    count = len(values)
    x, weights, means = (_cells(column) for column in (positions(count), hann(count, 1), values))
    columns = np.stack([x**m for m in range(degree + 1)], axis=1)
    weighted = columns * weights[:, None]
    inverse = np.linalg.inv(columns.T @ weighted / len(x))
    spread = inverse @ (weighted.T @ weighted / len(x)) @ inverse
    return inverse @ (weighted.T @ means) / len(x), noise * np.sqrt(np.diag(spread))


def _cells(values: Reals) -> Reals:
    """Means over neighbouring samples, of which few thousand are enough for what is slow."""
    width = max(len(values) // _CELLS, 1)
    return np.asarray(values[: len(values) // width * width].reshape(-1, width).mean(axis=1))


def _absorbed(c: Reals, s: Reals) -> float:
    """The part of the rate that belongs to a slow part with these coefficients and standard deviations."""
    cubic = max(abs(c[1]) - _SURE * s[1], 0.0)  # what a cubic drift adds to the rate in the middle
    size = 4 * c[2] ** 2 + 9 * c[3] ** 2
    if not size:
        return 0.0
    # f''' is 6 c3 + 24 c4 x + 60 c5 x^2, and k (c1 + 2 c2 x + 3 c3 x^2): least squares of the last two
    k = (48 * c[2] * c[4] + 180 * c[3] * c[5]) / size
    unsure = _SURE * math.hypot(24 * s[4], 60 * s[5]) / math.sqrt(size)
    if abs(k) > max(unsure, _STRAIGHT):
        return float(max(cubic, abs(6 * c[3] / k - c[1])))
    if unsure < _BENT:  # it is a polynomial
        return float(cubic)
    # all that is known is by how much the rate itself changes within half the length
    return float(max(cubic, _LONGEST * math.hypot(2 * c[2], 3 * c[3])))
