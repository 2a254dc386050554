"""Members of a family from their start to their last sample, with everything that is recorded of them."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.tangents import GROWTH
from rigidsim.solve.batch.family import Family, Numbers
from rigidsim.solve.batch.motion import BatchMotion
from rigidsim.solve.batch.tracing import TracedSystem
from rigidsim.solve.compiled import compiled_function, evaluate_rows
from rigidsim.solve.lanes import LaneResults, recommended_width
from rigidsim.solve.precision import precision_of
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.status import Status

Values = dict[str, np.ndarray]

_VALUES_AT_ONCE = 2_000_000
"""Sample values evaluated together; more would take memory that has to be fetched anew for each operation."""
_MOST_STEPS = 10_000
_STEPS_PER_UNIT = 200.0
"""A natural step is of the order of one internal unit of time. A lane that takes so many more is given up
here, before it holds the others any longer, and run by itself.
"""


@dataclass(frozen=True)
class BatchEvents:
    """Crossings of one event in a block, in the order of members and time (n,)."""

    name: str
    member: np.ndarray  # places in the block
    time: np.ndarray  # seconds
    values: Values  # recorded variables, (n, components), SI


@dataclass(frozen=True)
class BatchBlock:
    """Results of some members of a family; m members and their samples."""

    members: np.ndarray  # indices in the sweep
    places: np.ndarray  # in the numbers from which they were run
    times: np.ndarray  # (samples,), seconds
    start: np.ndarray  # (m,), each member's internal unit of time
    moments: np.ndarray  # (samples, m), likewise
    states: np.ndarray  # of the motion, (samples, states, m), internal units
    values: Values  # recorded variables, (samples, m, components), SI; NaN from where a member ended
    drifts: Values  # relative drifts by the names of the invariants, (samples, m)
    status: np.ndarray  # (m,) objects; None where a lane gave up and the member is to be run by itself
    reached: np.ndarray  # number of samples, (m,)
    steps: np.ndarray
    drift_bound: np.ndarray  # relative drift that rounding alone explains, (m,)
    events: list[BatchEvents]
    width: int  # lanes of the integrator, on which the last bits depend

    def largest_drifts(self) -> np.ndarray:
        """Magnitude of each sample's worst drift, (samples, m); infinite where one has no finite value, and 0
        where no sample was taken.
        """
        worst = np.zeros(self.moments.shape)
        for drift in self.drifts.values():
            worst = np.maximum(worst, np.where(np.isfinite(drift), np.abs(drift), np.inf))
        return np.where(np.arange(len(worst))[:, None] < self.reached, worst, 0.0)


class BatchRun:
    """Runs a family's members with what is compiled once; by default with the processor's own width."""

    def __init__(self, family: Family, width: int | None = None) -> None:
        self.width = width or recommended_width()
        self._traced = family.traced
        self._system = family.traced.system
        self._precision = precision_of("double")
        self._clocks: dict[int, SampleClock] = {}
        self._motion = BatchMotion(family.traced, self.width)
        self._outputs = BatchOutputs(family.traced)

    def compile(self) -> None:
        """Compile integrators and functions now rather than when the first members need them."""
        self._motion.compile()
        self._outputs.compile()

    def blocks(self, numbers: Numbers) -> Iterator[BatchBlock]:
        """Run members of this family, as many at a time as fit into memory."""
        samples = self._traced.prepared.clock.count
        each = samples * (len(self._system.states) + len(self._system.outputs))
        most = max(_VALUES_AT_ONCE // each // self.width, 1) * self.width
        # members with about as many steps run side by side, so that none waits for long
        order = np.argsort(numbers.doubles(self._system.rate_bound), kind="stable")
        for first in range(0, len(order), most):
            yield self._block(numbers, order[first : first + most])

    # --- one block ------------------------------------------------------------------------------------------

    def _block(self, numbers: Numbers, part: np.ndarray) -> BatchBlock:
        members, initial = numbers.members[part], numbers.initial[:, part]
        swept = numbers.parameters[:, part]
        units = numbers.whole_numbers(self._system.scaling.time)[part]
        start, times = self._times(units)
        moving = initial[: self._traced.moving]
        most = self._most_steps(start, times)
        lanes, along = self._motion.run(initial, swept, start, times, most)
        begun = self._outputs.begun(moving, swept, start)
        values_of = self._outputs.at(lanes.states, swept, times, begun, along)
        values, drifts = self._outputs.named(values_of, numbers, part)
        block = BatchBlock(
            members,
            part,
            self._traced.prepared.clock.labels(0, len(times)),
            start,
            times,
            lanes.states,
            values,
            drifts,
            self._status(lanes, most),
            _reached(lanes),
            lanes.steps,
            self._traced.prepared.drift_bound(lanes.steps),
            self._events(lanes, swept, numbers, part, units, begun),
            self.width,
        )
        self._ended_by_events(block)
        self._ended_by_drift(block)
        return block

    def _times(self, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Start (m,) and samples (samples, m) in each member's internal unit of time."""
        start, columns = np.empty(len(units)), np.empty((self._traced.prepared.clock.count, len(units)))
        for unit in np.unique(units).tolist():
            if unit not in self._clocks:
                scaling = replace(self._system.scaling, time=unit)
                self._clocks[unit] = SampleClock(self._system.scene.samples, self._precision, scaling)
            clock, same = self._clocks[unit], units == unit
            start[same] = clock.start
            columns[:, same] = clock.internal(0, clock.count)[:, None]
        return start, columns

    def _most_steps(self, start: np.ndarray, times: np.ndarray) -> int:
        asked = self._traced.prepared.scene.config.limits.max_steps
        longest = float((times[-1] - start).max())
        given_up = _MOST_STEPS + int(min(_STEPS_PER_UNIT * longest, 1e12))
        return given_up if asked is None else min(int(asked), given_up)

    def _status(self, lanes: LaneResults, most: int) -> np.ndarray:
        asked = self._traced.prepared.scene.config.limits.max_steps
        short = Status.MAX_STEPS if asked is not None and most == int(asked) else None
        found = np.full(len(lanes.arrived), Status.FINISHED, dtype=object)
        found[~lanes.arrived] = short
        found[~lanes.arrived & ~lanes.finite] = Status.NON_FINITE
        return found

    # --- events and guards ----------------------------------------------------------------------------------

    def _events(
        self,
        lanes: LaneResults,
        swept: np.ndarray,
        numbers: Numbers,
        part: np.ndarray,
        units: np.ndarray,
        begun: np.ndarray,
    ) -> list[BatchEvents]:
        events = []
        for index, crossing in enumerate(self._system.crossings):
            rows = [(m, f) for m, found in lanes.found.items() for f in found if f.event == index]
            rows.sort(key=lambda row: (row[0], row[1].time))
            place = np.array([m for m, _ in rows], dtype=np.int64)
            times = np.array([f.time for _, f in rows])
            values = {v.name: np.zeros((0, v.count)) for v in self._system.recorded}
            if rows:
                states = np.array([f.state for _, f in rows]).T[None]
                at = self._outputs.at(states, swept[:, place], times[None], begun[:, place])
                values = self._outputs.named_at_events(at, numbers, part[place])
            seconds = self._system.scaling.direction * np.ldexp(times, units[place]) if rows else times
            events.append(BatchEvents(crossing.name, place, seconds, values))
        return events

    def _ended_by_events(self, block: BatchBlock) -> None:
        """End motions at the first crossing that stops them; later samples and crossings are dropped."""
        stops = [e for e, c in zip(block.events, self._system.crossings, strict=True) if c.stop]
        first, way = np.full(len(block.members), math.inf), self._system.scaling.direction
        for event in stops:
            np.minimum.at(first, event.member, way * event.time)
        for m in np.flatnonzero(np.isfinite(first)).tolist():
            samples = int(np.searchsorted(way * block.times, first[m], side="right"))
            if samples <= block.reached[m]:
                block.status[m] = Status.EVENT
                _end(block, m, samples)
        for n, event in enumerate(block.events):
            kept = way * event.time <= first[event.member]
            if not kept.all():
                values = {name: v[kept] for name, v in event.values.items()}
                block.events[n] = BatchEvents(event.name, event.member[kept], event.time[kept], values)

    def _ended_by_drift(self, block: BatchBlock) -> None:
        """Apply the guard max_drift: the first sample beyond it is the last."""
        limit = self._traced.prepared.scene.config.limits.max_drift
        if limit is None or not block.drifts:
            return
        beyond = block.largest_drifts() > float(limit)
        for m in np.flatnonzero(beyond.any(axis=0)).tolist():
            block.status[m] = Status.MAX_DRIFT
            _end(block, m, int(np.argmax(beyond[:, m])) + 1)


def _reached(lanes: LaneResults) -> np.ndarray:
    """Number of samples that each member reached, (members,)."""
    found = np.full(len(lanes.arrived), len(lanes.states))
    short = np.flatnonzero(~lanes.arrived)
    finite = np.isfinite(lanes.states[:, :, short]).all(axis=1)
    found[short] = np.where(finite.all(axis=0), len(finite), np.argmin(finite, axis=0))
    return found


def _end(block: BatchBlock, member: int, samples: int) -> None:
    block.reached[member] = samples
    for values in (*block.values.values(), *block.drifts.values()):
        values[samples:, member] = np.nan


# --- what is recorded ---------------------------------------------------------------------------------------


class BatchOutputs:
    """Recorded variables and drifts of a traced system.

    The growth of tangent vectors has a separate function, of states that the motion alone lacks; together
    with it the code of the others would be compiled differently.
    """

    def __init__(self, traced: TracedSystem) -> None:
        self._traced = traced
        self._system = traced.system
        self._growth = {r.first for r in self._system.recorded if r.name == GROWTH}

    def _compiled(self, expressions: list[Any], states: int) -> tuple[Any, list[int]]:
        """A compiled function of states, and the indices of the states and parameters that it takes."""
        variables = [*self._system.variables[:states], *self._traced.parameters.variables]
        names = set(hy.get_variables([hy.expression(x) for x in expressions]))
        read = [n for n, variable in enumerate(variables) if str(variable) in names] or [0]
        taken = [variables[n] for n in read]
        wide = self._system.wide
        return compiled_function(expressions, taken, compact_mode=wide, fp_type=float), read

    @cached_property
    def _parts(self) -> tuple[list[int], list[Any], list[Any]]:
        """Rows and expressions of the outputs of the motion alone, and the growth's expressions."""
        outputs = list(enumerate(self._system.outputs))
        of_motion = [(row, x) for row, x in outputs if row not in self._growth]
        growth = [x for row, x in outputs if row in self._growth]
        return [row for row, _ in of_motion], [x for _, x in of_motion], growth

    @cached_property
    def _components(self) -> list[Any]:
        return [x for invariant in self._system.invariants for x in invariant.expressions]

    def compile(self) -> None:
        """Compile the functions that ``begun`` and ``at`` call."""
        _, of_motion, growth = self._parts
        for expressions in filter(None, (self._components, of_motion)):
            self._compiled(expressions, self._traced.moving)
        if growth:
            self._compiled(growth, len(self._system.states))

    def begun(self, initial: np.ndarray, swept: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Invariants' components at the start (components, m), for the motion's states (states, m)."""
        return self._evaluated(self._components, initial[None], swept, start[None])[:, 0]

    def at(
        self,
        states: np.ndarray,
        swept: np.ndarray,
        times: np.ndarray,
        begun: np.ndarray,
        along: np.ndarray | None = None,
    ) -> list[np.ndarray]:
        """All outputs, each (samples, m), of states (samples, states, m) and times (samples, m), internal
        units; ``along`` has tangent vectors, without which their growth is unknown.
        """
        rows, of_motion, growth = self._parts
        found = self._evaluated(of_motion, states, swept, times, begun)
        table = dict(zip(rows, found, strict=True))
        if growth:
            lost = np.full(times.shape, np.nan)
            grown = [lost] if along is None else self._evaluated(growth, along, swept, times)
            table |= dict(zip(sorted(self._growth), grown, strict=True))
        return [table[row] for row in range(len(table))]

    def named(self, found: Sequence[np.ndarray], numbers: Numbers, part: np.ndarray) -> tuple[Values, Values]:
        """Outputs, each (samples, m), as recorded variables (samples, m, components), SI, and drifts."""
        values = self._in_si(found, numbers, part)
        first = len(self._system.outputs) - len(self._system.invariants)
        drifts = {
            f"{invariant.name}_drift": found[first + n] for n, invariant in enumerate(self._system.invariants)
        }
        self._join(values, numbers, part)
        return values, drifts

    def named_at_events(self, found: Sequence[np.ndarray], numbers: Numbers, members: np.ndarray) -> Values:
        """Outputs at members' crossings, (1, n) each, as recorded variables (n, components), SI."""
        return {name: values[0] for name, values in self._in_si(found, numbers, members).items()}

    def _in_si(self, found: Sequence[np.ndarray], numbers: Numbers, members: np.ndarray) -> Values:
        values: Values = {}
        for variable in self._system.recorded:
            columns = [
                np.ldexp(found[variable.first + k], numbers.whole_numbers(exponent)[members])
                for k, exponent in enumerate(variable.exponents)
            ]
            values[variable.name] = np.stack(columns, axis=2)
        return values

    def _join(self, values: Values, numbers: Numbers, part: np.ndarray) -> None:
        """Give each quaternion the sign nearest to the one before, as in a single run."""
        for variable in self._system.recorded:
            if variable.continuity != "nearest":
                continue
            block = values[variable.name]
            begin = [numbers.doubles(x)[part] for x in self._traced.system.scene.quaternion]
            before = np.concatenate([np.stack(begin, axis=1)[None], block[:-1]])
            products = np.einsum("smc,smc->sm", block, before)
            signs = np.cumprod(np.where(products < 0, -1.0, 1.0), axis=0)
            block *= signs[:, :, None]

    def _evaluated(
        self,
        expressions: list[Any],
        states: np.ndarray,
        swept: np.ndarray,
        times: np.ndarray,
        begun: np.ndarray | None = None,
    ) -> np.ndarray:
        """Values (expressions, samples, m) for states (samples, states, m) and times (samples, m)."""
        samples, count, m = states.shape
        if not expressions:
            return np.empty((0, samples, m))
        function, read = self._compiled(expressions, count)
        # parameters of members are inputs like their states
        every = (samples, m)
        rows = [states[:, n] if n < count else np.broadcast_to(swept[n - count], every) for n in read]
        inputs = np.stack(rows).reshape(len(rows), -1)
        constants = None
        if function.nparams and begun is not None:
            constants = np.repeat(begun[:, None], samples, axis=1).reshape(len(begun), -1)
        found = evaluate_rows(function, inputs.T, constants, times.ravel())
        return found.reshape(len(expressions), samples, m)
