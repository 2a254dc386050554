"""Shadow ensembles: the simulated effect of rounding and truncation errors on motions.

Beside each motion go a few that are perturbed, again and again, as a step's errors perturb it, but many times
as much. Their distance over that factor is an error as the motion's own is: made anywhere, in any state, and
carried from there to the end, whatever is passed on the way. No law of growth is assumed.

Distances stay small (or are drawn in), so that they grow as infinitely small ones do. A loose tolerance is
good enough, since what is cut off from the series is a smooth function of the state and nearly the same for
all. Perturbations come between stretches of several steps: half of those that a stretch stands for before it,
half after, so that few stretches suffice for errors that grow as time makes them; where they grow faster,
stretches become shorter.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rigidsim.solve.shadow.measures import Measures, Spread, Starts

PERTURBED = 3
"""Perturbed motions beside one motion. Of two, the true errors of 1.2 % of the motions would be beyond three
times what is announced, instead of 0.3 % (Student's t at 9, where one direction leads); of 60 planar spins
one was 11 times as wrong as announced.
"""
HOPELESS_STEPS = 32_768
"""Steps beyond the expected number after which a motion is given up, say on its way to a collision."""
_FIRST = 2.0**-40
"""Initial distance that stands for one epsilon."""
_LARGEST, _DRAWN_IN, _SATURATED, _NEARER = 2.0**-24, 2.0**-26, 2.0**-14, 2.0**-8
"""Distance from which perturbed motions are drawn in, and to where; distance that is no longer small, so that
the stretch is repeated; and by how much nearer if it can't be shorter. A chord that is drawn in leaves the
surfaces on which the motion's invariants are constant by half its square, which must stay below what the
perturbations did.
"""
_NEAREST = 1e-280
_NOTHING = 2.0**-96
"""Initial value, in internal units, that is zero but for the arithmetic of the scene, and no size: a state
that is measured alone would be lost after its first step.
"""
_SHORTEST, _LONGEST = 4, 4096
"""Steps of a stretch. They are counted in steps, among which those of a close passage are many, not in time,
of which they take little.
"""
_CALM, _WILD = 8.0, 64.0
"""Growth over a stretch below which stretches may become longer, and above which they become shorter."""


class EnsembleCarrier(Protocol):
    """What integrates motions and the perturbed ones beside them.

    Attributes:
        tolerance: tolerance of the steps; None for the precision's epsilon.
    """

    @property
    def tolerance(self) -> float | None:
        """See above."""

    def advance(
        self, which: np.ndarray, states: np.ndarray, begin: np.ndarray, end: np.ndarray, steps: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Go on by at most so many steps (motions,), and no further than to given times.

        Args:
            which: numbers of the motions.
            states: (states, motions, 1 + perturbed), the motion itself first.
            begin, end: (motions, 1 + perturbed), which differ by the same intervals.

        Returns:
            States, all of a motion's where it has arrived, but for the intervals; not finite if they can't be
            followed. Steps (motions,) that it took, and the times (motions,) that it reached.
        """

    def again(self, steps: float) -> EnsembleCarrier:
        """A carrier suited to the given number of further steps."""


@dataclass(frozen=True)
class Perturbations:
    """Errors that a step adds to each state, in epsilons.

    Attributes:
        together: most steps with the same error of the time. Over a load's period it would average out,
            which those of single steps don't.
    """

    own: float = 0.4  # random error relative to the state's own size
    shared: float = 0.0  # random error relative to the largest state's size
    series: float = 1.0  # truncation error of the series, over its value in these states
    first: float = 0.5  # error at the start relative to the state's own size
    clock: float = 0.3  # error of the time, for loads that depend on it
    ahead: float = 0.0  # internal time by which the time in which such a load counts is ahead of the scene's
    together: float = math.inf


class ShadowEnsemble:
    """Motions, and the perturbed ones beside each of them: ``time`` is what was reached, (motions,), and
    ``spread`` what was seen. The random draws are the same for all motions and each time, so that results
    don't depend on the company.

    Args:
        perturbations: errors of a step, in units of ``epsilon``.
        rounded: (states,) bool, which of the initial values were rounded; all by default.
        series: truncation errors (states,) of a step that begins in a state at a time and stands for so many,
            for a tolerance far above epsilon.
        stretches: number of stretches at least, of motions with many steps.
    """

    def __init__(
        self,
        carrier: EnsembleCarrier,
        measures: Measures,
        starts: Starts,
        perturbations: Perturbations,
        epsilon: float,
        *,
        rounded: np.ndarray | None = None,
        series: Callable[[np.ndarray, float, float], np.ndarray] | None = None,
        stretches: int = 12,
    ) -> None:
        self.carrier, self._measures, self._errors = carrier, measures, perturbations
        self._epsilon, self._series, self._stretches = epsilon, series, stretches
        self._begin(starts, starts.states != 0 if rounded is None else rounded[:, None])

    def _begin(self, starts: Starts, rounded: np.ndarray) -> None:
        self._starts, motions = starts, len(starts.begin)
        self._states = np.repeat(starts.states[:, :, None], 1 + PERTURBED, axis=2)
        self._factor = np.full(motions, _FIRST)  # distance for one epsilon
        self._largest = np.where(np.abs(starts.states) > _NOTHING, np.abs(starts.states), 0.0)
        self._weigh()
        self.time, self._steps = starts.begin.copy(), np.zeros(motions)
        self._ahead, self._cut = np.zeros(motions), np.zeros(motions)
        self._over = np.zeros(motions)
        self._random = np.random.default_rng(0)
        self.spread = Spread(motions)
        self._pace(starts.steps)
        self._stride = self._most.copy()
        normal = self._random.standard_normal((len(starts.states), 1, PERTURBED))
        sizes, every = np.where(rounded, self._largest, 0.0)[:, :, None], np.arange(motions)
        self._add(every, self._errors.first * sizes * normal)
        self._far = self._distances(every, self._apart(every))  # of the farthest

    def _pace(self, steps: np.ndarray) -> None:
        """Set the longest stretches of so many further steps (motions,)."""
        longest = 2.0 ** np.floor(np.log2(np.maximum(math.sqrt(2) * steps / self._stretches, 1.0)))
        self._most = np.minimum(np.clip(longest, _SHORTEST, _LONGEST), self._errors.together)
        self._expected = self._steps + steps
        self._last_steps = self._steps + 4 * steps + HOPELESS_STEPS

    def elsewhere(self, state: np.ndarray, start: float, end: float, steps: float) -> ShadowEnsemble:
        """The ensemble of another part of the motion, from another state (states,); carried alike."""
        other, begin = copy.copy(self), np.array([start])
        units, read = self._starts.rate_units, self._starts.parameters
        starts = Starts(state[:, None], begin, np.array([end]), np.array([steps]), units, read)
        other._begin(starts, starts.states != 0)
        return other

    def away_from(self, state: np.ndarray) -> float:
        """Distance of a single motion from another state (states,) at this time, relative to its size."""
        apart, angles = state - self._states[:, 0, 0], self._measures.angles
        apart[angles] -= self._measures.turn * np.rint(apart[angles] / self._measures.turn)
        return float(self._distances(np.array([0]), apart[:, None, None])[0])

    def prepare_for(self, steps: float) -> None:
        """Prepare for so many further steps beyond those expected."""
        self.carrier = self.carrier.again(steps)
        self._pace(np.full(len(self.time), steps))

    def follow(
        self,
        until: float = math.inf,
        go_on: Callable[[], bool] = lambda: True,
        lost: float = math.inf,
    ) -> Spread:
        """Follow the motions to their ends, or until a time, while ``go_on`` says so and not all is lost."""
        ends = np.minimum(self._starts.end, until)
        with np.errstate(all="ignore"):
            while True:
                going = np.flatnonzero(self.spread.whole & (self.time < ends) & (self._over < lost))
                if not len(going) or not go_on():
                    return self.spread
                self._go(going, ends[going])

    def all_lost(self, lost: float) -> bool:
        """Whether neither the attitude (or the rates) nor the position can be predicted any more."""
        return bool((self._over >= lost).all())

    # --- a stretch ------------------------------------------------------------------------------------------

    def _go(self, going: np.ndarray, until: np.ndarray) -> None:
        """Follow some motions through one stretch, as long as growth allows."""
        # the same number of draws in each round, for whichever motions
        rows = 2 + len(self._states) * (2 if self._errors.shared else 1)
        normal = self._random.standard_normal((rows, PERTURBED))
        before, begin, steps = self._states[:, going], self.time[going], self._steps[going]
        # what moves is rounded; until that is known, little is left out
        stride = np.where(steps > 0, self._stride[going], float(_SHORTEST))
        expected = np.minimum(np.maximum(self._expected[going] - steps, 1), stride)
        # a rounded time is another time, for loads that depend on it: another one at each step, whereas the
        # perturbed motions' lasts for the stretch
        late = np.abs(begin + self._errors.ahead)
        wrong = self._errors.clock * late * self._factor[going] / np.sqrt(expected)
        shifts = np.zeros((len(going), 1 + PERTURBED))
        shifts[:, 1:] = wrong[:, None] * normal[0]
        found, taken, reached = self.carrier.advance(
            going, before, begin[:, None] + shifts, until[:, None] + shifts, stride
        )
        grown = self._distances(going, found[:, :, 1:] - found[:, :, :1])
        followed = np.isfinite(found).all(axis=(0, 2)) & (steps <= self._last_steps[going])
        well = followed & (grown < _SATURATED)
        if not well.all():
            self.spread.whole[going[~followed]] = False
            self._repeat(going[followed & ~well])
            if not well.any():
                return
            going, before, found = going[well], before[:, well], found[:, well]
            taken, reached, grown, until = taken[well], reached[well], grown[well], until[well]
            stride = stride[well]
        growth = grown / np.maximum(self._far[going], 1e-300)
        asked = self._stride[going]
        shorter = np.where(growth > _WILD, np.maximum(asked / 2, _SHORTEST), asked)
        self._stride[going] = np.where(growth < _CALM, np.minimum(2 * asked, self._most[going]), shorter)
        self._steps[going] += taken
        self.time[going] = reached
        sizes = np.maximum(np.abs(before[:, :, 0]), np.abs(found[:, :, 0]))
        if (sizes > self._largest[:, going]).any():
            self._largest[:, going] = np.maximum(self._largest[:, going], sizes)
            self._weigh()
        sizes = np.where(before[:, :, 0] != found[:, :, 0], sizes, 0.0)  # what stands still isn't rounded
        if angles := self._measures.angles:  # which grow, and step control with them
            found[angles] -= self._measures.turn * np.rint(found[angles, :, :1] / self._measures.turn)
        self._states[:, going] = found
        even = taken >= stride  # one that ended early will be followed by another short one
        likely = np.where(even, self._stride[going], np.minimum(2 * taken, self._stride[going]))
        self._perturb(going, sizes, taken, growth, np.where(reached < until, likely, 0.0), normal[1:])
        apart = self._apart(going)
        far = self._far[going] = self._distances(going, apart)
        if (far > _LARGEST).any():
            self._move(going, np.where(far > _LARGEST, _DRAWN_IN / np.maximum(far, _LARGEST), 1.0))
            apart = self._apart(going)
        self._note(going, apart)

    def _repeat(self, which: np.ndarray) -> None:
        """Set up stretches that have to be repeated: shorter, or from nearer."""
        short = self._stride[which] <= _SHORTEST
        self._stride[which] = np.maximum(self._stride[which] / 8, _SHORTEST)
        self._move(which[short], np.full(int(short.sum()), _NEARER))
        self.spread.whole[which] &= self._factor[which] > _NEAREST

    def _perturb(
        self,
        which: np.ndarray,
        sizes: np.ndarray,
        taken: np.ndarray,
        growth: np.ndarray,
        likely: np.ndarray,
        normal: np.ndarray,
    ) -> None:
        """Add errors of half of the steps taken, and of half of those likely in the next stretch, (motions,),
        to what moves; of random numbers (1 + states, perturbed), and as many more for shared errors.
        """
        errors, states = self._errors, len(sizes)
        left = np.maximum(self._expected[which] - self._steps[which], 1)
        ahead = np.minimum(likely, left) / 2
        steps = np.maximum(taken - self._ahead[which], 0.0) + ahead
        self._ahead[which] = ahead
        # of errors made all along a stretch of exponential growth g a part 1 / ln g grows as much (variances)
        root = np.sqrt(steps / np.minimum(np.maximum(np.log(growth), 1.0), math.log(_WILD)))[:, None]
        added = errors.own * (root.T * sizes)[:, :, None] * normal[1 : 1 + states, None]
        if errors.shared:
            size = errors.shared * root[:, 0] * sizes[self._measures.felt].max(axis=0, initial=0.0)
            moving = self._largest[:, which, None] > 0
            added += size[:, None] * np.where(moving, normal[1 + states :, None], 0.0)
        for n, motion in enumerate(which if self._series is not None else ()):
            assert self._series is not None
            of_step = self._series(self._states[:, motion, 0], float(self.time[motion]), float(steps[n]))
            wrong = errors.series * of_step / self._epsilon
            # one step stands for all of the stretch: they add up, or walk where their errors change sign
            added[:, n] += wrong[:, None] * (steps[n] + math.sqrt(steps[n]) * normal[0])
            cut = self._distances(which[n : n + 1], wrong[:, None, None])
            self._cut[motion] += steps[n] * float(cut[0])
        self._add(which, added)

    def _add(self, which: np.ndarray, added: np.ndarray) -> None:
        felt = self._measures.felt[:, None, None]
        self._states[:, which, 1:] += np.where(felt, self._factor[which][:, None] * added, 0.0)

    def _move(self, which: np.ndarray, factor: np.ndarray) -> None:
        """Bring perturbed motions nearer, in the same directions."""
        self._factor[which] *= factor
        self._far[which] *= factor
        self._states[:, which, 1:] = self._states[:, which, :1] + factor[:, None] * self._apart(which)

    def _apart(self, which: np.ndarray) -> np.ndarray:
        return np.asarray(self._states[:, which, 1:] - self._states[:, which, :1])

    def _distances(self, which: np.ndarray, apart: np.ndarray) -> np.ndarray:
        """Distance of the farthest perturbed motion (motions,), relative to the states' size."""
        scaled = apart * self._inverse[:, which, None]
        squares = self._measures.groups @ (scaled * scaled).reshape(len(apart), -1)
        largest: np.ndarray = np.sqrt(squares.reshape(-1, *apart.shape[1:]).max(axis=(0, 2)))
        return largest

    def _weigh(self) -> None:
        """Update inverse sizes (states, motions) of groups; 0 for what nothing feels or never moved."""
        groups = self._measures.groups
        sizes = groups.T @ (groups[:, :, None] * self._largest).max(axis=1)
        self._inverse = np.where(sizes > 0, 1 / np.maximum(sizes, 1e-150), 0.0)

    def _note(self, which: np.ndarray, apart: np.ndarray) -> None:
        states, unit = self._states[:, which, 0], self._factor[which]
        found = self._measures.differences(states, apart, self._starts, which, unit)
        cut, steps = self._cut[which], self._steps[which]
        self.spread.note(which, time=self.time[which], steps=steps, cut=cut, **found)
        lead = found["attitude" if self._measures.carried else "rates"]
        if self._measures.places["position"]:
            extent = self.spread.largest("distance")[which]
            lead = np.where(found["position"] * self._epsilon > extent, lead, 0.0)
        self._over[which] = lead
