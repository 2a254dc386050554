"""Weighted least squares: damped Gauss-Newton steps, covariances, and what the data leave undetermined; and
the search from several starts, with outliers left out.

Levenberg (1944) and Marquardt (1963), in columns scaled to norm one. Covariances with considered parameters:
Tapley, Schutz and Born 2004, Statistical Orbit Determination, section 6.2 (eqs. 6.2.9 and 6.3.15 ff.).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.workflows.fit.observations import (
    CHANGE,
    ROUNDING,
    FitKeys,
    NotPredicted,
    Prediction,
    Predictor,
    Readings,
    difference,
)

SINGULAR = 1e-7
"""Singular values of scaled columns below this share of the largest are taken for zero: correlations that
differ from one by less than its square are rounding in the derivatives.
"""
WITHIN = 1e-3
"""A fit has converged once its next step is shorter than so many sigmas."""
MOST_EVALUATIONS = 100
_DAMPING = 1e-3, 1e12  # the least, below which there is none, and the largest; scaled columns have norm one
_ROUNDED = 1e-11  # relative change of a sum of squares that rounding makes
_SHORT = 0.1  # sigmas: a step whose gain rounding may hide
_SMALL = 1e-4  # rad, below which the series of a function of an angle is right to rounding
_ROUNDS = 25
_FROM_START = 40  # evaluations from each of several starts
_FAR = 30.0  # sigmas, of all residuals together, above which a fit is doubted
_SAME = 1e-6  # relative difference of the sums of squares of starts that end in the same place


@dataclass(frozen=True)
class Linear:
    """A fit linearised at some values; rows are in units of their sigmas.

    Attributes:
        residuals: (rows,) observed less computed. slopes: (rows, estimated). considered: (rows, considered).
        noise: (estimated,) norms of columns below which they are rounding.
        pull: (estimated,) prior value less value. weights: (estimated,) 1/sigma of the prior; 0 for none.
        sets: of each set of observations the residuals in SI, (rows, components), used or not.
    """

    residuals: np.ndarray
    slopes: np.ndarray
    considered: np.ndarray
    noise: np.ndarray
    pull: np.ndarray
    weights: np.ndarray
    sets: list[np.ndarray]

    @cached_property
    def triangle(self) -> np.ndarray:
        """R of [slopes, residuals] with the priors' rows, (at most estimated + 1, estimated + 1)."""
        known = self.weights > 0
        prior = np.concatenate([np.diag(self.weights), (self.weights * self.pull)[:, None]], axis=1)[known]
        data = np.concatenate([self.slopes, self.residuals[:, None]], axis=1)
        return np.asarray(np.linalg.qr(np.concatenate([data, prior]), mode="r"))

    @cached_property
    def cost(self) -> float:
        """Sum of squares, with the priors'."""
        return float(np.sum(self.residuals**2) + np.sum((self.weights * self.pull) ** 2))

    def foreseen(self, step: np.ndarray) -> float:
        """By how much a step would lower the cost if the fit were linear."""
        change = self.triangle[:, :-1] @ step
        return float(change @ (2 * self.triangle[:, -1] - change))


class Solution:
    """Steps and covariances of a linearised fit, by singular values of its scaled columns.

    Attributes:
        null: (directions, estimated) that nothing determines, in scaled numbers; rows of norm one.
        scales: (estimated,) norms of the columns, with the priors; 1 for those without effect.
    """

    def __init__(self, linear: Linear) -> None:
        triangle, count = linear.triangle, len(linear.weights)
        norms = np.linalg.norm(triangle[:, :count], axis=0)
        empty = norms <= 10 * linear.noise
        self.scales = np.where(empty, 1.0, norms)
        scaled = np.where(empty, 0.0, triangle[:, :count] / self.scales)
        self._left, values, right_vectors = np.linalg.svd(scaled, full_matrices=True)
        if len(values) < count:  # fewer rows than numbers
            values = np.append(values, np.zeros(count - len(values)))
        rounding = 10 * np.max(np.where(empty, 0.0, linear.noise / self.scales), initial=0.0)
        least = max(SINGULAR, rounding) * max(float(values[0]), 1e-300)
        self._kept = values > least
        self._values = values
        self._vectors = right_vectors
        self.null = right_vectors[~self._kept]
        reduced = self._left.T @ triangle[:, count]
        self._reduced = np.zeros(count)
        self._reduced[: min(count, len(reduced))] = reduced[:count]

    @property
    def step_sigmas(self) -> float:
        """Length of the undamped step, in sigmas of the estimate."""
        return float(np.linalg.norm(self._reduced[self._kept]))

    def step(self, damping: float) -> np.ndarray:
        """The damped step, (estimated,); nothing moves along undetermined directions."""
        values = self._values[self._kept]
        parts = values / (values**2 + damping) * self._reduced[self._kept]
        return np.asarray(self._vectors[self._kept].T @ parts / self.scales)

    @property
    def covariance(self) -> np.ndarray:
        """(estimated, estimated), without undetermined directions."""
        half = self._vectors[self._kept].T / self._values[self._kept] / self.scales[:, None]
        return np.asarray(half @ half.T)


def consider_covariance(
    linear: Linear, solution: Solution, considered: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of all numbers, estimated ones first, with the considered ones' sigmas; and the sensitivity
    of the estimate to these.

    P = M + S C S', S = -M H' Hc, cov(x, c) = S C, with M the covariance of the data and priors alone, C that
    of the considered (Tapley, Schutz and Born, eqs. 6.3.22 to 6.3.27).
    """
    formal = solution.covariance
    sensitivity = -formal @ (linear.slopes.T @ linear.considered)
    own = np.diag(considered**2)
    cross = sensitivity @ own
    return np.block([[formal + cross @ sensitivity.T, cross], [cross.T, own]]), sensitivity


@dataclass(frozen=True)
class Ended:
    """Where an iteration ended: at these values (estimated,), after so many evaluations of the motion."""

    values: np.ndarray
    linear: Linear
    solution: Solution
    converged: bool
    evaluations: int


def iterate(
    begin: np.ndarray,
    linearised: Callable[[np.ndarray], Linear | None],
    report: Callable[[str], None] = lambda _: None,
    most: int = MOST_EVALUATIONS,
    within: float = WITHIN,
) -> Ended | None:
    """Damped Gauss-Newton steps until they are shorter than ``within`` sigmas, or change the sum of squares
    by rounding alone.

    Args:
        begin: (estimated,) first values.
        linearised: the fit at some values; None where the motion can't be computed.
        report: receives a line on each evaluation.

    Returns:
        Where it ended; None if the motion can't be computed at the first values.
    """
    values, linear = np.array(begin, dtype=float), linearised(begin)
    if linear is None:
        return None
    solution, evaluations, damping, growth = Solution(linear), 1, 0.0, 2.0
    while True:
        length, cost = solution.step_sigmas, linear.cost
        report(f"evaluation {evaluations}: sum of squares {cost:.6g}, next step {length:.2g} sigmas")
        if length <= within or evaluations >= most or damping > _DAMPING[1]:
            return Ended(values, linear, solution, length <= within, evaluations)
        step = solution.step(damping)
        trial, evaluations = linearised(values + step), evaluations + 1
        if trial is not None and trial.cost < cost:
            gained = (cost - trial.cost) / max(linear.foreseen(step), 1e-300)
            damping *= max(1 / 3, 1 - (2 * gained - 1) ** 3)  # Nielsen 1999
            damping, growth = damping if damping >= _DAMPING[0] else 0.0, 2.0
            values, linear, solution = values + step, trial, Solution(trial)
        elif (
            trial is not None
            and trial.cost <= cost * (1 + _ROUNDED)
            and length <= max(_SHORT, (10 * _ROUNDED * cost) ** 0.5)
        ):  # rounding is all that changes any more; damping doesn't keep it here
            return Ended(values, linear, solution, True, evaluations)
        else:
            damping, growth = max(damping, _DAMPING[0]) * growth, 2 * growth


# --- the search --------------------------------------------------------------------------------------------


class Weighing:
    """Readings of all sets, and what an experiment predicts for them.

    Attributes:
        used: of each set the rows that count, (rows,) bool.
        failure: why the motion couldn't be computed where this was last so.
    """

    def __init__(self, keys: FitKeys, readings: Sequence[Readings], predictor: Predictor) -> None:
        self.keys, self.readings, self._predictor = keys, list(readings), predictor
        self.used = [np.ones(len(r.times), dtype=bool) for r in readings]
        self._start = np.array([one.start for one in keys.estimated])
        self._fixed = np.array([one.start for one in keys.considered])
        self._weights = np.array([0.0 if k.sigma is None else 1.0 / k.sigma for k in keys.estimated])
        self.failure = ""
        self._moving = np.array([one.clock is None for one in keys.all])
        clocks = {one.clock: n for n, one in enumerate(keys.all) if one.clock is not None}
        files = {readings[n].source: place for n, place in clocks.items()}
        # of each set the place of its offset: its own, or that of another set from the same file
        self._clocks = [clocks.get(n, files.get(r.source)) for n, r in enumerate(readings)]
        self._begin, (_, end) = float(keys.scene.start), keys.scene.reach
        rate = np.linalg.norm([float(w) for w in keys.scene.angular_velocity or ()])
        self._step = CHANGE / max(float(rate), 1 / (end - self._begin))  # s, as for numbers of the motion
        self._forwards = keys.scene.samples.direction > 0

    def moved(self, values: np.ndarray) -> list[Readings]:
        """The readings at their times by the clocks of some values."""
        late = np.array([*values, *self._fixed]) - [one.start for one in self.keys.all]
        sets = zip(self.readings, self._clocks, strict=True)
        return [r if clock is None else replace(r, times=r.times + late[clock]) for r, clock in sets]

    def linear(self, values: np.ndarray) -> Linear | None:
        """The fit linearised at some values; None where the motion can't be computed."""
        sets = self.moved(values)
        each = [
            [r.times] if clock is None else [r.times, *self._around(r.times)]
            for r, clock in zip(sets, self._clocks, strict=True)
        ]
        times, places = np.unique(np.concatenate([x for one in each for x in one]), return_inverse=True)
        at = iter(np.split(places, np.cumsum([len(x) for one in each for x in one])[:-1]))
        try:
            found = self._predictor.at(np.array([*values, *self._fixed])[self._moving], times)
        except NotPredicted as error:
            self.failure = str(error)
            return None
        every, residuals, slopes, noise = [], [], [], np.zeros(len(self.keys.all))
        for readings, used, clock, at_times in zip(sets, self.used, self._clocks, each, strict=True):
            one, sigmas = readings.quantity, readings.sigmas[used]
            name, rows = one.variable, [next(at) for _ in at_times]
            ends = [found.values[name][place] for place in rows]
            every.append(difference(one, ends[0], readings.values))
            slope = self._widened(found.slopes[name][rows[0]])
            weight = np.sum(sigmas**-2.0)
            noise[self._moving] += found.noise[name] ** 2 * weight
            if clock is not None:
                widths = at_times[2] - at_times[1]
                slope[:, :, clock] = difference(one, ends[1], ends[2]) / widths[:, None]
                size = 1.0 if one.rotation or one.form == "angle" else float(np.abs(ends[0]).max())
                noise[clock] += (ROUNDING * size / self._step) ** 2 * weight
            slope = slope[used]
            if one.rotation:
                slope = np.einsum("nij,njk->nik", inverse_right_jacobian(every[-1][used]), slope)
            residuals.append((every[-1][used] / sigmas).ravel())
            slopes.append((slope / sigmas[:, :, None]).reshape(-1, slope.shape[2]))
        table, k = np.concatenate(slopes), len(self.keys.estimated)
        return Linear(
            np.concatenate(residuals), table[:, :k], table[:, k:], np.sqrt(noise)[:k],
            self._start - values, self._weights, every,
        )  # fmt: skip

    def _around(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Times just before and after others, on the same side of the run's start."""
        before, after, begin = times - self._step, times + self._step, self._begin
        later = (times > begin) | ((times == begin) & self._forwards)
        before = np.where(later, np.maximum(before, begin), before)
        return before, np.where(later, after, np.minimum(after, begin))

    def _widened(self, slopes: np.ndarray) -> np.ndarray:
        """Derivatives (rows, components, numbers) by all numbers from those by numbers of the motion."""
        wide = np.zeros((*slopes.shape[:2], len(self._moving)))
        wide[:, :, self._moving] = slopes
        return wide

    def along(self, values: np.ndarray, times: np.ndarray) -> Prediction:
        """Predictions with derivatives along the run, as far as the scene has them."""
        try:
            found = self._predictor.along(np.array([*values, *self._fixed])[self._moving], times)
        except NotPredicted:
            return Prediction({})
        return replace(found, slopes={name: self._widened(x) for name, x in found.slopes.items()})

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
    weighing: Weighing, starts: int, report: Callable[[str], None]
) -> tuple[Ended, list[float], list[str]]:
    """Fit from each start, and then again without rows beyond their limit until these stay the same.

    Returns:
        The best fit; the sums of squares where each start ended, nan for those from which the motion couldn't
        be computed; and what a user should know.

    Raises:
        RigidsimError: from no start the motion can be computed, or too few rows are left.
    """
    ended, costs, notes = _from_starts(weighing, starts, report)
    seen: list[bytes] = []
    while len(seen) < _ROUNDS and _sort_out(weighing, ended):
        kept = b"".join(used.tobytes() for used in weighing.used)
        if kept in seen:
            notes.append("the outlier rule alternates between sets of rows; the latest set is kept")
            break
        seen.append(kept)
        left = sum(int((~used).sum()) for used in weighing.used)
        report(f"round {len(seen)} of the outlier rule: {left} rows left out")
        again = iterate(ended.values, weighing.linear, report)
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
    size = float(np.sqrt(ended.linear.cost / len(ended.linear.residuals)))
    if size > _FAR:
        notes.append(
            f"residuals are {size:.3g} sigmas: the fit ended in another minimum, a load is missing, or the "
            "sigmas are too small; begin near the first row's attitude and rates (compare shows them), or "
            "try more starts"
        )
    return ended, costs, notes


def _from_starts(
    weighing: Weighing, starts: int, report: Callable[[str], None]
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
            report(f"start {number + 1} of {starts}")
        away = np.random.default_rng([number]).standard_normal(len(keys)) if number else np.zeros(len(keys))
        most = MOST_EVALUATIONS if starts == 1 else _FROM_START
        ended = iterate(begin + sigmas * away, weighing.linear, report, most)
        costs.append(np.nan if ended is None else ended.linear.cost)
        if ended is not None and (best is None or ended.linear.cost < best.linear.cost * (1 - _SAME)):
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
