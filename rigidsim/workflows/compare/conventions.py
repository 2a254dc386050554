"""What the columns of a trajectory are, by their names and units, and the convention that it is written in,
found by trying all.

A candidate is judged by three mismatches: of its attitudes with the experiment's, of their turning with its
rates, and of its rates with the experiment's. One after the other keeps the candidates that are about as good
as the best; the plainest of the rest is taken, and the others are listed, since this motion can't separate
them. Mismatches are averaged as logarithms, over rows that lie closer together near the beginning: the right
candidate is near there even if the motion is another one later. From a row to the next an attitude turns by
the mean of the rates at both, up to (rate x interval)^2 / 12 of it, whatever acts on the body.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.columns import (
    ANGLES,
    ATTITUDES,
    MATRIX,
    MRP,
    QUATERNION,
    VECTOR,
    columns_of,
    quaternions_from,
)
from rigidsim.formats.digits import FEW, written_resolution
from rigidsim.formats.trajectories import Trajectory
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import parse_number
from rigidsim.scene.rotations import (
    SEQUENCES,
    angles_between,
    conjugated,
    multiplied,
    normalised,
    of_euler,
    quaternion_of,
    turned,
    vector_of,
)

LEAST_ROWS = 3
_NORM = 1e-3  # that the median norm of quaternions may differ from one without a note
_DAMAGED = 0.05  # that a norm may differ from those around it; integrators let it drift, and more slowly
_GAP = 1000.0  # times the median spacing, from which on a gap is noted


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
        return replace(self, trajectory=self.trajectory.at(rows), **some)


def holds_attitude(found: Trajectory) -> bool:
    """Whether there is an attitude among the columns."""
    return any(kind in ATTITUDES for kind in columns_of(found.columns))


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
    found = found.at(slice(None))  # with numbers of its rows
    try:
        known = columns_of(found.columns)
    except ValueError as error:
        raise RigidsimError(f"{found.source}: {error}{without}") from None
    columns = {kind: one.names for kind, one in known.items()}
    kind = next((kind for kind in ATTITUDES if kind in columns), "")
    if not kind:
        raise RigidsimError(
            f"{found.source}: no attitude among its columns ({shown}), which all of a comparison is about; "
            f"name it qw qx qy qz, q0 q1 q2 q3, r11 ... r33, or euler_1 euler_2 euler_3{without}"
        )
    taken = {name: np.stack([found.column(one) for one in names], axis=1) for name, names in columns.items()}
    places = np.argsort([list(found.columns).index(name) for name in columns[kind]])
    order = "".join(known[kind].letters[n] for n in places) if known[kind].letters else ""
    if kind == ANGLES or order:
        taken[kind] = taken[kind][:, places]  # as in the file
    written, angle_unit = taken[kind], _unit(found, columns[kind], "rad")
    last_digits = written_resolution(written, found.narrow, few=FEW)
    if kind in (MRP, VECTOR):
        size = size_of(angle_unit, "rad") if angle_unit and kind == VECTOR else 1.0
        last_digits *= 2.0 if kind == MRP else size / 2  # of a small turn's quaternion
        taken[QUATERNION] = quaternions_from(kind, taken.pop(kind) * size)
        columns[QUATERNION], order, angle_unit = columns.pop(kind), "wxyz", None
        notes.append(f"{kind} were read as quaternions")
        kind = QUATERNION
    time_unit: str | None = "s"
    if found.epochs:
        if epoch is None:
            notes.append("the config has no [time] epoch: its time 0 was taken for the first row")
        zero = epoch or found.epochs[0]
        times = np.array([float(date.since(zero)) for date in found.epochs])
    else:
        name = found.timed
        if not name:
            raise RigidsimError(
                f"{found.source}: no time among its columns ({shown}); name it t or time{without}"
            )
        columns["time"] = [name]
        time_unit = _unit(found, [name]) or ("s" if name.lower() == "seconds" else None)
        times = found.column(name)
    if (np.diff(times) < 0).all():  # of a tool that went backwards
        back = slice(None, None, -1)
        found, times = found.at(back), times[back]
        taken = {name: values[back] for name, values in taken.items()}
    notes += _refuse_rows(found, times, kind, taken[kind])
    second = _seconds_in(time_unit or "s", found.source)
    resolution = found.resolution or (
        last_digits,
        written_resolution(taken["rates"], found.narrow) if "rates" in taken else 0.0,
    )
    used = {name for names in columns.values() for name in names}
    others = {name: values for name, values in found.columns.items() if name not in used}
    by_times = second * written_resolution(times, found.narrow)
    units = angle_unit, _unit(found, columns.get("rates", ()), "rad/s")
    return Attitudes(
        replace(found, columns=others), times * second, time_unit, kind, taken[kind], order, units[0],
        taken.get("rates"), units[1], taken.get("positions"), taken.get("velocities"),
        (*resolution, by_times), notes,
    )  # fmt: skip


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


# --- conventions --------------------------------------------------------------------------------------------

BODY_TO_SPACE, SPACE_TO_BODY = "body_to_space", "space_to_body"
_LEAST = 1e-9  # rad or relative: mismatches below are alike
_ALIKE = 0.35  # of mean natural logarithms: candidates within a factor of 1.4 are equally near
_NEAR = 1.0  # the same of attitudes where rates decide among them
_OFFSET_GAIN = 3.0  # the same, that a constant turn of the axes has to gain: a factor of 20
_OFFSET_LEAST = 1e-5  # rad; a smaller one is another start rather than other axes
_TURNING = float(np.log(0.1))  # of relative mismatches, above which attitudes don't turn at any rates read
_UNLIKE = float(np.log(0.3))  # the same, above which rates aren't the experiment's, however read
_FAR = float(np.log(0.15))  # of attitudes (rad), above which no candidate is near the experiment
_FASTEST = 0.7  # rad from row to row, above which turns don't show rates
_RATE_UNITS = ("rad/s", "deg/s", "rpm", "rad/day", "deg/day")


@dataclass(frozen=True)
class Convention:
    """How a trajectory is written.

    Attributes:
        order: of a quaternion's columns in the file, as "wxyz" or "xyzw"; empty for others.
        direction: "body_to_space" or "space_to_body": what its attitude takes vectors from and to.
        sequence: of Euler angles, with ``about`` "body" or "fixed" axes; empty for others.
        unit: of Euler angles. time_unit, rate_unit, rate_axes: of times and rates; empty without rates.
        offset: "none", "space" or "body": which axes differ from the experiment's, by a constant turn.
        offset_angle: of that turn, rad. offset_quaternion: w x y z, applied to the trajectory's attitudes
            from the left (space) or from the right (body).
        undecided: other conventions that this motion can't distinguish from this one.
    """

    order: str = ""
    direction: str = BODY_TO_SPACE
    sequence: str = ""
    about: str = ""
    unit: str = ""
    time_unit: str = "s"
    rate_unit: str = ""
    rate_axes: str = ""
    offset: str = "none"
    offset_angle: float = 0.0
    offset_quaternion: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    undecided: list[str] = field(default_factory=list)

    def quaternions(self, given: Attitudes) -> np.ndarray:
        """Attitudes (rows, 4) w x y z, from the experiment's body axes to its space axes."""
        values = given.attitude
        if given.kind == QUATERNION:
            found = values[:, [self.order.index(letter) for letter in "wxyz"]]
        elif given.kind == MATRIX:
            found = quaternion_of(values.reshape(-1, 3, 3))
        else:
            values, sequence = values * size_of(self.unit, "rad"), self.sequence
            if self.about == "fixed":  # turns about fixed axes are those about the body's in the other order
                values, sequence = values[:, ::-1], sequence[::-1]
            found = of_euler(sequence, values)
        found = normalised(found)
        found, turn = found if self.direction == BODY_TO_SPACE else conjugated(found), self._turn
        if self.offset == "space":
            return multiplied(turn, found)
        return multiplied(found, turn) if self.offset == "body" else found

    @property
    def _turn(self) -> np.ndarray:
        return np.array(self.offset_quaternion)

    def rates(self, given: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
        """Angular velocities (rows, 3) in the experiment's body axes, rad/s, at these attitudes."""
        values, turn = given * size_of(self.rate_unit, "rad/s"), self._turn
        if self.rate_axes == "body":
            return turned(conjugated(turn), values) if self.offset == "body" else values
        return turned(conjugated(quaternions), turned(turn, values) if self.offset == "space" else values)

    def turned_to(self, read: np.ndarray, own: np.ndarray) -> Iterator[Convention]:
        """This one and two with other axes, in which an attitude (4,) that it reads is the experiment's."""
        yield self
        back = conjugated(read)
        for side, product in (("space", multiplied(own, back)), ("body", multiplied(back, own))):
            turn = normalised(product)
            if (angle := float(np.linalg.norm(vector_of(turn)))) > _OFFSET_LEAST:
                yield replace(self, offset=side, offset_angle=angle, offset_quaternion=tuple(turn.tolist()))

    def __str__(self) -> str:
        words = [self.direction.replace("_", " ")]
        if self.sequence:
            words.insert(0, f"Euler angles {self.sequence} about {self.about} axes in {self.unit}")
        else:
            words.insert(0, f"quaternion in columns {', '.join(self.order)}" if self.order else "matrix")
        if self.rate_unit:
            words.append(f"rates along {self.rate_axes} axes in {self.rate_unit}")
        if self.offset != "none":
            words.append(f"{self.offset} axes turned by {np.degrees(self.offset_angle):.6g} deg")
        return ", ".join(words)


def rows_compared(count: int, begin: int = 0) -> np.ndarray:
    """Rows that conventions are found by: all over the trajectory, more of them near where it begins."""
    even = np.linspace(0, count - 1, 150).astype(int)
    away = (np.geomspace(1, count, 100) - 1).astype(int)
    found = np.unique(np.concatenate([even, begin + away, begin - away]))
    return np.asarray(found[(found >= 0) & (found < count)])


def attitude_conventions(given: Attitudes) -> list[Convention]:
    """All ways to read the attitude, the plainest first."""
    settled = given.trajectory.settled
    found = [Convention(direction=x) for x in (BODY_TO_SPACE, SPACE_TO_BODY)[: 1 if settled else 2]]
    if given.kind == QUATERNION:
        orders = [given.order] if given.order else ["wxyz", "xyzw"]
        return [replace(one, order=order) for order in orders for one in found]
    if given.kind == MATRIX:
        return found
    units = ["deg", "rad"] if np.abs(given.attitude).max() > 4 * np.pi else ["rad", "deg"]
    return [
        replace(one, sequence=sequence, about=about, unit=unit)
        for unit in ([given.unit] if given.unit else units)
        for about in ("body", "fixed")
        for one in found
        for sequence in SEQUENCES
    ]


def rate_conventions(given: Attitudes) -> list[dict[str, Any]]:
    """The same of units and axes of the rates."""
    units = [given.rate_unit] if given.rate_unit else list(_RATE_UNITS)
    axes = ("body",) if given.trajectory.settled else ("body", "space")
    return [{"rate_unit": unit, "rate_axes": one} for unit in units for one in axes]


def find_convention(
    given: Attitudes,
    asked: Mapping[str, str],
    motion: tuple[np.ndarray, np.ndarray] | None = None,
    begin: float = -np.inf,
) -> tuple[Convention, list[str]]:
    """The convention of a trajectory, and what a user should know of it.

    Args:
        asked: values that attributes of the convention have to have.
        motion: attitudes (rows, 4) and rates (rows, 3) of the experiment. Without it, the attitudes have to
            turn at the rates in the file.
        begin: time, s, at which both start.

    Raises:
        RigidsimError: no convention has the values asked for; or, without an experiment, the attitudes turn
            at the rates in none.
    """
    first = int(np.argmin(np.abs(given.times[:-1] - max(begin, given.times[0]))))
    rows = rows_compared(len(given.times) - 1, first)
    here, there, steps = given.at(rows), given.at(rows + 1), np.diff(given.times)[rows, None]
    plain, rated = attitude_conventions(given), [{}] if given.rates is None else rate_conventions(given)
    _refuse_others(given, asked, plain, rated)
    plain = [one for one in plain if _has(one, asked, "order", "direction", "sequence", "about", "unit")]
    tried = [(0.0, one) for one in plain]
    if motion is not None:
        own, at = motion[0][rows], int(np.searchsorted(rows, first))
        tried = [
            (_mean(angles_between(one.quaternions(here), own)) + _OFFSET_GAIN * (one.offset != "none"), one)
            for start in plain
            for one in start.turned_to(start.quaternions(here)[at], own[at])
            if _has(one, asked, "offset")
        ] or tried
    nearest = min(score for score, _ in tried)
    near, turns = _near(tried, _ALIKE), False
    if given.rates is not None:
        both = [
            (_turning(one, here, there, steps), one)
            for start in _near(tried, _NEAR)
            for one in (replace(start, **more) for more in rated)
            if _has(one, asked, "rate_unit", "rate_axes")
        ]
        turns = min(score for score, _ in both) < _TURNING
        near = _near(both, _ALIKE) if turns else [one for _, one in both if replace(one, **_NO_RATES) in near]
        if motion is not None:
            far = [(_apart(one, here, motion[1][rows]), one) for one in near]
            best = min(score for score, _ in far)
            named = {"rate_unit": near[0].rate_unit, "rate_axes": near[0].rate_axes}
            like = turns or best < _UNLIKE
            near = _near(far, _ALIKE) if like else [one for one in near if _has(one, named, *named)]
    if motion is None and given.rates is not None and not turns:
        raise RigidsimError(
            f"{given.trajectory.source}: in no convention tried does its attitude turn at its rates, or its "
            "rows are too far apart; rigidsim compare CONFIG FILE --timeline finds the convention with an "
            "experiment"
        )
    notes = []
    if motion is not None and nearest > _FAR:
        why = "this is one in which it turns at its rates" if turns else "that found may be wrong"
        notes.append(f"no convention tried brings it near the experiment: {why}")
    return replace(near[0], time_unit=given.time_unit or "s", undecided=[str(one) for one in near[1:]]), notes


_NO_RATES: dict[str, Any] = {"rate_unit": "", "rate_axes": ""}


def _has(one: Convention, asked: Mapping[str, str], *keys: str) -> bool:
    return all(getattr(one, key) == asked.get(key, getattr(one, key)) for key in keys)


def _near(tried: list[tuple[float, Convention]], within: float) -> list[Convention]:
    best = min(score for score, _ in tried)
    return [one for score, one in tried if score <= best + within]


def _mean(mismatches: np.ndarray) -> float:
    return float(np.mean(np.log(mismatches + _LEAST)))


def _turning(one: Convention, here: Attitudes, there: Attitudes, steps: np.ndarray) -> float:
    """Mismatch of the attitudes' turning with the rates, relative to these."""
    assert here.rates is not None
    assert there.rates is not None
    before, after = one.quaternions(here), one.quaternions(there)
    turns = vector_of(multiplied(conjugated(before), after))
    mean = (one.rates(here.rates, before) + one.rates(there.rates, after)) / 2
    size = float(np.linalg.norm(mean, axis=1).mean()) or 1.0
    slow = np.median(np.linalg.norm(turns, axis=1)) <= _FASTEST
    return _mean(np.linalg.norm(turns / steps - mean, axis=1) / size) if slow else float("inf")


def _apart(one: Convention, here: Attitudes, motion: np.ndarray) -> float:
    """Mismatch of the rates with the experiment's, relative to these."""
    assert here.rates is not None
    size = float(np.sqrt(np.mean(np.sum(motion**2, axis=1)))) or 1.0
    return _mean(np.linalg.norm(one.rates(here.rates, one.quaternions(here)) - motion, axis=1) / size)


def _refuse_others(
    given: Attitudes, asked: Mapping[str, str], plain: list[Convention], rated: list[dict[str, Any]]
) -> None:
    """Refuse values that no convention has."""
    keys = ("order", "direction", "sequence", "about", "unit")
    allowed = {key: {getattr(one, key): None for one in plain} for key in keys}
    allowed |= {key: {one.get(key, ""): None for one in rated} for key in _NO_RATES}
    allowed["offset"] = dict.fromkeys(("none", "space", "body"))
    if any(value not in allowed.get(key, ()) for key, value in asked.items()):
        words = ", ".join(f"{key}={value}" for key, value in asked.items())
        shown = "; ".join(f"{key} = {', '.join(x)}" for key, x in allowed.items() if any(x))
        raise RigidsimError(f"{given.trajectory.source}: convention: given {words}; allowed: {shown}")
