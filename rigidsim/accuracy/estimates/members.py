"""Errors of a batch's members until their ends, from a shadow ensemble of their motions, with the
perturbations and margins of single runs.

Each member is followed over all of its motion, at a loose tolerance; where errors grow so much that a motion
so followed becomes another one, once more at the run's own. Where the tolerance lets steps be wrong by more
than rounding does, members are run again at a tighter one and compared at their samples, which costs no more
than an ensemble would, and is no question of chance.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from rigidsim.accuracy.estimates import margins
from rigidsim.accuracy.estimates.course import UNCERTAIN, plain_perturbations
from rigidsim.solve.batch.family import Family, Numbers
from rigidsim.solve.batch.motion import MemberCarrier, ShadowLanes
from rigidsim.solve.batch.run import BatchBlock
from rigidsim.solve.shadow.ensemble import ShadowEnsemble
from rigidsim.solve.shadow.measures import Measures, Spread, Starts

LOOSE, FINER = 1e-6, 1e-8
"""Tolerances of the lanes: the first for all members; the second, whose steps cost 1.5 times as much, where
errors grow so much that the motion followed becomes another one: beside a separatrix errors were announced
ten times larger at the first.
"""
_STRETCHES = 6
_DRIFTED = 1e-2
"""Tolerance times growth from which a motion followed so loosely becomes a different one."""
_FASTER = 3.0
"""Power of time from which errors are taken to grow exponentially; those of few perturbed motions scatter."""
_EARLY = 0.25
"""Part of the time by whose end growth is compared with that at the end."""
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
    """Estimates for a family's members, with what they need compiled once."""

    def __init__(self, family: Family, width: int) -> None:
        self._traced, self._width = family.traced, width
        self._system, self._prepared = family.traced.system, family.traced.prepared
        self._epsilon = float(self._prepared.precision.epsilon)
        self._lanes: dict[float | None, ShadowLanes] = {}
        self._measures = Measures(self._system, self._traced.moving, self._traced.parameters.variables)

    def compile(self) -> None:
        """Compile beforehand what most members need."""
        self._through(LOOSE)
        if not self._by_chance:
            self._through(self._prepared.effective_tolerance * _TIGHTER)

    def of(self, numbers: Numbers, block: BatchBlock) -> MemberErrors:
        """Errors of a block's members."""
        ran = np.array([status is not None for status in block.status]) & (block.reached > 0)
        some = np.flatnonzero(ran)
        found = np.full((4, len(ran)), np.nan)
        if len(some):
            found[:, some] = self._errors(numbers, block, some)
        attitude, rates, position, velocity = found
        flies = "x" in self._system.states
        carried = self._measures.carried
        return MemberErrors(
            attitude if carried else None, rates, position if flies else None, velocity if flies else None
        )

    def _errors(self, numbers: Numbers, block: BatchBlock, some: np.ndarray) -> np.ndarray:
        places, scaling, system = block.places[some], self._system.scaling, self._system
        units = numbers.whole_numbers(scaling.time)[places]
        seconds = block.times[block.reached[some] - 1]
        begin_seconds = float(self._prepared.scene.start)
        begin, duration = np.ldexp(begin_seconds, -units), seconds - begin_seconds
        exponents = [
            numbers.whole_numbers(system.state_exponents[place])[places]
            for place in self._measures.places["rates"]
        ]
        starts = Starts(
            numbers.initial[: self._traced.moving, places],
            begin,
            begin + np.ldexp(duration, -units),
            block.steps[some],
            np.ldexp(1.0, np.array(exponents, dtype=np.int64).reshape(-1, len(places))),
            numbers.parameters[:, places],
        )
        by_chance = self._by_chance
        spread = self._followed(starts) if by_chance else self._compared(block, some, starts)
        label = margins.LABEL * self._epsilon * np.maximum(abs(begin_seconds), np.abs(seconds))
        pace = numbers.doubles(system.rate_bound)[places]
        level = margins.SAFETY * self._epsilon if by_chance else margins.COMPARED
        last, path = margins.LAST_BITS * self._epsilon, margins.PATH if by_chance else 1.0
        with np.errstate(over="ignore"):

            def at_end(name: str, size: np.ndarray | float, most: np.ndarray | float) -> np.ndarray:
                found = spread.largest(name)
                known = spread.whole & np.isfinite(found)
                return np.where(known, np.minimum(level * found + size, most), most)

            attitude = at_end("attitude", last + label * pace, math.pi)
            rates = at_end("rates", last, 2.0)
            extent, fastest = spread.largest("distance"), spread.largest("speed")
            moved = last * extent + np.ldexp(label, -units) * fastest
            position = path * at_end("position", moved, margins.AS_LARGE * extent)
            velocity = path * at_end("velocity", last * fastest, margins.AS_LARGE * fastest)
        length, speed = (numbers.whole_numbers(e)[places] for e in (scaling.length, scaling.speed))
        return np.array([attitude, rates, np.ldexp(position, length), np.ldexp(velocity, speed)])

    @property
    def _by_chance(self) -> bool:
        """Whether errors come mainly from rounding."""
        return self._prepared.effective_tolerance <= _BY_CHANCE * self._epsilon

    def _compared(self, block: BatchBlock, some: np.ndarray, starts: Starts) -> Spread:
        """Distance of members from runs at a tighter tolerance."""
        lanes = self._through(self._prepared.effective_tolerance * _TIGHTER)
        most = _MORE_STEPS * int(starts.steps.max()) + 1000
        there = lanes.at_samples(starts, block.moments[:, some], most)
        spread = Spread(len(some))
        for row, (state, apart) in enumerate(zip(there, block.states[:, :, some] - there, strict=True)):
            known = np.flatnonzero(block.reached[some] > row)
            away = apart[:, known, None]
            spread.note(known, **self._measures.differences(state[:, known], away, starts, known))
        return spread

    def _through(self, tolerance: float | None) -> ShadowLanes:
        if tolerance not in self._lanes:
            self._lanes[tolerance] = ShadowLanes(self._traced, self._width, tolerance)
        return self._lanes[tolerance]

    def _followed(self, starts: Starts) -> Spread:
        epsilon = self._epsilon
        lost, lead = math.pi / epsilon, "attitude" if self._measures.carried else "rates"
        plain = plain_perturbations(self._prepared.system)
        errors = replace(plain, own=plain.own * max(self._prepared.effective_tolerance / epsilon, 1.0))
        quarter = starts.begin + _EARLY * (starts.end - starts.begin)

        def through(tolerance: float | None, which: np.ndarray) -> tuple[Spread, np.ndarray]:
            some = starts.of(which)
            carrier = MemberCarrier(self._through(tolerance), some)
            ensemble = ShadowEnsemble(carrier, self._measures, some, errors, epsilon, stretches=_STRETCHES)
            spread = ensemble.follow(lost=lost)
            return spread, spread.largest(lead, quarter[which])

        spread, early = through(LOOSE, np.arange(len(quarter)))
        for tolerance, tighter in ((LOOSE, FINER), (FINER, None)):
            grown = spread.largest(lead)
            with np.errstate(divide="ignore", invalid="ignore"):
                power = np.log(grown / early) / math.log(1 / _EARLY)
            far = (grown > _DRIFTED / tolerance) & (power > _FASTER)
            if tighter is None:
                far &= spread.whole & (grown < margins.GONE * lost) & (starts.steps < margins.TIGHT_STEPS)
            again = np.flatnonzero(far | (~spread.whole & (tolerance == LOOSE)))
            if len(again):
                anew, early[again] = through(tighter, again)
                spread.put(again, anew)
        return spread
