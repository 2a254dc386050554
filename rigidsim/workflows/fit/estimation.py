"""Weighted least squares: damped Gauss-Newton steps, covariances, and what the data leave undetermined.

Levenberg (1944) and Marquardt (1963), in columns scaled to norm one. Covariances with considered parameters:
Tapley, Schutz and Born 2004, Statistical Orbit Determination, section 6.2 (eqs. 6.2.9 and 6.3.15 ff.).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

SINGULAR = 1e-7
"""Singular values of scaled columns below this share of the largest are taken for zero: correlations that
differ from one by less than its square are rounding in the derivatives.
"""
WITHIN = 1e-3
"""A fit has converged once its next step is shorter than so many sigmas."""
MOST_ITERATIONS = 100
_FIRST_DAMPING, _AFTER_FAILURE = 1e-6, 1e-3
_LARGEST_DAMPING = 1e12
_LEAST_DAMPING = 1e-12
_CALM = 3  # steps in a row that didn't fail, after which damping falls fast
_SHORTER = 0.1  # of a step: the next one may have the same derivatives
_LAST = 0.1  # sigmas: a step as short as this most likely ends a fit, where derivatives are needed anyway
_LATELY = 10  # evaluations
_ROUNDED = 1e-11  # relative change of a sum of squares that rounding makes


@dataclass(frozen=True)
class Linear:
    """A fit linearised at some values; rows are in units of their sigmas.

    Attributes:
        residuals: (rows,) observed less computed. slopes: (rows, estimated). considered: (rows, considered).
        noise: (estimated,) norms of columns below which they tell nothing.
        pull: (estimated,) prior value less value. weights: (estimated,) 1/sigma of the prior; 0 for none.
    """

    residuals: np.ndarray
    slopes: np.ndarray
    considered: np.ndarray
    noise: np.ndarray
    pull: np.ndarray
    weights: np.ndarray

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
    """Where an iteration ended.

    Attributes:
        values: (estimated,). iterations: evaluations of the motion. barred: whether the motion couldn't be
            computed in one of the last of these.
    """

    values: np.ndarray
    linear: Linear
    solution: Solution
    converged: bool
    iterations: int
    barred: bool = False


Linearised = Callable[..., Linear | None]
"""The fit at some values, with derivatives there if they are to be ``fresh`` (by default), otherwise with the
latest ones; None where the motion can't be computed.
"""


def _rounding_is_left(linear: Linear, solution: Solution) -> bool:
    """Whether the step without damping, too, would change the sum of squares by no more than rounding."""
    return solution.step_sigmas <= max(_LAST, (10 * _ROUNDED * linear.cost) ** 0.5)


def iterate(
    begin: np.ndarray,
    linearised: Linearised,
    told: Callable[[str], None] = lambda _: None,
    most: int = MOST_ITERATIONS,
) -> Ended | None:
    """Damped Gauss-Newton steps until they are shorter than ``WITHIN`` sigmas.

    Derivatives cost several times as much as a motion: they are worked out anew where the next step hasn't
    become much shorter, and with the motion itself where it will most likely be the last one. Where it ends
    they are those of its values.

    Args:
        begin: (estimated,) first values.
        told: receives a line on each iteration.

    Returns:
        Where it ended; None if the motion can't be computed at the first values.
    """
    values, linear, fresh = np.array(begin, dtype=float), linearised(begin), True
    if linear is None:
        return None
    solution, iterations, settled = Solution(linear), 1, False
    damping, growth, calm = _FIRST_DAMPING, 2.0, _CALM
    barred = -_LATELY  # the latest evaluation without a motion
    while iterations < most and damping < _LARGEST_DAMPING:
        before, trial = solution.step_sigmas, None
        told(f"evaluation {iterations}: sum of squares {linear.cost:.6g}, next step {before:.2g} sigmas")
        settled = settled or before <= WITHIN
        if settled and fresh:
            break
        last = not settled and not fresh and before <= _LAST
        if not settled:
            step = solution.step(damping)
            trial = linearised(values + step, fresh=last)
            barred = iterations if trial is None else barred
        iterations += 1
        rounded = trial is not None and trial.cost <= linear.cost * (1 + _ROUNDED)
        if trial is not None and (trial.cost < linear.cost or (last and rounded)):
            gained = (linear.cost - trial.cost) / max(linear.foreseen(step), 1e-300)
            calm += 1
            least = 1e-2 if calm > _CALM else 1 / 3  # just after a step that failed, not back to where it did
            damping = 0.0 if damping < _LEAST_DAMPING else damping * max(least, 1 - (2 * gained - 1) ** 3)
            settled, growth = trial.cost >= linear.cost, 2.0  # rounding is all that changes any more
            values, linear, fresh = values + step, trial, last
            solution = Solution(linear)
            if fresh or solution.step_sigmas <= _SHORTER * before:
                continue
        elif fresh:
            settled = rounded and _rounding_is_left(linear, solution)  # otherwise damping keeps it here
            if not settled:
                damping, growth, calm = max(damping, _AFTER_FAILURE) * growth, 2 * growth, 0
            continue
        linear, fresh, settled = _there(linearised, values), True, False
        solution = Solution(linear)
    if not fresh:
        linear = _there(linearised, values)
        solution = Solution(linear)
    converged = settled or solution.step_sigmas <= WITHIN
    return Ended(values, linear, solution, converged, iterations, iterations - barred <= _LATELY)


def _there(linearised: Linearised, values: np.ndarray) -> Linear:
    """The fit where the motion was computed before, with derivatives of these values."""
    found = linearised(values)
    assert found is not None
    return found
