"""Observations of a fit: what each set observes, and its times in seconds of the run, values and standard
deviations in SI. What is observed is a variable that can be recorded, or an expression, which becomes one for
the fit's time.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, get_args

import numpy as np

from rigidsim.errors import ConfigError, Problem, RigidsimError
from rigidsim.formats import ck_reading
from rigidsim.formats.messages import MESSAGE_COLUMNS
from rigidsim.formats.trajectories import Trajectory, config_unit, read_columns
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.names import written
from rigidsim.model.observables.observable import Observable
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import parse_number
from rigidsim.scene.expressions.names import names_of
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import ExpressionError, names_used, states_read
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.row_rotations import normalised, of_euler
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config, FitDataTable
from rigidsim.scene.space_axes import SpaceAxes
from rigidsim.scene.validation_messages import nearest
from rigidsim.solve.problem import prepare
from rigidsim.store.variables import LABELS

_PREFIX = "fit_expression_"
QUATERNION, EULER_ANGLES = "quaternion", "euler_angles"
"""Variables that are attitudes; what is computed of any is the former."""
_ROTATIONS = (QUATERNION, EULER_ANGLES)
_STATES = ("attitude", "flight")
_META = b"KPL/MK"
_NORM = 1e-2  # by which the norm of a quaternion may differ from 1
_LEAST, _MOST = 1e-150, 1e150  # of a standard deviation, whose square has to be a double
_SIGMAS = f"a standard deviation above zero, from {_LEAST:g} to {_MOST:g}, is allowed"


@dataclass(frozen=True)
class Observed:
    """One observable.

    Attributes:
        text: as the config says it. name: of the variable that is recorded for it.
        form: "quaternion" or "euler_angles" for attitudes, "angle" for others that turn, otherwise "plain".
        components: default names of its columns. unit: SI; None for an expression, of any.
    """

    text: str
    name: str
    form: str
    components: tuple[str, ...]
    unit: str | None

    @property
    def rotation(self) -> bool:
        """Whether it is an attitude, whose residuals are rotation vectors."""
        return self.form in _ROTATIONS

    @property
    def variable(self) -> str:
        """Name of what is recorded for it; any attitude as a quaternion."""
        return "quaternion" if self.rotation else self.name

    @property
    def config_unit(self) -> str | None:
        """``unit`` as configs write it."""
        return None if self.unit is None else config_unit(self.unit)


@contextmanager
def observing(experiment: Experiment) -> Iterator[tuple[list[Observed], Experiment]]:
    """What each ``[[fit.data]]`` observes, with the experiment that records it; expressions can be recorded
    inside the block only.

    Raises:
        ConfigError: something can't be recorded in this scene.
    """
    table = experiment.config.fit
    assert table is not None
    texts = [data.observable for data in table.data]
    own = [state.name for state in experiment.config.states]
    names, also, entered = [], list[str](), list[str]()
    try:
        for number, text in enumerate(texts, start=1):
            name = QUATERNION if text in _ROTATIONS else text
            if text not in OBSERVABLES and text not in own:
                name = f"{_PREFIX}{texts.index(text)}"
                OBSERVABLES[name], states = _expression(name, text, experiment.config, number)
                entered.append(name)
                also += [state for state in states if state in own]
            names.append(name)
        quiet = experiment.quiet([*dict.fromkeys([*names, *also])], events=[], fit=None)
        recorded = {one.name: one for one in prepare(quiet).system.recorded}
        found = []
        for text, name in zip(texts, names, strict=True):
            one, expression = recorded[name], name in entered
            labels = [LABELS.get(dim, [str(i) for i in range(one.count)]) for dim in one.dims]
            form, unit = "plain" if expression else "angle" if one.units == "rad" else "plain", one.units
            if text in _ROTATIONS:
                form = text
            if text == EULER_ANGLES:
                labels, unit = [LABELS["euler_angle"]], "rad"
            shown = "value" if expression else text
            components = tuple("_".join([shown, *parts]) for parts in product(*labels))
            found.append(
                Observed(text, text if form == text else name, form, components, None if expression else unit)
            )
        yield found, quiet
    finally:
        for name in entered:
            OBSERVABLES.pop(name, None)


def _expression(name: str, text: str, config: Config, number: int) -> tuple[Observable, frozenset[str]]:
    """An expression as an observable, with the states that it reads."""
    try:
        parsed = parse_expression(text, names_of(config), parameters=config.parameters)
    except ExpressionError as error:
        near = nearest(text, list(OBSERVABLES))
        what = f'"{text}" is no variable that can be recorded{near}, nor an expression: {error}'
        raise ConfigError(Problem(f"[[fit.data]] number {number} observable", what)) from None
    if not names_used(parsed):
        what = f'given "{text}", which never changes'
        raise ConfigError(Problem(f"[[fit.data]] number {number} observable", what))
    states = states_read(parsed)
    observable = Observable(
        name, (), "1", text, partial(_written, text), needs=tuple(s for s in _STATES if s in states)
    )
    return observable, states


def _written(text: str, m: Kinematics) -> list[Any]:
    """The expression of a scene, with its own values of ``[parameters]``."""
    config = m.scene.config
    return written(m, [parse_expression(text, names_of(config), parameters=config.parameters)])


# --- readings ----------------------------------------------------------------------------------------------


DataFiles = tuple[Path, ...]
"""Where the file of a ``[[fit.data]]`` is, and the kernels that it is read with, if it is a CK."""


def folder_of(experiment: Experiment) -> Path:
    """Where the data of a config lie: beside it, or in the working directory where it comes from no file."""
    source = Path(experiment.source)
    return source.parent if source.is_file() else Path()


def files_beside(experiment: Experiment) -> list[DataFiles]:
    """The data of a config where they lie."""
    assert experiment.config.fit is not None
    beside = folder_of(experiment)
    return [tuple(beside / x for x in (one.file, *one.kernels)) for one in experiment.config.fit.data]


def content(path: Path) -> bytes:
    """Bytes of a file, or of the dataset of a run's folder."""
    return (path / "dataset.h5" if path.is_dir() else path).read_bytes()


def digest(path: Path) -> str:
    """SHA-256 of a file, or of the dataset of a run's folder."""
    return hashlib.sha256(content(path)).hexdigest()


@dataclass(frozen=True)
class Readings:
    """One set of observations, rows ascending in time.

    Attributes:
        number: of its ``[[fit.data]]``, from 1.
        times: (rows,), s. values: (rows, components), SI; attitudes as quaternions (rows, 4).
        sigmas: (rows, components) of residuals, SI. rows: what the file calls them.
        outliers: beyond how many sigmas rows are left out; None: never.
        sha256: of the file. notes: what a user should know.
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
    notes: list[str] = field(default_factory=list)

    @property
    def label(self) -> str:
        """For people: the observable, with the number of its set."""
        return f"{self.quantity.text} (data {self.number})"

    @property
    def unit(self) -> str:
        """Of the residuals."""
        return "rad" if self.quantity.rotation else self.quantity.unit or "SI"


def read_readings(
    number: int, table: FitDataTable, quantity: Observed, files: DataFiles, scene: Scene
) -> Readings:
    """Read the data of a table of ``[[fit.data]]``, which are in these files.

    Raises:
        ConfigError: a key of the table doesn't suit. RigidsimError: a row of the file can't be used.
    """
    return _Reader(number, table, quantity, files, scene).readings()


@dataclass
class _Reader:
    """One table with its files."""

    number: int
    table: FitDataTable
    quantity: Observed
    files: DataFiles
    scene: Scene

    def readings(self) -> Readings:
        self.found = found = self._opened()
        notes = [f"{self.table.file}: {note}" for note in found.notes]
        times, values = self._times(), self._values()
        sigmas = self._sigmas(len(times))
        kept = self._within(times, notes)
        order = kept[np.argsort(times[kept], kind="stable")]
        rows = [found.row(n) for n in order]
        times, values, sigmas = times[order], values[order], sigmas[order]
        with np.errstate(over="ignore"):  # such as 1e300 for a missing value
            huge = np.abs(values).max(axis=1) / sigmas.min(axis=1) > _MOST
        if huge.any():
            first = int(np.argmax(huge))
            raise RigidsimError(
                f"{found.source}: {rows[first]}: {np.abs(values[first]).max() / self.factor:.6g} is more "
                f"than {_MOST:g} sigmas ({int(huge.sum())} such rows); remove these rows, or mend them"
            )
        again = np.flatnonzero(np.diff(times) == 0)
        same = [int(n) for n in again if (values[n] == values[n + 1]).all()]
        if same:
            raise RigidsimError(
                f"{found.source}: {rows[same[0] + 1]} repeats {rows[same[0]]}, with the same time and values "
                f"({len(same)} such rows); it would count twice: remove it"
            )
        if len(again):
            notes.append(
                f"{self.table.file}: {len(again)} rows have the time of another one with other values; each "
                "counts as an observation"
            )
        limit = None if self.table.outliers is None else float(self.table.outliers)
        return Readings(
            self.number, self.quantity, self.table.file, digest(self.files[0]), times, values, sigmas, rows,
            limit, notes,
        )  # fmt: skip

    def _fault(self, key: str, what: str) -> ConfigError:
        return ConfigError(Problem(f"[[fit.data]] number {self.number} {key}", what))

    def _opened(self) -> Trajectory:
        """The rows of a file; of a CK, which holds dates, and attitudes relative to J2000, as it has them."""
        file, *kernels = self.files
        if not kernels and file.suffix.lower() != ck_reading.SUFFIX:
            saved = file / "dataset.h5"  # where the file is the folder of a run
            return read_columns(saved if saved.is_file() else file).in_axes(self.scene.axes)
        if self.scene.epoch is None:
            what = "is a CK, which holds dates; give the date of time 0 as [time] epoch"
            raise self._fault("file", f"{self.table.file} {what}")
        if self.quantity.rotation and self.scene.axes is None:
            allowed = ", ".join(f'"{name}"' for name in get_args(SpaceAxes))
            what = (
                "is a CK, whose attitudes are relative to J2000; say by [frame] axes what the space axes of "
            )
            raise self._fault("file", f"{self.table.file} {what}the config are: {allowed}")
        for given, path in zip(self.table.kernels, kernels, strict=True):
            if path.is_file() and path.read_bytes().startswith(_META):
                what = "is a meta-kernel, whose paths a fit's copies don't have; list its kernels"
                raise self._fault("file", f"{given} {what}")
        return ck_reading.read_rows(file, kernels, self.scene.epoch, self.scene.axes)

    def _size(self, key: str, unit: str, expected: str | None) -> float:
        """A unit in another one, or in SI where the dimension isn't known."""
        try:
            return float(
                parse_number(f"1 {unit}") if expected is None else parse_number(f"1 {unit}", expected)
            )
        except ValueError as error:
            raise self._fault(key, str(error)) from None

    def _times(self) -> np.ndarray:
        name = self.table.time
        dates = self.found.dates(name, self.table.scale)
        if dates is None:
            return self.found.column(name) * self._size("time", self.found.unit(name) or "s", "s")
        if self.scene.epoch is None:
            raise self._fault(
                "time", f'"{name}" holds dates, but the config has no [time] epoch; give it one'
            )
        return np.array([float(date.since(self.scene.epoch)) for date in dates])

    def _values(self) -> np.ndarray:
        quantity, found = self.quantity, self.found
        components, usual = quantity.components, list(quantity.components)
        if found.epochs and quantity.variable in MESSAGE_COLUMNS:
            usual = list(MESSAGE_COLUMNS[quantity.variable])
            if quantity.variable != "angular_velocity":
                self._check_axes()
        names = self.table.columns or usual
        if len(names) != len(components):
            raise self._fault(
                "columns",
                f"given {len(names)}; {quantity.text} has {len(components)} ({', '.join(components)}): name "
                "a column for each",
            )
        given = np.stack([found.column(name) for name in names], axis=1)
        units = {unit for name in names if (unit := found.unit(name)) is not None}
        if len(units) > 1 and self.table.unit is None:
            said = ", ".join(sorted(units))
            raise self._fault("columns", f"columns in several units ({said}); write all in one")
        unit = self.table.unit or (units.pop() if units else None)
        self.factor = (
            1.0 if unit is None else self._size("unit", config_unit(unit), self.quantity.config_unit)
        )
        values = given * self.factor
        if quantity.form == EULER_ANGLES:
            return of_euler(self.scene.config.integrator.euler_sequence, values)
        if quantity.form != QUATERNION:
            return values
        norms = np.linalg.norm(values, axis=1)
        bad = np.flatnonzero(np.abs(norms - 1) > _NORM)
        if len(bad):
            raise RigidsimError(
                f"{found.source}: {found.row(bad[0])}: a quaternion of norm {norms[bad[0]]:.6g}; norms "
                "within 0.01 of 1 are allowed: mend or remove these rows"
            )
        return normalised(values)

    def _check_axes(self) -> None:
        """Refuse what a message holds in other axes than the config's, or in none that are named."""
        axes, theirs, known = self.scene.axes, self.found.axes, get_args(SpaceAxes)
        if self.quantity.rotation and not self.found.settled:
            what = f"{self.table.file} doesn't say which frame is the body's"
            raise self._fault("file", f"{what}; name the frames by REF_FRAME_A and REF_FRAME_B in the file")
        if not theirs or (theirs != axes and (theirs not in known or axes is None)):
            what = f'{self.table.file} is about the axes "{theirs}", and the config\'s space axes are '
            what += f'"{axes}"' if axes else "not named; say by [frame] axes what they are"
            allowed = f"attitudes and orbits about one of {', '.join(known)} are allowed"
            raise self._fault("file", f"{what}: {allowed}")

    def _sigmas(self, count: int) -> np.ndarray:
        given, quantity, found = self.table.sigma, self.quantity, self.found
        width = 3 if quantity.rotation else len(quantity.components)
        unit = "rad" if quantity.rotation else quantity.config_unit
        if isinstance(given, str) and found.has(given):
            factor = self.factor if quantity.form != QUATERNION else 1.0
            if unit is not None and (said := found.unit(given)) is not None:
                factor = self._size("sigma", said, unit)
            column = found.column(given) * factor
            wrong = ~_usable(column)
            if wrong.any():
                at = int(np.argmax(wrong))
                what = f"{found.source}: {found.row(at)}: {given} is {column[at] / factor:g}"
                raise RigidsimError(f"{what}; {_SIGMAS}")
            return np.repeat(column[:, None], width, axis=1)
        try:
            value = float(parse_number(given) if unit is None else parse_number(given, unit))
        except ValueError as error:
            raise self._fault("sigma", f"{error}; or the name of a column of {self.table.file}") from None
        if not _usable(value):
            raise self._fault("sigma", f"given {given}; {_SIGMAS}")
        return np.full((count, width), value)

    def _within(self, times: np.ndarray, notes: list[str]) -> np.ndarray:
        """Rows in the span of the run."""
        begin, end = float(self.scene.start), float(max(self.scene.end, self.scene.samples.last))
        inside = (times >= begin) & (times <= end)
        span = f"{begin:.6g} to {end:.6g} s"
        if not inside.any():
            raise RigidsimError(
                f"{self.found.source}: no row lies within the run ({span}): its rows are at "
                f"{times.min():.6g} to {times.max():.6g} s; change [time], or check epoch and scale"
            )
        if not inside.all():
            notes.append(
                f"{self.table.file}: {int((~inside).sum())} of {len(times)} rows lie outside the run "
                f"({span}) and were left out, first {self.found.row(int(np.argmin(inside)))}"
            )
        return np.flatnonzero(inside)


def _usable(sigma: Any) -> Any:
    return (sigma >= _LEAST) & (sigma <= _MOST)
