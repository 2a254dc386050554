"""What the columns of a trajectory are, by their names and units; what can't be used is refused."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.digits import FEW, written_resolution
from rigidsim.formats.trajectories import Trajectory
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import parse_number
from rigidsim.scene.text_tables import holds_times, name_and_unit
from rigidsim.scene.units import is_unit

LEAST_ROWS = 3
QUATERNION, MATRIX, ANGLES = "quaternion", "matrix", "angles"
_NORM = 1e-3  # that the median norm of quaternions may differ from one without a note
_DAMAGED = 0.05  # that a norm may differ from those around it; integrators let it drift, and more slowly
_GAP = 1000.0  # times the median spacing, from which on a gap is noted
_Q = r"(?:quaternion|quat|attitude|q)_?"
_MATRIX = r"(?:rotation_?matrix|matrix|dcm|rot|r|m|c|a)_?"
_EULER = r"(?:euler_?angles?|euler|angles?|ang|e|a)_?"
_RATE = r"(?:angular_?velocity|angular_?rate|angvel|body_?rate|omega|gyro|rate|om|w)_?"
_POSITION = r"(?:position|pos|r|p)?_?"
_VELOCITY = r"(?:velocity|vel|v)_?"
_PAIRS = [[f"{i}_?{j}" for i in digits for j in digits] for digits in ("123", "012", "xyz")]
_VECTORS = ("xyz", "123", "012")
_ANGLE_NAMES = [("phi", "theta", "psi"), ("roll", "pitch", "yaw"), ("alpha", "beta", "gamma"),
                ("precession", "nutation", "spin"), ("heading", "pitch", "roll")]  # fmt: skip
_SUFFIX = r"(?:_(?:deg|rad|deg_s|rad_s|degs|rads|rpm|m|s|m_s|body|b))?"
_FORMS: dict[str, list[tuple[str, Sequence[str]]]] = {
    QUATERNION: [(_Q, "wxyz"), ("", "wxyz"), (_Q, "0123"), (_Q, "1234")],
    MATRIX: [(_MATRIX, pairs) for pairs in _PAIRS],
    ANGLES: [*((f"(?:{_EULER})?", n) for n in _ANGLE_NAMES), (_EULER, "123"), (_EULER, "012")],
    "rates": [*((_RATE, letters) for letters in _VECTORS), ("", "pqr")],
    "positions": [(_POSITION, letters) for letters in _VECTORS],
    "velocities": [(_VELOCITY, letters) for letters in _VECTORS],
}
"""Stems and components of the names of columns, the surest ones first."""


@dataclass(frozen=True)
class Attitudes:
    """The columns of a trajectory by what they are; each array has a row for each time.

    Attributes:
        trajectory: with the columns that are none of the others here.
        times: s. time_unit: None where the file doesn't say it.
        kind: of the attitude: ``QUATERNION`` (rows, 4), ``MATRIX`` (rows, 9) or ``ANGLES`` (rows, 3), in the
            order of its columns. order: of a quaternion's, as "xyzw", where names say it.
        unit: of angles, as far as the file says it. rates: (rows, 3), in ``rate_unit``.
        positions, velocities: (rows, 3), SI.
        resolution: half the last digits that are written, of attitude, rates and times (s).
        notes: what a user should know of the columns.
    """

    trajectory: Trajectory
    times: np.ndarray
    time_unit: str | None
    kind: str
    attitude: np.ndarray
    order: str = ""
    unit: str | None = None
    rates: np.ndarray | None = None
    rate_unit: str | None = None
    positions: np.ndarray | None = None
    velocities: np.ndarray | None = None
    resolution: tuple[float, float, float] = (0.0, 0.0, 0.0)
    notes: list[str] = field(default_factory=list)

    def at(self, rows: np.ndarray | slice) -> Attitudes:
        """These rows alone."""
        names = ("times", "attitude", "rates", "positions", "velocities")
        some: dict[str, Any] = {name: x[rows] for name in names if (x := getattr(self, name)) is not None}
        columns = {name: values[rows] for name, values in self.trajectory.columns.items()}
        return replace(self, trajectory=replace(self.trajectory, columns=columns), **some)


def attitudes_of(found: Trajectory, epoch: Epoch | None) -> Attitudes:
    """Find time, attitude, rates and positions among the columns, and refuse rows that can't be used.

    Args:
        epoch: date of time 0 of the experiment, for a message with dates.

    Raises:
        RigidsimError: no attitude, no time, or rows that aren't finite, ascending, or enough.
    """
    notes = [f"left out, since they hold no real numbers: {', '.join(found.left_out)}"] * bool(found.left_out)
    without = "".join(f" ({words})" for words in notes)
    notes += found.notes
    shown = ", ".join(found.columns)
    rows = len(next(iter(found.columns.values()), ()))
    if rows < LEAST_ROWS:
        raise RigidsimError(
            f"{found.source}: {rows} rows; at least {LEAST_ROWS} are needed: sample more often{without}"
        )
    plain = {_plain(name): name for name in found.columns}
    columns: dict[str, list[str]] = {}
    for kind, forms in _FORMS.items():
        if kind in (MATRIX, ANGLES) and (QUATERNION in columns or MATRIX in columns):
            continue
        names = next(filter(None, (_components(plain, *form) for form in forms)), [])
        if names and not {*names} & {name for known in columns.values() for name in known}:
            columns[kind] = names
    kind = next((kind for kind in (QUATERNION, MATRIX, ANGLES) if kind in columns), "")
    if not kind:
        raise RigidsimError(
            f"{found.source}: no attitude among its columns ({shown}), which all of a comparison is about; "
            f"name it qw qx qy qz, q0 q1 q2 q3, r11 ... r33, or euler_1 euler_2 euler_3{without}"
        )
    taken = {name: np.stack([found.column(one) for one in names], axis=1) for name, names in columns.items()}
    letters = "".join(re.sub(_SUFFIX + "$", "", _plain(name))[-1:] for name in columns[kind])
    places = np.argsort([list(found.columns).index(name) for name in columns[kind]])
    order = "".join(letters[n] for n in places) if letters == "wxyz" else ""
    if kind == ANGLES or order:
        taken[kind] = taken[kind][:, places]  # as in the file
    time_unit: str | None = "s"
    if found.epochs:
        if epoch is None:
            notes.append("the config has no [time] epoch: its time 0 was taken for the first row")
        zero = epoch or found.epochs[0]
        times = np.array([float(date.since(zero)) for date in found.epochs])
    else:
        timed = list(filter(holds_times, found.columns))
        if not timed:
            raise RigidsimError(
                f"{found.source}: no time among its columns ({shown}); name it t or time{without}"
            )
        name = next((x for x in timed if (unit := found.unit(x)) is None or is_unit(unit)), timed[0])
        columns["time"] = [name]
        time_unit = _unit(found, [name]) or ("s" if name.lower() == "seconds" else None)
        times = found.column(name)
    notes += _refuse_rows(found, times, kind, taken[kind])
    second = _seconds_in(time_unit or "s", found.source)
    resolution = found.resolution or (
        written_resolution(taken[kind], found.narrow, few=FEW),
        written_resolution(taken["rates"], found.narrow) if "rates" in taken else 0.0,
    )
    used = {name for names in columns.values() for name in names}
    others = {name: values for name, values in found.columns.items() if name not in used}
    by_times = second * written_resolution(times, found.narrow)
    units = _unit(found, columns[kind], "rad"), _unit(found, columns.get("rates", ()), "rad/s")
    return Attitudes(
        replace(found, columns=others), times * second, time_unit, kind, taken[kind], order, units[0],
        taken.get("rates"), units[1], taken.get("positions"), taken.get("velocities"),
        (*resolution, by_times), notes,
    )  # fmt: skip


def _plain(name: str) -> str:
    """A name in small letters, without a unit in brackets."""
    bare = name_and_unit(name)[0] if name.rstrip()[-1:] in ("]", ")") else name
    return re.sub(r"[^a-z0-9]+", "_", bare.strip().lower()).strip("_")


def _components(plain: dict[str, str], stem: str, parts: Sequence[str]) -> list[str]:
    """Names of a stem with each of these components, in their order; none unless all are there."""
    found = []
    for part in parts:
        form = re.compile(stem + part + _SUFFIX)
        found.append(max(filter(form.fullmatch, plain), key=len, default=""))
    return [plain[name] for name in found] if all(found) and len({*found}) == len(parts) else []


def _unit(found: Trajectory, names: Sequence[str], expected: str = "") -> str | None:
    """The unit of columns as configs write it; None where the file names none, or none of this dimension."""
    units = {found.unit(name) for name in names}
    if len(units) > 1:
        shown = ", ".join(sorted(map(str, units)))
        raise RigidsimError(f"columns {', '.join(names)} have different units ({shown}); give one")
    unit = next(iter(units), None)
    try:
        return unit if unit is None or not expected or size_of(unit, expected) else None
    except ValueError:
        return None


@lru_cache
def size_of(unit: str, expected: str) -> float:
    """A unit in another one of its dimension."""
    return float(parse_number(f"1 {unit}", expected))


def _seconds_in(unit: str, source: str) -> float:
    """Seconds of a unit of time."""
    try:
        return size_of(unit, "s")
    except ValueError:
        raise RigidsimError(f'{source}: time in "{unit}"; allowed: s, ms, min, h, day, yr') from None


def _refuse_rows(found: Trajectory, times: np.ndarray, kind: str, attitude: np.ndarray) -> list[str]:
    """Refuse times that don't ascend, and quaternions and matrices that are no rotations; the rest that a
    user should know of the rows.

    Raises:
        RigidsimError: the first row that can't be used, and how many there are.
    """

    def refuse(bad: np.ndarray, what: str, then: str) -> None:
        if bad.any():
            row, more = found.row(int(np.argmax(bad))), f"({int(bad.sum()):,} such rows)"
            raise RigidsimError(f"{found.source}: {row}{what} {more}; {then}")

    notes, steps = [], np.diff(times, prepend=-np.inf)
    refuse(steps == 0, " has the time of the row before", "keep one row for each time")
    refuse(steps < 0, " is earlier than the row before", "sort the rows by time")
    if kind == MATRIX:
        matrices = attitude.reshape(-1, 3, 3)
        apart = np.abs(matrices @ matrices.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        refuse(apart > 0.1, ": the matrix is no rotation", "mend or remove these rows")
    if kind == QUATERNION:
        norms = np.linalg.norm(attitude, axis=1)
        most = float(np.median(norms))
        if not most:
            raise RigidsimError(f"{found.source}: most quaternions have the norm 0; write attitudes there")
        around = np.lib.stride_tricks.sliding_window_view(np.pad(norms, 2, mode="edge"), 5)
        bad = np.abs(norms - np.median(around, axis=1)) > _DAMAGED * most
        if bad.mean() < 0.1:
            what = f": a quaternion of norm {norms[np.argmax(bad)]:.6g}, where {most:.6g} is the median"
            refuse(bad, what, "these are no rotations: remove or mend them")
        if abs(most - 1) > _NORM:
            notes.append(f"quaternions have the norm {most:.6g}; they were normalised")
    longest, step = int(np.argmax(steps[1:])) + 1, float(np.median(steps[1:]))
    if steps[longest] > _GAP * step:
        notes.append(
            f"between {found.row(longest - 1)} and the next the time advances by {steps[longest]:.6g}, where "
            f"{step:.6g} is the median: a gap, or times in mixed units"
        )
    return notes
