"""Observations of a fit: their times in seconds of the run, values and standard deviations in SI."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import numpy as np

from rigidsim.errors import ConfigError, Problem, RigidsimError
from rigidsim.formats import ck_reading
from rigidsim.formats.attitude_messages import MESSAGE_COLUMNS
from rigidsim.formats.trajectories import Trajectory, read_columns
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import parse_number
from rigidsim.scene.fit_table import FitDataTable
from rigidsim.scene.row_rotations import SEQUENCES, normalised, of_euler
from rigidsim.scene.scene import Scene
from rigidsim.scene.space_axes import SpaceAxes
from rigidsim.scene.units import UnitError, conversion
from rigidsim.workflows.fit.observed import EULER_ANGLES, QUATERNION, Observed

_META = b"KPL/MK"
_NORM = 1e-2  # by which the norm of a quaternion may differ from 1
_LEAST, _MOST = 1e-150, 1e150  # of a standard deviation, whose square has to be a double
_SIGMAS = f"a standard deviation above zero, from {_LEAST:g} to {_MOST:g}, is allowed"


@dataclass(frozen=True)
class DataFiles:
    """Where the file of a ``[[fit.data]]`` is, and the kernels that it is read with, if it is a CK."""

    file: Path
    kernels: tuple[Path, ...] = ()

    @property
    def all(self) -> tuple[Path, ...]:
        """The file, then the kernels."""
        return (self.file, *self.kernels)

    @property
    def of_kernels(self) -> bool:
        """Whether the file is a CK."""
        return bool(self.kernels) or self.file.suffix.lower() == ck_reading.SUFFIX


def folder_of(experiment: Experiment) -> Path:
    """Where the data of a config lie: beside it, or in the working directory where it comes from no file."""
    source = Path(experiment.source)
    return source.parent if source.is_file() else Path()


def files_beside(experiment: Experiment) -> list[DataFiles]:
    """The data of a config where they lie."""
    assert experiment.config.fit is not None
    beside = folder_of(experiment)
    tables = experiment.config.fit.data
    return [DataFiles(beside / x.file, tuple(beside / one for one in x.kernels)) for x in tables]


@dataclass(frozen=True)
class Readings:
    """One set of observations, rows ascending in time.

    Attributes:
        number: of its ``[[fit.data]]``, from 1.
        times: (rows,), s. values: (rows, components), SI; attitudes as quaternions (rows, 4).
        sigmas: (rows, components) of residuals, SI. rows: what the file calls them.
        outliers: beyond how many sigmas rows are left out; None: never.
        sha256: of the file. told: what a user should know.
    """

    number: int
    quantity: Observed
    source: str
    sha256: str
    times: np.ndarray
    values: np.ndarray
    sigmas: np.ndarray
    rows: Sequence[str]
    outliers: float | None
    told: list[str] = field(default_factory=list)

    @property
    def label(self) -> str:
        """For people: the observable, with the number of its set."""
        return f"{self.quantity.text} (data {self.number})"


def read_readings(
    number: int, table: FitDataTable, quantity: Observed, scene: Scene, files: DataFiles
) -> Readings:
    """Read the data of a table of ``[[fit.data]]``, which are in these files.

    Raises:
        ConfigError: a key of the table doesn't suit. RigidsimError: a row of the file can't be used.
    """
    if files.of_kernels:
        found = _attitudes(number, table, quantity, scene, files)
    else:
        saved = files.file / "dataset.h5"  # where the file is the folder of a run
        found = read_columns(saved if saved.is_file() else files.file).in_axes(scene.axes)
    return _ReadTable(number, table, quantity, scene, found, files.file).made()


def _attitudes(
    number: int, table: FitDataTable, quantity: Observed, scene: Scene, files: DataFiles
) -> Trajectory:
    """The rows of a CK, which holds dates, and attitudes relative to J2000."""
    problem = ""
    if scene.epoch is None:
        problem = f"{table.file} is a CK, which holds dates; give the date of time 0 as [time] epoch"
    elif quantity.rotation and scene.axes is None:
        allowed = ", ".join(f'"{name}"' for name in get_args(SpaceAxes))
        problem = f"{table.file} is a CK, whose attitudes are relative to J2000; say by [frame] axes what "
        problem += f"the space axes of the config are: {allowed}"
    for given, path in zip(table.kernels, files.kernels, strict=True):
        if path.is_file() and path.read_bytes().startswith(_META):
            problem = f"{given} is a meta-kernel, whose paths a fit's copies don't have; list its kernels"
    if problem:
        raise ConfigError(Problem(f"[[fit.data]] number {number} file", problem))
    assert scene.epoch is not None
    return ck_reading.read_rows(files.file, files.kernels, scene.epoch, scene.axes)


class _ReadTable:
    """One table with its file."""

    def __init__(
        self,
        number: int,
        table: FitDataTable,
        quantity: Observed,
        scene: Scene,
        found: Trajectory,
        path: Path,
    ) -> None:
        self.number, self.table, self.quantity, self.scene = number, table, quantity, scene
        self.found, self.path = found, path
        self.told: list[str] = [f"{table.file}: {note}" for note in found.notes]

    def made(self) -> Readings:
        times = self._times()
        values = self._values()
        sigmas = self._sigmas(len(times))
        kept = self._within(times)
        order = kept[np.argsort(times[kept], kind="stable")]
        rows = [self.found.row(n) for n in order]
        times, values, sigmas = times[order], values[order], sigmas[order]
        self._refuse_huge(values, sigmas, rows)
        self._refuse_repeated(times, values, rows)
        limit = None if self.table.outliers is None else float(self.table.outliers)
        file = self.path / "dataset.h5" if self.path.is_dir() else self.path
        digest = hashlib.sha256(file.read_bytes()).hexdigest()
        return Readings(
            self.number, self.quantity, self.table.file, digest, times, values, sigmas, rows, limit, self.told
        )

    def fault(self, key: str, what: str) -> ConfigError:
        return ConfigError(Problem(f"[[fit.data]] number {self.number} {key}", what))

    def _times(self) -> np.ndarray:
        dates = self.found.dates(self.table.time, self.table.scale)
        if dates is None:
            unit = self.found.unit(self.table.time) or "s"
            return self.found.column(self.table.time) * self._factor("time", unit, "s")
        if self.scene.epoch is None:
            raise self.fault(
                "time", f'"{self.table.time}" holds dates, but the config has no [time] epoch; give it one'
            )
        return np.array([float(date.since(self.scene.epoch)) for date in dates])

    def _factor(self, key: str, unit: str, expected: str) -> float:
        try:
            factor, turns = conversion(unit, expected)
        except UnitError as error:
            raise self.fault(key, f'given "{unit}": {error}') from None
        return float(factor) * float(np.pi) ** turns

    def _values(self) -> np.ndarray:
        components = self.quantity.components
        names = self.table.columns or [*components]
        if self.found.epochs and self.quantity.variable in MESSAGE_COLUMNS:
            names = self.table.columns or [*MESSAGE_COLUMNS[self.quantity.variable]]
            if self.quantity.variable != "angular_velocity":
                self._check_axes()
        if len(names) != len(components):
            raise self.fault(
                "columns",
                f"given {len(names)}; {self.quantity.text} has {len(components)} "
                f"({', '.join(components)}): name a column for each",
            )
        given = np.stack([self.found.column(name) for name in names], axis=1)
        units = {self.found.unit(name) for name in names} - {None, "1"}
        if len(units) > 1 and self.table.unit is None:
            said = ", ".join(sorted(map(str, units)))
            raise self.fault("columns", f"columns in several units ({said}); write all in one")
        unit = self.table.unit or (units.pop() if units else None)
        self.factor = 1.0
        if unit is not None:
            expected = None if self.quantity.unit is None else config_unit(self.quantity.unit)
            plain = config_unit(unit)
            self.factor = self._factor("unit", plain, expected) if expected is not None else self._si(plain)
        values = given * self.factor
        if self.quantity.form == QUATERNION:
            norms = np.linalg.norm(values, axis=1)
            bad = np.flatnonzero(np.abs(norms - 1) > _NORM)
            if len(bad):
                raise RigidsimError(
                    f"{self.found.source}: {self.found.row(bad[0])}: a quaternion of norm "
                    f"{norms[bad[0]]:.6g}; norms within 0.01 of 1 are allowed: mend or remove these rows"
                )
            return normalised(values)
        if self.quantity.form == EULER_ANGLES:
            sequence = self.scene.config.integrator.euler_sequence
            assert sequence in SEQUENCES
            return of_euler(sequence, values)
        return values

    def _check_axes(self) -> None:
        """Refuse what a message holds in other axes than the config's, or in none that are said."""
        axes, theirs, known = self.scene.axes, self.found.axes, get_args(SpaceAxes)
        if self.quantity.rotation and not self.found.settled:
            what = f"{self.table.file} doesn't say which frame is the body's"
            raise self.fault("file", f"{what}; name the frames by REF_FRAME_A and REF_FRAME_B in the file")
        if not theirs or (theirs != axes and (theirs not in known or axes is None)):
            what = f'{self.table.file} is about the axes "{theirs}", and the config\'s space axes are '
            what += f'"{axes}"' if axes else "not named; say by [frame] axes what they are"
            allowed = f"attitudes and orbits about one of {', '.join(known)} are allowed"
            raise self.fault("file", f"{what}: {allowed}")

    def _si(self, unit: str) -> float:
        """Factor to SI for an expression, whose dimension isn't known."""
        number: Any = parse_any(f"1 {unit}", self.fault)
        return float(number)

    def _sigmas(self, count: int) -> np.ndarray:
        given = self.table.sigma
        width = 3 if self.quantity.rotation else len(self.quantity.components)
        own = self.quantity.unit
        unit = "rad" if self.quantity.rotation else own and config_unit(own)
        if isinstance(given, str) and self.found.has(given):
            factor = self.factor if self.quantity.form != QUATERNION else 1.0
            if unit is not None and (said := self.found.unit(given)) not in (None, "1"):
                factor = self._factor("sigma", config_unit(str(said)), unit)
            column = self.found.column(given) * factor
            if (wrong := ~_usable(column)).any():
                at = int(np.flatnonzero(wrong)[0])
                raise RigidsimError(
                    f"{self.found.source}: {self.found.row(at)}: {given} is {column[at] / factor:g}; "
                    + _SIGMAS
                )
            return np.repeat(column[:, None], width, axis=1)
        try:
            value = float(parse_any(given, self.fault) if unit is None else parse_number(given, unit))
        except ValueError as error:
            raise self.fault("sigma", f"{error}; or the name of a column of {self.table.file}") from None
        if not _usable(value):
            raise self.fault("sigma", f"given {given}; {_SIGMAS}")
        return np.full((count, width), value)

    def _within(self, times: np.ndarray) -> np.ndarray:
        """Rows in the span of the run; others are told of."""
        begin, end = float(self.scene.start), float(max(self.scene.end, self.scene.samples.last))
        inside = (times >= begin) & (times <= end)
        if not inside.any():
            raise RigidsimError(
                f"{self.found.source}: no row lies within the run ({begin:.6g} to {end:.6g} s): its rows "
                f"are at {times.min():.6g} to {times.max():.6g} s; change [time], or check epoch and scale"
            )
        if not inside.all():
            first = int(np.flatnonzero(~inside)[0])
            self.told.append(
                f"{self.table.file}: {int((~inside).sum())} of {len(times)} rows lie outside the run "
                f"({begin:.6g} to {end:.6g} s) and were left out, first {self.found.row(first)}"
            )
        return np.flatnonzero(inside)

    def _refuse_huge(self, values: np.ndarray, sigmas: np.ndarray, rows: Sequence[str]) -> None:
        """Refuse values, such as 1e300 for a missing one, whose sum of squares in sigmas is no double."""
        with np.errstate(over="ignore"):
            huge = np.abs(values).max(axis=1) / sigmas.min(axis=1) > _MOST
        if huge.any():
            first = int(np.argmax(huge))
            value = np.abs(values[first]).max() / self.factor
            raise RigidsimError(
                f"{self.found.source}: {rows[first]}: {value:.6g} is more than {_MOST:g} sigmas "
                f"({int(huge.sum())} such rows); remove these rows, or mend their values"
            )

    def _refuse_repeated(self, times: np.ndarray, values: np.ndarray, rows: Sequence[str]) -> None:
        again = np.flatnonzero(np.diff(times) == 0)
        same = [int(n) for n in again if (values[n] == values[n + 1]).all()]
        if same:
            one, other = rows[same[0]], rows[same[0] + 1]
            raise RigidsimError(
                f"{self.found.source}: {other} repeats {one}, with the same time and values ({len(same)} "
                "such rows); it would count twice: remove it"
            )
        if len(again):
            self.told.append(
                f"{self.table.file}: {len(again)} rows have the time of another one with other values; each "
                "counts as an observation"
            )


def config_unit(unit: str) -> str:
    """A unit of a dataset ("kg m2 s-1") as configs write it ("kg m^2 s^-1")."""
    return "rad/s" if unit == "rad s-1" else re.sub(r"(?<=[A-Za-z])(-?\d)", r"^\1", unit)


def _usable(sigma: Any) -> Any:
    return (sigma >= _LEAST) & (sigma <= _MOST)


def parse_any(value: Any, fault: Any) -> Any:
    """A number with any unit, in SI."""
    try:
        return parse_number(value)
    except ValueError as error:
        raise fault("unit", str(error)) from None
