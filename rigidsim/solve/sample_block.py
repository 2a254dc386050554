"""A block of samples on its way from the integration to its receiver, and what its Euler angles stand for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

Angles = tuple[float, float, float]
"""Euler angles in the order of their sequence, rad."""


class AngleState(NamedTuple):
    """Which Euler angles the angle states stand for; all fields are empty or 0 without angle states."""

    turns: tuple[int, ...] = ()  # full turns of the angle states
    chart: int = 0  # 1 for angles of the partner (``rigidsim.solve.effects.charts``)
    reference: tuple[float, ...] = ()  # requested angles at the latest step, rad, in the partner chart


_NOTHING = np.zeros(0)
_NO_ANGLES = AngleState()


@dataclass(frozen=True)
class SampleBlock:
    """Consecutive samples; all columns have one row for each.

    Attributes:
        reference: (n, 3) float64, rad: in the partner chart the asked angles shortly before each sample,
            from which it has its turns and its branch; zeros in the asked chart, (n, 0) without angle
            states.
    """

    first: int  # index of the first sample
    times: np.ndarray  # (n,), internal units, in the run's precision
    states: np.ndarray  # (n, states), internal units, in the run's precision, angles wrapped
    turns: np.ndarray  # (n, 3) int64, full turns of the angle states; (n, 0) without angle states
    chart: np.ndarray  # (n,) int64, 0 in the asked Euler sequence, 1 in its partner
    reference: np.ndarray
    put_back: np.ndarray  # (n, projected scalars) float64, what was put back of each until the sample
    joined: np.ndarray  # (n, angles) float64, rad: joined angles with their full turns; NaN where undefined

    @classmethod
    def of(
        cls,
        first: int,
        times: np.ndarray,
        states: np.ndarray,
        angles: AngleState = _NO_ANGLES,
        put_back: np.ndarray = _NOTHING,
        reference: np.ndarray | None = None,
    ) -> SampleBlock:
        """Samples with the same turns, chart and corrections, and reference angles if none are given."""
        n = len(times)
        turns = np.array([angles.turns], dtype=np.int64)
        if reference is None:
            reference = np.array([angles.reference], dtype=np.float64).repeat(n, axis=0)
        return cls(
            first,
            times,
            states,
            turns.repeat(n, axis=0),
            np.full(n, angles.chart, dtype=np.int64),
            reference,
            put_back[None, :].repeat(n, axis=0),
            np.zeros((n, 0)),
        )

    def __len__(self) -> int:
        return len(self.times)

    @property
    def _columns(self) -> tuple[np.ndarray, ...]:
        return self.times, self.states, self.turns, self.chart, self.reference, self.put_back, self.joined

    def rows(self, start: int, stop: int) -> SampleBlock:
        """Samples start ... stop-1 of the block, or as many of them as there are."""
        if start == 0 and stop >= len(self):
            return self
        return SampleBlock(self.first + start, *(column[start:stop] for column in self._columns))

    def only(self, which: np.ndarray, first: int) -> SampleBlock:
        """Some of the samples, by a mask, as those from a number on."""
        return SampleBlock(first, *(column[which] for column in self._columns))

    @staticmethod
    def concatenated(blocks: Sequence[SampleBlock]) -> SampleBlock:
        """Join at least one block with those that follow it."""
        if len(blocks) == 1:
            return blocks[0]
        columns = zip(*[block._columns for block in blocks], strict=True)
        return SampleBlock(blocks[0].first, *[np.concatenate(column) for column in columns])


def pack_angles(found: Sequence[AngleState]) -> np.ndarray:
    """One row for each: turns, chart, and the bits of the reference angles; (n, 0) without angle states.

    Unfinished runs have been saved in this format before ``AngleState`` was a separate value.
    """
    rows = [
        [*angles.turns, angles.chart, *np.array(angles.reference, dtype=np.float64).view(np.int64)]
        for angles in found
        if angles.turns
    ]
    return np.array(rows, dtype=np.int64).reshape(len(found), -1)


def unpack_angles(rows: np.ndarray) -> list[AngleState]:
    """Angle states restored from such rows; raises a ValueError for rows of another length."""
    if not rows.shape[1]:
        return [AngleState()] * len(rows)
    if rows.shape[1] != 7:
        raise ValueError(f"angles of shape {rows.shape}")
    rows = np.ascontiguousarray(rows, dtype=np.int64)
    reference = np.ascontiguousarray(rows[:, 4:]).view(np.float64)
    return [
        AngleState((a, b, c), chart, tuple(angles))
        for (a, b, c, chart, *_), angles in zip(rows.tolist(), reference.tolist(), strict=True)
    ]
