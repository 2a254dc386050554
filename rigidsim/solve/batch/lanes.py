"""Lanes of one batch integrator: members of a family, several at a time, from their start to the last sample.

A lane's bits depend neither on its neighbours nor on its place, but on the number of lanes, so that this is
recorded. If a state is no longer finite, heyoka stops all lanes at once: the others are repeated.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.solve.batch.lane_results import IDLE, Found, LaneResults, until_next
from rigidsim.solve.compiled import Kept
from rigidsim.solve.events import DIRECTIONS
from rigidsim.solve.step_bounds import bounds_of_sparse_series, longest_step

_GRID = 1 << 16
"""Samples at once; the step before the last of them is shortened, always at the same places."""
_ARRIVED, _LOST = hy.taylor_outcome.time_limit, hy.taylor_outcome.err_nf_state

_engines: Kept[Any] = Kept(16)


@dataclass(frozen=True)
class BatchSystem:
    """What a batch integrator is compiled from.

    Attributes:
        equations: equations over heyoka's variables and ``par``.
        events: expressions of the same, with directions.
        parameters: number of parameters that both read.
    """

    equations: Sequence[tuple[Any, Any]]
    events: Sequence[tuple[Any, int]]
    parameters: int
    tolerance: float | None
    compact: bool


def recommended_width() -> int:
    """Number of lanes that this processor handles at once in double precision."""
    return int(hy.recommended_simd_size())


@dataclass(frozen=True)
class _Motions:
    """Motions to be integrated: initial and parameters (.., n), start (n,), times (samples, n), and bounds of
    their steps (n,).
    """

    initial: np.ndarray
    parameters: np.ndarray
    start: np.ndarray
    times: np.ndarray
    longest: np.ndarray

    def of(self, which: Sequence[int]) -> _Motions:
        return _Motions(
            self.initial[:, which],
            self.parameters[:, which],
            self.start[which],
            self.times[:, which],
            self.longest[which],
        )


def _grouped(values: np.ndarray, width: int) -> np.ndarray:
    """Values (.., n) of motions as (groups, .., width), the last group filled with the last motion."""
    count = values.shape[-1]
    groups = -(-count // width)
    filled = values[..., np.minimum(np.arange(groups * width), count - 1)]
    split = filled.reshape(*values.shape[:-1], groups, width)
    return np.array(np.moveaxis(split, -2, 0), order="C")


class BatchEngine:
    """A compiled batch integrator of ``width`` lanes."""

    def __init__(self, system: BatchSystem, width: int) -> None:
        self.width = width
        self._system = system
        # recorded quantities may read more parameters than equations and events
        read = [right for _, right in system.equations] + [expression for expression, _ in system.events]
        self._used = max((int(str(p).removeprefix("p")) + 1 for p in hy.get_params(read)), default=0)
        self._log: list[Found] = []
        described = (
            system.equations,
            system.events,
            system.parameters,
            system.tolerance,
            system.compact,
            width,
        )
        if system.events:  # whose callbacks belong to this object
            self._integrator = self._compiled()
        else:
            self._integrator = _engines.get(described, self._compiled)
        self._longest = longest_step(self._integrator.order, np.float64)

    def _compiled(self) -> Any:
        system, width = self._system, self.width
        options: dict[str, Any] = {"compact_mode": system.compact}
        if system.tolerance is not None:
            options["tol"] = system.tolerance
        if self._used:
            options["pars"] = np.zeros((self._used, width))
        if system.events:
            options["nt_events"] = [
                hy.nt_event_batch(expression, self._noting(n), direction=DIRECTIONS[direction])
                for n, (expression, direction) in enumerate(system.events)
            ]
        states = np.zeros((len(system.equations), width))
        return hy.taylor_adaptive_batch(list(system.equations), states, **options)

    def _noting(self, event: int) -> Any:
        def called(integrator: Any, time: float, _: int, lane: int) -> None:
            state = integrator.update_d_output(np.full(self.width, time))[:, lane]
            self._log.append(Found(event, lane, float(time), np.array(state)))

        return called

    def run(
        self,
        initial: np.ndarray,
        parameters: np.ndarray,
        start: np.ndarray,
        times: np.ndarray,
        most_steps: int,
    ) -> LaneResults:
        """Integrate members to their last samples.

        Args:
            initial: (states, members); parameters likewise.
            start: (members,), times: (samples, members), internal units.
            most_steps: largest number of steps of a member.
        """
        count = initial.shape[1]
        result = LaneResults.empty(len(times), len(initial), count)
        motions = _Motions(initial, parameters, start, times, self.longest(initial, parameters, start))
        if len(times) <= 2 and bool((times[:-1] == start).all()) and bool((times[-1] > start).all()):
            if len(times) == 2:
                result.states[0] = initial
            result.states[-1] = np.nan  # of those that are lost on the way
            self._in_turn(result, motions, most_steps)
            return result
        for first in range(0, count, self.width):
            waiting = list(range(first, min(first + self.width, count)))
            while waiting:
                lost = self._together(result, waiting, motions, most_steps)
                if not lost or len(waiting) == 1:
                    break
                for member in lost:  # alone, so that it gets as far as possible
                    self._together(result, [member], motions, most_steps)
                waiting = [member for member in waiting if member not in lost]
        return result

    def longest(self, initial: np.ndarray, parameters: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Bounds of members' steps (members,), from all terms of the series at their start."""
        terms = self._integrator.tc  # (states, terms, lanes)
        still = np.zeros(self.width)
        sizes = []
        given = (_grouped(x, self.width) for x in (initial, parameters, start))
        for states, read, begin in zip(*given, strict=True):
            self._set(states, read, begin)
            self._integrator.step(still, write_tc=True)  # compute a series without moving
            sizes.append(np.abs(terms).max(axis=0))
        self._log.clear()
        found = np.concatenate(sizes, axis=1)[:, : len(start)]
        return np.minimum(bounds_of_sparse_series(found), self._longest)

    def onward(
        self,
        states: np.ndarray,
        parameters: np.ndarray,
        begin: np.ndarray,
        end: np.ndarray,
        longest: np.ndarray,
        most_steps: int,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """States (states, n) and times (n,) of motions at most so many steps later, internal units."""
        integrator, given = self._integrator, (states, parameters, begin, end, longest)
        there, read, then, ends, bounds = (_grouped(x, self.width) for x in given)
        taken = np.empty(then.shape)
        for group in range(len(there)):
            self._set(there[group], read[group], then[group])
            integrator.propagate_until(ends[group], max_steps=most_steps, max_delta_t=bounds[group])
            there[group], then[group] = integrator.state, integrator.time
            taken[group] = [outcome[3] for outcome in integrator.propagate_res]
        count = len(begin)
        return np.concatenate(list(there), axis=1)[:, :count], then.ravel()[:count], taken.ravel()[:count]

    def _set(self, states: np.ndarray, parameters: np.ndarray, begin: np.ndarray) -> None:
        self._integrator.set_time(begin)
        self._integrator.state[:] = states
        if self._used:
            self._integrator.pars[:] = parameters[: self._used]

    def _in_turn(self, result: LaneResults, motions: _Motions, most_steps: int) -> None:
        """Run members of which only the end is wanted: each that arrives frees its lane for the next."""
        integrator, width = self._integrator, self.width
        state, numbers = integrator.state, integrator.pars
        waiting = deque(range(motions.initial.shape[1]))
        inside, taken = [IDLE] * width, [0] * width
        target, bounds, begun = np.zeros(width), np.empty(width), [0.0] * width
        high, low = np.zeros(width), np.zeros(width)
        # one lane at a time below: numbers out of arrays cost ten times
        starts, ends, longest = motions.start.tolist(), motions.times[-1].tolist(), motions.longest.tolist()
        pace = 0.0

        def enter(lanes: Sequence[int]) -> None:
            """The next members, or nobody: a lane that has arrived already, with the state of some member."""
            for lane in lanes:
                member = waiting.popleft() if waiting else IDLE
                there = max(member, 0)
                state[:, lane] = motions.initial[:, there]
                if self._used:
                    numbers[:, lane] = motions.parameters[: self._used, there]
                bounds[lane] = longest[there]
                inside[lane], taken[lane] = member, 0
                begun[lane] = high[lane] = starts[there]
                low[lane], target[lane] = 0.0, starts[there] if member == IDLE else ends[there]
            integrator.set_dtime(high, low)

        enter(range(width))
        while inside.count(IDLE) < width:
            self._log.clear()
            most = until_next(high.tolist(), inside, target.tolist(), begun, taken, most_steps, pace)
            integrator.propagate_until(target, max_steps=most, max_delta_t=bounds)
            outcomes = integrator.propagate_res
            high, low = map(np.array, integrator.dtime)
            taken = [before + now[3] for before, now in zip(taken, outcomes, strict=True)]
            for crossing in self._log:
                if inside[crossing.lane] != IDLE:
                    result.found.setdefault(inside[crossing.lane], []).append(crossing)
            if any(now[0] == _LOST for now in outcomes):
                waiting.extendleft(result.lost(inside, taken, [now[0] == _LOST for now in outcomes]))
                enter(range(width))
                continue
            arrived = (high == target).tolist()
            ended = [
                lane
                for lane, member in enumerate(inside)
                if member != IDLE and (arrived[lane] or taken[lane] >= most_steps)
            ]
            for lane in ended:
                member = inside[lane]
                result.steps[member], result.arrived[member] = taken[lane], arrived[lane]
                # nothing is known at the end about members that didn't arrive
                result.states[-1, :, member] = state[:, lane] if arrived[lane] else np.nan
                pace = taken[lane] / float(high[lane] - begun[lane]) if arrived[lane] else pace
            if ended:
                enter(ended)

    def _together(
        self, result: LaneResults, members: list[int], motions: _Motions, most_steps: int
    ) -> list[int]:
        """Run one group; returns the members whose state was lost, because of which the others must be
        repeated.
        """
        integrator, count = self._integrator, len(members)
        here = motions.of(members + [members[0]] * (self.width - count))
        self._log.clear()
        self._set(here.initial, here.parameters, here.start)
        taken = np.zeros(count, dtype=np.int64)
        arrived, lost = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
        first, begin, left = 0, here.start, most_steps
        while True:
            part = here.times[first : first + _GRID]
            known = bool(first == 0 and (part[0] == here.start).all())
            if known and len(part) == 1:
                found = np.array(integrator.state)[None]
            else:
                grid = part if known else np.vstack([begin, part])
                _, found = integrator.propagate_grid(grid, max_steps=left, max_delta_t=here.longest)
                outcomes = integrator.propagate_res[:count]
                taken += [now[3] for now in outcomes]
                arrived[:] = [now[0] == _ARRIVED for now in outcomes]
                lost[:] = [now[0] == _LOST for now in outcomes]
            skipped = 0 if known else 1
            result.states[first : first + len(part), :, members] = found[skipped:, :, :count]
            first, begin, left = first + _GRID, part[-1], most_steps - int(taken.max())
            if not arrived.all() or first >= len(here.times) or left <= 0:
                break
        result.states[first:, :, members] = np.nan
        result.steps[members], result.finite[members] = taken, ~lost
        result.arrived[members] = arrived & (first >= len(here.times))
        if self._system.events:
            for place, member in enumerate(members):
                result.found[member] = [crossing for crossing in self._log if crossing.lane == place]
        return [member for member, gone in zip(members, lost.tolist(), strict=True) if gone]
