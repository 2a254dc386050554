"""What takes a motion and its neighbours forward, side by side, and what a loose tolerance does to a step."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import heyoka as hy
import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.engine import Integrator
from rigidsim.solve.precision import precision_of
from rigidsim.solve.steppers import stepper_of

NEIGHBOURS = 3
TOLERANCE, TIGHT = 1e-8, 1e-14
"""The tight one where errors grow so much that a loosely followed motion is soon another one."""
_UNROLLED_FROM = 200_000
"""Steps to be taken from which code that takes longer to compile pays."""
_HOPELESS_STEPS = 32_768
"""In one stretch: the motion comes to no end, say towards a collision."""
_LEAST_TOLERANCE = 1e-11
"""Whose errors in a step still stand out of rounding in double precision; others' are in proportion."""


class Lanes(Protocol):
    """The motion and its neighbours, side by side."""

    def advance(
        self, states: np.ndarray, begin: np.ndarray, end: np.ndarray
    ) -> tuple[np.ndarray, int] | None:
        """States (states, lanes) at the ends of intervals of time (lanes,), and steps that the first lane
        took; None where one isn't finite or takes steps without end.
        """


class BatchLanes:
    """All lanes in one call, in code of their own.

    Args:
        steps: to be taken; decides how it is compiled.
    """

    def __init__(self, system: System, steps: float, tolerance: float = TOLERANCE) -> None:
        self._system, self._tolerance = system, tolerance
        initial = np.repeat(np.array([[float(x)] for x in system.initial]), NEIGHBOURS + 1, axis=1)
        self._integrator = hy.taylor_adaptive_batch(
            system.equations,
            initial,
            tol=tolerance,
            compact_mode=steps < _UNROLLED_FROM or system.wide,
        )

    def again(self, steps: float) -> BatchLanes:
        """For more steps."""
        return self if steps < _UNROLLED_FROM else BatchLanes(self._system, steps, self._tolerance)

    def advance(
        self, states: np.ndarray, begin: np.ndarray, end: np.ndarray
    ) -> tuple[np.ndarray, int] | None:
        """As of ``Lanes``."""
        integrator = self._integrator
        integrator.state[:] = states
        integrator.set_time([float(t) for t in begin])
        integrator.propagate_until([float(t) for t in end], max_steps=_HOPELESS_STEPS)
        results = integrator.propagate_res
        if any(result[0] != hy.taylor_outcome.time_limit for result in results):
            return None
        return np.array(integrator.state), int(results[0][3])


class OwnLanes:
    """One after the other, by an integrator that is there already: for short motions.

    Args:
        integrator: in double precision; a copy of its own.
    """

    def __init__(self, integrator: Integrator) -> None:
        self._integrator = integrator

    def advance(
        self, states: np.ndarray, begin: np.ndarray, end: np.ndarray
    ) -> tuple[np.ndarray, int] | None:
        """As of ``Lanes``."""
        integrator, result, steps = self._integrator, np.empty_like(states), 0
        for lane in reversed(range(states.shape[1])):
            integrator.time = float(begin[lane])
            integrator.state[:] = states[:, lane]
            outcome, _, _, steps, *_ = integrator.propagate_until(float(end[lane]), max_steps=_HOPELESS_STEPS)
            if outcome != hy.taylor_outcome.time_limit:
                return None
            result[:, lane] = integrator.state
        return result, int(steps)


class SwitchingLanes:
    """One after the other, by a stepper that ends its steps on switching surfaces.

    Args:
        start, end: internal units.
        steps: of the motion between these.
    """

    def __init__(self, system: System, start: float, end: float, steps: int) -> None:
        precision = replace(precision_of("double"), compact=True)
        self._stepper = stepper_of(system, precision, None, precision.scalar(start))
        self._begin = self._stepper.mark()
        self._reached = {start: self._begin}  # by the motion itself, which may slide
        self._pace = steps / (end - start)

    def advance(
        self, states: np.ndarray, begin: np.ndarray, end: np.ndarray
    ) -> tuple[np.ndarray, int] | None:
        """As of ``Lanes``."""
        stepper, result = self._stepper, np.empty_like(states)
        # all lanes are on the sides, and have the signs, that the motion has
        known = self._reached.get(float(begin[0]), self._begin)
        for lane in range(states.shape[1]):
            state = states[:, lane]
            if lane == 0 and (known.state == state).all():
                stepper.back_to(known)
            else:
                stepper.back_to(replace(known, time=(float(begin[lane]), 0.0), state=state.copy()))
                stepper.settle()
            if not stepper.to(float(end[lane])):
                return None
            result[:, lane] = stepper.state
            if lane == 0:
                mark = replace(stepper.mark(), time=(float(end[0]), 0.0))
                self._reached = {float(begin[0]): known, float(end[0]): mark}
        return result, max(round(float(end[0] - begin[0]) * self._pace), 1)


class SeriesErrors:
    """What a tolerance lets a step be wrong by, held against double precision at its epsilon."""

    def __init__(self, system: System, tolerance: float) -> None:
        self._tried = max(tolerance, _LEAST_TOLERANCE)
        self._share = tolerance / self._tried
        initial = [float(x) for x in system.initial]
        self._loose, self._exact = (
            hy.taylor_adaptive(system.equations, initial, compact_mode=True, **options)
            for options in ({"tol": self._tried}, {})
        )

    def rate(self, state: np.ndarray, time: float) -> np.ndarray:
        """Error (states,) for each unit of time, internal units."""
        for integrator in (self._loose, self._exact):
            integrator.time = time
            integrator.state[:] = state
        _, size = self._loose.step(2.0**10)
        self._exact.propagate_until(self._loose.time, max_steps=64)
        wrong = np.array(self._loose.state) - np.array(self._exact.state)
        wrong[np.abs(wrong) < 2.0**-50 * np.abs(state)] = 0.0  # rounding
        return self._share * wrong / size if size and np.isfinite(wrong).all() else np.zeros_like(wrong)
