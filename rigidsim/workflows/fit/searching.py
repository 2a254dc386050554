"""From several starts to the best fit: residuals in units of their sigmas, with outliers left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.workflows.fit.estimation import MOST_EVALUATIONS, Ended, Linear, iterate
from rigidsim.workflows.fit.keys import FitKeys
from rigidsim.workflows.fit.predictions import NotPredicted, Prediction, Predictor, difference
from rigidsim.workflows.fit.readings import Readings

_SMALL = 1e-4  # rad, below which the series of a function of an angle is right to rounding
_ROUNDS = 25
_FROM_START = 40  # evaluations from each of several starts
_ROUNDED = 1e-9  # relative difference of sums of squares that rounding makes
_SAME = 1e-6  # relative difference of the sums of squares of starts that end in the same place


class Weighing:
    """Readings of all sets, and what an experiment predicts for them.

    Attributes:
        used: of each set the rows that count, (rows,) bool.
        failure: why the motion couldn't be computed where this was last so.
    """

    def __init__(self, keys: FitKeys, readings: Sequence[Readings], predictor: Predictor) -> None:
        self.keys, self.readings, self._predictor = keys, list(readings), predictor
        self.times, places = np.unique(np.concatenate([r.times for r in readings]), return_inverse=True)
        self._places = np.split(places, np.cumsum([len(r.times) for r in readings])[:-1])
        self.used = [np.ones(len(r.times), dtype=bool) for r in readings]
        self._start = np.array([one.start for one in keys.estimated])
        self._fixed = np.array([one.start for one in keys.considered])
        self._weights = np.array([0.0 if k.sigma is None else 1.0 / k.sigma for k in keys.estimated])
        self.failure = ""

    def linear(self, values: np.ndarray) -> Linear | None:
        """The fit linearised at some values; None where the motion can't be computed."""
        try:
            found = self._predictor.at([*values, *self._fixed], self.times)
        except NotPredicted as error:
            self.failure = str(error)
            return None
        every, residuals, slopes, noise = [], [], [], np.zeros(len(self.keys.all))
        for readings, places, used in zip(self.readings, self._places, self.used, strict=True):
            name, sigmas = readings.quantity.variable, readings.sigmas[used]
            every.append(difference(readings.quantity, found.values[name][places], readings.values))
            slope = found.slopes[name][places][used]
            if readings.quantity.rotation:
                slope = np.einsum("nij,njk->nik", inverse_right_jacobian(every[-1][used]), slope)
            residuals.append((every[-1][used] / sigmas).ravel())
            slopes.append((slope / sigmas[:, :, None]).reshape(-1, slope.shape[2]))
            noise += found.noise[name] ** 2 * np.sum(sigmas**-2.0)
        table, k = np.concatenate(slopes), len(self.keys.estimated)
        return Linear(
            np.concatenate(residuals), table[:, :k], table[:, k:], np.sqrt(noise)[:k],
            self._start - values, self._weights, every,
        )  # fmt: skip

    def along(self, values: np.ndarray, times: np.ndarray) -> Prediction:
        """Predictions with derivatives along the run, as far as the scene has them."""
        try:
            return self._predictor.along([*values, *self._fixed], times)
        except NotPredicted:
            return Prediction({})

    def sizes(self, residuals: list[np.ndarray]) -> list[np.ndarray]:
        """Of each row the largest residual of its components, in sigmas, (rows,) for each set."""
        sets = zip(residuals, self.readings, strict=True)
        return [np.abs(x / readings.sigmas).max(axis=1) for x, readings in sets]


def inverse_right_jacobian(vectors: np.ndarray) -> np.ndarray:
    """How rotation vectors (rows, 3) from computed to observed attitudes shrink as the computed ones turn,
    (rows, 3, 3): 1 + [v]/2 + (1/a^2 - (1 + cos a)/(2 a sin a)) [v]^2, a = |v| (Chirikjian 2012, eq. 10.86).
    """
    angle = np.linalg.norm(vectors, axis=1)
    safe = np.where(angle > _SMALL, angle, 1.0)
    factor = 1 / safe**2 - 0.5 / (safe * np.tan(0.5 * safe))  # (1 + cos a)/sin a = cot(a/2)
    factor = np.where(angle > _SMALL, factor, 1.0 / 12.0)
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    return np.asarray(np.eye(3) + 0.5 * cross + factor[:, None, None] * (cross @ cross))


def search(
    weighing: Weighing, starts: int, told: Callable[[str], None]
) -> tuple[Ended, list[float], list[str]]:
    """Fit from each start, and then again without rows beyond their limit until these stay the same.

    Returns:
        The best fit; the sums of squares where each start ended, nan for those from which the motion couldn't
        be computed; and what a user should know.

    Raises:
        RigidsimError: from no start the motion can be computed, or too few rows are left.
    """
    ended, costs, notes = _from_starts(weighing, starts, told)
    seen: list[bytes] = []
    while len(seen) < _ROUNDS and _sort_out(weighing, ended):
        kept = b"".join(used.tobytes() for used in weighing.used)
        if kept in seen:
            notes.append("the outlier rule goes round in circles: rows at its limit stay as they are here")
            break
        seen.append(kept)
        left = sum(int((~used).sum()) for used in weighing.used)
        told(f"round {len(seen)} of the outlier rule: {left} rows left out")
        again = iterate(ended.values, weighing.linear, told)
        if again is None:
            raise RigidsimError(f"fit: {weighing.failure}")
        ended = again
    if not ended.converged and weighing.failure:
        notes.append(f"steps towards a better fit were refused: {weighing.failure}")
    for readings, used in zip(weighing.readings, weighing.used, strict=True):
        if used.sum() < 0.5 * len(used):
            notes.append(
                f"{readings.label}: more than half of its rows were left out as outliers; its sigmas may be "
                "too small, or the fit ended far from the truth: try more starts"
            )
    return ended, costs, notes


def _from_starts(
    weighing: Weighing, starts: int, told: Callable[[str], None]
) -> tuple[Ended, list[float], list[str]]:
    """The best end of all starts: the config's values, then others from the priors, the same for the same
    config on any machine.
    """
    keys = weighing.keys.estimated
    begin = np.array([one.start for one in keys])
    sigmas = np.array([one.sigma or 0.0 for one in keys])
    best: Ended | None = None
    costs: list[float] = []
    for number in range(starts):
        if starts > 1:
            told(f"start {number + 1} of {starts}")
        away = np.random.default_rng([number]).standard_normal(len(keys)) if number else np.zeros(len(keys))
        most = MOST_EVALUATIONS if starts == 1 else _FROM_START
        ended = iterate(begin + sigmas * away, weighing.linear, told, most)
        costs.append(np.nan if ended is None else ended.linear.cost)
        if ended is not None and (best is None or ended.linear.cost < best.linear.cost * (1 - _ROUNDED)):
            best = ended
    if best is None:
        raise RigidsimError(f"fit: {weighing.failure}; change the values that it starts from")
    same = sum(cost <= best.linear.cost * (1 + _SAME) + _SAME for cost in costs)
    return best, costs, [f"{same} of {starts} starts end in the best fit"] if starts > 1 else []


def _sort_out(weighing: Weighing, ended: Ended) -> bool:
    """Leave out rows beyond their limit, the worst first, and take back those within; whether any changed.

    A large outlier draws the fit to itself and makes good rows look bad: a round leaves out only rows that
    are at least half as far off as the worst one.
    """
    sizes = weighing.sizes(ended.linear.sets)
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
