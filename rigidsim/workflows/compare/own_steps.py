"""A tool's order, or the tolerance of its steps, from local defects of rows at unequal distances.

A method of order p errs by a multiple of h^(p+1) in a step h, so that defects from row to row, if rows are
its steps and these don't follow the error, grow with the interval with that power. Where steps are chosen by
the error, defects are about as large whatever the interval: the tolerance, as the tool attains it. Rows that
are equally far apart show neither: over several steps errors add up, whatever the order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_LEAST_ROWS = 20
_UNEQUAL, _MUCH = (
    1.3,
    3.0,
)  # ratio of long intervals to short ones from which a tolerance, and an order, shows
_CLEAR = 0.85  # share of the variance (of logarithms) that the power explains
_STEEPEST, _FLATTEST = 20.0, 1.7  # slopes of methods of order 1 to 19
_ALIKE = 300.0  # ratio of large defects to small ones, up to which they are held


@dataclass(frozen=True)
class OwnSteps:
    """What defects tell of a tool's steps; None where that doesn't show.

    Attributes:
        order: of its method. tolerance: angle that errors of its steps are held to, rad.
    """

    order: float | None = None
    tolerance: float | None = None


def own_steps(intervals: np.ndarray, defects: np.ndarray, noise: float) -> OwnSteps:
    """Order or tolerance by local defects (rows,), rad, over intervals (rows,), s.

    Args:
        noise: rad, that the digits of the file allow; smaller defects tell nothing.
    """
    seen = np.isfinite(defects) & (defects > 5 * noise)
    if seen.sum() < max(_LEAST_ROWS, len(seen) / 2):
        return OwnSteps()
    lengths, sizes = np.log(intervals[seen]), np.log(defects[seen])
    unequal = np.exp(np.subtract(*np.quantile(lengths, [0.95, 0.05])))
    if unequal < _UNEQUAL:
        return OwnSteps()
    (slope, _), clear = np.polyfit(lengths, sizes, 1), np.corrcoef(lengths, sizes)[0, 1] ** 2
    if unequal >= _MUCH and clear >= _CLEAR and _FLATTEST <= slope <= _STEEPEST:
        return OwnSteps(order=float(slope - 1))
    alike = np.exp(np.subtract(*np.quantile(sizes, [0.9, 0.1]))) <= _ALIKE
    return (
        OwnSteps(tolerance=float(np.quantile(defects[seen], 0.95)))
        if alike and clear < _CLEAR
        else OwnSteps()
    )
