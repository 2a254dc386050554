"""Rows of a trajectory that can't be used are refused, by their number in the file, and gaps are told."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.trajectories import Trajectory
from rigidsim.store.many_rows import blocks_of, flagged, steps_of, usual, usual_step

_NORM = 1e-3  # that the usual norm of a quaternion may differ from one, beyond which it is told
_DAMAGED = 0.05  # that a norm may differ from those around it; integrators let it drift, and more slowly
_AROUND = 2  # rows on each side
_GAP = 1000.0  # times the median spacing, from which on a gap is told


def refuse_values(found: Trajectory, names: Iterable[str]) -> None:
    """Refuse columns with values that aren't finite."""
    for name in names:
        bad, at = _not_finite(found.columns[name])
        if bad:
            raise RigidsimError(
                f"{found.source}: {found.row(at)}: {name} is no finite number ({bad:,} "
                "such rows); remove these rows, or write them anew"
            )


def _not_finite(column: np.ndarray) -> tuple[int, int]:
    return flagged(lambda rows: ~np.isfinite(column[rows]), len(column))


def refuse_rows(
    found: Trajectory, times: np.ndarray, quaternions: np.ndarray | None, matrices: np.ndarray | None
) -> list[str]:
    """Refuse times (rows,) that don't ascend, quaternions (rows, 4) and matrices (rows, 3, 3) that are no
    rotations; the rest that a user should know of them.

    Raises:
        RigidsimError: the first row that can't be used, and how many there are.
    """
    count = len(times)
    again, at = flagged(lambda rows: steps_of(times, rows) == 0, count - 1)
    if again:
        raise RigidsimError(
            f"{found.source}: {found.row(at + 1)} has the time of the row before ({again:,} such "
            "rows); keep one row for each time"
        )
    back, at = flagged(lambda rows: steps_of(times, rows) < 0, count - 1)
    if back:
        raise RigidsimError(
            f"{found.source}: {found.row(at + 1)} is earlier than the row before; sort the rows by time"
        )
    if matrices is not None:
        bad, at = flagged(lambda rows: _apart_from_rotations(matrices[rows]) > 0.1, count)
        if bad:
            raise RigidsimError(
                f"{found.source}: {found.row(at)}: the matrix is no rotation ({bad:,} such rows)"
            )
    return [*([] if quaternions is None else _norms(found, quaternions)), *_gaps(found, times)]


def _norms(found: Trajectory, quaternions: np.ndarray) -> list[str]:
    count = len(quaternions)
    most = usual(lambda rows: np.linalg.norm(quaternions[rows], axis=1), count)

    def damaged(rows: slice) -> np.ndarray:
        """Norms unlike the median of each and those around it."""
        before, after = min(_AROUND, rows.start), min(_AROUND, count - rows.stop)
        norms = np.linalg.norm(quaternions[rows.start - before : rows.stop + after], axis=1)
        padded = np.pad(norms, (_AROUND - before, _AROUND - after), mode="edge")
        size = rows.stop - rows.start
        smooth = np.median([padded[n : n + size] for n in range(2 * _AROUND + 1)], axis=0)
        return np.abs(norms[before : before + size] - smooth) > _DAMAGED * most

    if not most:
        raise RigidsimError(
            f"{found.source}: most quaternions have the norm 0, and are no rotations; write attitudes there"
        )
    bad, first = flagged(damaged, count)
    if bad and bad < count / 10:
        norm = np.linalg.norm(quaternions[first])
        raise RigidsimError(
            f"{found.source}: {found.row(first)}: a quaternion of norm {norm:.6g}, "
            f"where {most:.6g} is usual ({bad:,} such rows); these are no rotations: remove or mend them"
        )
    return [f"quaternions have the norm {most:.6g}; they were normalised"] if abs(most - 1) > _NORM else []


def _apart_from_rotations(matrices: np.ndarray) -> np.ndarray:
    return np.asarray(np.abs(np.einsum("nij,nkj->nik", matrices, matrices) - np.eye(3)).max(axis=(1, 2)))


def _gaps(found: Trajectory, times: np.ndarray) -> list[str]:
    step = usual_step(times)
    longest, at = 0.0, 0
    for rows in blocks_of(len(times) - 1):
        steps = steps_of(times, rows)
        if steps.max() > longest:
            longest, at = float(steps.max()), rows.start + int(np.argmax(steps))
    if longest <= _GAP * step:
        return []
    return [
        f"between {found.row(at)} and the next the time advances by {longest:.6g}, where "
        f"{step:.6g} is usual: a gap, or times in mixed units"
    ]
