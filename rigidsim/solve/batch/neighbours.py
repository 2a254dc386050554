"""Neighbours of many members' motions, pushed at random as rounding does.

The simulation of ``rigidsim.solve.neighbours.pushed``, for members side by side: each is followed at a loose
tolerance by four lanes, itself and three neighbours. Between pushes lies a stretch of so many steps, after
which lanes stand at slightly different times; their distances are brought to one time by the equations.
The random draws are the same for every member, so that results don't depend on the company.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from rigidsim.solve.batch.neighbour_lanes import NeighbourLanes
from rigidsim.solve.neighbours.lanes import NEIGHBOURS
from rigidsim.solve.neighbours.pushed import Pushes

_STRETCHES, _SHORTEST = 6, 4
"""Approximate number of stretches of a run, and least number of steps of one. Half of a stretch's pushes come
before it and half after, so that few stretches suffice for errors that grow as time makes them; where they
grow faster, stretches become shorter.
"""
_FIRST = 2.0**-40
"""Initial distance that stands for one epsilon."""
_LARGEST, _DRAWN_IN, _SATURATED, _NEARER = 2.0**-24, 2.0**-26, 2.0**-14, 2.0**-8
"""Distance from which neighbours are drawn in, and to where; distance that is no longer small, so that the
stretch is repeated; and by how much nearer if it can't be shorter.
"""
_CALM, _WILD = 8.0, 64.0
"""Growth over a stretch below which stretches may become longer, and above which they become shorter."""
_EARLY = 0.25  # fraction of the time
_EPSILON = float(np.finfo(float).eps)
_MOST_ROUNDS = 20_000
_HOPELESS_STEPS = 32_768
"""Steps beyond the expected number after which a motion is given up."""


@dataclass(frozen=True)
class Starts:
    """Members to be followed.

    Attributes:
        initial, parameters: initial states (states, members), and the traced system's (parameters, members).
        begin, end: times in each member's internal units, (members,).
        steps: steps that each took, (members,).
        rate_units: factors that bring the body rates to a common unit, (3, members).
    """

    initial: np.ndarray
    parameters: np.ndarray
    begin: np.ndarray
    end: np.ndarray
    steps: np.ndarray
    rate_units: np.ndarray

    def of(self, which: np.ndarray) -> Starts:
        """The starts of some members."""
        return Starts(*(getattr(self, field.name)[..., which] for field in fields(self)))


@dataclass(frozen=True)
class Spreads:
    """Largest effect of errors of one epsilon per step, (members,).

    Attributes:
        rates, attitude, position, velocity: root mean square over the neighbours, in epsilons of internal
            units; attitude as an angle, rates relative to their size; zeros if the motion has none.
        extent, fastest: largest distance from the origin and speed, internal units.
        early: the leading spread (see ``leading``) after a quarter of the time.
        whole: False if the motion could not be followed to its end.
    """

    rates: np.ndarray
    attitude: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    extent: np.ndarray
    fastest: np.ndarray
    early: np.ndarray
    whole: np.ndarray

    @classmethod
    def none(cls, members: int) -> Spreads:
        """Spreads before anything was followed."""
        a, b, c, d, e, f, g = np.zeros((7, members))
        return cls(a, b, c, d, e, f, g, np.ones(members, dtype=bool))

    def put(self, places: np.ndarray, others: Spreads) -> None:
        """Replace the spreads of some members."""
        for field in fields(self):
            getattr(self, field.name)[places] = getattr(others, field.name)


def follow(lanes: NeighbourLanes, starts: Starts, pushes: Pushes, lost: float) -> Spreads:
    """Follow members to their ends.

    Args:
        lost: spread of the attitude (or the rates) past which nothing more can be learnt.
    """
    following = _Following(lanes, starts, pushes, lost)
    for number in range(_MOST_ROUNDS):
        going = np.flatnonzero(following.going)
        if not len(going):
            break
        with np.errstate(all="ignore"):
            following.go(going, np.random.default_rng(number))
    following.spreads.whole[following.going] = False
    return following.spreads


class _Following:
    """Members being followed.

    Attributes:
        going: mask of members still being followed, (members,).
    """

    def __init__(self, lanes: NeighbourLanes, starts: Starts, pushes: Pushes, lost: float) -> None:
        self._lanes, self._starts, self._pushes, self._lost = lanes, starts, pushes, lost
        states, members = starts.initial.shape
        self._state = starts.initial.copy()
        self._apart = np.zeros((states, members, NEIGHBOURS))
        self._time = starts.begin.copy()
        self._longest_steps = lanes.longest(starts.initial, starts.parameters, starts.begin)
        self._factor = np.full(members, _FIRST)  # distance for one epsilon
        self._sizes = np.abs(starts.initial)  # over the latest stretch, of what moves
        self._largest = self._sizes.copy()
        self._longest = np.maximum(
            2 ** np.floor(np.log2(np.maximum(starts.steps, 1) / _STRETCHES * 1.42)), _SHORTEST
        )
        self._longest = np.minimum(self._longest, pushes.together)
        self._stride = self._longest.copy()
        self._taken = np.zeros(members)
        self.spreads = Spreads.none(members)
        self.going = starts.end > starts.begin
        normal = np.random.default_rng(_MOST_ROUNDS).standard_normal((states, 1, NEIGHBOURS))
        slopes = lanes.slopes(self._state, starts.parameters, self._time)
        self._sizes[slopes == 0] = 0.0  # constant states aren't rounded
        everybody = np.arange(members)
        self._add(everybody, pushes.first * np.abs(starts.initial)[:, :, None] * normal)
        self._note(everybody)

    def go(self, going: np.ndarray, random: np.random.Generator) -> None:
        """Follow some members through one stretch."""
        states, starts = len(self._state), self._starts
        before, clock, after = (random.standard_normal((states, 1, NEIGHBOURS)) for _ in range(3))
        stride = self._stride[going]
        expected = np.clip(starts.steps[going] - self._taken[going], 1, stride)
        parameters = starts.parameters[:, going]
        kept = self._apart[:, going].copy()
        self._push(going, expected / 2, before)
        begun = self._apart[:, going].copy()
        # a rounded time is another time, for loads that depend on it: another one at each step, whereas the
        # neighbours' lasts for the stretch
        late = np.abs(self._time[going] + self._pushes.ahead)
        wrong = self._pushes.clock * late * self._factor[going] / np.sqrt(expected)
        shifts = np.concatenate([np.zeros((len(going), 1)), wrong[:, None] * clock[0]], axis=1)
        nearby = np.concatenate([np.zeros((states, len(going), 1)), begun], axis=2)
        there, times = self._lanes.onward(
            (self._state[:, going, None] + nearby).reshape(states, -1),
            np.repeat(parameters, NEIGHBOURS + 1, axis=1),
            (self._time[going, None] + shifts).reshape(-1),
            (starts.end[going, None] + shifts).reshape(-1),
            np.repeat(self._longest_steps[going], NEIGHBOURS + 1),
            np.repeat(stride, NEIGHBOURS + 1).astype(np.int64),
        )
        there = there.reshape(states, len(going), -1)
        times = times.reshape(len(going), -1) - shifts
        state, time = there[:, :, 0], times[:, 0]
        slopes = self._lanes.slopes(np.ascontiguousarray(state), parameters, time)
        apart = there[:, :, 1:] - there[:, :, :1] - slopes[:, :, None] * (times[:, 1:] - times[:, :1])
        finite = np.isfinite(apart).all(axis=(0, 2)) & np.isfinite(state).all(axis=0)
        grown = self._distances(going, np.where(finite[:, None], apart, 0.0))
        saturated = finite & (grown >= _SATURATED)
        self._again(going, saturated, kept)
        lost = going[~finite]
        self.spreads.whole[lost], self.going[lost] = False, False
        well = finite & ~saturated
        growth = grown / np.maximum(self._distances(going, begun), 1e-300)
        self._arrive(
            going[well],
            state[:, well],
            time[well],
            apart[:, well],
            growth[well],
            expected[well],
            slopes[:, well],
        )
        some = going[well]
        self._push(some, expected[well] / 2, after)
        self._draw_in(some)
        self._note(some)

    # --- parts of a stretch ---------------------------------------------------------------------------------

    def _again(self, going: np.ndarray, saturated: np.ndarray, kept: np.ndarray) -> None:
        """Set up stretches that have to be repeated: shorter, or from nearer."""
        which = going[saturated]
        self._apart[:, which] = kept[:, saturated]
        short = self._stride[which] <= _SHORTEST
        self._stride[which] = np.maximum(self._stride[which] / 8, _SHORTEST)
        near = which[short]
        self._apart[:, near] *= _NEARER
        self._factor[near] *= _NEARER
        hopeless = near[self._factor[near] < 1e-280]
        self.spreads.whole[hopeless], self.going[hopeless] = False, False

    def _arrive(
        self,
        which: np.ndarray,
        state: np.ndarray,
        time: np.ndarray,
        apart: np.ndarray,
        growth: np.ndarray,
        steps: np.ndarray,
        slopes: np.ndarray,
    ) -> None:
        stride = self._stride[which]
        shorter, longer = growth > _WILD, growth < _CALM
        stride = np.where(shorter, np.maximum(stride / 2, _SHORTEST), stride)
        self._stride[which] = np.where(longer, np.minimum(2 * stride, self._longest[which]), stride)
        sizes = np.maximum(np.abs(self._state[:, which]), np.abs(state))
        still = (self._state[:, which] == state) & (slopes == 0)
        self._largest[:, which] = np.maximum(self._largest[:, which], sizes)
        self._sizes[:, which] = np.where(still, 0.0, sizes)
        self._state[:, which], self._time[which], self._apart[:, which] = state, time, apart
        self._taken[which] += steps
        tired = self._taken[which] > 4 * self._starts.steps[which] + _HOPELESS_STEPS
        self.spreads.whole[which[tired]] = False
        self.going[which] = (time < self._starts.end[which]) & ~tired

    def _push(self, which: np.ndarray, steps: np.ndarray, normal: np.ndarray) -> None:
        """Add errors of so many steps (members,)."""
        sizes = self._pushes.own * np.sqrt(steps)[:, None] * self._sizes[:, which, None]
        self._add(which, sizes * normal)

    def _add(self, which: np.ndarray, pushed: np.ndarray) -> None:
        felt = np.where(self._lanes.felt[:, None, None], pushed, 0.0)
        self._apart[:, which] += self._factor[which][:, None] * felt

    def _draw_in(self, which: np.ndarray) -> None:
        """Move neighbours that are too far nearer, in the same directions."""
        far = self._distances(which, self._apart[:, which])
        nearer = np.where(far > _LARGEST, _DRAWN_IN / np.maximum(far, _LARGEST), 1.0)
        self._apart[:, which] *= nearer[:, None]
        self._factor[which] *= nearer

    def _distances(self, which: np.ndarray, apart: np.ndarray) -> np.ndarray:
        """Distance of the farthest neighbour, relative to the size of the respective states, (members,);
        states that never moved don't count.
        """
        groups = self._lanes.groups
        squares = np.einsum("gs,smn->gmn", groups, apart * apart)
        sizes = (groups[:, :, None] * self._largest[:, which]).max(axis=1)
        weights = np.where(sizes > 0, 1.0 / np.maximum(sizes, 1e-150) ** 2, 0.0)
        found: np.ndarray = np.sqrt((squares * weights[:, :, None]).max(axis=(0, 2)))
        return found

    def _note(self, which: np.ndarray) -> None:
        lanes, spreads = self._lanes, self.spreads
        apart = self._apart[:, which] / self._factor[which][:, None]
        note(lanes, spreads, which, self._state[:, which], apart, self._starts.of(which))
        lead = (spreads.attitude if lanes.carried else spreads.rates)[which]
        whole = self._starts.end[which] - self._starts.begin[which]
        gone = (self._time[which] - self._starts.begin[which]) / np.maximum(whole, 1e-300)
        soon = (spreads.early[which] == 0) | (gone <= _EARLY)
        spreads.early[which] = np.where(soon, lead, spreads.early[which])
        over = lead >= self._lost
        if lanes.places["position"]:
            over &= spreads.position[which] * _EPSILON > spreads.extent[which]
        self.going[which[over]] = False


def note(
    lanes: NeighbourLanes,
    spreads: Spreads,
    which: np.ndarray,
    state: np.ndarray,
    apart: np.ndarray,
    starts: Starts,
) -> None:
    """Record the distances of some members' neighbours if they are larger than before.

    Args:
        which: places of the members in the spreads.
        state: (states, n); apart: (states, n, others).
        starts: starts of the same n.
    """
    places, wrong = lanes.places, np.sqrt((apart**2).mean(axis=2))

    def length(table: np.ndarray, group: str) -> np.ndarray:
        return np.asarray(np.sqrt((table[places[group]] ** 2).sum(axis=0)))

    def larger(row: np.ndarray, found: np.ndarray) -> None:
        row[which] = np.maximum(row[which], found)

    rates = places["rates"]
    if rates:
        size, off = (np.sqrt(((starts.rate_units * x[rates]) ** 2).sum(axis=0)) for x in (state, wrong))
        larger(spreads.rates, np.where(size > 0, off / np.maximum(size, 1e-300), 0.0))
    if lanes.carried:
        there = np.ascontiguousarray(state)
        angles = [lanes.angles(there, apart[:, :, n], starts.parameters) for n in range(apart.shape[2])]
        larger(spreads.attitude, np.sqrt(np.mean(np.square(angles), axis=0)))
    if places["position"]:
        larger(spreads.position, length(wrong, "position"))
        larger(spreads.velocity, length(wrong, "velocity"))
        larger(spreads.extent, length(state, "position"))
        larger(spreads.fastest, length(state, "velocity"))
