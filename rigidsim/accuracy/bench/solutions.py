"""References of a measurement, integrated in a process of their own while the settings are tried."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rigidsim.accuracy.bench.plan import Plan
from rigidsim.accuracy.bench.worker import Task, ask
from rigidsim.accuracy.comparison import angles_between
from rigidsim.accuracy.reference import (
    LEAST_DIGITS,
    best_and_second,
    closed_form_error,
    equals_of,
    errors_of_best,
    exact_to,
)
from rigidsim.accuracy.setting import Setting
from rigidsim.errors import RigidsimError
from rigidsim.scene.config import Experiment

_WITHOUT_END = 1e6  # seconds: a reference is stopped only by the deadline

Solutions = Mapping[Setting, list[np.ndarray]]
"""Attitudes by setting, float64 parts (samples, 4)."""


@dataclass(frozen=True)
class ReferenceSolution:
    """Attitudes against which others are held.

    Attributes:
        attitudes: float64 parts (samples, 4).
        error: (samples,) estimate of their own error, rad.
        how: description of the reference.
    """

    setting: Setting
    attitudes: list[np.ndarray]
    error: np.ndarray
    how: str


def attitude_task(plan: Plan, setting: Setting, patience: float, *, wide: bool) -> Task:
    """Task that computes a setting's attitudes over the plan's times, or over the short part of them if it is
    ``wide``.

    Args:
        patience: limit of CPU seconds.
    """
    times = plan.times[: plan.short_count] if wide else plan.times
    return Task(setting, "attitudes", times, patience)


class ReferenceThread(threading.Thread):
    """Integrates the references while the settings are tried (in a process of its own)."""

    def __init__(
        self, experiment: Experiment, plan: Plan, deadline: float, grace: float, *, wanted: bool
    ) -> None:
        super().__init__(daemon=True)
        self._experiment, self._deadline, self._grace = experiment, deadline, grace
        self._exact = exact_to(LEAST_DIGITS, plan.exact).setting if plan.exact else None
        self._tasks: list[Task] = []
        if self._exact is not None:
            self._tasks = [attitude_task(plan, self._exact, _WITHOUT_END, wide=False)]
        elif wanted:
            self._tasks = [
                attitude_task(plan, setting, _WITHOUT_END, wide=precision == LEAST_DIGITS)
                for precision in ("quadruple", LEAST_DIGITS)
                for setting in best_and_second(precision)
            ]
        self._found: dict[Setting, list[np.ndarray]] = {}
        self._failure: BaseException | None = None

    def run(self) -> None:
        """See ``Thread``."""
        try:
            first_by = time.monotonic() + self._grace
            for answer in ask(self._experiment, self._tasks, deadline=self._deadline, first_by=first_by):
                if answer.problem is None:
                    parts = [np.array(part) for part in answer.values["attitudes"]]
                    self._found[self._tasks[answer.index].setting] = parts
        except BaseException as error:  # reported in the main thread
            self._failure = error

    def found(self, measured: Solutions) -> tuple[ReferenceSolution, ReferenceSolution | None]:
        """The reference, and a separate one for quadruple precision if needed.

        Args:
            measured: solutions over the same times, the best of which serves if there is nothing better.

        Raises:
            RigidsimError: there is no reference.
        """
        if self._failure is not None:
            raise self._failure
        if self._exact is not None and self._exact in self._found:
            exact = self._found[self._exact]
            own = np.full(len(exact[0]), closed_form_error(LEAST_DIGITS))
            how = f"closed form to {LEAST_DIGITS} digits"
            return ReferenceSolution(self._exact, exact, own, how), None
        wide = _best_of(LEAST_DIGITS, self._found)
        for precision, solutions in (
            ("quadruple", self._found), ("extended", measured), ("double", measured),
        ):  # fmt: skip
            best = _best_of(precision, solutions)
            if best is not None:
                return best, wide
        raise RigidsimError(
            "tradeoff: no reference could be integrated within the budget; give a larger --budget"
        )


def _best_of(precision: str | int, solutions: Solutions) -> ReferenceSolution | None:
    """The best solution of a precision, if there are others from which its error is known; else None."""
    best, _ = best_and_second(precision)
    equals = equals_of(best, solutions)
    if best not in solutions or not equals:
        return None
    error = errors_of_best(best, {s: angles_between(solutions[best], solutions[s]) for s in equals})
    how = f"{best.title}; its error is its distance from {' and '.join(s.title for s in equals[:3])}"
    return ReferenceSolution(best, solutions[best], error, how)
