"""Lanes of one batch integrator: members of a family, several at a time, from their start to the last sample.

A lane's bits depend neither on its neighbours nor on its place, but on the number of lanes, so that this is
recorded. If a state is no longer finite, heyoka stops all lanes at once: each is repeated by itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.solve.compiled import Kept
from rigidsim.solve.events import DIRECTIONS
from rigidsim.solve.requirements import Requirement
from rigidsim.solve.stepper import bound_of_sparse_series, longest_step

_GRID = 1 << 16
"""Samples at once; the step before the last of them is shortened, always at the same places."""
_ARRIVED, _LOST = hy.taylor_outcome.time_limit, hy.taylor_outcome.err_nf_state

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
    variables and ``par``, the parameters of both; ``requirement`` is what they need before steps.
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
    ) -> None:
        self.width, self._requirement = width, requirement or Requirement()
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
            there[group], then[group] = integrator.state, integrator.time
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
            self._integrator.pars[:] = parameters[: self._used]

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
                options = {"max_steps": most_steps - int(taken.max()), "max_delta_t": longest}
                if ends:
                    integrator.propagate_until(grid[-1], **options)
                    found = np.stack([initial, integrator.state])
                else:
                    _, found = integrator.propagate_grid(grid, **options)
                outcomes = integrator.propagate_res[:count]
                taken += [now[3] for now in outcomes]
                whole, lost = (np.array([now[0] == code for now in outcomes]) for code in (_ARRIVED, _LOST))
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
