"""What the columns of a trajectory are, by their names and units; what can't be used is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.digits import FEW, written_resolution
from rigidsim.formats.trajectories import Trajectory
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import parse_number
from rigidsim.scene.text_tables import TIMES, name_and_unit
from rigidsim.store.many_rows import blocks_of, gathered, picked
from rigidsim.workflows.compare.row_checks import refuse_rows, refuse_values

LEAST_ROWS = 3
_TIMES = {"s": "s", "sec": "s", "seconds": "s", "second": "s", "day": "day", "days": "day", "d": "day",
          "h": "h", "hr": "h", "hours": "h", "hour": "h", "min": "min", "minutes": "min", "ms": "ms",
          "yr": "yr", "years": "yr", "year": "yr"}  # fmt: skip
_STEMS = {
    "quaternion": r"(?:quaternion|quat|attitude|q)_?",
    "rates": r"(?:angular_?velocity|angular_?rate|angvel|body_?rate|omega|gyro|rate|om|w)_?",
    "position": r"(?:position|pos|r|p)?_?",
    "velocity": r"(?:velocity|vel|v)_?",
    "matrix": r"(?:rotation_?matrix|matrix|dcm|rot|r|m|c|a)_?",
    "euler": r"(?:euler_?angles?|euler|angles?|ang|e|a)_?",
}
_EULER_NAMES = [("phi", "theta", "psi"), ("roll", "pitch", "yaw"), ("alpha", "beta", "gamma"),
                ("precession", "nutation", "spin"), ("heading", "pitch", "roll")]  # fmt: skip


@dataclass(frozen=True)
class Attitudes:
    """The columns of a trajectory by what they are; each array has a row for each time.

    Attributes:
        trajectory: with the columns that are none of the others here.
        times: as in the file, in ``time_unit``, which is None where the file doesn't say.
        quaternions: (rows, 4) in the order of their columns, or as w x y z where names say which is which.
        named: the order of these named columns in the file, as "xyzw"; empty where names don't say it.
        matrices: (rows, 3, 3). angles: (rows, 3), in ``angle_unit``.
        rates: (rows, 3), in ``rate_unit``. positions, velocities: (rows, 3), SI.
        resolution: of attitude, rates and times by the digits that are written.
        told: what a user should know of the columns.
    """

    trajectory: Trajectory
    times: np.ndarray
    time_unit: str | None
    quaternions: np.ndarray | None = None
    named: str = ""
    matrices: np.ndarray | None = None
    angles: np.ndarray | None = None
    angle_unit: str | None = None
    rates: np.ndarray | None = None
    rate_unit: str | None = None
    positions: np.ndarray | None = None
    velocities: np.ndarray | None = None
    resolution: tuple[float, float, float] = (0.0, 0.0, 0.0)
    told: list[str] = field(default_factory=list)

    def at(self, rows: np.ndarray) -> Attitudes:
        """These rows alone, in memory."""
        names = ("times", "quaternions", "matrices", "angles", "rates", "positions", "velocities")
        arrays = {name: getattr(self, name) for name in names}
        columns = {name: picked(values, rows) for name, values in self.trajectory.columns.items()}
        some: dict[str, Any] = {name: picked(x, rows) for name, x in arrays.items() if x is not None}
        return replace(self, trajectory=replace(self.trajectory, columns=columns), **some)


def attitudes_of(found: Trajectory, epoch: Epoch | None) -> Attitudes:
    """Find time, attitude, rates and positions among the columns, and refuse rows that can't be used.

    Args:
        epoch: date of time 0 of the experiment, for a message with dates.

    Raises:
        RigidsimError: no attitude, no time, or rows that aren't finite, ascending, or enough.
    """
    told = [f"left out, since they hold no real numbers: {', '.join(found.left_out)}"] * bool(found.left_out)
    without = "".join(f" ({words})" for words in told)
    told += found.notes
    time_unit: str | None = "s"
    plain = {_plain(name): name for name in found.columns}
    units = {_plain(name): found.units.get(name) or name_and_unit(name)[1] for name in found.columns}
    rows = len(next(iter(found.columns.values()), ()))
    if rows < LEAST_ROWS:
        raise RigidsimError(
            f"{found.source}: {rows} rows; at least {LEAST_ROWS} are needed: sample more often" + without
        )
    used: dict[str, list[str]] = {}

    def take(kind: str, names: Sequence[str] | None) -> np.ndarray | None:
        if names is None:
            return None
        used[kind] = [plain[name] for name in names]
        columns = [found.columns[name] for name in used[kind]]
        return gathered(np.stack([x[block] for x in columns], axis=1) for block in blocks_of(rows))

    if found.epochs:
        times = _since(found, epoch, told)
    else:
        name, time_unit = _time_among(plain, units, found.source, without)
        column = found.columns[plain[name]]
        times = gathered(column[block] for block in blocks_of(rows))
        used["time"] = [plain[name]]
    quaternion = _components(plain, "quaternion", "wxyz") or _bare_quaternion(plain)
    places = {letter: list(plain).index(name) for letter, name in zip("wxyz", quaternion or (), strict=False)}
    named = "".join(sorted(places, key=places.__getitem__))
    ordered = (
        quaternion or _components(plain, "quaternion", "0123") or _components(plain, "quaternion", "1234")
    )
    matrix = _matrix(plain)
    euler = None if ordered or matrix else _euler(plain)
    rates = _vector(plain, "rates") or _exact(plain, "pqr")
    position = _vector(plain, "position") if _apart(plain, quaternion) else None
    velocity = _vector(plain, "velocity")
    made = Attitudes(
        found, times, time_unit, take("quaternion", ordered), named, _square(take("matrix", matrix)),
        take("euler", euler), _one_unit(units, euler), take("rates", rates), _one_unit(units, rates),
        take("position", position), take("velocity", velocity), told=told,
    )  # fmt: skip
    if made.quaternions is None and made.matrices is None and made.angles is None:
        raise RigidsimError(
            f"{found.source}: no attitude among its columns ({', '.join(found.columns)}), which all of a "
            "comparison is about; name it qw qx qy qz, q0 q1 q2 q3, r11 ... r33, or euler_1 euler_2 euler_3"
            + without
        )
    refuse_values(found, [name for names in used.values() for name in names])
    told += refuse_rows(found, made.times, made.quaternions, made.matrices)
    kept = [made.quaternions, made.matrices, made.angles]
    attitude = next(x for x in kept if x is not None)
    resolution = found.resolution or (
        written_resolution(attitude, found.narrow, few=FEW),
        0.0 if made.rates is None else written_resolution(made.rates, found.narrow),
    )
    by_times = written_resolution(made.times, found.narrow)
    taken = {name for names in used.values() for name in names}  # which is held already
    others = {name: values for name, values in found.columns.items() if name not in taken}
    return replace(made, trajectory=replace(found, columns=others), resolution=(*resolution, by_times))


def _plain(name: str) -> str:
    """A name in small letters, without a unit in brackets."""
    bare = name_and_unit(name)[0] if name.rstrip()[-1:] in ("]", ")") else name
    return re.sub(r"[^a-z0-9]+", "_", bare.strip().lower()).strip("_")


_SUFFIX = r"(?:_(?:deg|rad|deg_s|rad_s|degs|rads|rpm|m|s|m_s|body|b))?"


def _components(plain: Mapping[str, str], kind: str, letters: str) -> list[str] | None:
    """Names of a stem with each of these components, in their order; None unless all are there."""
    found = []
    for letter in letters:
        form = re.compile(_STEMS[kind] + letter + _SUFFIX)
        names = [name for name in plain if form.fullmatch(name)]
        if not names:
            return None
        found.append(max(names, key=len))
    return found if len(set(found)) == len(letters) else None


def _vector(plain: Mapping[str, str], kind: str) -> list[str] | None:
    """Names of the three components of a vector."""
    found = (_components(plain, kind, letters) for letters in ("xyz", "123", "012"))
    return next((names for names in found if names), None)


def _exact(plain: Mapping[str, str], names: Sequence[str]) -> list[str] | None:
    return list(names) if all(name in plain for name in names) else None


def _bare_quaternion(plain: Mapping[str, str]) -> list[str] | None:
    return _exact(plain, "wxyz")


def _apart(plain: Mapping[str, str], quaternion: Sequence[str] | None) -> bool:
    """Whether columns x y z aren't those of the quaternion."""
    return not (quaternion and set("xyz") <= set(quaternion))


def _matrix(plain: Mapping[str, str]) -> list[str] | None:
    for digits in ("123", "012", "xyz"):
        found = []
        for pair in (f"{i}_?{j}" for i in digits for j in digits):
            form = re.compile(_STEMS["matrix"] + pair)
            found.append(next((name for name in plain if form.fullmatch(name)), None))
        if all(found):
            return [name for name in found if name]
    return None


def _euler(plain: Mapping[str, str]) -> list[str] | None:
    """Angles in the order of their columns."""
    stripped = {re.sub(r"_(deg|rad)$", "", name): name for name in plain}
    order = list(plain)
    for names in _EULER_NAMES:
        forms = [re.compile(_STEMS["euler"].replace(")_?", ")?_?") + name) for name in names]
        found = [
            next((full for short, full in stripped.items() if form.fullmatch(short)), None) for form in forms
        ]
        if all(found):
            return sorted((x for x in found if x), key=order.index)
    return _components(plain, "euler", "123") or _components(plain, "euler", "012")


def _square(values: np.ndarray | None) -> np.ndarray | None:
    return None if values is None else values.reshape(-1, 3, 3)


def _time_among(
    plain: Mapping[str, str], units: Mapping[str, str | None], source: str, without: str
) -> tuple[str, str | None]:
    for name in plain:
        match = re.fullmatch(rf"(?:{'|'.join(TIMES)})(?:_([a-z]+))?", name)
        if match and (match[1] is None or match[1] in _TIMES):
            given = units[name] or match[1] or ("s" if name == "seconds" else None)
            if given is None:
                return name, None
            if (known := _TIMES.get(given.lower())) is None:
                raise RigidsimError(
                    f'{source}: time in "{given}"; allowed: {", ".join(dict.fromkeys(_TIMES.values()))}'
                )
            return name, known
    raise RigidsimError(
        f"{source}: no time among its columns ({', '.join(plain.values())}); name it t or time" + without
    )


def _one_unit(units: Mapping[str, str | None], names: Sequence[str] | None) -> str | None:
    found = {units[name] for name in names or ()}
    if len(found) > 1:
        shown = ", ".join(sorted(str(unit) for unit in found))
        raise RigidsimError(f"columns {', '.join(names or ())} have different units ({shown}); give one")
    return next(iter(found), None)


def _since(found: Trajectory, epoch: Epoch | None, told: list[str]) -> np.ndarray:
    """Times of a message, s from time 0 of the experiment."""
    dates = found.epochs
    if epoch is None:
        told.append("the config has no [time] epoch: its time 0 was taken for the first row")
        epoch = dates[0]
    return np.array([float(date.since(epoch)) for date in dates])


def seconds_in(unit: str) -> float:
    """Seconds of a unit of time."""
    return float(parse_number(f"1 {unit}", "s"))
