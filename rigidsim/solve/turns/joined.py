"""Joining angles that are functions of the state from sample to sample, with their full turns."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import heyoka as hy
import mpmath
import numpy as np

from rigidsim.model.euler_poles import UNDEFINED
from rigidsim.model.outputs import Recorded
from rigidsim.model.system import System
from rigidsim.solve.checkpoint import Arrays
from rigidsim.solve.compiled import CompiledFunction, evaluate_rows, interruptible
from rigidsim.solve.effects.angle_wrapping import AngleWrapping
from rigidsim.solve.precision import Precision
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.turns.count import FollowedSystem, TurnCounter, angles_to_join, doubtful_rows, is_sparse
from rigidsim.solve.turns.steps import AngleSteps, Place, SteadyAngles, advances_steadily, at_poles


@dataclass
class Continuity:
    """What joins the variables of a block of samples to those of the block before.

    Attributes:
        turns: full turns added to the joined angles, (angles,).
        wrapped_from: time (internal units) of the first sample with unknown turns: from there on, angles
            are recorded within one turn; nan if all are known, and -inf for states that aren't samples.
    """

    turns: np.ndarray = field(default_factory=lambda: np.zeros(3, dtype=np.int64))
    last_angles: np.ndarray | None = None  # of the latest sample, float64, before those turns; None before it
    last_quaternion: np.ndarray | None = None
    last_time: float = math.nan  # of the latest sample, internal units, if turns are counted from it
    last_state: np.ndarray | None = None
    wrapped_from: float = math.nan

    def pack(self) -> Arrays:
        """It as arrays of a checkpoint."""
        arrays = {"joined_turns": self.turns, "joined_wrapped": np.array([self.wrapped_from])}
        if self.last_angles is not None:
            arrays["joined_angles"] = self.last_angles
        if self.last_quaternion is not None:
            arrays["joined_quaternion"] = self.last_quaternion
        if self.last_state is not None:
            arrays |= {"joined_state": self.last_state, "joined_time": np.array([self.last_time])}
        return arrays

    @classmethod
    def unpacked(cls, arrays: Mapping[str, np.ndarray]) -> Continuity:
        """Restored from them."""
        return cls(
            np.asarray(arrays.get("joined_turns", np.zeros(3)), dtype=np.int64),
            arrays.get("joined_angles"),
            arrays.get("joined_quaternion"),
            float(arrays.get("joined_time", [math.nan])[0]),
            arrays.get("joined_state"),
            float(arrays.get("joined_wrapped", [math.nan])[0]),
        )


_LOOKED_AT = 2.0**-16  # singular factor, in double precision, below which it is worked out in the run's own
_DOUBTFUL = 2.0  # rad, as in ``turn_count``
_POLE = 1e-6  # size of an angle's sine and cosine below which dense samples aren't looked at in parts


class JoinedAngles:
    """The angles of a system that are joined from sample to sample.

    Between dense samples, which tell all turns, they take the nearest way. Between sparse ones they advance
    steadily, if that is known (``rigidsim.model.observables.steadiness``), and are followed along the motion
    elsewhere, if that is ``countable``. An angle that is undefined is NaN; only of Euler angles in their pole
    the first keeps the value it had, and the last is what it leaves of the turn that both share.
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
        ends = np.cumsum([r.count for r in self.variables]).tolist()
        self._parts = {r.name: slice(end - r.count, end) for r, end in zip(self.variables, ends, strict=True)}
        self._system, self._wrapping = system, wrapping
        self._compiled, self._precision, self._steps = compiled, precision, AngleSteps(self.variables)
        self.dense = not self.variables or not is_sparse(system)
        steady = [] if self.dense else [r for r in self.variables if advances_steadily(system, r)]
        self._steady_variables = steady
        self._with_poles = [(r, r.poles) for r in self.variables if r.poles is not None]
        self._others = [r for r in self.variables if r not in steady]
        self.sparse = bool(self._others) and not self.dense
        self._followed = FollowedSystem(system)
        followed = self._followed.system
        countable = countable and followed is not None
        followed = followed or system
        self._steady = SteadyAngles(followed, steady) if steady else None
        self._counter = TurnCounter(followed, self._others) if self._others and countable else None
        self._way = TurnCounter(followed, steady) if steady and countable else None
        sizes = [size for r in self.variables for size in r.squared_sizes]
        self.sizes = compiled(sizes) if sizes else None
        self._least = (UNDEFINED * float(precision.epsilon)) ** 2
        nothing = precision.array([mpmath.mpf(0)])
        with np.errstate(invalid="ignore"):
            self._zero, self._undefined = nothing[0], (nothing / nothing)[0]

    def __bool__(self) -> bool:
        return bool(self.variables)

    def first(self) -> Continuity:
        """State before the first sample."""
        return Continuity(np.zeros(max(3, len(self.columns)), dtype=np.int64))

    def part(self, variable: Recorded) -> slice | None:
        """Where a variable's angles are among the joined ones; None if they aren't joined."""
        return self._parts.get(variable.name)

    def joined(
        self, known: Continuity, angles: np.ndarray, sizes: np.ndarray | None, samples: SampleBlock
    ) -> tuple[np.ndarray, Continuity]:
        """Angles (n, angles) with their turns, and what the next block is joined to."""
        squared = self._all_sizes(sizes, len(angles))
        lost = (squared < self._least) | ~np.isfinite(squared)
        if lost.any():
            angles = angles.copy()
            angles[lost] = self._zero  # undefined: no direction
        angles = self._kept_in_poles(known, angles, samples)
        plain, size = angles.astype(np.float64), np.sqrt(squared)
        times, states = samples.times.astype(np.float64), self._followed.states(samples)
        block = _DoubleSamples(times, states, plain, size)
        if known.wrapped_from == -math.inf:  # apart from the samples
            turns, wrapped_from = np.zeros(angles.shape, dtype=np.int64), known.wrapped_from
        elif self.dense:
            turns = known.turns[: len(self.columns)] + np.cumsum(self._nearest(known, block), axis=0)
            wrapped_from = known.wrapped_from
        else:
            turns, wrapped_from = self._sparse_turns(known, block)
        found = self._wrapping.unwrapped(angles, turns)
        found[lost] = self._undefined
        known = replace(known, turns=turns[-1], last_angles=plain[-1], wrapped_from=wrapped_from)
        if not self.dense or self._counter is not None:
            known = replace(known, last_time=float(times[-1]), last_state=states[-1])
        return found, known

    def follow(self, known: Continuity, time: float) -> None:
        """Count turns from the latest sample up to where the run is, for at most a fifth of a second."""
        latest = _latest(known)
        if self._counter is not None and latest is not None and math.isnan(known.wrapped_from):
            self._counter.begin(_of(latest, self._columns_of(self._others)))
            self._counter.follow(time)

    def _all_sizes(self, sizes: np.ndarray | None, count: int) -> np.ndarray:
        """Squared sizes (n, angles); 1 for Euler angles, which are judged by their middle one."""
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

    def _kept_in_poles(self, known: Continuity, angles: np.ndarray, samples: SampleBlock) -> np.ndarray:
        """Euler angles (n, angles) whose first one keeps its value where it is undefined."""
        if known.wrapped_from == -math.inf:  # apart from the samples
            return angles
        for number, (variable, poles) in enumerate(self._with_poles):
            first = int(self._columns_of([variable])[0])
            plain = angles[:, first : first + 3].astype(np.float64)
            side, factor = at_poles(poles.sequence, plain[:, 1])
            if not (factor < _LOOKED_AT).any():
                continue
            squares = evaluate_rows(self._squared_factors, samples.states, times=samples.times)
            lost = np.asarray(squares[number].astype(np.float64) < self._least)
            latest = np.maximum.accumulate(np.where(lost, -1, np.arange(len(lost))))
            begun = math.nan if known.last_angles is None else known.last_angles[first]
            kept = np.where(latest < 0, begun, plain[latest, 0])
            angles = angles.copy()
            for row in np.flatnonzero(lost & np.isfinite(kept) & (kept != plain[:, 0])):
                value = self._precision.of_double(kept[row])
                moved = value - angles[row, first]
                angles[row, first] = value
                angles[row, first + 2] = angles[row, first + 2] - side[row] * moved
        return angles

    @cached_property
    def _squared_factors(self) -> CompiledFunction:
        """Squared factors that vanish in the poles, compiled once a sample comes near one."""
        squares = [poles.squared_factor for _, poles in self._with_poles]
        return interruptible(lambda: self._compiled(squares))

    def _columns_of(self, variables: Sequence[Recorded]) -> np.ndarray:
        """Columns of the variables' angles among the joined ones."""
        all_of = np.arange(len(self.columns))
        return np.concatenate([all_of[:0], *(all_of[self.part(r)] for r in variables)])

    def _doubtful(self, jumps: np.ndarray, angles: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """Rows whose turns dense samples don't tell because an angle is near its pole."""
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

    def _nearest(self, known: Continuity, block: _DoubleSamples) -> np.ndarray:
        """Full turns (n, angles) from row to row, each the nearest, except near a pole."""
        before = block.angles[0] if known.last_angles is None else known.last_angles
        angles = np.vstack([before, block.angles])
        jumps = self._steps.jumps(angles)
        made = np.rint((jumps - np.diff(angles, axis=0)) / (2 * np.pi)).astype(np.int64)
        if self._counter is None:
            return made
        for row in self._doubtful(jumps, angles, block.sizes):
            latest = block.place(row - 1) if row else _latest(known)
            if latest is not None:
                self._counter.begin(latest)
                found = self._counter.turns(block.place(row))
                made[row] = made[row] if found is None else found
        return made

    def _sparse_turns(self, known: Continuity, block: _DoubleSamples) -> tuple[np.ndarray, float]:
        """Full turns (n, angles) of each row, and the time from which those of followed angles are lost."""
        turns = np.zeros(block.angles.shape, dtype=np.int64)
        wrapped_from = known.wrapped_from
        others, steady = self._columns_of(self._others), self._columns_of(self._steady_variables)
        if len(others):
            turns[:, others], wrapped_from = self._counted(known, block, others)
        if self._steady is not None:
            turns[:, steady] = known.turns[steady] + np.cumsum(self._advanced(known, block, steady), axis=0)
        return turns, wrapped_from

    def _advanced(self, known: Continuity, block: _DoubleSamples, columns: np.ndarray) -> np.ndarray:
        """Full turns (n, columns) from row to row of angles that advance steadily."""
        assert self._steady is not None
        made = np.zeros((len(block.times), len(columns)), dtype=np.int64)
        for row in range(len(block.times)):
            latest = block.place(row - 1) if row else _latest(known)
            if latest is None:
                continue
            before, here = _of(latest, columns), _of(block.place(row), columns)
            found = self._steady.turns(before, here, block.sizes[row, columns])
            if found is None and self._way is not None:
                self._way.begin(before)
                found = self._way.turns(here)
            if found is None:
                found = -np.rint((here.angles - before.angles) / (2 * np.pi)).astype(np.int64)
            made[row] = found
        return made

    def _counted(
        self, known: Continuity, block: _DoubleSamples, columns: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """Full turns (n, columns) counted along the motion, zero once lost, and the time when they are."""
        turns = np.zeros((len(block.times), len(columns)), dtype=np.int64)
        latest, before, wrapped_from = _latest(known), known.turns[columns], known.wrapped_from
        for row, time in enumerate(block.times.tolist()):
            if not math.isnan(wrapped_from):
                break
            made: np.ndarray | None = None
            here = block.place(row)
            if self._counter is not None and latest is not None:
                self._counter.begin(_of(latest, columns))
                made = self._counter.turns(_of(here, columns))
            elif self._counter is not None and latest is None:  # at the first sample
                made = np.zeros(len(columns), dtype=np.int64)
            if made is None:
                wrapped_from = time
                break
            before = turns[row] = before + made
            latest = here
        return turns, wrapped_from


@dataclass(frozen=True)
class _DoubleSamples:
    """Samples in float64, internal units; angles (n, angles) without turns, sizes of sines and cosines."""

    times: np.ndarray
    states: np.ndarray
    angles: np.ndarray
    sizes: np.ndarray

    def place(self, row: int) -> Place:
        """One sample as a place."""
        return Place(float(self.times[row]), self.states[row], self.angles[row])


def _of(place: Place, columns: np.ndarray) -> Place:
    """A place with only some of its angles."""
    return replace(place, angles=place.angles[columns])


def _latest(known: Continuity) -> Place | None:
    """The latest sample; None if there is none."""
    if known.last_state is None or known.last_angles is None:
        return None
    return Place(known.last_time, known.last_state, known.last_angles)
