"""Steps that end on switching surfaces: no step passes over a kink or a jump.

The engine itself ends a step where the argument of a surface vanishes. The event's callback sets the new
side, a parameter of the equations, and the engine goes on: many steps in one call. After the call all
boundaries are looked at together. The first step that isn't plain, as where both sides push onto a surface,
surfaces meet, or a side is wrong because a zero was missed, is taken back with all that follow, and taken by
itself: the fields of all sides decide how the motion goes on from its end. Whether a step is plain depends on
that step alone, and a plain one by itself has the same bits; so these don't depend on how many steps are
taken at once.

The engine would find the zero at which a step begins again and again, in place of those that follow. So where
an argument is zero but for rounding, its event watches the sum with a parameter, a rounding on the side that
the motion is on. Then no cooldown is needed, and a boundary holds all that later steps depend on.

Surfaces that depend on time alone end no step by themselves: their roots are noted, and worked out from the
expressions as written (``rigidsim.solve.switching.moments``). The turns of angles and the sign of the
quaternion, where an expression depends on them, are parameters of the equations, continued from step to step;
along surfaces the motion has equations of its own, compiled when they are first needed. Both take single
steps.
"""

from __future__ import annotations

import copy
import math
from bisect import bisect_left
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.compiled import TaylorEngine, interruptible
from rigidsim.solve.events import BESIDE, EventLog, engine_events, of_order_one
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.requirements import SetAtKnots
from rigidsim.solve.stepper import Mark, SamplesWithin, bound_of_sparse_series, may_be_sparse
from rigidsim.solve.switching.moments import between, of_time
from rigidsim.solve.switching.sides import (
    HELD,
    SLIDES,
    Continuation,
    Fields,
    SurfaceFunctions,
    SurfaceValues,
    crossings,
)
from rigidsim.solve.switching.sliding import MOST_AT_ONCE, Meeting, sliding
from rigidsim.solve.switching.turned import MOST, Turned
from rigidsim.solve.taylor_stepper import TaylorStepper

_ATTEMPTS = 32  # attempts at one step
_MOST_CALLS = 1000  # that take steps on to a given time
_FIRST_AHEAD, _MOST_AHEAD = 16, 1024  # steps that are looked at together: some MB of series
_MOST_SWITCHES = 256
"""Switches at intervals shorter than ``_SHORTEST`` that count as an accumulation, or as swings kept up by
rounding, whose period is the square root of its size.
"""
_SHORTEST = 2.0**-8  # internal units of time; with more digits less, see ``_window``
_ROUNDINGS = 2.0**15  # in the square of an interval
_MOST_LEFT_OUT = 8.0  # roundings of the state, by a moment in two numbers
_NOT_RESOLVED = "choose a higher precision, or count time from an epoch shortly before"
_WIDTH = 2.0**8  # roundings of a time between two findings of the same crossing

Root = tuple[Any, int, int]
"""Time, number of a surface, and the side to which it leads."""


class _Passed(NamedTuple):
    """A boundary that was passed among many, with what its step may have to be taken back for.

    Attributes:
        crossed: number of the surface on which the step ended, from 1; 0 for none.
        switches: count of the latest switches, and since when.
        series: Taylor coefficients of the step if it began on a surface, (states, order + 1).
        samples: number of samples taken up to here.
    """

    time: tuple[Scalar, Scalar]
    state: np.ndarray
    pars: np.ndarray
    crossed: int
    switches: tuple[int, float]
    events: int
    samples: int
    size: float
    series: np.ndarray | None


class SwitchingStepper(TaylorStepper):
    """Stepper of a system with surfaces, or with angles whose turns matter; it begins where motion leads."""

    version = 2
    single_steps = True

    def __init__(
        self,
        system: System,
        precision: Precision,
        tolerance: Scalar | None,
        start: Scalar,
        log: EventLog | None = None,
    ) -> None:
        self._roots: list[Root] = []  # noted within the latest step
        self._cut: tuple[int, int] | None = None  # surface on which the engine ended it, and the new side
        self._passed: list[_Passed] | None = None  # boundaries, while many steps are taken
        self._samples: SamplesWithin | None = None
        self._halted = self._fresh = False
        self._offset: list[int] = []  # parameters that are added to events
        self._ahead = _FIRST_AHEAD
        self._functions_by_chart: dict[int, SurfaceFunctions] = {}
        self._engines: dict[tuple[int, tuple[int, ...], tuple[int, ...]], TaylorEngine] = {}
        self._chart = 0
        surfaces = system.plan.surfaces
        self._modes = [1] * len(surfaces.found)
        self._crossed, self._count, self._since = 0, 0, 0.0
        self._count_of_pars = system.parameters  # without what is added to events
        self._piece: np.ndarray | None = None  # parameters of the piece in which the latest step was
        self._off, self._minus, self._plus = _scalars(precision, [0.0, -1.0, 1.0])
        super().__init__(system, precision, tolerance, start, log)
        # in the partner chart, where a run may begin, angles are plain already
        self._turned = Turned.begun(system, *self._plain(self.state, self.time))
        self._dense = self._integrator
        self._unsettled = ""
        self._begin()
        self.begun = self.mark()

    # --- memory ---------------------------------------------------------------------------------------------

    @property
    def _along(self) -> tuple[int, ...]:
        return tuple(j for j, mode in enumerate(self._modes) if mode == SLIDES)

    @property
    def _held(self) -> dict[int, tuple[int, int]]:
        """For surfaces kept to at rest: the surface whose side each has (1) or the opposite (-1)."""
        return {
            j: (abs(mode) - HELD, 1 if mode > 0 else -1)
            for j, mode in enumerate(self._modes)
            if abs(mode) >= HELD
        }

    @property
    def _functions(self) -> SurfaceFunctions:
        if self._chart not in self._functions_by_chart:
            system = self._system_of(self._chart)
            self._functions_by_chart[self._chart] = interruptible(
                lambda: SurfaceFunctions(system, self.precision)
            )
        return self._functions_by_chart[self._chart]

    def mark(self) -> Mark:
        mark = super().mark()
        sides = (
            *map(float, self._modes),
            *self._turned.angles,
            *self._turned.quaternion,
            float(self._crossed),
            float(self._count),
            self._since,
        )
        return replace(mark, memory=(mark.memory, sides))

    def back_to(self, mark: Mark) -> None:
        tiny, sides = mark.memory
        s, a = len(self._modes), len(self._turned.angles)
        self._modes = [int(x) for x in sides[:s]]
        self._turned = Turned(list(sides[s : s + a]), list(sides[s + a : -3]))
        crossed, count, self._since = sides[-3:]
        self._crossed, self._count = int(crossed), int(count)
        self.failure = ""
        self._enter()
        self._piece = None
        super().back_to(replace(mark, memory=tiny))

    def pack(self, memory: Any) -> dict[str, np.ndarray]:
        tiny, sides = memory
        return super().pack(tiny) | {"rhythm_switching": np.array(sides)}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> Any:
        _, known = self.begun.memory
        sides = np.asarray(arrays.get("rhythm_switching", np.zeros(0)), dtype=np.float64)
        if sides.shape != (len(known),):
            raise ValueError(f"the checkpoint remembers {sides.shape} numbers of switching surfaces")
        return super().unpack(arrays), tuple(sides.tolist())

    def use(self, chart: int) -> None:
        self._chart = chart
        self._enter()
        self._longest = self._bounds[chart]

    def settle(self) -> None:
        """Must be called after the state was set from outside: takes the sides on which it lies."""
        # the state lies beside surfaces that it kept to
        self._modes = [mode if abs(mode) == 1 else 1 for mode in self._modes]
        self._agree()
        self._enter()

    # --- engines --------------------------------------------------------------------------------------------

    def _enter(self) -> None:
        """Continue with the equations of this chart along the current surfaces."""
        key = self._chart, self._along, tuple(self._modes[j] for j in self._held)
        if key not in self._engines:
            system, along, held = self._system_of(self._chart), self._along, self._held
            interruptible(lambda: self._compiled(system, along, held))
        entered = self._engines[key]
        if entered is not self._integrator:
            entered.dtime = self._integrator.dtime
            entered.state[:] = self._integrator.state
            self._integrator = entered

    def _compiled(
        self, system: System, along: tuple[int, ...] = (), held: Mapping[int, tuple[int, int]] | None = None
    ) -> TaylorEngine:
        held, kind = held or {}, self.precision.scalar
        options = dict(self.precision.options)
        equations = system.equations
        shifted = [u + hy.par[system.parameters + j] for j, u in enumerate(system.surfaces)]
        ends, noted = [], []
        for j, u in enumerate(of_order_one(system, shifted, system.surfaces)):
            if j in along or j in held:
                continue
            if of_time(system, j):
                noted.append(hy.nt_event(u, self._noting(j), fp_type=kind))
            else:
                ends.append(self._event(u, j))
        if along:
            found = sliding(system, along, held)
            equations = found.equations
            for j, side in zip(along, found.sides, strict=True):
                ends.append(self._event(side - 1.0, j, 1, hy.event_direction.positive))
                ends.append(self._event(side + 1.0, j, -1, hy.event_direction.negative))
        if self.has_events:
            offsets = system.parameters + len(system.surfaces)
            noted += engine_events(system, self.precision, self.log, offsets=offsets)
        if self._tolerance is not None:
            options["tol"] = self._tolerance
        integrator = hy.taylor_adaptive(
            equations,
            self.precision.array(system.initial),
            time=self._start,
            t_events=ends,
            nt_events=noted,
            compact_mode=self.precision.compact or system.wide or len(along) > 1,
            **options,
        )
        self._engines[(self._chart, along, tuple(self._modes[j] for j in held))] = integrator
        return integrator

    def _event(
        self, u: hy.expression, j: int, end: int = 0, way: hy.event_direction = hy.event_direction.any
    ) -> hy.t_event:
        """The event that ends steps on a surface, or the motion along it."""

        def called(engine: TaylorEngine, sign: int) -> bool:
            self._cut = j, end or sign
            if self._passed is None:
                return False
            self._halted = self._halted or not self._crosses(engine, *self._cut)
            return not self._halted

        return hy.t_event(
            u, callback=called, direction=way, cooldown=self._off, fp_type=self.precision.scalar
        )

    def _noting(self, j: int) -> Callable[[TaylorEngine, Scalar, int], None]:
        def called(_: TaylorEngine, time: Scalar, way: int) -> None:
            self._roots.append((time, j, way))

        return called

    # --- parameters -----------------------------------------------------------------------------------------

    def _pars(
        self, turns: list[float], over: dict[int, int] | None = None, low: Scalar | None = None
    ) -> np.ndarray:
        """Parameters of the equations; turns of angles, and the sign of the quaternion, are given."""
        modes = self._modes if over is None else [over.get(j, mode) for j, mode in enumerate(self._modes)]
        sides = [-1.0 if mode < 0 else 1.0 for mode in modes]
        numbers = [*sides, *turns]
        if (pieces := self.system.pieces) is not None:
            if self._piece is None:  # of those that meet at a boundary, the one that ends there
                self._piece = self._piece_of(bisect_left(pieces.knots, self.time))
            numbers += [0.0] * (self.system.first_of_pieces - len(numbers))
            return np.concatenate([_scalars(self.precision, numbers), self._piece])
        pars = _scalars(self.precision, numbers)
        if not self._functions.clocked:
            return pars
        return np.concatenate([pars, np.array([self._off if low is None else low], dtype=pars.dtype)])

    def _piece_of(self, number: int) -> np.ndarray:
        assert self.system.pieces is not None
        return self.system.pieces.parameters(number)

    def _meet(self) -> Scalar | None:
        """Continue with the piece of the equations that begins here, if one does."""
        if isinstance(self._requirement, SetAtKnots):
            self._piece = self._piece_of(self._requirement.enter(self._integrator))
        return self.end

    @property
    def _low(self) -> Scalar:
        """Second number of the time."""
        return self._integrator.dtime[1]

    def _parameters(self, over: dict[int, int] | None = None) -> np.ndarray:
        """Parameters at this boundary; turns and sign continue from the latest step."""
        return self._pars(self._joined(self.state, self.time), over, self._low)

    def _look(self, state: np.ndarray, time: Scalar, low: Scalar | None = None) -> SurfaceValues:
        """SurfaceValues at the surfaces in a state of the latest step, at a time in one number or two."""
        return self._functions.look(state, time, self._pars(self._joined(state, time), low=low))

    def _plain(self, state: np.ndarray, time: Scalar) -> tuple[list[float], list[float]]:
        """Angles within one turn, and the quaternion without its sign, that expressions read."""
        return self._functions.values(state, time, self._pars(self._functions.unturned))[1:]

    def _joined(self, state: np.ndarray, time: Scalar) -> list[float]:
        """Turns and sign, continued from the latest step on to a state."""
        return self._turned.parameters(*self._plain(state, time)) if self._functions.unturned else []

    def _follow(self) -> None:
        """Continue angles and quaternion to the end of the step just taken."""
        if self._functions.unturned:
            self._turned = self._turned.followed(*self._plain(self.state, self.time))

    def _set(self) -> None:
        """Set the parameters of the equations, and what is added to events, at this boundary.

        An event of the config that lies there, and was found on the way to it, watches the zero of its sum
        with next to nothing.
        """
        engine, pars = self._integrator, self._parameters()
        look = self._functions.look(self.state, self.time, pars)
        # the change of the state in a unit of time shows its size
        noises = self._functions.noises(look, [self.state, look.field])
        moved = [0.0] * len(self._modes)
        for j, (u, noise, mode) in enumerate(zip(look.u, noises, self._modes, strict=True)):
            of_time = self._functions.moments[j].of_time
            near = abs(float(u)) <= noise or (j + 1 == self._crossed and not of_time)
            if near and abs(mode) < HELD:
                moved[j] = mode * (
                    noise if of_time else self._functions.beside(self.state, self.time, pars, j)
                )
        if self.has_events:
            moved += [
                self._event_offset(*found) for found in self._functions.crossings(self.state, self.time, pars)
            ]
        everything = np.concatenate([pars, _scalars(self.precision, moved)])
        engine.pars[:] = everything[: len(engine.pars)]  # along a surface the last ones have no meaning
        self._offset = [self.system.parameters + i for i, number in enumerate(moved) if number]

    def _event_offset(self, value: float, noise: float) -> float:
        """Offset to add to an event's expression."""
        if self._along and abs(value) <= noise:  # it is zero all along the surface and crosses nothing
            return 2 * noise
        return 2.0 ** (-self.precision.bits - BESIDE) if self._crossed and value == 0 else 0.0

    # --- many steps -----------------------------------------------------------------------------------------

    def take(self, count: int, samples: SamplesWithin | None = None) -> bool:
        """See ``TaylorStepper``."""
        last, smallest, largest, going = self.steps + count, math.inf, 0.0, True
        while going and self.steps < last:
            before, alone = self.steps, True
            if not self._single:
                alone = self._together(min(last - before, self._ahead), samples)
                if self.steps > before:
                    smallest, largest = min(smallest, self.smallest), max(largest, self.largest)
                going = samples is None or not samples.ended
            if alone and going and self.steps < last:
                if not self._one():
                    return False
                smallest, largest = min(smallest, self.smallest), max(largest, self.largest)
                going = samples is None or samples(self._dense)
                if self.watcher is not None and samples is not None and samples.states:
                    break  # it knows of the latest step alone
            stuck = self.steps == before or self.collapsed or self.unresolved
            if stuck or self.ended or self.time == self.until or self.log.stop is not None:
                break
        self.smallest, self.largest = smallest, largest
        return True

    @property
    def _single(self) -> bool:
        """Whether steps have to be taken one by one here."""
        if self._unsettled or self._functions.unturned or self.watcher is not None:
            return True
        return any(abs(mode) != 1 for mode in self._modes)

    def _together(self, most: int, samples: SamplesWithin | None) -> bool:
        """Take several plain steps; returns whether the one that follows has to be taken by itself."""
        until = self._meet()
        self._set()
        self._quieten()
        self._roots.clear()
        engine, begun, known = self._integrator, self.mark(), 0 if samples is None else len(samples.states)
        self._passed, self._samples, self._cut, self._halted = [], samples, None, False
        self._fresh = bool(self._crossed) or not self.steps
        try:
            outcome, *_ = engine.propagate_until(
                self._far if until is None else until,
                max_steps=most,
                max_delta_t=self._longest,
                callback=self._pass,
                write_tc=True,
            )
        finally:
            passed, self._passed, self._samples = self._passed, None, None
        kept, alone = self._holding(begun, passed)
        alone = alone or (kept == len(passed) and (self._halted or outcome == hy.taylor_outcome.err_nf_state))
        self._ahead = min(2 * self._ahead, _MOST_AHEAD) if kept == len(passed) else max(kept, 1)
        if alone or kept < len(passed):
            self._back_among(begun, known, passed[:kept], samples)
        if kept:
            sizes = [one.size for one in passed[:kept]]
            self.smallest, self.largest = min(sizes), max(sizes)
            self._crossed, self._dense = passed[kept - 1].crossed, engine
            self.steps = begun.steps + kept
            self._judge(begun.time[0], kept)
        return alone

    def _back_among(
        self, begun: Mark, known: int, passed: list[_Passed], samples: SamplesWithin | None
    ) -> None:
        """Go back to the last of the boundaries passed, or to where they began."""
        found = self.log.found[:]
        self.back_to(begun)
        if passed:
            last, self.log.found[:] = passed[-1], found
            begun = replace(begun, time=last.time, state=last.state, events=last.events)
            self._modes = [1 if side > 0 else -1 for side in last.pars[: len(self._modes)]]
            self._count, self._since = last.switches
            TaylorStepper.back_to(self, replace(begun, memory=begun.memory[0]))
            known = last.samples
        if samples is not None:
            samples.back_to(known)

    def _crosses(self, engine: TaylorEngine, j: int, side: int) -> bool:
        """Go on beyond a surface on which a step ended among many; False if that has to be looked into."""
        if side != -self._modes[j] or not self._counts(float(engine.time)):
            return False
        self._modes[j], first, pars = side, self._count_of_pars, engine.pars
        pars[j] = self._plus if side > 0 else self._minus
        beside = self._functions.beside(engine.state, engine.time, pars[:first], j)
        pars[first + j] = self.precision.of_double(side * beside)
        self.log.quiet_until = engine.time + self._width(engine.time)
        return True

    def _pass(self, engine: TaylorEngine) -> bool:
        """Note a boundary among many."""
        self._halted = self._halted or bool(self._roots)
        if self._halted:
            return False
        first, crossed = self._count_of_pars, 0 if self._cut is None else self._cut[0] + 1
        offset = [first + crossed - 1] if crossed else []
        for place in self._offset:
            if place not in offset:
                engine.pars[place] = self._off
        time = engine.dtime
        if self._functions.clocked and self.system.pieces is None:
            engine.pars[first - 1] = time[1]
        samples = self._samples
        going = samples is None or samples(engine)
        assert self._passed is not None
        self._passed.append(
            _Passed(
                time,
                np.array(engine.state),
                np.array(engine.pars[:first]),
                crossed,
                (self._count, self._since),
                len(self.log.found),
                0 if samples is None else len(samples.states),
                abs(float(engine.last_h)),
                np.array(engine.tc) if self._fresh else None,
            )
        )
        if not crossed:
            self.log.quiet_until = None
        self._offset, self._cut, self._fresh = offset, None, bool(crossed)
        return going

    def _holding(self, begun: Mark, passed: list[_Passed]) -> tuple[int, bool]:
        """How many of the boundaries hold, and whether the step after these has to be taken by itself.

        After a boundary where something other than the surface crossed is zero but for rounding, the
        parameters have to be set anew.
        """
        if not passed:
            return 0, False
        states = np.array([begun.state, *(one.state for one in passed)])
        times = np.array([one.time[0] for one in passed])
        pars = np.array([one.pars for one in passed])
        crossed = np.array([one.crossed - 1 for one in passed])
        sides = np.where(pars[:, : len(self._modes)] > 0, 1.0, -1.0)
        bad, near = np.zeros((2, len(passed)), dtype=bool)
        rows = np.flatnonzero((crossed >= 0) | self._functions.asks(states[1:], times, pars, sides))
        if len(rows):
            there = states[:-1][rows], states[1:][rows], times[rows], pars[rows]
            bad[rows], near[rows] = self._wrong_or_near(*there, sides[rows].T, crossed[rows])
        rows = np.flatnonzero(crossed >= 0)
        if len(rows):
            here = states[1:][rows], times[rows], pars[rows]
            bad[rows] |= near[rows] | ~self._crossing(*here, crossed[rows])
        series = [(row, one.series) for row, one in enumerate(passed) if one.series is not None]
        maybe = may_be_sparse(np.array([found for _, found in series])) if series else np.zeros(0)
        for k in np.flatnonzero(maybe):
            row, found = series[k]
            bad[row] |= bound_of_sparse_series(found) < passed[row].size
        if self._functions.hides:
            begins = [begun.time[0], *times[:-1]]
            for row, (begin, end) in enumerate(zip(begins, times, strict=True)):
                bad[row] |= bool(self._hidden(begin, end, [int(side) for side in sides[row]]))
        first = int(np.argmax(bad)) if bad.any() else len(passed)
        again = int(np.argmax(near)) + 1 if near.any() else len(passed)
        return min(first, again), first < again and first < len(passed)

    def _wrong_or_near(
        self,
        before: np.ndarray,
        states: np.ndarray,
        times: np.ndarray,
        pars: np.ndarray,
        sides: np.ndarray,
        crossed: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """At which of many boundaries a surface other than the one crossed is on the wrong side, or near."""
        looks = self._functions.looks(states, times, pars)
        others = np.arange(len(looks.u))[:, None] != crossed
        wrong = sides * looks.u < -looks.noises(states)
        near = np.abs(looks.u) <= looks.widest_noises(before, states)
        return (wrong & others).any(axis=0), (near & others).any(axis=0)

    def _crossing(
        self, states: np.ndarray, times: np.ndarray, pars: np.ndarray, crossed: np.ndarray
    ) -> np.ndarray:
        """At which of many boundaries the fields of both sides lead across the surface, and no event is."""
        rows = np.arange(len(crossed))
        side, flipped = np.where(pars[rows, crossed] > 0, 1.0, -1.0), pars.copy()
        flipped[rows, crossed] = -flipped[rows, crossed]
        looks = [self._functions.looks(states, times, given) for given in (pars, flipped)]
        (here, noise), (there, other) = (look.rates(crossed, rows) for look in looks)
        found = np.minimum(side * here, side * there) > np.maximum(noise, other)
        return found & ~self._functions.crosses_too(states, times, pars) if self.has_events else found

    # --- one step -------------------------------------------------------------------------------------------

    def step(self) -> bool:
        """Take one step, not past a surface; False if lost, or if it can't go on (``failure`` says why)."""
        return self._one()

    def skip(self, count: int) -> bool:
        return self.take(count)

    def to(self, time: float) -> bool:
        known = self.until
        try:
            self.until = time if known is None else min(time, known)
            for _ in range(_MOST_CALLS):
                if time - self.time <= abs(time) * self._epsilon:
                    return True
                if not self.take(_MOST_AHEAD):
                    break
        finally:
            self.until = known
        return False

    def dense(self, time: Scalar) -> np.ndarray:
        return np.array(self._dense.update_d_output(time))

    def _one(self) -> bool:
        """Take a step by itself, and decide how the motion goes on from its end."""
        if self._unsettled:
            self.failure = self._unsettled
            return False
        until = self._meet()
        self._watched()
        self._quieten()
        log, events, longest = self.log, len(self.log.found), self._longest
        for attempt in range(_ATTEMPTS + self.precision.bits):
            engine = self._integrator
            self._set()
            time, before = engine.dtime, np.array(engine.state)
            finite = self._natural(until, longest)
            bound = bound_of_sparse_series(engine.tc) if self._crossed or not self.steps else np.inf
            bound = min(bound, self._bound_of_turn(before, time[0]))
            if bound < abs(float(engine.last_h)):
                self._return(time, before, events)
                finite = self._natural(until, self.precision.of_double(bound))
            if not finite:
                return False
            size = engine.last_h
            root = self._first_root(time, before)
            if root is None and (missed := self._missed(before)) is not None:
                if attempt < self.precision.bits:  # the engine finds it in a shorter step
                    self._return(time, before, events)
                    longest = size / 2
                    continue
                root = time[0], missed, -self._modes[missed]
            if root is None:
                break
            log.drop_after(events, root[0] + self._width(root[0]))
            moment, known = self._moment(root)
            left = between(time, moment)
            if left > 0:
                self._again(time, before, left, moment if known else None)
                size, self._cut = left, root[1:]
                break
            # the step begins on the surface and leaves its side at once
            self._return(time, before, events)
            if not self._arrive(*root[1:], [before], bool(self._crossed)):
                return False
        else:
            assert root is not None
            return self._fail(root[1], "it turns back to it again and again")
        cut, again = self._cut, bool(self._crossed)
        if cut is not None and self.has_events:
            self._note_events(before, time[0], events)
        self._dense = engine
        self.smallest = self.largest = abs(float(size))
        self.steps += 1
        self._judge(time[0], 1)
        self.ended = self.watcher is not None and not self.watcher(engine)
        self._follow()
        self._crossed = 0
        if cut is not None and not self._arrive(*cut, [before, np.array(self.state)], again):
            return False
        if self._along:
            self._keep_to_surfaces()
        return True

    def _note_events(self, before: np.ndarray, begun: Scalar, known: int) -> None:
        """Note events that lie on the surface where the step ended, before the engine found them."""
        found, width = self.log.found[known:], self._width(self.time)
        noted = {event.index for event in found if event.time >= self.time - width}
        pars = self._parameters()
        earlier, here = (
            self._functions.crossings(*place, pars) for place in ((before, begun), (self.state, self.time))
        )
        for i, ((value, _), (now, noise)) in enumerate(zip(earlier, here, strict=True)):
            direction = self.system.crossings[i].direction
            if i not in noted and abs(now) <= noise < abs(value) and direction * value <= 0:
                self.log.note(i, self.time, self.state)

    def _natural(self, until: Scalar | None, longest: Scalar) -> bool:
        """Take a natural step, which may end on a surface, from where the parameters are set."""
        engine = self._integrator
        self._roots.clear()
        self._cut = None
        if until is None:
            outcome, _ = engine.step(longest, write_tc=True)
        else:
            outcome, *_ = engine.propagate_until(until, max_steps=1, max_delta_t=longest, write_tc=True)
        return bool(outcome != hy.taylor_outcome.err_nf_state)

    def _return(self, time: tuple[Scalar, Scalar], state: np.ndarray, events: int) -> None:
        self.log.back_to(events)
        self._integrator.dtime = time
        self._integrator.state[:] = state

    def _bound_of_turn(self, before: np.ndarray, time: Scalar) -> float:
        """Bound of a step just taken within which turns can be continued: series of many terms go far."""
        if not self._functions.unturned:
            return math.inf
        pars = self._pars(self._functions.unturned)  # the engine has fewer where it slides
        after = np.array(self.state), self.time
        rates = [self._functions.rate(*there, pars) for there in ((before, time), after)]
        return MOST / max(sum(rates) / 2, 1e-300)

    def _width(self, time: Scalar) -> Scalar:
        size = _WIDTH * self._epsilon * max(abs(float(time)), 1.0)
        return self.precision.of_double(size)

    def _quieten(self) -> None:
        """Suppress events at the surface where the latest step ended, which found them."""
        time = self.time
        self.log.quiet_until = time + self._width(time) if self._crossed else None

    # --- roots that the engine doesn't stop at -----------------------------------------------------------

    def _moment(self, root: Root) -> tuple[tuple[Scalar, Scalar], bool]:
        """Time of a root in two numbers, and whether it is known from the surface's expression."""
        known = self._functions.moments[root[1]].near(root[0], self._modes)
        return known or (root[0], root[0] * 0), known is not None

    def _first_root(self, begun: tuple[Scalar, Scalar], before: np.ndarray) -> Root | None:
        """The first root where the step just taken leaves its side, from where it begun; None if none is."""
        engine = self._integrator
        end, after = engine.time, np.array(engine.state)
        states = [before, after]
        hidden = self._hidden(begun[0], end, self._modes)
        # known moments may differ by less than one number resolves
        roots = sorted([*self._roots, *hidden], key=lambda root: self._moment(root)[0])
        for n, (time, j, side) in enumerate(roots):
            if self._modes[j] == SLIDES or roots[n] in hidden:
                return roots[n]
            if side != -self._modes[j]:
                continue
            following = next((t for t, i, _ in roots[n + 1 :] if i == j), end)
            middle = time + (following - time) / 2
            look = self._look(engine.update_d_output(middle), middle)
            if float(look.u[j]) * side > self._functions.noise(look, j, states):
                return roots[n]
        return None

    def _missed(self, before: np.ndarray) -> int | None:
        """A surface on whose wrong side the step just taken ended, although the engine found no zero."""
        look = self._look(self.state, self.time, self._low)
        noises = self._functions.noises(look, [before, np.array(self.state)])
        for j, mode in enumerate(self._modes):
            wrong = abs(mode) < HELD and -mode * float(look.u[j]) > noises[j]
            if wrong and (self._cut is None or self._cut[0] != j):
                return j
        return None

    def _hidden(self, begin: Scalar, end: Scalar, modes: Sequence[int]) -> list[Root]:
        """Roots within a step that its polynomials may have missed."""
        middles = [moments.hidden(begin, end, modes) for moments in self._functions.moments]
        return [(middle, j, -modes[j]) for j, middle in enumerate(middles) if middle is not None]

    def _again(
        self,
        time: tuple[Scalar, Scalar],
        before: np.ndarray,
        size: Scalar,
        moment: tuple[Scalar, Scalar] | None,
    ) -> None:
        """Repeat the step just taken up to a root, or to its known moment."""
        engine, muted = self._integrator, self.log.muted
        self.log.muted = True
        try:
            engine.dtime = time
            engine.state[:] = before
            engine.step(size, write_tc=True)
            if moment is not None:
                engine.dtime = moment
        finally:
            self.log.muted = muted

    # --- surfaces -------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        """Find the sides at the start."""
        look = self._agree()
        on = self._lying_on(look, [self.state])
        if on:
            choice = self._at_rest(on, look) or self._chosen(on)
            if choice.modes is None:
                self._fail(on[0], f"the motion starts there, and {choice.why}")
                self._unsettled = self.failure
            else:
                self._take(choice)

    def _at_rest(self, on: list[int], look: SurfaceValues) -> Continuation | None:
        """How to continue if swings about two surfaces have decayed to rounding; None otherwise."""
        resting = np.abs(look.u.astype(np.float64)) <= self._functions.swing_noises(look, self.state)
        small = [i for i, mode in enumerate(self._modes) if i in on or abs(mode) >= HELD or resting[i]]
        if len(small) < 2:
            return None

        def at(sides: Mapping[int, int], state: np.ndarray, time: Scalar) -> SurfaceValues:
            return self._functions.look(state, time, self._parameters(dict(sides)))

        meeting = Meeting(at, self._functions, np.array(self.state), self.time, self._epsilon)
        kept = {j: self._modes[j] for j in (*self._along, *self._held)}
        return meeting.rest(sorted({*small, *kept}), kept)

    def _keep_to_surfaces(self) -> None:
        """Remove the rounding that moved the state off the surfaces along which it slides."""
        state = self._integrator.state
        look = self._look(state, self.time, self._low)
        for j in (*self._along, *self._held):
            gradient = look.gradients[j]
            square = sum((g * g for g in gradient), gradient[0] * 0)
            if square != 0:
                state[:] = state - (look.u[j] / square) * gradient

    def _lying_on(self, look: SurfaceValues, states: list[np.ndarray]) -> list[int]:
        """Surfaces whose arguments are zero but for rounding of these states."""
        near = np.abs(look.u.astype(np.float64)) <= self._functions.noises(look, states)
        return [int(j) for j in np.flatnonzero(near)]

    @property
    def _window(self) -> float:
        """Time (internal units) within which ``_MOST_SWITCHES`` count as an accumulation."""
        return _MOST_SWITCHES * min(_SHORTEST, (_ROUNDINGS * self._epsilon) ** 0.5)

    def _counts(self, now: float) -> bool:
        """Count a switch; False if they accumulate."""
        if now - self._since > self._window:
            self._since, self._count = now, 0
        self._count += 1
        return self._count <= _MOST_SWITCHES

    def _arrive(self, j: int, side: int, states: list[np.ndarray], again: bool) -> bool:
        """Continue from a surface (``again``: as the step began); False if that is impossible."""
        self._crossed = j + 1
        if not self._counts(float(self.time)):
            return self._fail(j, f"its sides changed more than {_MOST_SWITCHES} times in almost no time")
        if self._modes[j] == SLIDES:
            self._modes[j] = side
            for i, (by, sign) in self._held.items():
                if by == j:
                    self._modes[i] = sign * side
            self._enter()
            return True
        look = self._look(self.state, self.time, self._low)
        on = [j, *self._along, *self._held]
        on += [i for i in self._lying_on(look, states) if i not in on]
        moments = [i for i in on if self._functions.moments[i].of_time]
        alone = len(moments) == 1
        if (again or not alone) and any(self._unresolved(i, alone) for i in moments):
            why = (
                f"something so strong changes that two numbers of {self.precision.name} precision don't tell "
                "its impulse"
            )
            return self._fail(j, why, _NOT_RESOLVED)
        choice = self._at_rest(on, look) or self._chosen(on, hint=(j, side))
        if choice.modes is None:
            return self._fail(j, choice.why)
        self._take(choice)
        return True

    def _unresolved(self, j: int, alone: bool) -> bool:
        """Whether the change of the field on a surface matters even for what two numbers leave out of its
        moment. Where something ends alone the state tells its impulse, by which the rest is judged; where it
        begins, nothing is known yet.
        """
        before, after = (
            self._functions.look(self.state, self.time, self._parameters({j: side * self._modes[j]})).field
            for side in (1, -1)
        )
        if alone and float(np.abs(after).max()) > float(np.abs(before).max()):
            return False
        change = max(abs(float(x)) for x in after - before)
        size = max(1.0, *(abs(float(x)) for x in self.state))
        allowed, time = _MOST_LEFT_OUT * self._epsilon * size, self._integrator.dtime
        if change * self._epsilon**2 * abs(float(time[0])) <= allowed:
            return False
        return change * self._functions.moments[j].left_out(time, self._modes) > allowed

    def _agree(self, known: Collection[int] = ()) -> SurfaceValues:
        """Put all surfaces except the known ones on the sides where the state lies, since an argument that
        reads another surface's side jumps with it; returns the last look.
        """
        for _ in range(len(self._modes) + 1):
            look, changed = self._look(self.state, self.time, self._low), False
            noises = self._functions.noises(look, [self.state])
            for j, mode in enumerate(self._modes):
                u = float(look.u[j])
                beyond = mode * u < 0 and abs(u) > noises[j]
                if beyond and j not in known and abs(mode) < HELD:
                    self._modes[j], changed = -mode, True
            if not changed:
                break
        return look

    def _take(self, choice: Continuation) -> None:
        assert choice.modes is not None
        for j, mode in choice.modes.items():
            self._modes[j] = mode
        self._agree(choice.modes)
        self._enter()
        if self._along:
            self._keep_to_surfaces()

    def _chosen(self, on: list[int], hint: tuple[int, int] | None = None) -> Continuation:
        """How to continue from the surfaces on which the state lies."""

        def at(sides: dict[int, int]) -> SurfaceValues:
            return self._functions.look(self.state, self.time, self._parameters(sides))

        moving = [j for j in on if hint is not None and j == hint[0]]
        for j in on:
            if j not in moving and j not in Fields(at, self._functions, [j]).tangential_surfaces():
                moving.append(j)
        idle = {j: self._modes[j] or 1 for j in on if j not in moving}
        if not moving:
            return self._by_trial(idle)
        crossed = (
            crossings(at, self._functions, {j: self._modes[j] or 1 for j in moving})
            if len(moving) > MOST_AT_ONCE
            else {}
        )
        moving = [j for j in moving if j not in crossed]
        if len(moving) > MOST_AT_ONCE:
            return Continuation(None, f"more than {MOST_AT_ONCE} surfaces meet there")
        if not moving:
            return Continuation({**idle, **crossed})
        choice = Fields(lambda sides: at({**crossed, **sides}), self._functions, moving).choose()
        if choice.modes is not None:
            return Continuation({**idle, **crossed, **choice.modes})
        if not choice.tangential or hint is None or hint[0] in crossed:
            return choice
        # touched: rounding hides the rates, but the step was seen to reach the other side
        return Continuation({**idle, **crossed, **{j: self._modes[j] for j in moving}, hint[0]: hint[1]})

    def _by_trial(self, idle: dict[int, int]) -> Continuation:
        """At rest on a surface, find by trial the side on which a step stays on its own."""
        modes = dict(idle)
        for j in idle:
            kept = []
            for side in (1, -1):
                self._modes[j] = side
                moved = self._moved(j)
                if moved == 0 or moved == side:
                    kept.append(side if moved else 0)
            self._modes[j] = idle[j]
            if kept == [1, -1]:
                return Continuation(None, "it could leave it to either side")
            if not kept:
                return Continuation(None, "both sides lead back to it with growing speed")
            modes[j] = kept[0] or idle[j]
        return Continuation(modes)

    def _moved(self, j: int) -> int:
        """The side of a surface to which a trial step leads, by a copy of the engine; 0 for none."""
        engine, before = self._integrator, np.array(self.state)
        muted, self.log.muted = self.log.muted, True
        self._integrator = trial = copy.deepcopy(engine)
        try:
            self._set()
            begin = trial.time
            self._natural(self._meet(), self._longest)
            found = self._cut[1] if self._cut is not None and self._cut[0] == j else 0
            for part in (1 / 16, 1 / 2, 1.0):
                then = begin + self.precision.of_double(part) * (trial.time - begin)
                look = self._look(np.array(trial.update_d_output(then)), then)
                if abs(float(look.u[j])) > self._functions.noise(look, j, [before, np.array(trial.state)]):
                    return 1 if look.u[j] > 0 else -1
            return found
        finally:
            self._integrator, self.log.muted = engine, muted
            self._roots.clear()

    def _fail(self, j: int, why: str, what_to_do: str = "") -> bool:
        surface = self.system.plan.surfaces.found[j]
        what_to_do = what_to_do or surface.remedy
        self.failure = f'at the kink or jump of "{surface.text}" ({surface.where}) {why}; {what_to_do}'
        return False


def _scalars(precision: Precision, numbers: list[float]) -> np.ndarray:
    """Numbers of a precision."""
    if issubclass(precision.scalar, float | np.floating):
        return np.array(numbers, dtype=precision.scalar) + 0
    return np.array([precision.of_double(x) for x in numbers], dtype=precision.scalar)


def stepper_of(
    system: System,
    precision: Precision,
    tolerance: Scalar | None,
    start: Scalar,
    log: EventLog | None = None,
) -> TaylorStepper:
    """The stepper of a system: a plain one, unless the system switches sides; tolerance None stands for the
    precision's epsilon, and without a log no events are looked for.
    """
    kind = SwitchingStepper if system.switches else TaylorStepper
    return kind(system, precision, tolerance, start, log)
