"""What takes natural steps through a motion, the boundaries between them, and bounds of steps for cases in
which the engine, which uses the last two terms of a series, can't choose them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any, Protocol

import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.compiled import TaylorEngine
from rigidsim.solve.events import EventLog
from rigidsim.solve.precision import Precision, Scalar


@dataclass(slots=True)  # frozen it would take 2 us more, at each of many steps
class Mark:
    """A natural step boundary, with all that a run needs to go on from it with the same bits."""

    time: tuple[Scalar, Scalar]  # two numbers whose sum it is, internal units
    state: np.ndarray  # (states,), internal units
    events: int = 0
    steps: int = 0
    memory: Any = None  # whatever else the stepper's later steps depend on, as a value that stays as it is
    effects: tuple[Any, ...] = ()  # the memory of each effect
    next_row: int = 0  # the first row (``sampling.Rows``) that isn't handed over


class Watcher(Protocol):
    """Called for each natural step, whose dense output it may use."""

    def begin(self, time: Scalar) -> None:
        """Called before steps, with their starting time."""

    def __call__(self, integrator: TaylorEngine) -> bool:
        """Called after each step; False ends the call that took it."""


class SamplesWithin:
    """Samples within steps as they are taken, at ascending times (n,), n > 0; past the last one it asks to
    end the call.
    """

    def __init__(self, times: np.ndarray) -> None:
        self.times = times
        self.states: Any = []  # or an array (n, states)
        self.ended = False
        self._listed = list(times)  # which is looked up in half the time

    @property
    def upcoming(self) -> Scalar | None:
        """The next sample's time; None after the last."""
        return self.times[len(self.states)] if len(self.states) < len(self.times) else None

    def __call__(self, engine: TaylorEngine) -> bool:
        """Take those within the engine's step; False if it asks to end the call."""
        return self.passed(engine.time, engine.update_d_output)

    def passed(self, now: Scalar, dense: Callable[[Scalar], np.ndarray]) -> bool:
        """Take those within a step that ends now; False if it asks to end the call."""
        times, states = self._listed, self.states
        while (count := len(states)) < len(times) and times[count] <= now:
            states.append(dense(times[count]).copy())  # heyoka reuses its buffer
        self.ended = now >= times[-1]
        return not self.ended

    def within(self, engine: TaylorEngine) -> bool:
        """False if it asks to end the call, where the engine itself takes them."""
        self.ended = engine.time >= self.times[-1]
        return not self.ended

    def until(self, stop: Scalar | None) -> np.ndarray:
        """The samples taken that lie before a time, None for any."""
        return np.asarray(self.states if stop is None else self.states[: int((self.times <= stop).sum())])

    def back_to(self, count: int) -> None:
        """Forget all but the first."""
        self.states = list(self.states[:count])
        self.ended = False


@dataclass(frozen=True)
class OwnErrors:
    """A solver's own estimate of a run's largest errors until its end.

    Attributes:
        attitude: rad; None without an attitude.
        rates: error of the angular velocity, relative to its size.
        how: description of the method.
        position, velocity: m and m/s; None if the body has no position.
    """

    attitude: float | None
    rates: float
    how: str
    position: float | None = None
    velocity: float | None = None


class Stepper:
    """Takes single natural steps with dense output; no step is ever shortened for a sample.

    A user-defined one defines ``time``, ``state``, ``step``, ``dense`` and ``back_to``, and keeps ``steps``,
    ``smallest`` and ``largest``. All bits must follow from what its marks hold.

    Attributes:
        system: the system integrated.
        precision: precision of the arithmetic.
        steps: natural steps taken and kept.
        log: the events found along the way.
        has_events: whether it looks for any.
        smallest, largest: step sizes of the latest call, internal units.
        single_steps: whether steps are always taken one by one.
        changes_charts: whether it can continue in the system's partner (``use``).
        failure: why the latest step couldn't be taken although its state is finite; empty otherwise.
        destination: time of the last sample, internal units; None if steps may become arbitrarily
            small.
        unresolved: whether several steps were taken at once that have to be taken back and taken one by one.
        ended: whether the watcher asked to end the call after the latest step.
        until: time beyond which no step may go, to be set from outside: one that would is cut short to end
            there; None for any.
        watcher: sees each step and may end a call early; None without one.
        version: of its memory; a checkpoint with another is refused.
    """

    version = 1
    single_steps = True
    changes_charts = False

    def __init__(self, system: System, precision: Precision, log: EventLog | None = None) -> None:
        self.system, self.precision = system, precision
        self.log = log or EventLog()
        self.has_events = False
        self.steps = 0
        self.smallest = self.largest = 0.0
        self.failure = ""
        self.destination: float | None = None
        self.unresolved = self.ended = False
        self.until: Scalar | None = None
        self.watcher: Watcher | None = None

    @property
    def time(self) -> Scalar:
        """Current time (of two numbers the first), internal units, in the run's precision."""
        raise NotImplementedError

    @property
    def state(self) -> np.ndarray:
        """Current state (states,), internal units, which effects assign to in place."""
        raise NotImplementedError

    def step(self) -> bool:
        """Take one step with dense output; False if the state is no longer finite."""
        raise NotImplementedError

    def dense(self, time: Scalar) -> np.ndarray:
        """State at a time within the step just taken by ``step``, shape (states,)."""
        raise NotImplementedError

    def take(self, count: int, samples: SamplesWithin | None = None) -> bool:
        """Take at most ``count`` steps, and samples within them; fewer if all samples are taken, the watcher
        ends the call, or one ends at ``until``. False if the state is no longer finite.
        """
        smallest, largest = math.inf, 0.0
        for _ in range(count):
            if not self.step():
                return False
            smallest, largest = min(smallest, self.smallest), max(largest, self.largest)
            going = samples is None or samples.passed(self.time, self.dense)
            if not going or self.ended or self.collapsed or self.time == self.until:
                break
        self.smallest, self.largest = smallest, largest
        return True

    def mark(self) -> Mark:
        """Remember this boundary."""
        time = self.time, self.precision.of_double(0.0)
        return Mark(time, np.array(self.state), len(self.log.found), self.steps)

    def back_to(self, mark: Mark) -> None:
        """Return to a boundary."""
        raise NotImplementedError

    def pack(self, memory: Any) -> dict[str, np.ndarray]:
        """A mark's memory as arrays of a checkpoint, float64 or int64, with names that no effect uses."""
        return {}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> Any:
        """A mark's memory restored from a checkpoint's arrays.

        Raises:
            ValueError: they belong to another system.
        """
        return None

    @property
    def collapsed(self) -> bool:
        """Whether steps have become too small to ever arrive."""
        return False

    def to_whole_time(self) -> bool:
        """Go to the first of the two numbers of the time; False if that takes too many steps."""
        return True

    def errors(self) -> OwnErrors | None:
        """Its own estimate of the errors made so far; None if it has none, and then none is announced."""
        return None

    # --- those that change charts -------------------------------------------------------------------------

    @property
    def chart(self) -> int:
        """0 in the system, 1 in its partner."""
        return 0

    def use(self, chart: int) -> None:
        """Continue in the system (0) or its partner (1), whose time and state must be set afterwards."""

    def enter(self, chart: int, state: np.ndarray) -> None:
        """Continue from here in a chart, where this is the state."""
        raise NotImplementedError

    def bound_steps(self) -> None:
        """Bound the steps by the series at the start, after its state was set."""


_SPARSE = 1.5
"""Largest ratio of the step by the last two terms to the step by the terms before, in proportion to an
exponential's terms: 1.5^20 is three digits.
"""
# A motion whose Taylor series ends (free fall without rotation) would have infinite steps. Natural steps are
# of the order of one internal unit, far below this, so that the bound changes no other motion.
_LONGEST_BITS = 30
_SPARE_BITS = 24  # bits of a type's exponents left for the states of order one and their sums


def longest_step(order: int, number: type) -> float:
    """Bound of all steps, internal units.

    Events are found on a step's polynomials, scaled by the powers of its size up to the order: where those
    overflow, as 2^30 to the 10th does in single precision, heyoka silently finds none.
    """
    if not issubclass(number, np.floating):  # quadruple and beyond have far more than a thousand exponents
        return 2.0**_LONGEST_BITS
    return 2.0 ** min(_LONGEST_BITS, (np.finfo(number).maxexp - _SPARE_BITS) // order)


def bound_of_sparse_series(coefficients: np.ndarray) -> float:
    """Bound of a step from all Taylor coefficients (states, order + 1) of any step from there, if it is far
    below that from the last two, which the engine uses; infinity elsewhere.

    From rest under a torque that grows with time, a quaternion's series have every third term only: the last
    two are zero, and the engine would take any step at all.
    """
    with np.errstate(over="ignore"):  # of wider types
        sizes = np.abs(coefficients.astype(np.float64)).max(axis=0).tolist()
    if not all(map(math.isfinite, sizes)):  # next to a pole of Euler angles: this chart is left
        return math.inf
    order, base = len(sizes) - 1, max(sizes[0], 1.0)  # the engine's errors are absolute below 1

    def radius(term: int) -> float:
        return (base / sizes[term]) ** (1 / term) if sizes[term] > 0 else math.inf

    def of_entire(term: int) -> float:  # terms of an exponential, like a rotation's
        return math.exp(math.lgamma(term + 1) / term)

    terms = range(order // 2 + 1, order - 1)
    shortest = min((radius(m) for m in terms), default=math.inf)
    expected = min((radius(m) * of_entire(order) / of_entire(m) for m in terms), default=math.inf)
    if min(radius(order), radius(order - 1)) <= _SPARSE * expected:
        return math.inf
    return shortest * math.exp(-2 - 0.7 / (order - 1))  # as heyoka's own (Jorba & Zou 2005)


def may_be_sparse(states: np.ndarray, coefficients: np.ndarray, order: int) -> np.ndarray:
    """Which of many steps may have such a bound, by the states (n, states) where they begin and their later
    coefficients (n, states, terms), from ``order // 2 + 1`` on.
    """
    with np.errstate(all="ignore"):
        sizes = reduce(np.maximum, np.abs(coefficients.astype(np.float64, copy=False)).swapaxes(0, 1))
        terms = np.arange(order // 2 + 1, order + 1)
        entire = np.array([math.lgamma(term + 1) / term for term in terms])
        base = np.maximum(np.abs(states.astype(np.float64, copy=False)).max(axis=1, keepdims=True), 1.0)
        radii = (np.log(base) - np.log(sizes)) / terms
        expected = (radii + (entire[-1] - entire))[:, :-2].min(axis=1)
        return ~(radii[:, -2:].min(axis=1) <= math.log(_SPARSE) + expected - 1e-6)
