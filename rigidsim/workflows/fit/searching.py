"""From several starts to the best fit, with outliers left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.workflows.fit.estimation import Ended, iterate
from rigidsim.workflows.fit.weighing import Residuals, Weighing

_ROUNDS = 25
_FROM_START = 40  # iterations from each of several starts
_SAME = 1e-6  # relative difference of the sums of squares of starts that end in the same place


@dataclass
class FoundFit:
    """What was done to find the best fit; ``costs``: sums of squares where each start ended, nan for those
    from which the motion couldn't be computed.
    """

    ended: Ended
    compared: Residuals
    costs: list[float]
    rounds: int
    told: list[str] = field(default_factory=list)


def search(weighing: Weighing, starts: int, told: Callable[[str], None]) -> FoundFit:
    """Fit from each start, and then again without rows beyond their limit until these stay the same.

    Raises:
        RigidsimError: from no start the motion can be computed, or too few rows are left.
    """
    ended, costs, notes = _from_starts(weighing, starts, told)
    compared = weighing.compared(ended.values, fresh=starts > 1)  # the latest needn't be the best
    seen: list[bytes] = []
    rounds = 0
    while rounds < _ROUNDS and _sort_out(weighing, compared):
        kept = b"".join(used.tobytes() for used in weighing.used)
        if kept in seen:
            notes.append("the outlier rule goes round in circles: rows at its limit stay as they are here")
            break
        seen.append(kept)
        rounds += 1
        left = sum(int((~used).sum()) for used in weighing.used)
        told(f"round {rounds} of the outlier rule: {left} rows left out")
        again = iterate(ended.values, weighing.linearised, _telling(told))
        if again is None:
            raise RigidsimError(f"fit: {weighing.failure}")
        ended, compared = again, weighing.compared(again.values, fresh=False)
    if not ended.converged and ended.barred:
        notes.append(f"steps towards a better fit were refused: {weighing.failure}")
    for readings, used in zip(weighing.readings, weighing.used, strict=True):
        if used.sum() < 0.5 * len(used):
            notes.append(
                f"{readings.label}: more than half of its rows were left out as outliers; its sigmas may be "
                "too small, or the fit ended far from the truth: try more starts"
            )
    return FoundFit(ended, compared, costs, rounds, notes)


def _from_starts(
    weighing: Weighing, starts: int, told: Callable[[str], None]
) -> tuple[Ended, list[float], list[str]]:
    """The best end of all starts, the first of which is the config's values."""
    best: Ended | None = None
    costs: list[float] = []
    for number, values in enumerate(drawn(weighing, starts)):
        if starts > 1:
            told(f"start {number + 1} of {starts}")
        most = {} if starts == 1 else {"most": _FROM_START}
        ended = iterate(values, weighing.linearised, _telling(told), **most)
        costs.append(np.nan if ended is None else ended.linear.cost)
        if ended is not None and (best is None or _better(ended, best)):
            best = ended
    if best is None:
        raise RigidsimError(f"fit: {weighing.failure}; change the values that it starts from")
    notes = []
    if starts > 1:
        same = sum(cost <= best.linear.cost * (1 + _SAME) + _SAME for cost in costs)
        notes.append(f"{same} of {starts} starts end in the best fit")
    return best, costs, notes


def _better(one: Ended, other: Ended) -> bool:
    """Whether an end is lower, by more than rounding."""
    return one.linear.cost < other.linear.cost * (1 - 1e-9)


def drawn(weighing: Weighing, starts: int) -> list[np.ndarray]:
    """The config's values, then others from the priors: the same for the same config on any machine."""
    keys = weighing.keys.estimated
    begin = np.array([one.start for one in keys])
    sigmas = np.array([one.sigma or 0.0 for one in keys])
    return [
        begin if n == 0 else begin + sigmas * np.random.default_rng([n]).standard_normal(len(keys))
        for n in range(starts)
    ]


def _sort_out(weighing: Weighing, compared: Residuals) -> bool:
    """Leave out rows beyond their limit, the worst first, and take back those within; whether any changed.

    A large outlier draws the fit to itself and makes good rows look bad: a round leaves out only rows that
    are at least half as far off as the worst one.
    """
    sizes = weighing.sizes(compared)
    limits = [np.inf if r.outliers is None else r.outliers for r in weighing.readings]
    beyond = [
        float(size[used & (size > limit)].max(initial=0.0))
        for size, used, limit in zip(sizes, weighing.used, limits, strict=True)
    ]
    worst, changed = max(beyond), False
    for n, (size, limit) in enumerate(zip(sizes, limits, strict=True)):
        bad = size > max(limit, 0.5 * worst)
        used = np.where(weighing.used[n], ~bad, size <= limit)
        changed |= bool((used != weighing.used[n]).any())
        weighing.used[n] = used
    return changed


def _telling(told: Callable[[str], None]) -> Callable[[int, float, float], None]:
    def tell(iteration: int, cost: float, step: float) -> None:
        told(f"evaluation {iteration}: sum of squares {cost:.6g}, next step {step:.2g} sigmas")

    return tell
