"""From several starts to the best fit: residuals in units of their sigmas, with outliers left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.workflows.fit.estimation import Ended, Linear, iterate
from rigidsim.workflows.fit.keys import FitKeys
from rigidsim.workflows.fit.predictions import NotPredicted, Prediction, Predictor, difference
from rigidsim.workflows.fit.readings import Readings

_SMALL = 1e-4  # rad, below which the series of a function of an angle is right to rounding
_ROUNDS = 25
_FROM_START = 40  # iterations from each of several starts
_ROUNDED = 1e-9  # relative difference of sums of squares that rounding makes
_SAME = 1e-6  # relative difference of the sums of squares of starts that end in the same place


@dataclass(frozen=True)
class Residuals:
    """Readings beside a prediction, one array for each set.

    Attributes:
        residuals: (rows, components), observed less computed, SI; rotation vectors for attitudes.
        slopes: (rows, components, numbers), of what is computed. noise: (numbers,), of these.
    """

    residuals: list[np.ndarray]
    slopes: list[np.ndarray]
    noise: list[np.ndarray]


class Weighing:
    """Readings of all sets, and what an experiment predicts for them."""

    def __init__(self, keys: FitKeys, readings: Sequence[Readings], predictor: Predictor) -> None:
        self.keys, self.readings, self._predictor = keys, list(readings), predictor
        self.times, places = np.unique(np.concatenate([r.times for r in readings]), return_inverse=True)
        self._places = np.split(places, np.cumsum([len(r.times) for r in readings])[:-1])
        self.used = [np.ones(len(r.times), dtype=bool) for r in readings]
        self._count = len(keys.estimated)
        self._start = np.array([one.start for one in keys.estimated])
        self._fixed = np.array([one.start for one in keys.considered])
        self._weights = np.array([0.0 if k.sigma is None else 1.0 / k.sigma for k in keys.estimated])
        self.failure = ""
        self._sloped: Prediction | None = None  # the latest prediction, with the latest derivatives
        self._latest: tuple[bytes, Residuals] | None = None  # the same beside the readings, with its values
        self._fresh = False  # whether these derivatives are those of its values

    def compared(self, values: np.ndarray, *, fresh: bool = True) -> Residuals:
        """Residuals and slopes of all rows, used or not; the latest slopes unless they are to be ``fresh``.

        Raises:
            NotPredicted: the motion doesn't reach them.
        """
        if self._latest is not None and self._latest[0] == values.tobytes() and self._fresh >= fresh:
            return self._latest[1]
        found = self._predictor.at([*values, *self._fixed], self.times, slopes=fresh)
        self._fresh = bool(found.slopes)  # some come with them, asked for or not
        if not found.slopes:
            assert self._sloped is not None
            found = Prediction(found.values, self._sloped.slopes, self._sloped.noise)
        self._sloped = found
        self._latest = values.tobytes(), self._beside(found)
        return self._latest[1]

    def along(self, values: np.ndarray, times: np.ndarray) -> Prediction:
        """Predictions with derivatives along the run, as far as the scene has them."""
        try:
            return self._predictor.along([*values, *self._fixed], times)
        except NotPredicted:
            return Prediction({})

    def _beside(self, found: Prediction) -> Residuals:
        parts = [self._set(r, p, found) for r, p in zip(self.readings, self._places, strict=True)]
        return Residuals(*map(list, zip(*parts, strict=True)))

    def _set(
        self, readings: Readings, places: np.ndarray, found: Prediction
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        name = readings.quantity.variable
        computed, slopes = found.values[name][places], found.slopes[name][places]
        residuals = difference(readings.quantity, computed, readings.values)
        if readings.quantity.rotation:
            slopes = np.einsum("nij,njk->nik", inverse_right_jacobian(residuals), slopes)
        return residuals, slopes, found.noise[name]

    def linearised(self, values: np.ndarray, fresh: bool = True) -> Linear | None:
        """The fit at some values, by the rows that are used, with the latest slopes unless they are to be
        ``fresh``; None where the motion can't be computed.
        """
        try:
            compared = self.compared(values, fresh=fresh)
        except NotPredicted as error:
            self.failure = str(error)
            return None
        residuals, slopes, noise = [], [], np.zeros(len(self.keys.all))
        for n, readings in enumerate(self.readings):
            used, sigmas = self.used[n], readings.sigmas[self.used[n]]
            residuals.append((compared.residuals[n][used] / sigmas).ravel())
            slope = compared.slopes[n][used] / sigmas[:, :, None]
            slopes.append(slope.reshape(-1, slope.shape[2]))
            noise += compared.noise[n] ** 2 * np.sum(sigmas**-2.0)
        every = np.concatenate(slopes)
        k = self._count
        return Linear(
            np.concatenate(residuals), every[:, :k], every[:, k:], np.sqrt(noise)[:k],
            self._start - values, self._weights,
        )  # fmt: skip

    def sizes(self, compared: Residuals) -> list[np.ndarray]:
        """Of each row the largest residual of its components, in sigmas, (rows,) for each set."""
        return [
            np.abs(residuals / readings.sigmas).max(axis=1)
            for residuals, readings in zip(compared.residuals, self.readings, strict=True)
        ]


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
        again = iterate(ended.values, weighing.linearised, told)
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
        ended = iterate(values, weighing.linearised, told, **most)
        costs.append(np.nan if ended is None else ended.linear.cost)
        if ended is not None and (best is None or ended.linear.cost < best.linear.cost * (1 - _ROUNDED)):
            best = ended
    if best is None:
        raise RigidsimError(f"fit: {weighing.failure}; change the values that it starts from")
    notes = []
    if starts > 1:
        same = sum(cost <= best.linear.cost * (1 + _SAME) + _SAME for cost in costs)
        notes.append(f"{same} of {starts} starts end in the best fit")
    return best, costs, notes


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
