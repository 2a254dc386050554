"""Errors of a batch's members until their ends, from tangents of their motions, with the perturbations and
margins of single runs.

Each member is followed over all of its motion, which begins anew at some of its samples. Where the tolerance
lets steps be wrong by more than rounding does, members are run again at a tighter one and compared at their
samples, which costs no more than tangents would, and is no question of chance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rigidsim.accuracy.estimates.estimate import (
    AS_LARGE,
    COMPARED,
    LABEL,
    LAST_BITS,
    PATH,
    SAFETY,
    UNCERTAIN,
    plain_perturbations,
)
from rigidsim.solve.batch.family import BatchBlock, Family
from rigidsim.solve.error_tangents import (
    ErrorTangents,
    Known,
    LaneCarrier,
    Measures,
    Spread,
    Starts,
    timed,
)
from rigidsim.solve.lanes import BatchEngine

_TOLERANCE = 1e-8  # of lanes, which begin anew at some of the samples
_BEGUN_ANEW = 16  # times at most
_STRETCHES = 6
_LANES = 8
"""Least number of lanes: a step of eight in vectors of four costs 1.6 of one of four."""
_BY_CHANCE = 8.0
"""Tolerance in epsilons up to which a step's error is mostly random rounding."""
_TIGHTER = 2.0**-10
"""Factor on the tolerance of a run that counts as exact, as far as errors of the tolerance go."""
_MORE_STEPS = 4


@dataclass(frozen=True)
class MemberErrors:
    """Largest errors of members until their last samples, (members,), in the units of ``Estimate``; nan for
    those that have none.
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
    """Estimates for a family's members."""

    def __init__(self, family: Family, width: int) -> None:
        self._family, self._width = family, width
        self._system, self._prepared = family.system, family.prepared
        self._epsilon = float(self._prepared.precision.epsilon)
        self._measures = Measures(self._system, family.moving, family.variables)

    def _engine(self, tolerance: float) -> BatchEngine:
        """Integrator of the motion alone, with an error of the time after its parameters."""
        family = self._family
        rights = family.as_parameters([right for _, right in family.system.equations[: family.moving]])
        equations = zip(family.system.variables, timed(rights, len(family.in_equations)), strict=False)
        width, wide = max(self._width, _LANES), family.system.wide
        return BatchEngine(list(equations), width, tolerance=tolerance, compact=wide)

    @cached_property
    def _lanes(self) -> BatchEngine:
        return self._engine(_TOLERANCE)

    @cached_property
    def _better(self) -> BatchEngine:
        return self._engine(float(self._prepared.effective_tolerance) * _TIGHTER)

    def compile(self) -> None:
        """Compile beforehand what most members need."""
        _ = self._lanes if self._by_chance else self._better

    def of(self, block: BatchBlock) -> MemberErrors:
        """Errors of a block's members."""
        ran = np.array([status is not None for status in block.status]) & (block.reached > 0)
        some = np.flatnonzero(ran)
        found = np.full((4, len(ran)), np.nan)
        if len(some):
            found[:, some] = self._errors(block, some)
        attitude, rates, position, velocity = found
        flies = "x" in self._system.states
        carried = self._measures.carried
        return MemberErrors(
            attitude if carried else None, rates, position if flies else None, velocity if flies else None
        )

    def _errors(self, block: BatchBlock, some: np.ndarray) -> np.ndarray:
        family, system = self._family, self._system
        places, scaling = block.places[some], system.scaling
        units = family.whole_numbers(scaling.time)[places]
        seconds = block.times[block.reached[some] - 1]
        begin_seconds = float(self._prepared.scene.start)
        way = self._prepared.scene.samples.direction
        begin, duration = way * np.ldexp(begin_seconds, -units), way * (seconds - begin_seconds)
        exponents = [
            family.whole_numbers(system.state_exponents[place])[places]
            for place in self._measures.places["rates"]
        ]
        starts = Starts(
            family.initial[: family.moving, places],
            begin,
            begin + np.ldexp(duration, -units),
            block.steps[some],
            np.ldexp(1.0, np.array(exponents, dtype=np.int64).reshape(-1, len(places))),
            family.parameters[:, places],
        )
        by_chance = self._by_chance
        spread = self._followed(block, some, starts) if by_chance else self._compared(block, some, starts)
        label = LABEL * self._epsilon * np.maximum(abs(begin_seconds), np.abs(seconds))
        pace = family.doubles(system.rate_bound)[places]
        level = SAFETY * self._epsilon if by_chance else COMPARED
        last, path = LAST_BITS * self._epsilon, PATH if by_chance else 1.0
        with np.errstate(over="ignore"):

            def at_end(name: str, size: np.ndarray | float, most: np.ndarray | float) -> np.ndarray:
                found = spread.largest(name)
                known = spread.whole & np.isfinite(found)
                return np.where(known, np.minimum(level * found + size, most), most)

            attitude = at_end("attitude", last + label * pace, math.pi)
            rates = at_end("rates", last, 2.0)
            extent, fastest = spread.largest("distance"), spread.largest("speed")
            moved = last * extent + np.ldexp(label, -units) * fastest
            position = path * at_end("position", moved, AS_LARGE * extent)
            velocity = path * at_end("velocity", last * fastest, AS_LARGE * fastest)
        length, speed = (family.whole_numbers(e)[places] for e in (scaling.length, scaling.speed))
        return np.array([attitude, rates, np.ldexp(position, length), np.ldexp(velocity, speed)])

    @property
    def _by_chance(self) -> bool:
        """Whether errors come mainly from rounding."""
        return self._prepared.effective_tolerance <= _BY_CHANCE * self._epsilon

    def _compared(self, block: BatchBlock, some: np.ndarray, starts: Starts) -> Spread:
        """Distance of members from runs at a tighter tolerance."""
        read = starts.parameters[self._family.in_equations]
        most = _MORE_STEPS * int(starts.steps.max()) + 1000
        moments = block.moments[:, some]
        read = np.concatenate([read, np.zeros((1, len(some)))])
        there = self._better.run(starts.states, read, starts.begin, moments, most).states
        spread = Spread(len(some))
        for row, (state, apart) in enumerate(zip(there, block.states[:, :, some] - there, strict=True)):
            known = np.flatnonzero(block.reached[some] > row)
            away = apart[:, known, None]
            spread.note(known, **self._measures.differences(state[:, known], away, starts, known))
        return spread

    def _followed(self, block: BatchBlock, some: np.ndarray, starts: Starts) -> Spread:
        epsilon, read = self._epsilon, starts.parameters[self._family.in_equations]
        carrier = LaneCarrier(self._lanes, read, starts)
        loose = max(self._prepared.effective_tolerance / epsilon, 1.0)
        errors = plain_perturbations(self._prepared.system, loose)
        rows = np.unique(np.linspace(0, len(block.moments) - 1, _BEGUN_ANEW + 2).astype(int)[1:-1])
        times, states = (
            block.moments[np.ix_(rows, some)],
            block.states[:, : self._family.moving][rows][:, :, some],
        )
        unknown = ~np.isfinite(states).all(axis=1) | (rows[:, None] >= block.reached[some])
        known = Known(np.where(unknown, np.nan, times), states)
        tangents = ErrorTangents(
            carrier, self._measures, starts, errors, epsilon, known=known, stretches=_STRETCHES
        )
        return tangents.follow(lost=math.pi / epsilon)
