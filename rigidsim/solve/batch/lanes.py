"""Lanes of one batch integrator: members of a family, several at a time, from their start to the last sample.

A lane's bits depend neither on its neighbours nor on its place, but on the number of lanes, so that this is
recorded. Where a state is no longer finite heyoka stops all lanes at once: the others are taken again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.solve.compiled import Kept
from rigidsim.solve.events import DIRECTIONS
from rigidsim.solve.stepper import LONGEST_STEP

_GRID = 1 << 16
"""Samples at once; the step before the last of them is shortened, at the same places always."""

_IDLE = -1
_FIRST_STEPS, _LEAST_STEPS = 64, 8
"""At once, while nothing is known of a lane's pace, and where one is about to arrive."""
_ARRIVED, _LOST = hy.taylor_outcome.time_limit, hy.taylor_outcome.err_nf_state

_engines: Kept[Any] = Kept(16)


@dataclass(frozen=True)
class Found:
    """One crossing: of which event, in which lane, when (internal units) and where."""

    event: int
    lane: int
    time: float
    state: np.ndarray


@dataclass
class Lanes:
    """How members fared.

    Attributes:
        states: (samples, states, members) at the sample times; not numbers from where one ended.
        finite: whether the state stayed so, (members,).
        arrived: whether it got to the last sample.
        steps: that it took.
        found: crossings on the way, of members that have any.
    """

    states: np.ndarray
    finite: np.ndarray
    arrived: np.ndarray
    steps: np.ndarray
    found: dict[int, list[Found]] = field(default_factory=dict)

    @classmethod
    def empty(cls, samples: int, states: int, members: int) -> Lanes:
        """Before anything ran."""
        yes = np.ones(members, dtype=bool)
        table = np.full((samples, states, members), np.nan)
        return cls(table, yes, yes.copy(), np.zeros(members, dtype=np.int64))

    def placed(self, order: np.ndarray) -> Lanes:
        """With member k moved to place ``order[k]``."""
        back = np.argsort(order)
        found = {int(order[k]): crossings for k, crossings in self.found.items()}
        parts = (self.finite[back], self.arrived[back], self.steps[back])
        return Lanes(np.ascontiguousarray(self.states[:, :, back]), *parts, found)

    def put(self, places: np.ndarray, others: Lanes) -> None:
        """How some fared, in place of what was known of them."""
        self.states[:, :, places] = others.states
        for mine, theirs in (
            (self.finite, others.finite),
            (self.arrived, others.arrived),
            (self.steps, others.steps),
        ):
            mine[places] = theirs


@dataclass(frozen=True)
class BatchSystem:
    """What is compiled.

    Attributes:
        equations: over heyoka's variables and ``par``.
        events: expressions of the same, with directions.
        parameters: how many both read.
    """

    equations: Sequence[tuple[Any, Any]]
    events: Sequence[tuple[Any, int]]
    parameters: int
    tolerance: float | None
    compact: bool


def recommended_width() -> int:
    """Lanes that this processor takes at once in double precision."""
    return int(hy.recommended_simd_size())


def _parameters_used(system: BatchSystem) -> int:
    """How many of the parameters the engine is to have: as far as its equations and events read them. What is
    recorded may read more.
    """
    read = [right for _, right in system.equations] + [expression for expression, _ in system.events]
    return max((int(str(p).removeprefix("p")) + 1 for p in hy.get_params(read)), default=0)


class BatchEngine:
    """A compiled batch integrator.

    Args:
        width: of the batch.
    """

    def __init__(self, system: BatchSystem, width: int) -> None:
        self.width = width
        self._system = system
        self._used = _parameters_used(system)
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
    ) -> Lanes:
        """Take members to their last samples.

        Args:
            initial: (states, members); parameters likewise.
            start: (members,), times: (samples, members), internal units.
            most_steps: that one may take.
        """
        count = initial.shape[1]
        result = Lanes.empty(len(times), len(initial), count)
        if len(times) <= 2 and bool((times[:-1] == start).all()) and bool((times[-1] > start).all()):
            if len(times) == 2:
                result.states[0] = initial
            self._in_turn(result, initial, parameters, start, times[-1], most_steps)
            return result
        for first in range(0, count, self.width):
            waiting = list(range(first, min(first + self.width, count)))
            while waiting:
                chosen = np.array(waiting + [waiting[0]] * (self.width - len(waiting)))
                lost = self._together(
                    result,
                    waiting,
                    initial[:, chosen],
                    parameters[:, chosen],
                    start[chosen],
                    times[:, chosen],
                    most_steps,
                )
                if not lost or len(waiting) == 1:
                    break
                for member in lost:  # alone, so that it gets as far as it can
                    only = np.full(self.width, member)
                    self._together(
                        result,
                        [member],
                        initial[:, only],
                        parameters[:, only],
                        start[only],
                        times[:, only],
                        most_steps,
                    )
                waiting = [member for member in waiting if member not in lost]
        return result

    def _in_turn(
        self,
        result: Lanes,
        initial: np.ndarray,
        parameters: np.ndarray,
        start: np.ndarray,
        end: np.ndarray,
        most_steps: int,
    ) -> None:
        """Run members whose end alone is asked for: whoever arrives makes room for the next in its lane."""
        integrator = self._integrator
        waiting = deque(range(initial.shape[1]))
        inside = [_IDLE] * self.width
        taken = [0] * self.width
        target, begun = np.zeros(self.width), np.zeros(self.width)
        high, low = np.zeros(self.width), np.zeros(self.width)

        def enter(lane: int) -> None:
            """The next member, or nobody: a lane that has arrived already, with the state of some member."""
            inside[lane] = waiting.popleft() if waiting else _IDLE
            member = max(inside[lane], 0)
            integrator.state[:, lane] = initial[:, member]
            if self._used:
                integrator.pars[:, lane] = parameters[: self._used, member]
            high[lane], low[lane], begun[lane] = start[member], 0.0, start[member]
            target[lane] = start[member] if inside[lane] == _IDLE else end[member]
            taken[lane] = 0

        for lane in range(self.width):
            enter(lane)
        while any(member != _IDLE for member in inside):
            integrator.set_dtime(high, low)
            self._log.clear()
            most = _until_next(high, inside, target, begun, taken, most_steps)
            integrator.propagate_until(target, max_steps=most, max_delta_t=LONGEST_STEP)
            outcomes = integrator.propagate_res
            high, low = (np.array(part) for part in integrator.dtime)
            taken = [before + int(now[3]) for before, now in zip(taken, outcomes, strict=True)]
            lost = any(now[0] == _LOST for now in outcomes)
            for crossing in self._log:
                if inside[crossing.lane] != _IDLE:
                    result.found.setdefault(inside[crossing.lane], []).append(crossing)
            for lane, member in enumerate(inside):
                if member == _IDLE:
                    continue
                if lost and outcomes[lane][0] != _LOST:  # stopped by its neighbour, it begins again
                    result.found.pop(member, None)
                    waiting.appendleft(member)
                    inside[lane] = _IDLE
                elif lost or high[lane] == target[lane] or taken[lane] >= most_steps:
                    result.steps[member] = taken[lane]
                    result.finite[member] = not lost
                    result.arrived[member] = high[lane] == target[lane] and not lost
                    if result.arrived[member]:
                        result.states[-1, :, member] = integrator.state[:, lane]
                    inside[lane] = _IDLE
                else:
                    continue
            for lane, member in enumerate(inside):
                if member == _IDLE and (waiting or lost or target[lane] != begun[lane]):
                    enter(lane)

    def _together(
        self,
        result: Lanes,
        members: list[int],
        initial: np.ndarray,
        parameters: np.ndarray,
        start: np.ndarray,
        times: np.ndarray,
        most_steps: int,
    ) -> list[int]:
        """Run one group; those members whose state was lost, because of which the others have to be taken
        again.
        """
        integrator = self._integrator
        self._log.clear()
        integrator.set_time(start)
        integrator.state[:] = initial
        if self._used:
            integrator.pars[:] = parameters[: self._used]
        taken, first, begin, left = [0] * len(members), 0, start, most_steps
        while True:
            part = times[first : first + _GRID]
            known = bool(first == 0 and (part[0] == start).all())
            if known and len(part) == 1:
                found, outcomes = np.array(integrator.state)[None], []
            else:
                grid = part if known else np.vstack([begin, part])
                _, found = integrator.propagate_grid(grid, max_steps=left, max_delta_t=LONGEST_STEP)
                outcomes = integrator.propagate_res[: len(members)]
            skipped = 0 if known else 1
            result.states[first : first + len(part), :, members] = found[skipped:, :, : len(members)]
            taken = [before + int(now[3]) for before, now in zip(taken, outcomes, strict=False)] or taken
            codes = [now[0] for now in outcomes]
            first, begin, left = first + _GRID, part[-1], most_steps - max(taken)
            if any(code != _ARRIVED for code in codes) or first >= len(times) or left <= 0:
                break
        lost = [m for m, code in zip(members, codes, strict=False) if code == _LOST]
        arrived = [code == _ARRIVED for code in codes] or [True] * len(members)
        for member, steps, there in zip(members, taken, arrived, strict=True):
            result.steps[member] = steps
            result.finite[member] = member not in lost
            result.arrived[member] = there and first >= len(times)
        if self._log:
            for place, member in enumerate(members):
                result.found[member] = [crossing for crossing in self._log if crossing.lane == place]
        elif self._system.events:
            for member in members:
                result.found.pop(member, None)
        return lost


def _until_next(
    moments: np.ndarray,
    inside: list[int],
    target: np.ndarray,
    begun: np.ndarray,
    taken: list[int],
    most_steps: int,
) -> int:
    """Steps until about the first lane arrives, at its pace so far."""
    found = most_steps
    for lane, moment in enumerate(moments.tolist()):
        if inside[lane] == _IDLE:
            continue
        gone, left = moment - begun[lane], target[lane] - moment
        expected = _FIRST_STEPS if taken[lane] == 0 or gone <= 0 else int(left / gone * taken[lane]) + 2
        found = min(found, max(expected, _LEAST_STEPS), most_steps - taken[lane])
    return max(found, 1)
