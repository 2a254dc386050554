"""Lanes of one batch integrator: members of a family, several at a time, from their start to the last sample.

A lane's bits depend neither on its neighbours nor on its place, but on the number of lanes, so that this is
recorded. If a state is no longer finite, heyoka stops all lanes at once: each is repeated by itself.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.errors import required
from rigidsim.solve.compiled import Kept
from rigidsim.solve.events import DIRECTIONS
from rigidsim.solve.requirements import Requirement, SetAtKnots
from rigidsim.solve.stepper import bound_of_sparse_series, longest_step

_GRID = 1 << 16
"""Samples at once; the step before the last of them is shortened, always at the same places."""
_AT_ONCE = 128  # pieces passed in one call, or one by one after some lane needed more steps than one
_ARRIVED, _LOST = hy.taylor_outcome.time_limit, hy.taylor_outcome.err_nf_state

LANES_OF_A_TABLE = 16
"""Lanes of members that pass the rows of a table together: what each row sets takes as long as some ten."""

_Motions = tuple[np.ndarray, ...]
"""Of motions to be integrated: initial and parameters (.., n), start (n,), times (samples, n), and bounds of
steps (n,).
"""


@dataclass(frozen=True)
class Found:
    """One crossing: its event, lane, time (internal units) and state."""

    event: int
    lane: int
    time: float
    state: np.ndarray


_engines: Kept[tuple[Any, list[Found]]] = Kept(64)


@dataclass
class LaneResults:
    """Results of members integrated side by side.

    Attributes:
        finite, arrived: whether the state stayed finite, and the last sample was reached, (members,).
        found: crossings on the way, for members that have any.
    """

    states: np.ndarray  # (samples, states, members) at the sample times; nan from where a member ended
    finite: np.ndarray
    arrived: np.ndarray
    steps: np.ndarray  # steps taken, (members,)
    found: dict[int, list[Found]] = field(default_factory=dict)


def recommended_width() -> int:
    """Number of lanes that this processor handles at once in double precision."""
    return int(hy.recommended_simd_size())


def _grouped(values: np.ndarray, width: int) -> np.ndarray:
    """Values (.., n) of motions as (groups, .., width), the last group filled with the last motion."""
    count = values.shape[-1]
    groups = -(-count // width)
    filled = values[..., np.minimum(np.arange(groups * width), count - 1)]
    split = filled.reshape(*values.shape[:-1], groups, width)
    return np.array(np.moveaxis(split, -2, 0), order="C")


class BatchEngine:
    """A compiled batch integrator of ``width`` lanes, of equations and events (with directions) over heyoka's
    variables and ``par``, the parameters of both; ``requirement`` is what they need before steps. ``knots``
    are set for all lanes, of motions that start together; their parameters come first.
    """

    def __init__(
        self,
        equations: Sequence[tuple[Any, Any]],
        width: int,
        *,
        events: Sequence[tuple[Any, int]] = (),
        tolerance: float | None = None,
        compact: bool = False,
        optimised: bool = True,
        requirement: Requirement | None = None,
        knots: SetAtKnots | None = None,
    ) -> None:
        self.width, self._requirement = width, requirement or Requirement()
        self._knots, self._first = knots, 0 if knots is None else knots.parameters
        # recorded quantities may read more parameters than equations and events
        read = [right for _, right in equations] + [expression for expression, _ in events]
        self._used = max((int(str(p).removeprefix("p")) + 1 for p in hy.get_params(read)), default=0)
        key = list(equations), list(events), width, compact, tolerance, optimised
        self._integrator, self._log = _engines.get(key, lambda: self._made(*key))
        self._longest = longest_step(self._integrator.order, np.float64)

    def _made(
        self,
        equations: list[tuple[Any, Any]],
        events: list[tuple[Any, int]],
        width: int,
        compact: bool,
        tolerance: float | None,
        optimised: bool,
    ) -> tuple[Any, list[Found]]:
        """An integrator, and the crossings of its events since the list was cleared."""
        log: list[Found] = []
        options: dict[str, Any] = {"compact_mode": compact, "opt_level": 3 if optimised else int(not compact)}
        if tolerance is not None:
            options["tol"] = tolerance
        if self._used:
            options["pars"] = np.zeros((self._used, width))

        def noting(event: int, integrator: Any, time: float, _: int, lane: int) -> None:
            state = integrator.update_d_output(np.full(width, time))[:, lane]
            log.append(Found(event, lane, float(time), np.array(state)))

        if events:
            options["nt_events"] = [
                hy.nt_event_batch(expression, partial(noting, n), direction=DIRECTIONS[direction])
                for n, (expression, direction) in enumerate(events)
            ]
        return hy.taylor_adaptive_batch(equations, np.zeros((len(equations), width)), **options), log

    def run(
        self,
        initial: np.ndarray,
        parameters: np.ndarray,
        start: np.ndarray,
        times: np.ndarray,
        most_steps: int,
    ) -> LaneResults:
        """Integrate members to their last samples: initial (states, members), parameters likewise, start
        (members,) and times (samples, members) in internal units, and the largest number of steps of each.
        """
        count = initial.shape[1]
        result = LaneResults(
            np.empty((len(times), *initial.shape)),
            np.ones(count, dtype=bool),
            np.ones(count, dtype=bool),
            np.zeros(count, dtype=np.int64),
        )
        terms = self._series(initial, parameters, start)
        motions = initial, parameters, start, times, self._bounds(terms)
        # members with about as many steps run side by side, so that none waits for long
        last = len(terms) - 1
        pace = np.maximum(terms[-1] ** (1 / last), terms[-2] ** (1 / (last - 1)))
        order = np.argsort(pace * (times[-1] - start), kind="stable").tolist()
        for first in range(0, count, self.width):
            members = order[first : first + self.width]
            if self._together(result, members, motions, most_steps) and len(members) > 1:
                for member in members:  # alone, so that it gets as far as possible
                    self._together(result, [member], motions, most_steps)
        return result

    def longest(self, initial: np.ndarray, parameters: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Bounds of members' steps (members,), from all terms of the series at their start."""
        return self._bounds(self._series(initial, parameters, start))

    def _bounds(self, terms: np.ndarray) -> np.ndarray:
        # one by one: numpy's last bits may depend on the place in an array
        return np.array([min(bound_of_sparse_series(sizes[None]), self._longest) for sizes in terms.T])

    def _series(self, initial: np.ndarray, parameters: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Largest coefficient of each term of members' series at their start, (terms, members)."""
        still, sizes = np.zeros(self.width), []
        given = (_grouped(x, self.width) for x in (initial, parameters, start))
        for states, read, begin in zip(*given, strict=True):
            self._set(states, read, begin)
            self._integrator.step(still, write_tc=True)  # compute a series without moving
            sizes.append(np.abs(self._integrator.tc).max(axis=0))
        return np.concatenate(sizes, axis=1)[:, : len(start)]

    def onward(self, most_steps: int, *given: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """States (states, n) and times (n,) of motions at most so many steps later, not finite if lost, and
        the steps taken (n,): from states, parameters, times, ends and bounds of steps, internal units.
        """
        integrator, count = self._integrator, given[0].shape[1]
        there, read, then, ends, bounds = (_grouped(x, self.width) for x in given)
        steps = np.empty(then.shape)
        for group in range(len(there)):
            self._set(there[group], read[group], then[group])
            self._requirement.meet(integrator)
            options = {"max_delta_t": bounds[group], "callback": list(self._requirement.each) or None}
            integrator.propagate_until(ends[group], max_steps=most_steps, **options)
            # a step's length is rounded, but none goes beyond its end
            there[group], then[group] = integrator.state, np.minimum(integrator.time, ends[group])
            steps[group] = [outcome[3] for outcome in integrator.propagate_res]
        found, times = np.concatenate(list(there), axis=1)[:, :count], then.ravel()[:count]
        taken = steps.ravel()[:count]
        stopped = np.isin(
            np.arange(count) // self.width, np.flatnonzero(~np.isfinite(there).all(axis=(1, 2)))
        )
        for lane in np.flatnonzero(stopped).tolist() if count > 1 else ():
            only = [lane]  # the others of a lost one go on alone
            found[:, only], times[only], taken[only] = self.onward(most_steps, *(x[..., only] for x in given))
        return found, times, taken

    def _set(self, states: np.ndarray, parameters: np.ndarray, begin: np.ndarray) -> None:
        self._log.clear()
        self._integrator.set_time(begin)
        self._integrator.state[:] = states
        if self._used:
            self._integrator.pars[self._first :] = parameters[: self._used - self._first]
        if self._knots is not None:
            pieces = self._knots.pieces
            number = pieces.number_at(begin[0])
            begins = number > 0 and pieces.knots[number - 1] == begin[0]
            self._enter(pieces.parameters(number), pieces.changes(number) if begins else [])

    def _enter(self, parameters: np.ndarray, changes: list[tuple[int, np.ndarray]]) -> None:
        """Go on in a piece of the equations, with changes where it begins."""
        engine, knots = self._integrator, required(self._knots)
        for series, values in changes:
            engine.state[knots.places[series]] = values[:, None]
        engine.pars[: self._first] = parameters[:, None]

    def _together(self, result: LaneResults, members: list[int], motions: _Motions, most_steps: int) -> bool:
        """Run one group; returns whether a state was lost."""
        lanes = members + [members[0]] * (self.width - len(members))
        initial, parameters, start, times, longest = (numbers[..., lanes] for numbers in motions)
        integrator, count = self._integrator, len(members)
        self._set(initial, parameters, start)
        taken, whole, lost = (
            np.zeros(count, dtype=np.int64),
            np.ones(count, dtype=bool),
            np.zeros(count, bool),
        )
        # natural steps, the last of which is shortened to end there, in place of a grid of times
        ends = len(times) <= 2 and bool((times[:-1] == start).all() and (times[-1] > start).all())
        first, begin = 0, start
        while first < len(times) and whole.all() and taken.max() < most_steps:
            part = times[first : first + _GRID]
            grid, found = part if (part[0] == begin).all() else np.vstack([begin, part]), initial[None]
            if len(grid) > 1:
                most = most_steps - int(taken.max())
                if self._knots is not None:
                    found, codes, steps = self._through(grid, longest, most)
                else:
                    options = {"max_steps": most, "max_delta_t": longest}
                    if ends:
                        integrator.propagate_until(grid[-1], **options)
                        found = np.stack([initial, integrator.state])
                    else:
                        _, found = integrator.propagate_grid(grid, **options)
                    codes, _, _, steps = map(list, zip(*integrator.propagate_res, strict=True))
                taken += np.array(steps[:count])
                whole, lost = (np.array([now == code for now in codes[:count]]) for code in (_ARRIVED, _LOST))
            result.states[first : first + len(part), :, members] = found[-len(part) :, :, :count]
            first, begin = first + len(part), part[-1]
        result.states[first:, :, members] = np.nan
        if ends:
            result.states[-1][:, np.array(members)[~whole]] = np.nan
        result.steps[members], result.finite[members] = taken, ~lost
        result.arrived[members] = whole & (first >= len(times))
        for place, member in enumerate(members):
            result.found[member] = [crossing for crossing in self._log if crossing.lane == place]
        return bool(lost.any())

    def _through(
        self, grid: np.ndarray, longest: np.ndarray, most: int
    ) -> tuple[np.ndarray, list[Any], list[int]]:
        """As ``propagate_grid`` does, through pieces of the equations, one by one or, while each takes every
        lane a single step, many in a call. Returns states at the grid's times, outcomes, and steps.
        """
        engine, pieces, times = self._integrator, required(self._knots).pieces, grid[:, 0].tolist()
        found, taken = np.full((len(grid), *engine.state.shape), np.nan), np.zeros(self.width, dtype=np.int64)
        found[0], done, now, codes = engine.state, 1, times[0], [_ARRIVED] * self.width
        number, single, slowly = pieces.number_at(now), False, 0
        while done < len(times):
            if taken.max() >= most:
                codes = [hy.taylor_outcome.step_limit] * self.width
                break
            slowly -= 1
            if single and slowly < 0:
                done, passed = self._singly(number, found, times, done, longest, most - int(taken.max()))
                number, taken, slowly = number + passed, taken + passed, 0 if passed else _AT_ONCE
                if passed:
                    now = pieces.knots[number - 1]
                    continue
            end = pieces.knots[number] if number < len(pieces.knots) else math.inf
            within = times[done : bisect_right(times, end)]
            stops = [now, *within, *([end] if end < times[-1] and end not in within[-1:] else [])]
            rows = np.repeat(np.array(stops)[:, None], self.width, axis=1)
            options = {"max_steps": most - int(taken.max()), "max_delta_t": longest}
            states = engine.propagate_grid(rows, **options)[1]
            codes, _, _, steps = map(list, zip(*engine.propagate_res, strict=True))
            found[done : done + len(within)], taken = states[1 : 1 + len(within)], taken + steps
            if any(code != _ARRIVED for code in codes):
                break
            now, done, single = stops[-1], done + len(within), max(steps) == 1
            if now == end:
                number += 1
                engine.set_time(rows[-1])
                self._enter(pieces.parameters(number), pieces.changes(number))
            else:
                single = False
        return found, codes, taken.tolist()

    def _singly(
        self, number: int, found: np.ndarray, times: list[float], done: int, longest: np.ndarray, most: int
    ) -> tuple[int, int]:
        """Pass pieces of equal lengths from one on that all lanes begin, each in one step; none if a lane
        needs more. Returns how many times of the grid are ``done``, and the pieces passed.
        """
        engine, knots, begun = self._integrator, required(self._knots), done
        places, last = knots.pieces.knots, knots.last_alike(number, min(most, _AT_ONCE) - 1)
        while last >= number and places[last] >= times[-1]:
            last -= 1
        count = last - number + 1
        if count < 1:
            return done, 0
        before, coming = engine.state.copy(), islice(knots.pieces.following(number + 1), count)
        read = engine.pars[: self._first], engine.state

        def next_piece(_: Any) -> bool:
            nonlocal done
            if (piece := next(coming, None)) is None:  # some lane is late
                return False
            knot, parameters, changes = piece
            while times[done] <= knot:
                found[done] = engine.update_d_output(np.full(self.width, times[done]))
                done += 1
            for series, values in changes:
                read[1][knots.places[series]] = values[:, None]
            read[0][:] = parameters[:, None]
            return True

        start, end = (np.full(self.width, places[one]) for one in (number - 1, last))
        bounds = np.minimum(longest, places[number] - places[number - 1])
        engine.propagate_until(end, max_delta_t=bounds, callback=next_piece, write_tc=True)
        if all(steps == count and code == _ARRIVED for code, _, _, steps in engine.propagate_res):
            return done, count
        engine.set_time(start)
        engine.state[:] = before
        self._enter(knots.pieces.parameters(number), [])
        return begun, 0
