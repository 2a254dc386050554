"""Angles that are functions of the state, joined from sample to sample with their full turns."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import heyoka as hy
import mpmath
import numpy as np

from rigidsim.model.outputs import Recorded
from rigidsim.model.system import System
from rigidsim.solve.angle_wrapping import AngleWrapping
from rigidsim.solve.engine import CompiledFunction
from rigidsim.solve.precision import Precision
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.turn_count import Place, TurnCounter, angles_to_join, doubtful_rows, is_sparse, nearest

UNDEFINED = 16.0
"""Rounding errors of an angle's sine and cosine below which both are but rounding: there it is NaN."""
_DOUBTFUL = 2.0  # rad, as in ``turn_count``
_POLE = 1e-6  # size of an angle's sine and cosine below which dense samples aren't looked at in parts


@dataclass
class Continuity:
    """What joins the variables of a block of samples to those of the block before.

    Attributes:
        turns: full turns added to the joined angles, (angles,).
        last_angles, last_quaternion: of the latest sample, float64, the angles before those turns; None
            before the first block.
        last_time, last_state: of the latest sample, float64, internal units, where turns are counted from it.
        wrapped_from: time (internal units) of the first sample whose turns aren't known: from there on angles
            are recorded within one turn; nan where all are known.
    """

    turns: np.ndarray = field(default_factory=lambda: np.zeros(3, dtype=np.int64))
    last_angles: np.ndarray | None = None
    last_quaternion: np.ndarray | None = None
    last_time: float = math.nan
    last_state: np.ndarray | None = None
    wrapped_from: float = math.nan


class JoinedAngles:
    """The angles of a system that are joined.

    Attributes:
        sparse: whether the samples are too sparse to tell turns.
        columns: of the system's outputs, one for each angle.

    Args:
        compiled: compiles expressions of the states.
        precision: the run's.
        countable: whether the motion between sparse samples can be followed.
    """

    def __init__(
        self,
        system: System,
        compiled: Callable[[list[hy.expression]], CompiledFunction],
        wrapping: AngleWrapping,
        *,
        precision: Precision,
        countable: bool,
    ) -> None:
        self.variables = angles_to_join(system)
        self.columns = [r.first + i for r in self.variables for i in range(r.count)]
        self.sparse = bool(self.variables) and is_sparse(system)
        self._system, self._wrapping = system, wrapping
        self._counter = TurnCounter(system, self.variables) if self.variables and countable else None
        sizes = [size for r in self.variables for size in r.squared_sizes]
        self.sizes = compiled(sizes) if sizes else None
        self._least = (UNDEFINED * float(precision.epsilon)) ** 2
        nothing = precision.array([mpmath.mpf(0)])
        with np.errstate(invalid="ignore"):
            self._zero, self._undefined = nothing[0], (nothing / nothing)[0]

    def __bool__(self) -> bool:
        return bool(self.variables)

    def first(self) -> Continuity:
        """Before the first sample."""
        return Continuity(np.zeros(max(3, len(self.columns)), dtype=np.int64))

    def part(self, variable: Recorded) -> slice | None:
        """Where a variable's angles are among the joined ones; None where it isn't."""
        place = 0
        for joined in self.variables:
            if joined.name == variable.name:
                return slice(place, place + joined.count)
            place += joined.count
        return None

    def joined(
        self, known: Continuity, angles: np.ndarray, sizes: np.ndarray | None, samples: SampleBlock
    ) -> tuple[np.ndarray, Continuity]:
        """Angles (n, angles) with their turns, and what the next block is joined to.

        Args:
            angles: without turns.
            sizes: squared, of those that have one, (their number, n).
        """
        size = self._all_sizes(sizes, len(angles))
        lost = (size < self._least) | ~np.isfinite(size)
        if lost.any():
            angles = angles.copy()
            angles[lost] = self._zero  # no direction
        if self.sparse:
            turns, known = self._counted(known, angles, samples)
        else:
            turns, known = self._unwrapped(known, angles, np.sqrt(size), samples)
        found = self._wrapping.unwrapped(angles, turns)
        if lost.any():
            found[lost] = self._undefined
        return found, known

    def follow(self, known: Continuity, time: float) -> None:
        """Count turns from the latest sample on as far as the run has come, for a fifth of a second at most.

        Args:
            time: internal units.
        """
        if self._counter is not None and (latest := _latest(known)) is not None:
            self._counter.begin(latest)
            self._counter.follow(time)

    def _all_sizes(self, sizes: np.ndarray | None, count: int) -> np.ndarray:
        """(n, angles), squared; 1 for Euler angles, which are told by their middle one."""
        found = np.ones((count, len(self.columns)))
        if sizes is None:
            return found
        place = 0
        plain = np.asarray(sizes).astype(np.float64)
        for variable in self.variables:
            if variable.squared_sizes:
                part = self.part(variable)
                found[:, part] = plain[place : place + variable.count].T
                place += variable.count
        return found

    def _doubtful(self, jumps: np.ndarray, angles: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """Rows whose turns dense samples don't tell, since an angle is near its pole."""
        found: set[int] = set()
        for variable in self.variables:
            part = self.part(variable)
            if not variable.squared_sizes:
                rows = doubtful_rows(jumps[:, part], angles[:, part], self._system.sequence)
            else:
                rows = np.flatnonzero((np.abs(jumps[:, part]) > _DOUBTFUL).any(axis=1))
                rows = np.array([r for r in rows if (sizes[r, part] > _POLE).all()], dtype=np.int64)
            found |= set(rows.tolist())
        return np.array(sorted(found), dtype=np.int64)

    def _unwrapped(
        self, known: Continuity, block: np.ndarray, sizes: np.ndarray, samples: SampleBlock
    ) -> tuple[np.ndarray, Continuity]:
        """The full turns that make each angle nearest to the sample before, but for those near a pole, whose
        way is followed.
        """
        plain = block.astype(np.float64)
        before = plain[0] if known.last_angles is None else known.last_angles
        angles = np.vstack([before, plain])
        made = -np.rint(np.diff(angles, axis=0) / (2 * np.pi)).astype(np.int64)
        if self._counter is not None:
            jumps = nearest(np.diff(angles, axis=0))
            times, states = samples.times.astype(np.float64), samples.states.astype(np.float64)
            for row in self._doubtful(jumps, angles, sizes):
                latest = Place(times[row - 1], states[row - 1], plain[row - 1]) if row else _latest(known)
                if latest is not None:
                    self._counter.begin(latest)
                    found = self._counter.turns(Place(times[row], states[row], plain[row]))
                    made[row] = made[row] if found is None else found
            known = replace(known, last_time=float(times[-1]), last_state=states[-1])
        turns = known.turns[: plain.shape[1]] + np.cumsum(made, axis=0)
        return turns, replace(known, turns=turns[-1], last_angles=plain[-1])

    def _counted(
        self, known: Continuity, block: np.ndarray, samples: SampleBlock
    ) -> tuple[np.ndarray, Continuity]:
        """The full turns that the motion from each sample to the next makes; none once they are lost."""
        plain, turns = block.astype(np.float64), np.zeros(block.shape, dtype=np.int64)
        times, states = samples.times.astype(np.float64), samples.states.astype(np.float64)
        for row, (time, state, angles) in enumerate(zip(times.tolist(), states, plain, strict=True)):
            latest, here = _latest(known), Place(time, state, angles)
            if not math.isnan(known.wrapped_from):
                break
            made: np.ndarray | None = None
            if self._counter is not None and latest is not None:
                self._counter.begin(latest)
                made = self._counter.turns(here)
            elif self._counter is not None and known.last_angles is None:  # the first sample
                made = np.zeros(plain.shape[1], dtype=np.int64)
            if made is None:
                known = replace(known, wrapped_from=time, turns=turns[row])
                break
            turns[row] = known.turns[: plain.shape[1]] + made
            known = replace(known, turns=turns[row], last_angles=angles, last_time=time, last_state=state)
        return turns, known


def _latest(known: Continuity) -> Place | None:
    """The latest sample; None without one, and where the turns are lost."""
    if known.last_state is None or known.last_angles is None or not math.isnan(known.wrapped_from):
        return None
    return Place(known.last_time, known.last_state, known.last_angles)
