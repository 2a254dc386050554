"""Event crossings along the motion: their times and states in the run's own precision.

heyoka finds them on the dense output of each step. Their expressions affect its choice of steps, so
that a run with events differs from one without by rounding. A step that is taken back removes its crossings
too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import heyoka as hy
import numpy as np

from rigidsim.errors import StoppedError
from rigidsim.model.system import Crossing, System
from rigidsim.solve.checkpoint import Arrays, pack, unpack
from rigidsim.solve.compiled import TaylorEngine, compiled_function
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.sample_block import AngleState, SampleBlock, pack_angles, unpack_angles
from rigidsim.solve.status import Status

MOST_EVENTS = 1_000_000
BESIDE = 60
"""Size of the offset that moves an expression off a zero at a step's beginning, in bits below a rounding of
one.
"""
_WIDTH = 2.0**8  # roundings of a time between two findings of the same crossing
_LATEST = 256  # events that a step may be taken anew from
DIRECTIONS = {
    0: hy.event_direction.any,
    1: hy.event_direction.positive,
    -1: hy.event_direction.negative,
}


@dataclass(frozen=True)
class FoundEvent:
    """One crossing of an event."""

    index: int
    time: Scalar  # and state (states,): internal units, in the run's precision
    state: np.ndarray
    angles: AngleState  # what the angle states stood for at the beginning of the step that contains it


@dataclass
class EventLog:
    """All crossings so far, in order of time."""

    crossings: Sequence[Crossing] = ()
    angles: Callable[[], AngleState] = AngleState
    found: list[FoundEvent] = field(default_factory=list)
    stop: Scalar | None = None  # time of the first crossing that ends the run, or None
    quiet_until: Scalar | None = None  # time up to which crossings are already known; None if there are none
    muted: bool = False  # whether a step is being repeated whose crossings are already known
    kicked: list[Scalar] = field(default_factory=list)  # times at which it did, in any part of the motion
    due: FoundEvent | None = None  # the first crossing that changes the motion, which has yet to do so

    def note(self, index: int, time: Scalar, state: np.ndarray) -> None:
        """Record a crossing found by the engine; raises a StoppedError if there are too many."""
        if self.due is not None and time > self.due.time:
            return
        if self.stop is None or time <= self.stop:
            kicks = self.crossings[index].kicks and self.due is None
            self.due = FoundEvent(index, time, np.array(state), self.angles()) if kicks else self.due
        if self.muted or (self.quiet_until is not None and time <= self.quiet_until):
            return
        if len(self.found) >= MOST_EVENTS:
            raise StoppedError(
                f"more than {MOST_EVENTS} events; give them a direction, or an expression that crosses zero "
                "less often"
            )
        if self.stop is not None and time > self.stop:
            return
        self.found.append(FoundEvent(index, time, np.array(state), self.angles()))
        if self.crossings[index].stop and self.stop is None:
            self.stop = time

    def began_there(self, integrator: TaylorEngine, time: Scalar, precision: Precision) -> bool:
        """Whether a crossing that changes the motion is the one at which the engine's step began."""
        begin = integrator.time - integrator.last_h
        width = precision.of_double(_WIDTH * float(precision.epsilon) * max(abs(float(time)), 1.0))
        latest = (f.time for f in self.found[-_LATEST:] if self.crossings[f.index].kicks)
        known = [*self.kicked[-_LATEST:], *latest]
        return any(abs(begin - at) <= width and abs(time - at) <= width for at in known)

    @property
    def ending(self) -> FoundEvent | None:
        """The crossing that ends the run."""
        return next((f for f in self.found if self.crossings[f.index].stop), None)

    @property
    def why_impossible(self) -> str:
        """Why the motion can't go on past the crossing that ends the run; empty if that is an event."""
        ending = self.ending
        return "" if ending is None else self.crossings[ending.index].impossible

    @property
    def status(self) -> Status:
        """The status of a run that the first crossing that stops it has ended."""
        ending = self.ending
        if ending is None or not self.why_impossible:
            return Status.EVENT
        return Status(f"stopped: {self.crossings[ending.index].kind}")

    def occurrences(self, index: int, last: float) -> list[FoundEvent]:
        """The crossings of one event up to a time, internal units."""
        return [f for f in self.found if f.index == index and float(f.time) <= last]

    def back_to(self, count: int) -> None:
        """Forget all but the first ``count``; raises a ValueError if there are fewer."""
        if count > len(self.found):
            raise ValueError(f"{len(self.found)} events are known, not {count}")
        del self.found[count:]
        self.due = None
        ending = self.ending
        self.stop = None if ending is None else ending.time


def samples_at(found: Sequence[FoundEvent], precision: Precision) -> SampleBlock:
    """At least one crossing, as samples that can be evaluated."""
    n = len(found)
    return SampleBlock(
        first=0,
        times=np.array([f.time for f in found], dtype=precision.scalar),
        states=np.array([f.state for f in found], dtype=precision.scalar),
        turns=np.array([f.angles.turns for f in found], dtype=np.int64).reshape(n, -1),
        chart=np.array([f.angles.chart for f in found], dtype=np.int64),
        reference=np.array([f.angles.reference for f in found], dtype=np.float64).reshape(n, -1),
        put_back=np.zeros((n, 0)),
        joined=np.zeros((n, 0)),
    )


def engine_events(
    system: System,
    precision: Precision,
    log: EventLog,
    *,
    start: Scalar | None = None,
    offsets: int | None = None,
) -> list[hy.nt_event]:
    """heyoka's events for a system's crossings; ``offsets`` is the index of the first of the parameters that
    are added to the expressions, one each.

    The engine finds a zero at the very beginning of a step twice, and misses the one that follows within it.
    So an expression that is zero at the start, if there is one, has far less than a rounding added.
    """

    def callback(index: int) -> Callable[[TaylorEngine, Scalar, int], None]:
        def called(integrator: TaylorEngine, time: Scalar, _: int) -> None:
            if system.crossings[index].kicks and log.began_there(integrator, time, precision):
                return
            log.note(index, time, integrator.update_d_output(time))

        return called

    at_zero = [False] * len(system.crossings) if start is None else _zero_at(system, start)
    meant = [c.expression for c in system.crossings]
    expressions = []
    for i, expression in enumerate(meant):
        shifted = expression if offsets is None else expression + hy.par[offsets + i]
        apart = at_zero[i] or system.crossings[i].kicks  # each step after an impulse begins on a zero
        expressions.append(shifted + 2.0 ** (-precision.bits - BESIDE) if apart else shifted)
    return [
        hy.nt_event(expression, callback(i), direction=DIRECTIONS[c.direction], fp_type=precision.scalar)
        for i, (c, expression) in enumerate(
            zip(system.crossings, of_order_one(system, expressions, meant), strict=True)
        )
        if not c.known
    ]


def _zero_at(system: System, start: Scalar) -> list[bool]:
    """Which events' expressions vanish at the start, in double precision."""
    expressions = [c.expression for c in system.crossings]
    compiled = compiled_function(expressions, system.variables, compact_mode=True)
    values = compiled(np.array([float(x) for x in system.initial]), time=float(start))
    return [bool(value == 0) for value in values]


def pack_events(found: Sequence[FoundEvent], precision: Precision) -> Arrays:
    """Crossings as arrays."""
    if not found:
        return {}
    arrays = pack(np.array([f.time for f in found], dtype=precision.scalar), precision, "time")
    states = np.concatenate([np.asarray(f.state) for f in found]).astype(precision.scalar)
    arrays |= pack(states, precision, "state")
    arrays["index"] = np.array([f.index for f in found], dtype=np.int64)
    arrays["turns"] = pack_angles([f.angles for f in found])
    return arrays


def unpack_events(arrays: Mapping[str, np.ndarray], precision: Precision, states: int) -> list[FoundEvent]:
    """Crossings restored from packed arrays; raises a ValueError if these don't belong together."""
    times = unpack(arrays, precision, "time")
    count = len(times)
    values = unpack(arrays, precision, "state").reshape(count, states)
    index = arrays.get("index", np.zeros(0, dtype=np.int64))
    if index.shape != (count,):
        raise ValueError("events without their kind")
    angles = unpack_angles(arrays.get("turns", np.zeros((count, 0), dtype=np.int64)))
    return [FoundEvent(int(i), t, v, a) for i, t, v, a in zip(index, times, values, angles, strict=True)]


STATES = 64
TIMES = (0.0, 0.25, 0.5, 0.75, 1.0)  # as fractions of the run
_WORTH_A_UNIT = 1  # bits above one; a smaller excess loosens nothing


def of_order_one(
    system: System, expressions: Sequence[hy.expression], meant: Sequence[hy.expression]
) -> list[hy.expression]:
    """Expressions scaled by powers of two; ``meant`` are the same without what keeps them off a zero."""
    if not expressions:
        return []
    return [
        expression if not bits else expression * 2.0**-bits
        for expression, bits in zip(expressions, _bits(system, meant), strict=True)
    ]


def _bits(system: System, expressions: Sequence[hy.expression]) -> list[int]:
    """Binary exponents, at least 0, of the largest values over the run's time and states of order one."""
    scene, scaling = system.scene, system.scaling
    start, end = (float(scaling.internal(t, scene.context)) for t in (scene.start, scene.samples.last))
    random = np.random.default_rng(0)
    states = random.uniform(-1.0, 1.0, (STATES, len(system.states)))
    states[0] = [float(x) for x in system.initial]
    compiled = compiled_function(expressions, system.variables, compact_mode=True)
    parameters = random.uniform(-1.0, 1.0, (STATES, compiled.nparams))
    sides = len(system.surfaces)
    parameters[:, sides : sides + len(system.turning)] *= end - start  # full turns, for rates of order one
    if system.clocked:
        parameters[:, system.parameters - 1 :] = 0.0  # a part of the time far below its last digit
    largest = np.zeros(len(expressions))
    options = {"pars": np.ascontiguousarray(parameters.T)} if compiled.nparams else {}
    for part in TIMES:
        if compiled.is_time_dependent:
            options["time"] = np.full(STATES, start + part * (end - start))
        with np.errstate(all="ignore"):
            values = np.asarray(compiled(np.ascontiguousarray(states.T), **options))
        largest = np.fmax(largest, np.where(np.isfinite(values), np.abs(values), 0.0).max(axis=1))
    return [int(bits) for bits in exponents_of(largest)]


def exponents_of(largest: np.ndarray) -> np.ndarray:
    """Binary exponents of the units for given largest values."""
    exponents = np.frexp(largest)[1]
    return np.where(exponents > _WORTH_A_UNIT, exponents, 0)
