"""What a run's Euler angles stand for, as a value and as numbers of a checkpoint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

Angles = tuple[float, float, float]
"""Euler angles in the order of their sequence, rad."""


class AngleState(NamedTuple):
    """Which Euler angles the angle states stand for; all fields are empty or 0 without angle states.

    Attributes:
        turns: full turns of the angle states.
        chart: 0 for angles of the requested sequence, 1 for those of its partner
            (``rigidsim.solve.effects.charts``).
        reference: in the partner chart, the requested angles at the latest natural step, rad; else zeros.
    """

    turns: tuple[int, ...] = ()
    chart: int = 0
    reference: tuple[float, ...] = ()


def pack_angles(found: Sequence[AngleState]) -> np.ndarray:
    """One row for each: turns, chart, and the bits of the reference angles; (n, 0) without angle states.

    Unfinished runs have been saved in this format before ``AngleState`` was a value of its own.
    """
    rows = [
        [*angles.turns, angles.chart, *np.array(angles.reference, dtype=np.float64).view(np.int64)]
        for angles in found
        if angles.turns
    ]
    return np.array(rows, dtype=np.int64).reshape(len(found), -1)


def unpack_angles(rows: np.ndarray) -> list[AngleState]:
    """Angle states restored from such rows.

    Raises:
        ValueError: rows of another length.
    """
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
