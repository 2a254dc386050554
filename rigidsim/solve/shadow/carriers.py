"""What carries a motion and the perturbed ones beside it."""

import copy
from bisect import bisect_left
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.heyoka_expressions import TANGENT
from rigidsim.model.observables.mechanical import WORK
from rigidsim.model.system import System
from rigidsim.solve.compiled import TaylorEngine
from rigidsim.solve.precision import precision_of
from rigidsim.solve.shadow.ensemble import HOPELESS_STEPS, PERTURBED, EnsembleCarrier
from rigidsim.solve.shadow.series_errors import ONE_ORDER
from rigidsim.solve.shadow.through_pieces import onward
from rigidsim.solve.switching.stepper import stepper_of
from rigidsim.solve.taylor_stepper import TaylorStepper

_DOUBLE_ORDER = 20
"""Order of the series in double precision at its epsilon; the work of a step grows as its square."""
LOOSE, TOLERANCE, TIGHT = 1e-6, 1e-8, 1e-14
"""Tolerances. The loose one, with half the code, serves while the motion stays near the run's own: over
18,000 steps of a driven body it strays by 3e-4, over 30,000 of a fall by 8e-6. The tight one serves if errors
grow so much that a loosely followed motion soon becomes a different one.
"""
_TIGHT_UNTIL = 50_000
_OWN_UNTIL, OWN_FIRST = 5_000, 500
"""Steps up to which the run's own integrator costs less than code compiled for all; and those that it takes
of longer motions first, so that no code is compiled for a motion that is soon lost.
"""
_OWN_UNTIL_OF_PIECES = 300
"""The first of these through pieces of the equations, at whose edges an own integrator stops with each motion
by itself: that alone takes 0.2 ms a step of a Moon with an edge after every second step.
"""
_UNROLLED_FROM, _LOOSELY_UNROLLED_FROM, _OPTIMISED_FROM = 3_000, 1_500, 300_000
"""Steps to be taken from which code pays that takes longer to compile and less time to run. Of 66 and 126
terms of the equations' decomposition, four lanes, tolerance 1e-8: compact 42 and 48 ms, 10 and 22 us a step;
unrolled 60 and 132 ms, 2.2 and 5.4 us; unrolled and optimised 315 and 860 ms, 1.3 and 3.2 us. An own
integrator takes 18 and 48 us for four lanes. At 1e-6 half of that.
"""
_UNEVEN, _FEW_STEPS, _FEW_OF_ALL = 2.5, 8, 2048
"""Ratio of longest to shortest step of those that count as alike; and numbers of steps that don't matter."""
Advanced = tuple[np.ndarray, np.ndarray, np.ndarray]


@contextmanager
def borrowed(stepper: TaylorStepper | None) -> Iterator[None]:
    """Use a run's stepper, or copies of its engine, inside the block without leaving a trace."""
    if stepper is None:
        yield
        return
    log = stepper.log
    mark, found, muted = stepper.mark(), list(log.found), log.muted
    log.muted = True
    try:
        yield
    finally:
        log.muted, log.found[:] = muted, found
        stepper.back_to(mark)


def own_until(system: System, integrator: TaylorEngine) -> float:
    """Steps of a run up to which its own integrator costs less than code that is compiled for all motions."""
    if system.pieces is not None:
        return _OWN_UNTIL_OF_PIECES
    return _OWN_UNTIL * max(1.0, (_DOUBLE_ORDER / int(integrator.order)) ** 2)


class _SingleMotion:
    """Carrier of one motion. A stretch ends when steps have become longer or shorter, as in a close passage:
    errors made there count for more, and in other states.
    """

    tolerance: float

    def __init__(self, steps: float = 0.0) -> None:
        self._most_even, self._few = HOPELESS_STEPS, max(_FEW_STEPS, round(steps / _FEW_OF_ALL))

    def advance(
        self, which: np.ndarray, states: np.ndarray, begin: np.ndarray, end: np.ndarray, steps: np.ndarray
    ) -> Advanced:
        """See ``EnsembleCarrier``."""
        found = self._onward(states[:, 0], begin[0], end[0], int(steps[0]))
        if found is None:
            return np.full_like(states, np.nan), np.ones(1), end[:, 0]
        moved, taken, reached = found
        return moved[:, None], np.array([max(taken, 1)]), np.array([reached])

    def _onward(
        self, states: np.ndarray, begin: np.ndarray, end: np.ndarray, most: int
    ) -> tuple[np.ndarray, int, float] | None:
        """The same of states (states, 1 + perturbed); None if they can't be followed."""
        raise NotImplementedError

    def _evenly(self, go: Callable[[int], tuple[Any, ...]], most: int) -> int:
        """Take steps while they are alike; returns how many."""
        tried = min(self._most_even, most)
        while True:
            _, shortest, longest, steps, *_ = go(tried)
            if longest <= _UNEVEN * shortest or steps <= self._few:
                self._most_even = 2 * max(tried, self._few)
                return int(steps)
            tried = steps // 2


class BatchCarrier(_SingleMotion):
    """All in one call, in compiled code of their own.

    States that nothing depends on, not even a step, stay constant: they would only cost compile time.
    """

    def __init__(self, system: System, steps: float, tolerance: float = TOLERANCE) -> None:
        super().__init__(steps)
        self._system, self.tolerance = system, tolerance
        self._level = self._level_for(steps, tolerance)
        self._carried = [i for i, n in enumerate(system.states) if not (n == WORK or n.startswith(TANGENT))]
        equations = [system.equations[i] for i in self._carried]
        initial = np.array([[float(system.initial[i])] for i in self._carried])
        options: dict[str, Any] = {"compact_mode": True, "opt_level": 0}
        if self._level:
            options = {"compact_mode": system.wide, "opt_level": 1 if system.wide else self._level - 1}
        every = np.repeat(initial, 1 + PERTURBED, axis=1)
        self._integrator = hy.taylor_adaptive_batch(equations, every, tol=tolerance, **options)
        self._go_on = onward(system, [system.states[i] for i in self._carried])

    @staticmethod
    def _level_for(steps: float, tolerance: float) -> int:
        """0 for compact code, 1 for unrolled, 2 for optimised."""
        unrolled = _LOOSELY_UNROLLED_FROM if tolerance >= LOOSE else _UNROLLED_FROM
        return int(steps >= unrolled) + int(steps >= _OPTIMISED_FROM)

    def again(self, steps: float) -> EnsembleCarrier:
        """See ``EnsembleCarrier``."""
        if self._level_for(steps, self.tolerance) <= self._level:
            return self
        return BatchCarrier(self._system, steps, self.tolerance)

    def _onward(
        self, states: np.ndarray, begin: np.ndarray, end: np.ndarray, most: int
    ) -> tuple[np.ndarray, int, float] | None:
        integrator, carried = self._integrator, self._carried

        def go(most: int) -> tuple[Any, ...]:
            integrator.state[:] = states[carried]
            integrator.set_time(begin.tolist())
            return self._go_on(integrator, float(begin[0]), float(end[0]), end, most)

        steps = self._evenly(go, most)
        reached = float(integrator.time[0])
        arrived = hy.taylor_outcome.time_limit
        if any(result[0] != arrived for result in integrator.propagate_res):
            # the others took steps of almost the same lengths
            self._go_on(integrator, reached, reached, end - end[0] + reached, HOPELESS_STEPS)
            if any(result[0] != arrived for result in integrator.propagate_res):
                return None
        moved = states.copy()
        moved[carried] = integrator.state
        return moved, steps, reached


class OwnCarrier(_SingleMotion):
    """One after the other, by a copy of a run's integrator in double precision: nothing has to be compiled,
    and up to ``until`` steps it costs less. ``then`` is the tolerance for many more steps, None if states
    bear no loose one.
    """

    def __init__(self, system: System, integrator: TaylorEngine, then: float | None = TOLERANCE) -> None:
        super().__init__()
        self._system, self._then = system, then
        self._integrator = copy.deepcopy(integrator)
        self._go_on = onward(system, system.states)
        self.until = own_until(system, integrator)
        self.tolerance = float(integrator.tol)

    def again(self, steps: float) -> EnsembleCarrier:
        """See ``EnsembleCarrier``."""
        if steps < self.until - OWN_FIRST:
            return self
        if self._then is not None:
            return BatchCarrier(self._system, steps, self._then)
        return BatchCarrier(self._system, steps, TIGHT if steps < _TIGHT_UNTIL else TOLERANCE)

    def _onward(
        self, states: np.ndarray, begin: np.ndarray, end: np.ndarray, most: int
    ) -> tuple[np.ndarray, int, float] | None:
        integrator, moved = self._integrator, np.empty_like(states)

        def go(lane: int, last: float, until: float, most: int) -> tuple[Any, ...]:
            integrator.time = float(begin[lane])
            integrator.state[:] = states[:, lane]
            return self._go_on(integrator, float(begin[0]), last, until, most)

        steps = self._evenly(lambda most: go(0, float(end[0]), float(end[0]), most), most)
        moved[:, 0] = integrator.state
        reached = float(integrator.time)
        for lane in range(1, states.shape[1]):
            outcome, *_ = go(lane, reached, float(end[lane] - (end[0] - reached)), HOPELESS_STEPS)
            if outcome != hy.taylor_outcome.time_limit:
                return None
            moved[:, lane] = integrator.state
        return moved, steps, reached


class StepperCarrier(_SingleMotion):
    """One after the other, by a stepper that ends its steps on switching surfaces or at given times: the
    system's own in double precision, borrowed, or one compiled for so many steps, with a tolerance.
    """

    def __init__(
        self, system: System, start: float, end: float, steps: int, own: TaylorStepper | float | None = None
    ) -> None:
        super().__init__()
        stepper = own
        if not isinstance(stepper, TaylorStepper):
            precision = replace(precision_of("double"), compact=True)
            stepper = stepper_of(system, precision, stepper, precision.scalar(start))
        self._stepper = stepper
        self.tolerance = float(stepper.integrator.tol)
        self._begin = stepper.begun
        self._reached = {start: self._begin}  # by the motion itself, which may slide
        self._pace = steps / (end - start)

    def again(self, steps: float) -> EnsembleCarrier:
        """See ``EnsembleCarrier``."""
        return self

    def _onward(
        self, states: np.ndarray, begin: np.ndarray, end: np.ndarray, most: int
    ) -> tuple[np.ndarray, int, float] | None:
        stepper, moved = self._stepper, np.empty_like(states)
        first, reached = float(begin[0]), min(float(end[0]), float(begin[0]) + most / self._pace)
        # all are on the sides, and have the signs, that the motion has; and none is past an edge of the
        # equations' pieces that it isn't, where it would go on with what holds before
        known = self._reached.get(first, self._begin)
        pieces = stepper.system.pieces
        edges = [] if pieces is None else pieces.knots[bisect_left(pieces.knots, first) :][:1]
        for lane in range(states.shape[1]):
            state = states[:, lane]
            if lane == 0 and (known.state == state).all():
                stepper.back_to(known)
            else:
                start = min([float(begin[lane]), *map(float, edges)])
                stepper.back_to(replace(known, time=(start, 0.0), state=state.copy()))
                stepper.settle()
            if not stepper.to(float(end[lane] - (end[0] - reached))):
                return None
            moved[:, lane] = stepper.state
            if lane == 0:
                self._reached = {first: known, reached: replace(stepper.mark(), time=(reached, 0.0))}
        return moved, round((reached - first) * self._pace), reached

    def of_step(self, state: np.ndarray, time: float, stretch: float) -> np.ndarray:
        """What the next step cuts off, (states,): all terms past the last, which gain as much as that."""
        stepper, known = self._stepper, self._reached.get(time)
        if known is not None:
            stepper.back_to(known)
        engine = stepper.integrator
        if known is None or not stepper.step():
            return np.zeros_like(state)
        series, size = np.asarray(engine.tc, dtype=float), float(stepper.largest)
        order = series.shape[1] - 1
        before, last = (np.abs(series[:, n]).max() * size**n for n in (order - 1, order))
        gain = min(last / before, 1 / ONE_ORDER) if before > 0 else 1 / ONE_ORDER
        return np.asarray(gain / (1 - gain) * size**order * series[:, order])
