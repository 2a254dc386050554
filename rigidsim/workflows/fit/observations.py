"""What a fit is made of: observations, parameters, and what the experiment predicts at other values of them.

Each set of observations has its times in seconds of the run, values and standard deviations in SI. What is
observed is a variable that can be recorded, or an expression, which becomes one for the fit's time.
Parameters are keys of the config as single numbers.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, get_args

import numpy as np

from rigidsim.errors import ConfigError, Problem, RigidsimError, ensure
from rigidsim.formats.columns import (
    MRP,
    POSITIONS,
    RATES,
    VECTOR,
    VELOCITIES,
    columns_of,
    quaternions_from,
)
from rigidsim.formats.messages import MESSAGE_COLUMNS
from rigidsim.formats.spice import CK_SUFFIX, read_rows
from rigidsim.formats.trajectories import Trajectory, config_unit, read_columns
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.names import written
from rigidsim.model.observables.observable import Observable
from rigidsim.scene.choices import DEFAULT_METHOD
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import parse_number, powers, unit_text
from rigidsim.scene.expressions.names import names_of
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import ExpressionError, names_used, states_read
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.rotations import conjugated, multiplied, normalised, of_euler, of_vector, vector_of
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.scene.schema import Config, FitDataTable, KnownWithin
from rigidsim.scene.space_axes import SpaceAxes
from rigidsim.scene.starts import given_attitude, spin_rate
from rigidsim.scene.validation_messages import nearest, shown
from rigidsim.scene.varied_keys import ATTITUDE, VariedKey, varied_keys
from rigidsim.solve.problem import prepare
from rigidsim.store.variables import LABELS
from rigidsim.workflows.run import sampled
from rigidsim.workflows.sensitivity import Tangents

_PREFIX = "fit_expression_"
QUATERNION, EULER_ANGLES = "quaternion", "euler_angles"
"""Variables that are attitudes; what is computed of any is the former."""
_ROTATIONS = (QUATERNION, EULER_ANGLES)
_FORMS = {
    QUATERNION: (QUATERNION, MRP, VECTOR), "angular_velocity": (RATES,), "position": (POSITIONS,),
    "velocity": (VELOCITIES,),
}  # fmt: skip
"""Quantities of ``rigidsim.formats.columns`` that variables are, in order."""
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
    own = [state.name for _, _, state in experiment.config.every_state]
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
        quiet = experiment.quiet(
            [*dict.fromkeys([*names, *also])], events=experiment.config.impulses, fit=None
        )
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
    """Where the data of a config lie: next to it, or in the working directory if it comes from no file."""
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
        times, values = self._times() + float(self.table.offset), self._values()
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
        if not kernels and file.suffix.lower() != CK_SUFFIX:
            what = f"{self.table.file} is one of several files, of which a fit copies one; write one table"
            ensure(file.suffix != ".42", self._fault("file", what))
            saved = file / "dataset.h5"  # where the file is the folder of a run
            segment = f"#{self.table.segment}" if self.table.segment else ""
            found = read_columns(saved if saved.is_file() else Path(f"{file}{segment}"))
            return replace(found, reach=self.scene.reach).in_axes(self.scene.axes)
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
        return read_rows(file, kernels, self.scene.epoch, self.scene.axes)

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
        if "time" not in self.table.model_fields_set and not self.found.has(name):
            name = self.found.timed or name
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
        kind = ""
        if not (self.table.columns or all(map(found.has, usual)) or quantity.form == EULER_ANGLES):
            kind, usual = self._recognised(usual)
        if kind in (MRP, VECTOR):
            return self._turns(kind, usual)
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

    def _recognised(self, usual: list[str]) -> tuple[str, list[str]]:
        """What the columns of the quantity are, and their names; the usual ones if nothing is recognised."""
        try:
            known = columns_of(self.found.columns)
        except ValueError as error:
            raise RigidsimError(f"{self.found.source}: {error}, or name them in columns") from None
        kind = next((one for one in _FORMS.get(self.quantity.variable, ()) if one in known), "")
        if not kind:
            return "", usual
        names = known[kind].names
        what = (
            f"{self.found.source}: which of {', '.join(names)} is the scalar isn't said; name the columns w "
        )
        said = kind != QUATERNION or known[kind].letters
        ensure(said, RigidsimError(f"{what}x y z in columns"))
        return kind, names

    def _turns(self, kind: str, names: list[str]) -> np.ndarray:
        """Quaternions of attitudes in another form."""
        units = {unit for name in names if (unit := self.found.unit(name)) is not None}
        what = f"columns in several units ({', '.join(sorted(units))}); write all in one"
        ensure(len(units) <= 1, self._fault("columns", what))
        unit = self.table.unit or next(iter(units), "rad")
        self.factor = 1.0 if kind == MRP else self._size("unit", unit, "rad")
        values = np.stack([self.found.column(name) for name in names], axis=1)
        return quaternions_from(kind, values * self.factor)

    def _check_axes(self) -> None:
        """Refuse what a message holds in other axes than the config's, or in none that are named."""
        axes, theirs, known = self.scene.axes, self.found.axes, get_args(SpaceAxes)
        if self.quantity.rotation and not self.found.settled:
            what = f"{self.table.file} doesn't say which frame is the body's"
            raise self._fault("file", f"{what}; name the frames by REF_FRAME_A and REF_FRAME_B in the file")
        if not theirs or (theirs != axes and (theirs not in known or axes is None)):
            what = f'{self.table.file} is about the axes "{theirs}", and the config\'s space axes are '
            what += f'"{axes}"' if axes else "not named; name them by [frame] axes"
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
        """Rows no farther from the run's start than its end, on both sides."""
        begin, end = self.scene.reach
        inside = (times >= begin) & (times <= end)
        span = f"{begin:.6g} to {end:.6g} s"
        if not inside.any():
            raise RigidsimError(
                f"{self.found.source}: no row lies as near to the run's start as its end ({span}): its rows "
                f"are at {times.min():.6g} to {times.max():.6g} s; change [time], or check epoch and scale"
            )
        if not inside.all():
            first = self.found.row(int(np.argmin(inside)))
            notes.append(
                f"{self.table.file}: {int((~inside).sum())} of {len(times)} rows lie farther from the run's "
                f"start than its end ({span}) and were left out, first {first}"
            )
        return np.flatnonzero(inside)


def _usable(sigma: Any) -> Any:
    return (sigma >= _LEAST) & (sigma <= _MOST)


# --- parameters ---------------------------------------------------------------------------------------------

_CLOCK = "fit.data[N].offset"
_ATTITUDES = ("euler_angles", "pole", "prime_meridian", "obliquity", "node_longitude", "apm")


@dataclass(frozen=True)
class FitKey:
    """One number that is estimated or considered.

    Attributes:
        key: dotted, with its index: ``initial.angular_velocity[2]``.
        unit: SI unit of its values, "1" for none.
        start: the config's value, SI. sigma: known beforehand, SI; None for nothing.
        suffix: unit with which values are written into the config, where they have one there.
        places: keys of the config where it stands. size: against which changes of it are small or not.
        clock: of an offset, the index of its ``[[fit.data]]``; None for numbers of the motion.
    """

    key: str
    unit: str
    start: float
    sigma: float | None = None
    suffix: str = ""
    places: tuple[str, ...] = ()
    size: float = 1.0
    clock: int | None = None


class FitKeys:
    """All numbers of a fit, estimated ones first, each in the order of the config.

    Attributes:
        estimated: keys in ``[fit] parameters``. considered: keys in ``[fit] consider``.
        scene: of the config's values.
    """

    def __init__(self, experiment: Experiment) -> None:
        table = experiment.config.fit
        assert table is not None
        self._experiment = experiment
        self.scene = build_scene(experiment)
        self.estimated = self._all("parameters", table.parameters, "prior", table.prior)
        self.considered = self._all("consider", list(table.consider), "consider", table.consider)
        self._turned = any(one.key.startswith(ATTITUDE) for one in self.all)

    @property
    def all(self) -> tuple[FitKey, ...]:
        """Estimated ones, then considered ones."""
        return (*self.estimated, *self.considered)

    @property
    def motion(self) -> tuple[FitKey, ...]:
        """All but offsets of times, which no motion depends on."""
        return tuple(one for one in self.all if one.clock is None)

    # --- reading --------------------------------------------------------------------------------------------

    def _all(
        self, where: str, keys: Sequence[str], known: str, sigmas: Mapping[str, KnownWithin]
    ) -> tuple[FitKey, ...]:
        every = varied_keys(self._experiment, keys, f"[fit] {where}", _CLOCK)
        found, problems = {one.name: self._one(one) for one in every}, []
        for key, table in sorted(sigmas.items(), key=lambda item: len(item[0])):  # components override
            plain = key.replace(" ", "")
            members = [one for one in every if one.name == plain or one.name.startswith(f"{plain}[")]
            given = table.sigma if isinstance(table.sigma, list) else [table.sigma] * len(members)
            try:
                if not members:
                    raise ValueError("is not among the parameters; name it there, or remove its prior")
                if len(given) != len(members):
                    raise ValueError(f"given {shown(given)} as sigma; one for each component is needed")
                for one, value in zip(members, given, strict=True):
                    sigma = _sigma(value, one, self._parameter(one))
                    found[one.name] = replace(found[one.name], sigma=sigma)
            except ValueError as error:
                problems.append(Problem(f'[fit] {known}."{key[:60]}"', str(error)))
        if problems:
            raise ConfigError(problems, self._experiment.source)
        return tuple(found.values())

    def _parameter(self, varied: VariedKey) -> Any:
        table, _, name = varied.name.partition(".")
        return self._experiment.config.parameters.get(name) if table == "parameters" else None

    def _one(self, varied: VariedKey) -> FitKey:
        suffix, unit, given = "", varied.unit, self._parameter(varied)
        if given is not None and given.unit:  # constants of expressions have separate units
            found = unit_text(powers(given.unit)) or "rad"
            suffix = unit = f"rad{found[1:]}" if found.startswith("1/") else found
        places = tuple(str(place) for place in varied.places)
        size = abs(float(varied.number)) or abs(float(varied.size)) or 1.0
        steps = varied.places[0].steps if varied.places else ()
        clock = int(steps[2]) if steps[:1] == ("fit",) else None
        return FitKey(varied.name, unit, float(varied.number), None, suffix, places, size, clock)

    # --- other values ---------------------------------------------------------------------------------------

    def overrides(self, values: Sequence[float] | np.ndarray) -> list[str]:
        """``KEY=VALUE`` texts of values in the order of ``motion``, every digit of the doubles written."""
        found = []
        turn = np.zeros(3)
        for one, value in zip(self.motion, values, strict=True):
            if one.key.startswith(ATTITUDE):
                turn[int(one.key[-2])] = value
            else:
                number = repr(float(value))
                text = f'"{number} {one.suffix}"' if one.suffix else number
                found += [f"{place}={text}" for place in one.places]
        return [*(self._start(turn) if self._turned else ()), *found]

    def _start(self, turn: np.ndarray) -> list[str]:
        """The attitude at the start turned by a rotation vector, instead of whatever gives it."""
        initial, begun = self.scene.config.initial, given_attitude(self.scene)
        given = np.array([float(x) for x in begun.quaternion])
        quaternion = multiplied(given[None, :], of_vector(turn[None, :]))[0]
        texts = [f"initial.{name}=" for name in _ATTITUDES if getattr(initial, name) is not None]
        along = []
        if initial.spin_period is not None:
            texts.append("initial.spin_period=")
            along = [spin_rate(self.scene) * x for x in self.scene.figure.pole]
        elif initial.apm is not None and begun.angular_velocity is not None:
            along = begun.angular_velocity
        if initial.apm is not None:  # which implies them
            implied = {"time.epoch": self.scene.epoch, "frame.axes": self.scene.axes}
            implied["initial.relative_to"] = initial.relative_to
            texts += [f'{key}="{value}"' for key, value in implied.items() if value is not None]
        if along:
            texts.append(f"initial.angular_velocity=[{', '.join(repr(float(w)) for w in along)}]")
        shown_values = ", ".join(repr(float(x)) for x in quaternion)
        return [*texts, f"initial.quaternion=[{shown_values}]"]

    def experiment(self, values: Sequence[float] | np.ndarray, base: Experiment) -> Experiment:
        """An experiment at other values, without a text: for runs that nobody keeps."""
        varied = self._experiment.with_overrides(self.overrides(values), writes=False)
        return replace(base, config=varied.config)

    def fitted(self, values: Sequence[float] | np.ndarray) -> Experiment:
        """The config with estimated values written in, and without ``[fit]``."""
        everything = zip(self.all, [*values, *(one.start for one in self.considered)], strict=True)
        moving = [value for one, value in everything if one.clock is None]
        return self._experiment.with_overrides(["fit=", *self.overrides(moving)])


def _sigma(given: Any, varied: VariedKey, parameter: Any) -> float:
    """A standard deviation in SI, of a key or of a parameter."""
    anything = varied.name.startswith(("parameters", "states")) and varied.unit == "1"
    number = parse_number(given, "" if anything else varied.unit)
    needed = parameter.unit if parameter is not None else ""
    if number.unit and needed and powers(number.unit) != powers(needed):
        raise ValueError(f"given {shown(given)}, where {needed}, the parameter's unit, is needed")
    if not float(number) > 0:
        raise ValueError(f"given {shown(given)} as sigma; a standard deviation above zero is allowed")
    return float(number)


# --- predictions --------------------------------------------------------------------------------------------

CHANGE = 1e-4
"""Change of what is observed (of attitudes in rad, of others relative to their size) that the steps of
central differences make: what is cut off and the rounding of double runs are a share of 1e-8 of it each.
"""
ALONG = ("quaternion", "angular_velocity", "position")
"""What is predicted along the whole run."""
ROUNDING = 1e-12  # of runs in double precision, relative to the size of what is observed
_FIRST = 1e-4  # first steps, relative to the size of each number


class NotPredicted(RigidsimError):
    """The motion at these values ends before an observation, or has no finite values there."""


@dataclass
class Prediction:
    """Predictions at some times.

    Attributes:
        values: by variable, (times, components), SI; quaternions for attitudes.
        slopes: by variable, (times, components, numbers) derivatives; of attitudes by rotation vectors in
            space axes, rad, (times, 3, numbers).
        noise: by variable, (numbers,): of slopes, below which they are rounding.
    """

    values: dict[str, np.ndarray]
    slopes: dict[str, np.ndarray] = field(default_factory=dict)
    noise: dict[str, np.ndarray] = field(default_factory=dict)


class ByDifferences:
    """Runs of the experiment, and central differences between them."""

    how = "central differences of runs"

    def __init__(self, keys: FitKeys, quiet: Experiment, quantities: Sequence[Observed]) -> None:
        self._keys, self._quiet = keys, quiet
        self._variables = {one.variable: one for one in quantities}
        self._steps = _FIRST * np.array([one.size for one in keys.motion])
        self._adapted = False

    def at(self, values: Sequence[float], times: np.ndarray) -> Prediction:
        """Predictions with derivatives at ascending times (s).

        Raises:
            NotPredicted: the motion doesn't get there.
        """
        centre = self.values(values, times)
        found = self._differences(values, times, centre)
        if not self._adapted:
            self._adapt(found)
            found = self._differences(values, times, centre)
        return found

    def along(self, values: Sequence[float], times: np.ndarray) -> Prediction:
        """The same of attitude, angular velocity and position, as far as the scene has them."""
        names = []
        for name in ALONG:
            with suppress(ConfigError):
                prepare(self._quiet.quiet([name]))
                names.append(name)
        if not names:
            return Prediction({})
        forms = {"quaternion": "quaternion"}
        found = [Observed(name, name, forms.get(name, "plain"), (), None) for name in names]
        return ByDifferences(self._keys, self._quiet.quiet(names), found).at(values, times)

    def values(self, values: Sequence[float] | np.ndarray, times: np.ndarray) -> dict[str, np.ndarray]:
        """Predictions alone."""
        try:
            changed = self._keys.experiment(values, self._quiet)
            made = sampled(changed, times, self._quiet.config.output.record, fit=None)
        except ConfigError as error:
            raise NotPredicted(f"the experiment can't be run at these values: {error}") from None
        dataset = made.dataset
        if dataset.sizes["time"] != len(times):
            raise NotPredicted(f"the motion {made.outcome.message} before an observation")
        found = {}
        for name in self._variables:
            value = dataset[name].values
            found[name] = value.reshape(len(times), -1)
            if not np.isfinite(found[name]).all():
                raise NotPredicted(f"{name} has no finite value at each observation")
        return found

    def _differences(
        self, values: Sequence[float], times: np.ndarray, centre: dict[str, np.ndarray]
    ) -> Prediction:
        found = Prediction(centre)
        slopes: dict[str, list[np.ndarray]] = {name: [] for name in self._variables}
        for n, step in enumerate(self._steps):
            ends = []
            for sign in (-1, 1):
                moved = np.array(values, dtype=float)
                moved[n] += sign * step
                ends.append((moved[n], self.values(moved, times)))
            width = ends[1][0] - ends[0][0]
            for name, one in self._variables.items():
                before, after = ends[0][1][name], ends[1][1][name]
                slopes[name].append(difference(one, before, after) / width)
        for name, parts in slopes.items():
            width = 3 if self._variables[name].rotation else centre[name].shape[1]
            none = np.empty((len(times), width, 0))
            found.slopes[name] = np.stack(parts, axis=2) if parts else none
            size = self._size(name, centre)
            found.noise[name] = ROUNDING * size / self._steps
        return found

    def _size(self, name: str, centre: dict[str, np.ndarray]) -> float:
        one = self._variables[name]
        return 1.0 if one.rotation or one.form == "angle" else float(np.abs(centre[name]).max()) or 1.0

    def _adapt(self, found: Prediction) -> None:
        """Steps that change what is observed by ``CHANGE``."""
        for n, step in enumerate(self._steps):
            largest = max(
                float(np.abs(found.slopes[name][:, :, n]).max()) / self._size(name, found.values)
                for name in self._variables
            )
            wanted = CHANGE / largest if largest > 0 else np.inf
            self._steps[n] = min(max(wanted, 1e-4 * step), 100 * step)
        self._adapted = True


class ByTangents:
    """Variational equations with the motion, compiled once for all values: side by side where a motion
    allows it, otherwise one step after the other.
    """

    how = "variational equations"

    def __init__(
        self, keys: FitKeys, quiet: Experiment, quantities: Sequence[Observed], times: np.ndarray
    ) -> None:
        """Compile; ``times``: s, of all observations."""
        self._names = list(dict.fromkeys(one.variable for one in quantities))
        self._keys = [one.key for one in keys.motion]
        self._sizes = np.array([one.size for one in keys.motion])
        none = Problem("[fit] parameters", "no number of the motion is estimated")
        ensure(self._keys, ConfigError(none))
        integrator = quiet.config.integrator.model_copy(update={"method": DEFAULT_METHOD})
        stepping = replace(quiet, config=quiet.config.model_copy(update={"integrator": integrator}))
        if prepare(stepping).system.wide:
            what = "its equations are so many that to differentiate them takes longer than the runs"
            raise ConfigError(Problem("[fit] parameters", what))
        self._source = Tangents(
            stepping, self._keys, record=self._names, quickly=True, where="[fit] parameters", times=times
        )

    def at(self, values: Sequence[float], times: np.ndarray, names: Sequence[str] = ()) -> Prediction:
        """Predictions with derivatives at ascending times (s).

        Args:
            names: of variables, as far as the scene has them; by default those observed.

        Raises:
            NotPredicted: the motion doesn't get there.
        """
        given = {key: float(value) for key, value in zip(self._keys, values, strict=True)}
        try:
            rows = self._source.at(given, times)
        except ConfigError as error:
            raise NotPredicted("; ".join(problem.what for problem in error.problems)) from None
        made = Prediction({})
        for name in names or self._names:
            if name not in rows.values:
                continue
            value = made.values[name] = rows.values[name]
            made.slopes[name] = np.ascontiguousarray(rows.slopes[name].transpose(0, 2, 1))
            size = 1.0 if name == QUATERNION else float(np.abs(value).max()) or 1.0
            made.noise[name] = ROUNDING * size / self._sizes
            if not (np.isfinite(value).all() and np.isfinite(made.slopes[name]).all()):
                raise NotPredicted(f"{name} has no finite value at each observation")
        return made

    def along(self, values: Sequence[float], times: np.ndarray) -> Prediction:
        """The same, with attitude, angular velocity and position, as far as the scene has them."""
        return self.at(values, times, names=ALONG)


def difference(quantity: Observed, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """From one value to another, (rows, components); of attitudes the rotation vector in space axes."""
    if quantity.rotation:
        return vector_of(multiplied(other, conjugated(one)))
    apart = other - one
    return np.asarray(np.remainder(apart + np.pi, 2 * np.pi) - np.pi) if quantity.form == "angle" else apart


Predictor = ByDifferences | ByTangents
