"""Errors of a batch's members until their ends, from neighbours of their motions.

As for a single run (``rigidsim.accuracy.estimates.estimate``), with the same pushes and margins. Each
member's neighbours are followed over all of its motion, at a loose tolerance; where errors grow so much
that a motion so followed becomes another one, once more at the run's own.

Where the tolerance lets steps be wrong by more than rounding does, members are simply run again at a
tighter one and compared at their samples. That costs no more than neighbours would, and is no question of
chance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rigidsim.accuracy.estimates.carriers import plain_pushes
from rigidsim.accuracy.estimates.growth import UNCERTAIN
from rigidsim.accuracy.estimates.margins import AS_LARGE, LABEL, LAST_BITS, MARGINS, Margins
from rigidsim.solve.batch.family import Family, Numbers
from rigidsim.solve.batch.neighbour_lanes import NeighbourLanes
from rigidsim.solve.batch.neighbours import Spreads, Starts, follow, note
from rigidsim.solve.batch.run import BatchBlock

LOOSE, FINER = 1e-6, 1e-8
"""Tolerances of the lanes: the first for all members; the second, whose steps cost 1.5 times as much, where
errors grow so much that the motion followed becomes another one: beside a separatrix errors were announced
ten times larger at the first.
"""
_DRIFTED = 1e-2
"""Tolerance times growth from which a motion followed so loosely becomes a different one."""
_BY_CHANCE = 8.0
"""Tolerance in epsilons up to which a step's error is mostly random rounding."""
_TIGHTER = 2.0**-10
"""Factor on the tolerance of a run that counts as exact, as far as errors of the tolerance go."""
_MORE_STEPS = 4


@dataclass(frozen=True)
class MemberErrors:
    """Largest errors of members until their last samples, (members,); nan for those that have none.

    Attributes:
        attitude: rad, at most pi; None without an attitude.
        rates: error of the angular velocity, relative to its size.
        position, velocity: m and m/s; None if the body has no position.
    """

    attitude: np.ndarray | None
    rates: np.ndarray
    position: np.ndarray | None
    velocity: np.ndarray | None

    @property
    def uncertain(self) -> np.ndarray:
        """Mask of the members whose digits are gone."""
        return (self.rates if self.attitude is None else self.attitude) > UNCERTAIN


class MemberEstimates:
    """Estimates for a family's members, with what they need compiled once.

    Args:
        width: number of lanes of the batch that ran them.
    """

    def __init__(self, family: Family, width: int, margins: Margins = MARGINS) -> None:
        self._traced, self._width, self._margins = family.traced, width, margins
        self._system, self._prepared = family.traced.system, family.traced.prepared
        self._lanes: dict[float | None, NeighbourLanes] = {}

    def compile(self) -> None:
        """Compile beforehand what most members need."""
        self._through(LOOSE)
        if not self._by_chance:
            self._through(self._prepared.effective_tolerance * _TIGHTER)

    def of(self, numbers: Numbers, block: BatchBlock) -> MemberErrors:
        """Errors of a block's members.

        Args:
            numbers: numbers from which the block was run.
        """
        ran = np.array([status is not None for status in block.status]) & (block.reached > 0)
        some = np.flatnonzero(ran)
        found = np.full((4, len(ran)), np.nan)
        if len(some):
            found[:, some] = self._errors(numbers, block, some)
        attitude, rates, position, velocity = found
        flies = "x" in self._system.states
        carried = self._system.mechanics.attitude is not None
        return MemberErrors(
            attitude if carried else None, rates, position if flies else None, velocity if flies else None
        )

    def _errors(self, numbers: Numbers, block: BatchBlock, some: np.ndarray) -> np.ndarray:
        places, scaling = block.places[some], self._system.scaling
        units = numbers.whole_numbers(scaling.time)[places]
        seconds = block.times[block.reached[some] - 1]
        begin_seconds = float(self._prepared.scene.start)
        begin, duration = np.ldexp(begin_seconds, -units), seconds - begin_seconds
        exponents = [
            numbers.whole_numbers(self._system.state_exponents[place])[places]
            for place in self._through(LOOSE).places["rates"]
        ]
        starts = Starts(
            numbers.initial[: self._traced.moving, places],
            numbers.parameters[:, places],
            begin,
            begin + np.ldexp(duration, -units),
            block.steps[some],
            np.ldexp(1.0, np.array(exponents, dtype=np.int64).reshape(-1, len(places))),
        )
        by_chance = self._by_chance
        spreads = self._followed(starts) if by_chance else self._compared(block, some, starts)
        level = float(self._prepared.precision.epsilon)
        label = LABEL * level * np.maximum(abs(begin_seconds), np.abs(seconds))
        pace = numbers.doubles(self._system.rate_bound)[places]
        margin = level * (self._margins.safety if by_chance else self._margins.compared)
        with np.errstate(over="ignore"):

            def at_end(spread: np.ndarray, size: np.ndarray | float, most: np.ndarray | float) -> np.ndarray:
                whole = spreads.whole & np.isfinite(spread)
                return np.where(whole, np.minimum(margin * spread + size, most), most)

            last = LAST_BITS * level
            attitude = at_end(spreads.attitude, last + label * pace, math.pi)
            rates = at_end(spreads.rates, last, 2.0)
            extent, fastest = spreads.extent, spreads.fastest
            moved = last * extent + np.ldexp(label, -units) * fastest
            path = self._margins.path if by_chance else 1.0
            position = path * at_end(spreads.position, moved, AS_LARGE * extent)
            velocity = path * at_end(spreads.velocity, last * fastest, AS_LARGE * fastest)
        length, speed = (numbers.whole_numbers(e)[places] for e in (scaling.length, scaling.speed))
        return np.array([attitude, rates, np.ldexp(position, length), np.ldexp(velocity, speed)])

    @property
    def _by_chance(self) -> bool:
        """Whether errors come mainly from rounding."""
        asked, epsilon = self._prepared.effective_tolerance, float(self._prepared.precision.epsilon)
        return asked <= _BY_CHANCE * epsilon

    def _compared(self, block: BatchBlock, some: np.ndarray, starts: Starts) -> Spreads:
        """Distance of members from runs at a tighter tolerance, in epsilons."""
        lanes = self._through(self._prepared.effective_tolerance * _TIGHTER)
        most = _MORE_STEPS * int(starts.steps.max()) + 1000
        here = block.states[:, :, some]
        there = lanes.again(
            starts.initial, starts.parameters, block.start[some], block.moments[:, some], most
        )
        spreads, epsilon = Spreads.none(len(some)), float(self._prepared.precision.epsilon)
        for row, (state, apart) in enumerate(zip(there, here - there, strict=True)):
            known = np.flatnonzero(block.reached[some] > row)
            note(lanes, spreads, known, state[:, known], apart[:, known, None], starts.of(known))
        for found in (spreads.rates, spreads.attitude, spreads.position, spreads.velocity):
            found /= epsilon
        return spreads

    def _through(self, tolerance: float | None) -> NeighbourLanes:
        if tolerance not in self._lanes:
            self._lanes[tolerance] = NeighbourLanes(self._traced, self._width, tolerance)
        return self._lanes[tolerance]

    def _followed(self, starts: Starts) -> Spreads:
        margins, lanes = self._margins, self._through(LOOSE)
        lost = math.pi / float(self._prepared.precision.epsilon)
        epsilon = float(self._prepared.precision.epsilon)
        plain = plain_pushes(self._prepared.system)
        pushes = replace(plain, own=plain.own * max(self._prepared.effective_tolerance / epsilon, 1.0))
        spreads = follow(lanes, starts, pushes, lost)
        for tolerance, tighter in ((LOOSE, FINER), (FINER, None)):
            lead = spreads.attitude if lanes.carried else spreads.rates
            with np.errstate(divide="ignore", invalid="ignore"):
                power = np.log(lead / spreads.early) / math.log(4.0)
            far = (lead > _DRIFTED / tolerance) & (power > margins.most_power)
            if tighter is None:
                far &= spreads.whole & (lead < margins.gone * lost) & (starts.steps < margins.tight_steps)
            again = np.flatnonzero(far | (~spreads.whole & (tolerance == LOOSE)))
            if len(again):
                spreads.put(again, follow(self._through(tighter), starts.of(again), pushes, lost))
        return spreads
