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
MOST_EVALUATIONS = 100
_DAMPING = 1e-3, 1e12  # the least, below which there is none, and the largest; scaled columns have norm one
_ROUNDED = 1e-11  # relative change of a sum of squares that rounding makes
_SHORT = 0.1  # sigmas: a step whose gain rounding may hide


@dataclass(frozen=True)
class Linear:
    """A fit linearised at some values; rows are in units of their sigmas.

    Attributes:
        residuals: (rows,) observed less computed. slopes: (rows, estimated). considered: (rows, considered).
        noise: (estimated,) norms of columns below which they tell nothing.
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
    told: Callable[[str], None] = lambda _: None,
    most: int = MOST_EVALUATIONS,
) -> Ended | None:
    """Damped Gauss-Newton steps until they are shorter than ``WITHIN`` sigmas, or change the sum of squares
    by rounding alone.

    Args:
        begin: (estimated,) first values.
        linearised: the fit at some values; None where the motion can't be computed.
        told: receives a line on each evaluation.

    Returns:
        Where it ended; None if the motion can't be computed at the first values.
    """
    values, linear = np.array(begin, dtype=float), linearised(begin)
    if linear is None:
        return None
    solution, evaluations, damping, growth = Solution(linear), 1, 0.0, 2.0
    while True:
        length, cost = solution.step_sigmas, linear.cost
        told(f"evaluation {evaluations}: sum of squares {cost:.6g}, next step {length:.2g} sigmas")
        if length <= WITHIN or evaluations >= most or damping > _DAMPING[1]:
            return Ended(values, linear, solution, length <= WITHIN, evaluations)
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
