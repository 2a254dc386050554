"""heyoka's integrator stepping freely: natural steps only, dense output, no step ever shortened."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.rotations import Symbolic
from rigidsim.model.system import System
from rigidsim.solve.compiled import TaylorEngine, compiled_engine, interruptible
from rigidsim.solve.events import EventLog, engine_events
from rigidsim.solve.impulses import Due, Impulses
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.requirements import Far, StepCallback, requirement_of
from rigidsim.solve.stepper import Mark, SamplesWithin, Stepper, bound_of_sparse_series, longest_step

_ARRIVED = hy.taylor_outcome.time_limit
_LOST = hy.taylor_outcome.err_nf_state
_FAR = 1e300  # a target that no run reaches: propagation ends by the count of steps
_MOST_TO_WHOLE_TIME = 1000  # steps
_CHUNK_TO, _MOST_CHUNKS_TO = 256, 4000  # steps to a given time at once, and how often so many
_HOPELESS_STEPS = 1e15  # left to the last sample; at the fastest pace they would take years
_LEAST_GRID = 8  # steps from which a grid, of 20 us, costs less than a callback
_TINY_STEPS = 32  # in a row, before a run is given up: a close passage has some
_LONGEST_FOLLOWED = 1.0  # a turn by 1 rad or less: in the partner chart angles are followed step by step


class TaylorStepper(Stepper):
    """A compiled integrator and its count of steps; the partner's equations are compiled when needed."""

    single_steps = False
    changes_charts = True

    def __init__(
        self,
        system: System,
        precision: Precision,
        tolerance: Scalar | None,
        start: Scalar,
        log: EventLog | None = None,
    ) -> None:
        if any(kick.time is None for kick in system.kicks):
            log = log or EventLog(system.crossings)  # which the motion depends on
        super().__init__(system, precision, log)
        self._impulses = Impulses(system, precision)
        self._due: Due | None = None  # what acts before the next step
        self._coming: Due | None = None  # what is next at a known time
        self._earlier: TaylorEngine | None = None  # of the step in which the motion changed
        self._tolerance, self._start = tolerance, start
        self._requirement = requirement_of(system)
        self.has_events = log is not None and bool(system.crossings)
        self._integrator, self._chart = self._compiled(system), 0
        self._engines = {(0, self._along): self._integrator}
        far = 1e37 if precision.scalar is np.float32 else _FAR
        self._far = precision.number(system.scene.context.mpf(far))
        bounds = (longest_step(self._integrator.order, precision.scalar), _LONGEST_FOLLOWED)
        self._bounds = [precision.number(system.scene.context.mpf(bound)) for bound in bounds]
        self._longest = self._bounds[0]
        self.bound_steps()
        self._tiny, self._whole = 0, False  # whether the latest step ended a piece of the equations by itself
        self._epsilon = float(precision.epsilon)
        self.begun = TaylorStepper.mark(self)

    def bound_steps(self) -> None:
        """Bound the steps where series at the start have gaps where the engine looks.

        The first step alone needs that, but all are bounded, which costs steps and no accuracy: calls take
        many steps with one bound, and members of a batch and resumed sessions must have the same.
        """
        if self.single_steps:  # which are seen to one by one
            return
        self._meet()
        engine, muted = self._integrator, self.log.muted
        time, state = engine.dtime, np.array(engine.state)
        self.log.muted = True
        engine.step(self._longest, write_tc=True)
        self.log.muted = muted
        bound = bound_of_sparse_series(engine.tc)
        engine.dtime = time
        engine.state[:] = state
        if bound < float(self._longest):
            self._bounds[self._chart] = self._longest = self.precision.of_double(bound)

    def settle(self) -> None:
        """Must be called after the state was set from outside, to one before what acts there."""
        self._due = self._impulses.at(self.time)
        self._take_sides()

    def _take_sides(self) -> None:
        """Continue on the sides of surfaces on which the state lies."""

    def _compiled(self, system: System) -> TaylorEngine:
        noted = engine_events(system, self.precision, self.log, start=self._start) if self.has_events else []
        return self._engine_of(system, system.equations, nt_events=noted)

    def _engine_of(
        self, system: System, equations: Sequence[tuple[Symbolic, Symbolic]], **more: Any
    ) -> TaylorEngine:
        """The engine of equations in a system's states, with events and other options."""
        options = dict(self.precision.options, time=self._start)
        options["compact_mode"] = self.precision.compact or system.wide
        if self._tolerance is not None:
            options["tol"] = self._tolerance
        return compiled_engine(equations, self.precision.array(system.initial), **options | more)

    def _system_of(self, chart: int) -> System:
        found = self.system if chart == 0 else self.system.partner
        assert found is not None
        return found

    @property
    def _along(self) -> tuple[int, ...]:
        """Surfaces along which the motion slides, with separate equations."""
        return ()

    def use(self, chart: int) -> None:
        self._chart = chart
        self._enter()
        self._longest = self._bounds[chart]

    def _enter(self) -> None:
        """Continue with the equations of this chart along the current surfaces."""
        key = self._chart, self._along
        if key not in self._engines:
            system = self._system_of(self._chart)
            self._engines[key] = interruptible(lambda: self._compiled(system))
        entered = self._engines[key]
        if entered is not self._integrator:
            entered.dtime = self._integrator.dtime
            entered.state[:] = self._integrator.state
            self._integrator = entered

    def enter(self, chart: int, state: np.ndarray) -> None:
        self.use(chart)
        self._integrator.state[:] = state

    def _meet(self) -> Scalar | None:
        """Set what the equations need here; returns the time beyond which no step may go, None for any."""
        self._kick()
        return _earlier(self._requirement.meet(self._integrator), self._until)

    @property
    def _until(self) -> Scalar | None:
        """The time beyond which no step may go that begins here, whatever the equations need."""
        coming = self._impulses.after(self.time)
        return _earlier(self.until, None if coming is None else coming.time)

    def _hold(self, samples: SamplesWithin | None = None) -> None:
        """Stop where an impulse acts within the latest step, or at its end."""
        engine, due, coming = self._integrator, self.log.due, self._coming
        if due is not None:
            if samples is not None:
                samples.back_to(len(samples.until(due.time)))
            self._earlier, self.log.due = copy.deepcopy(engine), None
            engine.dtime = (due.time, due.time * 0)
            engine.state[:] = due.state
            self._due = Due(due.time, [due.index])
            self.log.kicked.append(due.time)
        elif coming is not None and abs(coming.time - engine.time) <= 4 * self._epsilon * abs(coming.time):
            engine.dtime = (coming.time, coming.time * 0)
            self._due = coming
            for event in coming.events if self.has_events else ():
                self.log.note(event, coming.time, engine.state)

    def _kick(self) -> None:
        """Let what is due act, and look for what comes."""
        if self._due is not None:
            system = self._system_of(self._chart)
            self._integrator.state[:] = self._impulses.changed(system, self._due, self._integrator.state)
            self._due = None
            self._take_sides()
        self._earlier, self._coming = None, self._impulses.after(self.time)

    @property
    def end(self) -> Scalar | None:
        """The time beyond which no step that begins now may go; None for any."""
        return _earlier(self._requirement.end_after(self.time), self._until)

    def _watched(
        self, *samples: Callable[[TaylorEngine], bool]
    ) -> list[Callable[[TaylorEngine], bool]] | None:
        """What to call after each of the steps that begin now."""
        watching: list[StepCallback] = []
        if self.watcher is not None:
            self.watcher.begin(self._integrator.time)
            watching.append(self.watcher)
        if any(crossing.kicks for crossing in self.log.crossings):
            watching.append(lambda _: self.log.due is None)
        return [*self._requirement.each, *watching, *samples] or None

    @property
    def integrator(self) -> TaylorEngine:
        """The heyoka object in use, for provenance."""
        return self._integrator

    @property
    def chart(self) -> int:
        return self._chart

    @property
    def time(self) -> Scalar:
        return self._integrator.time

    @property
    def state(self) -> np.ndarray:
        return self._integrator.state

    def mark(self) -> Mark:
        self._kick()
        engine, found = self._integrator, len(self.log.found)
        return Mark(engine.dtime, np.array(engine.state), found, self.steps, self._tiny)

    def back_to(self, mark: Mark) -> None:
        self._integrator.dtime = mark.time
        self._integrator.state[:] = mark.state
        self.log.back_to(mark.events)
        self.steps, self._tiny, self.unresolved = mark.steps, mark.memory, False
        self._due = self._earlier = None

    def pack(self, memory: int) -> dict[str, np.ndarray]:
        """See ``Stepper``: the number of latest steps in a row that were tiny."""
        return {"rhythm_tiny": np.array([memory], dtype=np.int64)}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> int:
        return int(arrays.get("rhythm_tiny", np.zeros(1))[0])

    def to_whole_time(self) -> bool:
        """Go to the high part of time; stays and returns False if that takes too many natural steps."""
        engine = self._integrator
        time, state = engine.dtime, np.array(engine.state)
        if time[1] == 0:
            return True
        self._meet()
        # one step is nearly always enough, and costs less than a call that may take several
        for arrived in (
            lambda: engine.step(-time[1])[0] == _ARRIVED and engine.dtime == (time[0], 0),
            lambda: engine.propagate_until(time[0], max_steps=_MOST_TO_WHOLE_TIME)[0] == _ARRIVED,
        ):
            if arrived():
                return True
            engine.dtime = time
            engine.state[:] = state
        return False

    def step(self) -> bool:
        """Take one step with dense output; False if the state is no longer finite."""
        going = self._propagate(self._meet(), 1, dense=True)
        self._hold()
        return going

    def dense(self, time: Scalar) -> np.ndarray:
        return np.array((self._earlier or self._integrator).update_d_output(time))  # heyoka reuses its buffer

    def take(self, count: int, samples: SamplesWithin | None = None) -> bool:
        """See ``Stepper``."""
        last, smallest, largest = self.steps + count, math.inf, 0.0
        while True:
            end = self._meet()
            if not self._within_piece(last - self.steps, end, samples):
                return False
            self._hold(samples)
            smallest, largest = min(smallest, self.smallest), max(largest, self.largest)
            if (
                ((end is None or self.time != end) and self._due is None)
                or self.time == self.until
                or self.steps >= last
            ):
                break
            wanted = samples is not None and not samples.ended and self.watcher is None
            if not wanted or self.unresolved or self.collapsed or self.log.stop is not None:
                break
        self.smallest, self.largest = smallest, largest
        return True

    def _within_piece(self, count: int, end: Scalar | None, samples: SamplesWithin | None) -> bool:
        """Take steps, none beyond a time: by the engine's own grid, which has the same bits and costs half,
        where that takes no other steps, as it would from a time that is two numbers, and no sample was found
        in the piece before.
        """
        engine, before = self._integrator, self._integrator.dtime
        far = self._requirement.far(before, end, self._until) if end is not None and self._whole else None
        if far is not None:
            return self._propagate(far[0], count, samples, far=far)
        plain = end is None and not self._requirement.each and before[1] == 0
        if samples is None or len(samples.states) or not plain or count < _LEAST_GRID:
            return self._propagate(end, count, samples)
        times = samples.times
        first = int(times[0] == before[0])
        outcome, smallest, largest, taken, _, states = engine.propagate_grid(
            np.concatenate([[before[0]], times[first:], [self._far]]).astype(times.dtype),
            max_steps=count,
            max_delta_t=self._longest,
            callback=self._watched(samples.within),
        )
        samples.states = states[1 - first :]
        return self._account(before, outcome, smallest, largest, taken)

    def to(self, time: Scalar) -> bool:
        """Go exactly to a time with a shortened last step: for comparisons, never for a run's samples."""
        chunks, known, watcher = _MOST_CHUNKS_TO, self.until, self.watcher
        self.until, self.watcher = time if known is None else min(time, known), None
        try:
            while chunks > 0:  # Ctrl-C is heeded between chunks
                if time - self.time <= abs(time) * self._epsilon:
                    return True
                before = self.steps
                if not self.take(_CHUNK_TO) or self.steps == before:
                    break
                chunks -= self.steps - before == _CHUNK_TO
        finally:
            self.until, self.watcher = known, watcher
        return False

    def _propagate(
        self,
        until: Scalar | None,
        count: int,
        samples: SamplesWithin | None = None,
        *,
        dense: bool = False,
        far: Far | None = None,
    ) -> bool:
        """Take at most ``count`` steps, none beyond a time, or as a requirement says: whether all is well."""
        before, longest = self._integrator.dtime, self._longest
        called: list[StepCallback] = [] if samples is None else [samples]
        if far is not None:
            longest, called = min(far[1], longest), [*called, far[2]]
        outcome, smallest, largest, taken, *_ = self._integrator.propagate_until(
            self._far if until is None else until,
            max_steps=count,
            max_delta_t=longest,
            callback=self._watched(*called),
            write_tc=dense or samples is not None or self.watcher is not None,
        )
        self._whole = until == self._integrator.time and (taken == 1 or far is not None)
        return self._account(before, outcome, smallest, largest, taken, longest)

    def _account(
        self,
        before: tuple[Scalar, Scalar],
        outcome: hy.taylor_outcome,
        smallest: Scalar,
        largest: Scalar,
        taken: int,
        longest: Scalar | None = None,
    ) -> bool:
        self.smallest, self.largest = abs(float(smallest)), abs(float(largest))
        if taken and self.largest == 0.0 and self._integrator.dtime != before:
            # heyoka omits steps of the greatest allowed size, and one that ends where it must
            gone = abs(float(self._integrator.time - before[0])) if taken == 1 else 0.0
            self.smallest = self.largest = gone or float(longest or self._longest)
        self.steps += int(taken)
        self._judge(before[0], int(taken))
        return bool(outcome != _LOST)

    @property
    def collapsed(self) -> bool:
        """Whether the latest steps were all so small that time, as a single number, doesn't resolve them, and
        more remain to the last sample than can ever be taken.
        """
        return self._tiny >= _TINY_STEPS

    def _judge(self, before: Scalar, taken: int) -> None:
        """Count tiny steps, if they were taken one by one."""
        if self.destination is None or not taken:
            return
        begin, end = float(before), float(self._integrator.time)
        size = self.largest if taken == 1 else self.smallest  # a step that ends on a surface may be any size
        resolved = self._epsilon * (abs(end) if taken == 1 else max(abs(begin), abs(end)))
        if not (size < resolved and size * _HOPELESS_STEPS < self.destination - begin):
            self._tiny = 0
        elif taken == 1:
            self._tiny += 1
        else:
            self.unresolved = True


def _earlier(*times: Scalar | None) -> Scalar | None:
    """The earlier of the times that there are."""
    return min((time for time in times if time is not None), default=None)
