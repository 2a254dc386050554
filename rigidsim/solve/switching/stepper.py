"""Steps that end on switching surfaces: no step passes over a kink or a jump.

The engine itself ends a step where the argument of a surface vanishes. The event's callback sets the new
side, a parameter of the equations, and the engine goes on: many steps in one call. After the call all
boundaries are looked at together. The first step that isn't plain, as where both sides push onto a surface,
surfaces meet, or a side is wrong because a zero was missed, is taken back with all that follow, and taken by
itself: the fields of all sides decide how the motion goes on from its end. Whether a step is plain depends on
that step alone, and a plain one by itself has the same bits; so these don't depend on how many steps are
taken at once.

The engine would find the zero at which a step begins again and again, in place of those that follow. So an
event watches for the argument's way out of the side that the motion is on, never for its way in: a clear
crossing leaves the surface behind. Where the argument stays zero but for rounding, its event watches the sum
with a parameter, a rounding on that side. Then no cooldown is needed, and a boundary holds all that later
steps depend on.

Surfaces that depend on time alone are crossed at moments known as written, where steps end
(``rigidsim.solve.switching.moments``). The turns of angles and the sign of the quaternion, where an
expression depends on them, are parameters of the equations, continued from step to step; along surfaces the
motion has separate equations, compiled when they are first needed. Both take single steps.
"""

from __future__ import annotations

import copy
import math
from bisect import bisect_left
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.compiled import TaylorEngine, interruptible
from rigidsim.solve.events import BESIDE, EventLog, engine_events, of_order_one
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.requirements import SetAtKnots, StepCallback
from rigidsim.solve.stepper import Mark, SamplesWithin, bound_of_sparse_series, may_be_sparse
from rigidsim.solve.switching.moments import Moments, between
from rigidsim.solve.switching.sides import (
    SLIDES,
    Continuation,
    Fields,
    SurfaceFunctions,
    SurfaceValues,
    crossings,
    one,
)
from rigidsim.solve.switching.sliding import MOST_AT_ONCE, sliding
from rigidsim.solve.switching.turned import MOST, Turned
from rigidsim.solve.taylor_stepper import TaylorStepper

_ATTEMPTS = 32  # at one step that begins on a surface
_MISTAKEN = 2.0**10  # roundings of an argument from which on the engine can't have found its zero
_FAR_OFF = 2.0**100  # within the range of single precision
_FIRST_AHEAD, _MOST_AHEAD = 64, 1024  # steps that are looked at together: some MB of series
_MOST_SWITCHES = 256
"""Switches at intervals shorter than ``_SHORTEST`` that count as an accumulation, or as swings kept up by
rounding, whose period is the square root of its size.
"""
_SHORTEST = 2.0**-8  # internal units of time; with more digits less, see ``_window``
_ROUNDINGS = 2.0**15  # in the square of an interval
_MOST_LEFT_OUT = 8.0  # roundings of the state, by a moment in two numbers
_NOT_RESOLVED = "choose a higher precision, or count time from an epoch shortly before"
_WIDTH = 2.0**8  # roundings of a time between two findings of the same crossing


class _Passed(NamedTuple):
    """A boundary that was passed among many, with what its step may have to be taken back for.

    Attributes:
        crossed: the surface on which the step ended; -1 for none.
        switches: number and begin of the switches that may accumulate.
        samples: number of samples taken up to here.
        size: of the step, which may be negative.
        series: the later half of the Taylor coefficients of the step, if it began on a surface.
    """

    time: tuple[Scalar, Scalar]
    events: int
    crossed: int
    switches: tuple[int, float]
    samples: int
    size: Scalar
    series: np.ndarray | None


class SwitchingStepper(TaylorStepper):
    """Stepper of a system with surfaces, or with angles whose turns matter; it begins where motion leads."""

    version = 3
    single_steps = True

    def __init__(
        self,
        system: System,
        precision: Precision,
        tolerance: Scalar | None,
        start: Scalar,
        log: EventLog | None = None,
    ) -> None:
        self._cut: tuple[int, int] | None = None  # surface on which the engine ended it, and the new side
        self._passed: list[_Passed] | None = None  # boundaries, while many steps are taken
        self._states = precision.zeros((_MOST_AHEAD + 1, len(system.states)))  # there, after where they begin
        self._halted = self._fresh = False
        self._ahead = _FIRST_AHEAD
        self._functions_by_chart: dict[int, SurfaceFunctions] = {}
        self._chart = 0
        self._moments = Moments(system, precision)
        self._modes = [1] * len(system.surfaces)
        self._free = np.array([j not in self._moments.timed for j in range(len(self._modes))], dtype=bool)
        # number from 1 of the surface where the latest step ended, negative after a clear crossing
        self._crossed, self._count, self._since = 0, 0, 0.0
        shortest = min(_SHORTEST, (_ROUNDINGS * float(precision.epsilon)) ** 0.5)
        self._window = _MOST_SWITCHES * shortest  # within which so many switches are an accumulation
        self._count_of_pars = system.parameters  # without what is added to events
        self._piece: np.ndarray | None = None  # parameters of the piece in which the latest step was
        self._now = np.zeros(0)  # parameters that sides and equations read, all of them, where steps begin
        self._off, self._signs = precision.of_double(0.0), precision.of_doubles(np.array([-1.0, 1.0]))
        self._narrow = np.array([self._moments.may_mistake(j) for j in range(len(self._modes))], dtype=bool)
        self._offset_size = 2.0 ** (-precision.bits - BESIDE)
        self._usual = [self._offset_size] * len(self._modes) + [0.0] * len(system.crossings)
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
    def _functions(self) -> SurfaceFunctions:
        if self._chart not in self._functions_by_chart:
            system = self._system_of(self._chart)
            self._functions_by_chart[self._chart] = interruptible(
                lambda: SurfaceFunctions(system, self.precision, self._moments)
            )
        return self._functions_by_chart[self._chart]

    def mark(self) -> Mark:
        self._kick()
        engine, turned = self._integrator, self._turned
        sides = *self._modes, *turned.angles, *turned.quaternion, self._crossed, self._count, self._since
        memory = self._tiny, sides
        return Mark(engine.dtime, np.array(engine.state), len(self.log.found), self.steps, memory)

    def _back_among(self, begun: Mark, passed: list[_Passed]) -> None:
        """Return to the last of some boundaries that were passed among many, or to where they begin."""
        if not passed:
            return self.back_to(begun)
        last, (tiny, sides) = passed[-1], begun.memory
        modes = list(sides[: len(self._modes)])
        for boundary in passed:
            if boundary.crossed >= 0:
                modes[boundary.crossed] *= -1
        memory = tiny, (*modes, *sides[len(modes) : -3], -(last.crossed + 1), *last.switches)
        state, steps = self._states[len(passed)].copy(), begun.steps + len(passed)
        return self.back_to(Mark(last.time, state, last.events, steps, memory))

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

    def _take_sides(self) -> None:
        # the state lies next to surfaces that it slid along
        self._modes = [mode or 1 for mode in self._modes]
        self._take_known_sides()
        self._agree()
        self._enter()

    # --- engines --------------------------------------------------------------------------------------------

    def _compiled(self, system: System) -> TaylorEngine:
        equations, along, more = system.equations, self._along, dict[str, Any]()
        outwards = [hy.par[j] * u + hy.par[system.parameters + j] for j, u in enumerate(system.surfaces)]
        arguments = enumerate(of_order_one(system, outwards, system.surfaces))
        ends = [self._event(u, j) for j, u in arguments if self._free[j] and j not in along]
        noted = []
        if along:
            found = sliding(system, along)
            equations, more = found.equations, {"compact_mode": True} if len(along) > 1 else {}
            for j, side in zip(along, found.sides, strict=True):
                ends.append(self._event(side - 1.0, j, 1, hy.event_direction.positive))
                ends.append(self._event(side + 1.0, j, -1, hy.event_direction.negative))
        if self.has_events:
            offsets = system.parameters + len(system.surfaces)
            noted = engine_events(system, self.precision, self.log, offsets=offsets)
        return self._engine_of(system, equations, t_events=ends, nt_events=noted, **more)

    def _event(
        self, u: hy.expression, j: int, end: int = 0, way: hy.event_direction = hy.event_direction.negative
    ) -> hy.t_event:
        """The event that ends steps on a surface, or the motion along it."""

        def called(engine: TaylorEngine, _: int) -> bool:
            self._cut = j, end or -self._modes[j]
            if self._passed is None:
                return False
            self._halted = self._halted or not self._crosses(engine, j)
            return not self._halted

        return hy.t_event(
            u, callback=called, direction=way, cooldown=self._off, fp_type=self.precision.scalar
        )

    # --- parameters -----------------------------------------------------------------------------------------

    def _pars(
        self, turns: list[float], over: dict[int, int] | None = None, low: Scalar | None = None
    ) -> np.ndarray:
        """Parameters of the equations; turns of angles, and the sign of the quaternion, are given."""
        modes = self._modes if over is None else [over.get(j, mode) for j, mode in enumerate(self._modes)]
        sides = [-1.0 if mode < 0 else 1.0 for mode in modes]
        numbers, scalars = [*sides, *turns], self.precision.of_doubles
        if (pieces := self.system.pieces) is not None:
            if self._piece is None:  # of those that meet at a boundary, the one that ends there
                self._piece = self._piece_of(bisect_left(pieces.knots, self.time))
            numbers += [0.0] * (self.system.first_of_pieces - len(numbers))
            return np.concatenate([scalars(np.array(numbers) + 0.0), self._piece])
        pars = scalars(np.array(numbers) + 0.0)
        if not self._functions.clocked:
            return pars
        return np.concatenate([pars, np.array([self._off if low is None else low], dtype=pars.dtype)])

    def _piece_of(self, number: int) -> np.ndarray:
        assert self.system.pieces is not None
        return self.system.pieces.parameters(number)

    def _meet(self) -> Scalar | None:
        """Continue with the piece of the equations that begins here, if one does."""
        self._kick()
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
        """The surfaces in a state of the latest step, at a time in one number or two."""
        return self._functions.look(state, time, self._pars(self._joined(state, time), low=low))

    def _plain(self, state: np.ndarray, time: Scalar) -> tuple[list[float], list[float]]:
        """Angles within one turn, and the quaternion without its sign, that expressions read."""
        return self._functions.plain(state, time, self._pars(self._functions.unturned))

    def _joined(self, state: np.ndarray, time: Scalar) -> list[float]:
        """Turns and sign, continued from the latest step on to a state."""
        return self._turned.parameters(*self._plain(state, time)) if self._functions.unturned else []

    def _follow(self) -> None:
        """Continue angles and quaternion to the end of the step just taken."""
        if self._functions.unturned:
            self._turned = self._turned.followed(*self._plain(self.state, self.time))

    def _set(self, muted: Collection[int] = ()) -> None:
        """Set the parameters of the equations, and what is added to events, at this boundary.

        An event of the config that lies there, and was found on the way to it, watches the zero of its sum
        with next to nothing.
        """
        engine, pars = self._integrator, self._parameters()
        look = self._functions.look(self.state, self.time, pars)
        # the change of the state in a unit of time shows its size
        near = np.abs(look.u) <= look.noises(self.state, look.field.T)
        moved = self._usual[: len(self._modes)]
        for j in np.flatnonzero(self._free).tolist():
            if (near[j, 0] or j + 1 == self._crossed) and j + 1 != -self._crossed:
                moved[j] = float(look.beside(self.state)[j])
        for j in muted:
            moved[j] = _FAR_OFF
        if self.has_events:
            moved += [
                self._event_offset(value, noise)
                for value, noise in self._functions.crossings(*one(self.state, self.time, pars))[..., 0].T
            ]
        everything = np.concatenate([pars, self.precision.of_doubles(np.array(moved))])
        engine.pars[:] = everything[: len(engine.pars)]  # those that nothing reads have no meaning
        self._now = pars

    def _event_offset(self, value: float, noise: float) -> float:
        """Offset to add to an event's expression."""
        if self._along and abs(value) <= noise:  # it is zero all along the surface and crosses nothing
            return 2 * noise
        return self._offset_size if self._crossed and value == 0 else 0.0

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
                if not self.step():
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
        if self._unsettled or self._functions.unturned or self.watcher is not None or self._along:
            return True
        knot = self._moments.following(self._integrator.dtime)
        return knot is not None and bool(knot[0] <= self.time)

    def _together(self, most: int, samples: SamplesWithin | None) -> bool:
        """Take several plain steps; returns whether the one that follows has to be taken by itself."""
        until = self._meet()
        self._set()
        self._quieten(self.time if self._crossed else None)
        engine, begun, known = self._integrator, self.mark(), 0 if samples is None else len(samples.states)
        self._passed, self._cut, self._halted = [], None, False
        self._fresh = bool(self._crossed) or not self.steps
        knot = self._moments.following(engine.dtime)
        ends = [x for x in (until, None if knot is None else knot[0]) if x is not None]
        try:
            outcome, *_ = engine.propagate_until(
                min(ends, default=self._far),
                max_steps=most,
                max_delta_t=self._longest,
                callback=self._noting(self._passed, knot, samples),
                write_tc=True,
            )
        finally:
            passed, self._passed = self._passed, None
        if passed:
            self.steps, self._crossed = self.steps + len(passed), -(passed[-1].crossed + 1)
        kept, alone = self._holding(begun, passed)
        alone = alone or (kept == len(passed) and (self._halted or outcome == hy.taylor_outcome.err_nf_state))
        self._ahead = min(4 * self._ahead, _MOST_AHEAD) if kept == len(passed) else max(kept, 1)
        if alone or kept < len(passed):
            self._back_among(begun, passed[:kept])
            if samples is not None:
                samples.back_to(passed[kept - 1].samples if kept else known)
        if kept:
            sizes = [abs(float(one.size)) for one in passed[:kept]]
            self.smallest, self.largest, self._dense = min(sizes), max(sizes), engine
            self._judge(begun.time[0], kept)
            self._hold()
        return alone

    def _crosses(self, engine: TaylorEngine, j: int) -> bool:
        """Go on beyond a surface on which a step ended among many; False if that has to be looked into."""
        if not self._counts(float(engine.time)):
            return False
        side = self._modes[j] = -self._modes[j]
        engine.pars[j] = self._signs[int(side > 0)]
        self._quieten(engine.time)
        return True

    def _noting(
        self, passed: list[_Passed], knot: tuple[Scalar, Scalar] | None, samples: SamplesWithin | None
    ) -> StepCallback:
        """What notes each boundary among many; with few look-ups, as a step takes some ten times as long."""
        engine, first, found, states = self._integrator, self._count_of_pars, self.log.found, self._states
        # views that follow the engine
        state, pars, series = engine.state, engine.pars, engine.tc[:, engine.order // 2 + 1 :]
        states[0], dense = state, engine.update_d_output
        clocked = self._functions.clocked and self.system.pieces is None and len(pars) >= first
        taken, upcoming = (0, None) if samples is None else (len(samples.states), samples.upcoming)
        added, quiet = pars[first:], not self.has_events
        usual = self.precision.of_doubles(np.array(self._usual[: len(added)]))

        def note(engine: TaylorEngine) -> bool:
            nonlocal taken, upcoming
            time, cut, going = engine.dtime, self._cut, True
            if knot is not None and (time >= knot or time[0] >= knot[0]):
                self._halted = True
            if self._halted:
                return False
            if not passed:  # what was near where the steps began
                added[:] = usual
            if clocked:
                pars[first - 1] = time[1]
            if samples is not None and (upcoming is None or time[0] >= upcoming):
                going = samples.passed(time[0], dense)
                taken, upcoming = len(samples.states), samples.upcoming
            crossed, switches = -1 if cut is None else cut[0], (self._count, self._since)
            kept = series.copy() if self._fresh else None
            held = time, len(found), crossed, switches, taken, engine.last_h, kept
            passed.append(tuple.__new__(_Passed, held))  # a third of the time of _Passed(...)
            states[len(passed)] = state
            if cut is None and not quiet:
                self._quieten(None)
            self._cut, self._fresh = None, cut is not None
            return going

        return note

    def _holding(self, begun: Mark, passed: list[_Passed]) -> tuple[int, bool]:
        """How many of the boundaries hold, and whether the step after these has to be taken by itself.

        After a boundary where something other than the surface crossed is zero but for rounding, the
        parameters have to be set anew.
        """
        if not passed:
            return 0, False
        both, _, cut, _, _, sizes, kept = zip(*passed, strict=True)
        before, here = self._states[: len(passed)], self._states[1 : len(passed) + 1]
        times, crossed = np.array([x for x, _ in both]), np.array(cut)
        rows = np.flatnonzero(crossed >= 0)
        j, each, flips = crossed[rows], np.arange(len(rows)), np.ones((len(passed), len(self._modes)))
        flips[rows, j] = -1.0
        sides = np.array(begun.memory[1][: len(self._modes)]) * np.cumprod(flips, axis=0)
        pars = np.repeat(self._now[None], len(passed), axis=0)
        pars[:, : len(self._modes)] = self._signs[(sides > 0).astype(int)]
        if self._functions.clocked and self.system.pieces is None:
            pars[:, -1] = [low for _, low in both]
        look = self._functions.looks(here, times, pars)
        size, widths = np.abs(look.u), look.noises(before, here, look.field.T)
        others = self._free[:, None] & (np.arange(sides.shape[1])[:, None] != crossed)
        near, wrong = (others & (size <= widths)).any(axis=0), others & (sides.T * look.u < 0)
        bad = (wrong & (size > look.noises(here))).any(axis=0) if wrong.any() else np.zeros_like(near)
        if len(rows):
            flipped = pars[rows]
            flipped[each, j] = -flipped[each, j]
            beyond = self._functions.looks(here[rows], times[rows], flipped)
            least = sides[rows, j] * np.array([look.rates[j, rows], beyond.rates[j, each]])
            noise = np.maximum(look.rate_noises[j, rows], beyond.rate_noises[j, each])
            there = ~self._narrow[j] | (size <= _MISTAKEN * widths)[j, rows]
            bad[rows] |= near[rows] | ~(there & (least.min(axis=0) > noise))
            if self.has_events:
                value, width = self._functions.crossings(here[rows], times[rows], pars[rows])
                bad[rows] |= (np.abs(value) <= width).any(axis=0)
        if fresh := [row for row, series in enumerate(kept) if series is not None]:
            order = self._integrator.order
            maybe = may_be_sparse(before[fresh], np.array([kept[row] for row in fresh]), order)
            for row in np.array(fresh)[maybe].tolist():
                series = np.zeros((before.shape[1], order + 1), dtype=before.dtype)
                series[:, 0], series[:, order // 2 + 1 :] = before[row], kept[row]
                bad[row] |= bound_of_sparse_series(series) < abs(float(sizes[row]))
        first = int(np.argmax(bad)) if bad.any() else len(passed)
        again = int(np.argmax(near)) + 1 if near.any() else len(passed)
        return min(first, again), first < again and first < len(passed)

    # --- one step -------------------------------------------------------------------------------------------

    def dense(self, time: Scalar) -> np.ndarray:
        return np.array(self._dense.update_d_output(time))

    def step(self) -> bool:
        """Take a step by itself, not past a surface, and decide how the motion goes on from its end; False if
        lost, or if it can't go on (``failure`` says why).
        """
        if self._unsettled:
            self.failure = self._unsettled
            return False
        until = self._meet()
        self._watched()
        self._quieten(self.time if self._crossed else None)
        events, longest, muted = len(self.log.found), self._longest, set[int]()
        for attempt in range(self.precision.bits + _ATTEMPTS):
            engine = self._integrator
            self._set(muted)
            time, before = engine.dtime, np.array(engine.state)
            knot = self._moments.following(time)
            left = longest if knot is None else between(time, knot)
            finite = self._natural(until, min(longest, left))
            bound = bound_of_sparse_series(engine.tc) if self._crossed or not self.steps else np.inf
            bound = min(bound, self._bound_of_turn(before, time[0]))
            if bound < abs(float(engine.last_h)):
                self._return(time, before, events)
                finite = self._natural(until, self.precision.of_double(bound))
            if not finite:
                return False
            size = engine.last_h
            reached = knot if self._cut is None and size >= left else None
            if reached is not None:
                engine.dtime = reached
            missed, mistaken = self._wrong(before)
            if missed is None and mistaken is None:
                break
            self._return(time, before, events)
            if mistaken is not None:
                muted.add(mistaken)
            elif attempt < self.precision.bits:  # the engine finds its zero in a shorter step
                longest = size / 2
            elif missed is not None and not self._arrive(missed, -self._modes[missed], before):
                return False  # it left its side at once
        else:
            return self._fail(missed or 0, "it turns back to it again and again")
        cut = self._cut
        if (cut is not None or reached is not None) and self.has_events:
            self._note_events(before, time[0], events)
        self._dense = engine
        self.smallest = self.largest = abs(float(size))
        self.steps += 1
        self._judge(time[0], 1)
        self.ended = self.watcher is not None and not self.watcher(engine)
        self._follow()
        self._crossed = 0
        if cut is not None and not self._arrive(*cut, before):
            return False
        if reached is not None and not self._pass_knot(reached, before):
            return False
        if self._along:
            self._keep_to_surfaces()
        self._hold()
        return True

    def _note_events(self, before: np.ndarray, begun: Scalar, known: int) -> None:
        """Note events that lie on the surface where the step ended, before the engine found them."""
        found, width = self.log.found[known:], self._width(self.time)
        noted = {event.index for event in found if event.time >= self.time - width}
        pars = self._parameters()
        states, times = np.array([before, self.state]), np.array([begun, self.time], dtype=before.dtype)
        values, noises = self._functions.crossings(states, times, np.array([pars, pars]))
        crossed = (np.abs(values[:, 1]) <= noises[:, 1]) & (noises[:, 1] < np.abs(values[:, 0]))
        for i in np.flatnonzero(crossed).tolist():
            if (
                i not in noted
                and not self.system.crossings[i].known
                and self.system.crossings[i].direction * values[i, 0] <= 0
            ):
                self.log.note(i, self.time, self.state)

    def _natural(self, until: Scalar | None, longest: Scalar) -> bool:
        """Take a natural step, which may end on a surface, from where the parameters are set."""
        engine = self._integrator
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
        rates = [self._functions.spin(*there, pars) for there in ((before, time), after)]
        return MOST / max(sum(rates) / 2, 1e-300)

    def _width(self, time: Scalar) -> Scalar:
        size = _WIDTH * self._epsilon * max(abs(float(time)), 1.0)
        return self.precision.of_double(size)

    def _quieten(self, crossed: Scalar | None) -> None:
        """Suppress events at the surface where the latest step ended, at this time, which found them."""
        if self.has_events:
            self.log.quiet_until = None if crossed is None else crossed + self._width(crossed)

    def _wrong(self, before: np.ndarray) -> tuple[int | None, int | None]:
        """A surface on whose wrong side the step just taken ended, although the engine found no zero; and one
        on which it ended although that isn't there, as for a function far narrower than the step.
        """
        look, here = self._look(self.state, self.time, self._low), -1 if self._cut is None else self._cut[0]
        wrong = -np.array(self._modes) * look.u[:, 0] > look.noises(before, self.state)[:, 0]
        missed = next((j for j in np.flatnonzero(wrong & self._free).tolist() if j != here), None)
        if not self._moments.may_mistake(here):
            return missed, None
        noise = look.noises(before, self.state, look.field.T)[here, 0]
        return missed, here if abs(look.u[here, 0]) > _MISTAKEN * noise else None

    # --- surfaces -------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        """Find the sides at the start."""
        self._take_known_sides()
        on = self._lying_on(self._agree(), self.state)
        if on and not self._continues(self._chosen(on), on[0], "the motion starts there, and "):
            self._unsettled = self.failure

    def _take_known_sides(self) -> None:
        for j, side in self._moments.sides(self._integrator.dtime).items():
            self._modes[j] = side

    def _keep_to_surfaces(self) -> None:
        """Remove the rounding that moved the state off the surfaces along which it slides."""
        state = self._integrator.state
        u, gradients = self._functions.exact(state, self.time, self._parameters())
        for j in self._along:
            square = sum((g * g for g in gradients[j]), gradients[j][0] * 0)
            if square != 0:
                state[:] = state - (u[j] / square) * gradients[j]

    def _lying_on(self, look: SurfaceValues, *states: np.ndarray) -> list[int]:
        """Surfaces whose arguments are zero but for rounding of these states."""
        near = np.abs(look.u) <= look.noises(*states)
        return [int(j) for j in np.flatnonzero(near[:, 0] & self._free)]

    def _counts(self, now: float) -> bool:
        """Count a switch; False if they accumulate."""
        if now - self._since > self._window:
            self._since, self._count = now, 0
        self._count += 1
        return self._count <= _MOST_SWITCHES

    def _arrive(self, j: int, side: int, before: np.ndarray) -> bool:
        """Continue from a surface on which a step ended; False if that is impossible."""
        self._crossed = j + 1
        if not self._counts(float(self.time)):
            return self._fail(j, f"its sides changed more than {_MOST_SWITCHES} times in almost no time")
        if self._modes[j] == SLIDES:
            self._modes[j] = side
            self._enter()
            return True
        look = self._look(self.state, self.time, self._low)
        on = list(dict.fromkeys([j, *self._along, *self._lying_on(look, before, self.state)]))
        if on == [j] and Fields(self._at, on).crossed(side):
            self._crossed = -self._crossed
        return self._continues(self._chosen(on, hint=(j, side)), j)

    def _pass_knot(self, knot: tuple[Scalar, Scalar], before: np.ndarray) -> bool:
        """Continue from a moment known as written; False if that is impossible."""
        for off, earlier, later in self._moments.passed(knot):
            changed = [j for j, side in later.items() if side != earlier[j]]
            if changed and self._unresolved(off, earlier, later):
                what = f"two numbers of {self.precision.name} precision don't resolve its impulse"
                return self._fail(changed[0], f"something so strong changes that {what}", _NOT_RESOLVED)
        self._take_known_sides()
        self._crossed = self._moments.timed[0] + 1 if self._moments.timed else 0
        on = [*self._along, *self._lying_on(self._agree(), before, self.state)]
        return not on or self._continues(self._chosen(list(dict.fromkeys(on))), on[0])

    def _unresolved(self, off: float, earlier: Mapping[int, int], later: Mapping[int, int]) -> bool:
        """Whether the change of the field at a moment matters even for what two numbers leave out of it.

        Where something ends the state shows its impulse, by which the rest is judged; where it begins,
        nothing is known yet.
        """
        fields = [self._at(sides).field for sides in (earlier, later)]
        if np.abs(fields[1]).max() > np.abs(fields[0]).max():
            return False
        size = max(1.0, *(abs(float(x)) for x in self.state))
        return bool(np.abs(fields[1] - fields[0]).max() * off > _MOST_LEFT_OUT * self._epsilon * size)

    def _at(self, sides: Mapping[int, int]) -> SurfaceValues:
        """The surfaces here, with other sides than those that the motion is on."""
        return self._functions.look(self.state, self.time, self._parameters(dict(sides)))

    def _continues(self, choice: Continuation, j: int, so: str = "") -> bool:
        """Take the way to continue that was found; False if there is none."""
        if choice.modes is None:
            return self._fail(j, so + choice.why)
        for i, mode in choice.modes.items():
            self._modes[i] = mode
        self._agree(choice.modes)
        self._enter()
        if self._along:
            self._keep_to_surfaces()
        return True

    def _agree(self, known: Collection[int] = ()) -> SurfaceValues:
        """Put all surfaces except the known ones on the sides where the state lies, since an argument that
        reads another surface's side jumps with it; returns the last look.
        """
        for _ in range(len(self._modes) + 1):
            look, changed = self._look(self.state, self.time, self._low), False
            wrong = -np.array(self._modes) * look.u[:, 0] > look.noises(self.state)[:, 0]
            for j in np.flatnonzero(wrong & self._free).tolist():
                if j not in known:
                    self._modes[j], changed = -self._modes[j], True
            if not changed:
                break
        return look

    def _chosen(self, on: list[int], hint: tuple[int, int] | None = None) -> Continuation:
        """How to continue from the surfaces on which the state lies."""

        moving = [j for j in on if hint is not None and j == hint[0]]
        moving += [j for j in on if j not in moving and j not in Fields(self._at, [j]).tangential]
        tangential = {j: self._modes[j] or 1 for j in on if j not in moving}
        if not moving:
            return self._by_trial(tangential)
        crossed = {}
        if len(moving) > MOST_AT_ONCE:
            crossed = crossings(self._at, {j: self._modes[j] or 1 for j in moving})
        moving = [j for j in moving if j not in crossed]
        if len(moving) > MOST_AT_ONCE:
            return Continuation(None, f"more than {MOST_AT_ONCE} surfaces meet there")
        if not moving:
            return Continuation({**tangential, **crossed})
        choice = Fields(lambda sides: self._at({**crossed, **sides}), moving).choose()
        if choice.modes is not None:
            return Continuation({**tangential, **crossed, **choice.modes})
        if not choice.tangential or hint is None or hint[0] in crossed:
            return choice
        # touched: rounding hides the rates, but the step was seen to reach the other side
        return Continuation(
            {**tangential, **crossed, **{j: self._modes[j] for j in moving}, hint[0]: hint[1]}
        )

    def _by_trial(self, tangential: dict[int, int]) -> Continuation:
        """At rest on a surface, find by trial the side on which a step stays on its own."""
        modes = dict(tangential)
        for j in tangential:
            kept = []
            for side in (1, -1):
                self._modes[j] = side
                moved = self._moved(j)
                if moved == 0 or moved == side:
                    kept.append(side if moved else 0)
            self._modes[j] = tangential[j]
            if kept == [1, -1]:
                return Continuation(None, "it could leave it to either side")
            if not kept:
                return Continuation(None, "both sides lead back to it with growing speed")
            modes[j] = kept[0] or tangential[j]
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
                if abs(look.u[j, 0]) > look.noises(before, trial.state)[j, 0]:
                    return 1 if look.u[j, 0] > 0 else -1
            return found
        finally:
            self._integrator, self.log.muted = engine, muted

    def _fail(self, j: int, why: str, what_to_do: str = "") -> bool:
        surface = self.system.plan.surfaces.found[j]
        what_to_do = what_to_do or surface.remedy
        self.failure = f'at the kink or jump of "{surface.text}" ({surface.where}) {why}; {what_to_do}'
        return False


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
