"""What other tools wrote, as named columns of doubles: text, Parquet, netCDF and CCSDS messages.

Nothing is known here of what the columns mean, nor is anything left out, sorted or filled in.
"""

from __future__ import annotations

import importlib.util
import itertools
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import date
from decimal import Decimal
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from rigidsim.errors import RigidsimError, ensure
from rigidsim.formats import gubas
from rigidsim.formats.messages import MESSAGE_COLUMNS, message_columns
from rigidsim.scene.epochs import DIGITS, Epoch, parse_epoch
from rigidsim.scene.exact import is_unit
from rigidsim.scene.rotations import conjugated, multiplied, turned
from rigidsim.scene.space_axes import ECLIPTIC, SpaceAxes, from_equator
from rigidsim.scene.text_tables import (
    TableError,
    TextTable,
    holds_times,
    is_date,
    name_and_unit,
    open_table,
)
from rigidsim.scene.validation_messages import nearest

if TYPE_CHECKING:
    import pandas
    import xarray

KINDS = (
    "CSV (.csv, .txt, .dat, .tsv), Parquet, NumPy (.npz), netCDF or HDF5 that xarray reads (.nc, .h5, "
    ".zarr), AEM, CK (.bc), the qbn.42 of 42, GUBAS' x_out.bin and LagrangianStateOut*.csv"
)
KNOWN_AXES = frozenset(get_args(SpaceAxes))
"""Space axes whose turns to each other are known."""
TEXT = {".csv", ".txt", ".dat", ".tsv", ".tum"}
"""Endings of the names of text files."""
_XARRAY = {".nc", ".nc4", ".cdf", ".h5", ".hdf5", ".zarr"}
_MOST_COLUMNS = 500
_NORM = 0.05  # by which quaternions of a table without names may differ from norm 1
_BLOCK = 65_536  # rows of a text that are held as words
_UNNAMED = {8: "timestamp x y z qx qy qz qw"}
"""Columns of tables without names, by their number: TUM's."""
_OF_42 = {"time": ("time",), "qbn": ("qx", "qy", "qz", "qw"), "wbn": ("wx", "wy", "wz"),
          "PosN": ("x", "y", "z"), "VelN": ("vx", "vy", "vz")}  # fmt: skip
"""Files of the simulator 42 that lie in one folder, with what they hold; the first two are needed."""
_UNIX = {"s": Fraction(1), "ms": Fraction(1, 10**3), "us": Fraction(1, 10**6), "ns": Fraction(1, 10**9)}
_UNIX_RANGE = 1e9, 4.2e9  # s: 2001 to 2103
_UNIX_BEGIN = date(1970, 1, 1).toordinal()
_TICKS = 10**DIGITS


@dataclass(frozen=True)
class Trajectory:
    """Columns of one trajectory.

    Attributes:
        columns: by name, in the order of the file, (rows,) float64 each.
        units: of columns, as far as the file says so apart from their names.
        source: the file, or what was given in Python.
        counted: what a row is called, "line" of a text, otherwise "row".
        narrow: whether the numbers were single precision.
        epochs: times of a message as dates, in place of a column of times.
        axes: the space axes that a message names; empty where none are named.
        settled: whether a message says, or a tool writes only, attitudes from body to space axes.
        resolution: half the last digits of a message's quaternions and rates, whose numbers were converted.
        left_out: names of columns that hold no real numbers.
        notes: what a user should know of how the file was read.
        lines: numbers of the rows as the file counts them; None: from 0.
        text: the text that the columns are from; cells that are no numbers are read there again.
        exact: whole numbers of columns that doubles can't hold.
        reach: least and largest time (s) that an experiment has, if known, which are no Unix time.
    """

    columns: Mapping[str, np.ndarray]
    source: str
    units: Mapping[str, str] = field(default_factory=dict)
    counted: str = "row"
    narrow: bool = False
    epochs: tuple[Epoch, ...] = ()
    axes: str = ""
    settled: bool = False
    resolution: tuple[float, float] | None = None
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    lines: np.ndarray | None = None
    text: TextTable | None = None
    exact: Mapping[str, np.ndarray] = field(default_factory=dict)
    reach: tuple[float, float] | None = None

    def row(self, index: int) -> str:
        """A row as the file counts it."""
        return f"{self.counted} {int(index if self.lines is None else self.lines[index])}"

    def at(self, rows: np.ndarray | slice) -> Trajectory:
        """These rows alone, counted as in the file."""
        lines = self.lines
        if lines is None:
            lines = np.arange(len(next(iter(self.columns.values()))))
        columns = {name: values[rows] for name, values in self.columns.items()}
        epochs = tuple(self.epochs[n] for n in np.arange(len(self.epochs))[rows]) if self.epochs else ()
        return replace(self, columns=columns, lines=lines[rows], epochs=epochs)

    @property
    def names(self) -> list[str]:
        """Names of all columns, also of those that hold no numbers."""
        return list(self.columns) if self.text is None else self.text.names

    def named(self, name: str) -> str:
        """The column of this name, with its unit or without.

        Raises:
            RigidsimError: there is none, or there are several.
        """
        if name in self.names:
            return name
        same = [one for one in self.names if name_and_unit(one)[0] == name]
        if len(same) == 1:
            return same[0]
        near = f"; give one of {', '.join(same)}" if same else nearest(name, self.names)
        raise RigidsimError(
            f'{self.source}: has no column "{name}"{near}; its columns are {", ".join(self.names)[:400]}'
        )

    def has(self, name: str) -> bool:
        """Whether there is a column of this name, with its unit or without."""
        return any(name in (one, name_and_unit(one)[0]) for one in self.names)

    def unit(self, name: str) -> str | None:
        """The unit of a column as configs write it, as far as the file or the column's name says it."""
        name = self.named(name)
        unit = config_unit(self.units.get(name) or name_and_unit(name)[1] or "")
        return unit if is_unit(unit) or (unit and holds_times(name)) else None

    def column(self, name: str) -> np.ndarray:
        """Numbers of a column, (rows,) float64.

        Raises:
            RigidsimError: there is no such column, or a row holds no finite number.
        """
        name = self.named(name)
        rows = 0 if self.lines is None else len(self.lines)
        found = self.columns.get(name, np.full(rows, np.nan))  # of words where it is none of them
        bad = np.flatnonzero(~np.isfinite(found))
        if len(bad):
            cells = [] if self.text is None else itertools.islice(self.text.column(name), bad[0], bad[0] + 1)
            given = "".join(f' ("{cell[:40]}")' for _, cell in cells)
            raise RigidsimError(
                f"{self.source}: {self.row(bad[0])}: {name} is no finite number{given}, as in "
                f"{len(bad):,} of {len(found):,} rows; remove these rows, or write their values"
            )
        return found

    @property
    def timed(self) -> str:
        """The column of times, a message's own stamp before others; empty without one."""
        found = sorted(filter(holds_times, self.columns), key=lambda name: not name.endswith("stamp"))
        known = (name for name in found if (unit := self.unit(name)) is None or is_unit(unit))
        return next(known, next(iter(found), ""))

    def _of_unix(self, name: str) -> list[Epoch] | None:
        """Dates of seconds, or parts of them, since 1970; None of other numbers."""
        values, unit = self.columns[name], self.unit(name)
        low, high = (np.min(values, initial=np.inf), np.max(values, initial=-np.inf))
        if self.reach and unit in (None, "s") and self.reach[0] <= low <= high <= self.reach[1]:
            return None
        sizes = (size for one, size in _UNIX.items() if unit in (None, one))
        fits = (x for x in sizes if _UNIX_RANGE[0] <= low * float(x) and high * float(x) < _UNIX_RANGE[1])
        if (size := next(fits, None)) is None:
            return None
        numbers: Iterable[Any] = self.exact.get(name, values)
        if self.text is not None and name in self.text.names:
            numbers = (Decimal(self.text.plain(cell)) for _, cell in self.text.column(name))
        ticks = (round(Fraction(x if isinstance(x, Decimal) else x.item()) * size * _TICKS) for x in numbers)
        days = (divmod(x, 86400 * _TICKS) for x in ticks)
        return [Epoch("UTC", _UNIX_BEGIN + day, rest) for day, rest in days]

    def dates(self, name: str, scale: str) -> list[Epoch] | None:
        """Dates of a message, or of a column in a time scale; None if it holds numbers, but for Unix time.

        Raises:
            RigidsimError: there is no such column, or a row holds no date.
        """
        if self.epochs:
            return list(self.epochs)
        name = self.named(name)
        if name in self.columns:
            return self._of_unix(name)
        if self.text is None or not any(is_date(cell) for _, cell in self.text.column(name)):
            return None
        found = []
        for number, cell in self.text.column(name):
            try:
                found.append(parse_epoch(cell, scale))
            except ValueError as error:
                raise RigidsimError(f"{self.source}: line {number}: {error}") from None
        return found

    def of_pair(self, name: str) -> tuple[Trajectory, Trajectory]:
        """The columns of the first of two bodies, and of the second of this name without what marks them,
        ``rigid_body_`` or its name; times belong to both.
        """
        marks = re.compile(rf"(?:rigid_body|{re.escape(name)})_")
        bare = {one: marks.sub("", one, count=1).replace(f"_{name}_", "_") for one in self.columns}
        theirs = {one for one in self.columns if marks.match(one)}
        own = {one: values for one, values in self.columns.items() if one not in theirs}
        kept = {bare[one]: one for one in self.columns if one in theirs or one == self.timed}
        units = {new: self.units[one] for new, one in kept.items() if one in self.units}
        second = {new: self.columns[one] for new, one in kept.items()}
        return replace(self, columns=own), replace(self, columns=second, units=units, text=None, notes=())

    def dated(self) -> Trajectory:
        """With the dates of a column of times, read as UTC, or of Unix time; the same if times are others."""
        if name := self.timed:
            if (unix := self._of_unix(name)) is None:
                return self
            columns = {one: values for one, values in self.columns.items() if one != name}
            notes = (*self.notes, "times were read as Unix time (UTC)")
            return replace(self, columns=columns, epochs=tuple(unix), notes=notes)
        for name in filter(holds_times, self.names):
            if (dates := self.dates(name, "UTC")) is not None:
                left_out = tuple(one for one in self.left_out if one != name)
                notes = ("dates were read as UTC",)
                return replace(self, epochs=tuple(dates), left_out=left_out, notes=notes)
        return self

    def in_axes(self, axes: str | None) -> Trajectory:
        """A message's attitudes and path in other space axes; the same where either are not known."""
        if ECLIPTIC not in (axes, self.axes) or axes == self.axes or not {axes, self.axes} <= KNOWN_AXES:
            return self
        turn, columns = np.array([from_equator(ECLIPTIC, np)]), dict(self.columns)
        turn = turn if axes == ECLIPTIC else conjugated(turn)
        for variable, names in MESSAGE_COLUMNS.items():
            if variable == "angular_velocity" or not columns.keys() >= set(names):
                continue
            values = np.stack([columns[name] for name in names], axis=1)
            change = multiplied if len(names) == 4 else turned
            columns |= dict(zip(names, change(turn, values).T, strict=True))
        return replace(self, columns=columns, axes=axes or "")


def config_unit(unit: str) -> str:
    """A unit of a dataset ("kg m2 s-1") as configs write it ("kg m^2 s^-1")."""
    return "rad/s" if unit == "rad s-1" else re.sub(r"(?<=[A-Za-z])(-?\d)", r"^\1", unit)


def is_trajectory(path: Path) -> bool:
    """Whether a file holds a trajectory, by its name; what else lies in the folder of a run doesn't."""
    suffix = path.suffix.lower()
    if suffix in _XARRAY:
        return not (path.parent / "dataset.h5").exists()
    return suffix in {*TEXT, ".npz", ".42", ".parquet", ".pq", ".aem", ".apm", ".oem", ".xml", ".bin"}


def file_and_segment(path: Path) -> tuple[Path, str]:
    """A file, and the segment of a message that its name ends with: ``top.aem#2``."""
    name, _, segment = path.name.rpartition("#")
    return (path.with_name(name), segment) if name and not path.exists() else (path, "")


def read_columns(path: Path) -> Trajectory:
    """Read a file by the kind that its name and its first line say.

    Raises:
        RigidsimError: there is no such file, it is of no known kind, or it can't be read.
    """
    path, segment = file_and_segment(path)
    if not path.exists():
        raise RigidsimError(f"{path}: there is no such file; allowed: {KINDS}")
    suffix = path.suffix.lower()
    what = f"{path}: given segment {segment}, which an AEM or OEM alone has; remove it"
    if suffix in (*_XARRAY, ".parquet", ".pq", ".npz"):
        ensure(not segment, RigidsimError(what))
        try:
            return {".parquet": _of_parquet, ".pq": _of_parquet, ".npz": _of_numpy}.get(
                suffix, _of_xarray_file
            )(path)
        except (RigidsimError, MemoryError):
            raise
        except Exception as error:  # readers of other packages raise many kinds on files of other contents
            raise _unreadable(path, error) from None
    try:
        if path.is_file():
            with path.open(errors="replace") as file:
                head = file.read(4096)
            if (found := re.search(r"CCSDS_(AEM|APM|OEM)_VERS", head)) is not None:
                return Trajectory(source=str(path), **message_columns(path, found[1], segment=segment))
            ensure(not segment, RigidsimError(what))
            if suffix == ".42":
                return _of_42(path)
            if suffix == ".bin" or gubas.is_table(path):
                return Trajectory(gubas.read_states(path), str(path), settled=True)
            if suffix in TEXT:
                return _of_text(path)
    except TableError as error:
        raise RigidsimError(f"{path}: {error}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise _unreadable(path, error) from None
    raise RigidsimError(f"{path}: of no known kind; allowed: {KINDS}, or the folder of a run")


def read_trajectory(path: Path, reach: tuple[float, float] | None = None) -> Trajectory:
    """The same, with dates where the file has them, or Unix time, in place of times; ``reach`` as in
    ``Trajectory``.
    """
    found = read_columns(path)
    return found if path.suffix.lower() in _XARRAY else replace(found, reach=reach).dated()


def _unreadable(path: Path, error: Exception) -> RigidsimError:
    text = str(error).strip() or type(error).__name__
    return RigidsimError(f"{path}: can't be read ({text.splitlines()[0][:200]})")


def trajectory_of(table: Any, source: str = "the table") -> Trajectory:
    """The columns of a mapping of arrays, a pandas DataFrame, or an xarray Dataset.

    An array of more dimensions, as quaternions (rows, 4), becomes a column for each component.
    """
    if hasattr(table, "data_vars"):
        return _of_dataset(table, source)
    if hasattr(table, "itertuples"):
        return _of_frame(table, source)
    if not isinstance(table, Mapping):
        raise RigidsimError(
            f"given {type(table).__name__}; a path, a mapping of names to arrays, a pandas DataFrame or an "
            "xarray Dataset is allowed"
        )
    return _made(((str(name), np.asarray(value), ()) for name, value in table.items()), source)


def _made(
    given: Iterable[tuple[str, Any, tuple[str, ...]]], source: str, units: Mapping[str, str] | None = None
) -> Trajectory:
    """Columns of arrays (or of what is read from a file by slices), each with the labels of its components
    (none: numbers from 0).
    """
    columns: dict[str, np.ndarray] = {}
    exact: dict[str, np.ndarray] = {}
    left_out, narrow = [], False
    for name, value, labels in given:
        places = list(itertools.product(*map(range, value.shape[1:])))
        if not value.ndim or len(places) > _MOST_COLUMNS:
            continue
        if value.dtype.kind not in "fiu":
            left_out.append(name)
            continue
        narrow = narrow or value.dtype == np.float32
        if value.dtype.kind in "iu" and value.ndim == 1:
            exact[name] = np.asarray(value)
        table = np.asarray(value).reshape(len(value), -1).astype(np.float64)
        parts = labels or ["".join(map(str, place)) for place in places]
        for part, column in zip(parts, table.T, strict=True):
            columns[name if value.ndim == 1 else f"{name}_{part}"] = column
    sizes = {len(column) for column in columns.values()}
    if len(sizes) > 1:
        raise RigidsimError(f"{source}: columns of different lengths ({sorted(sizes)[:5]}); give equal ones")
    return Trajectory(columns, source, units or {}, narrow=narrow, left_out=tuple(left_out), exact=exact)


def _of_frame(frame: pandas.DataFrame, source: str) -> Trajectory:
    columns = {str(name): frame[name].to_numpy() for name in frame.columns}
    if isinstance(frame.index.name, str) and frame.index.dtype.kind in "fiu":
        columns = {frame.index.name: frame.index.to_numpy(), **columns}
    return _made(((name, value, ()) for name, value in columns.items()), source)


def _of_dataset(dataset: xarray.Dataset, source: str) -> Trajectory:
    """The variables along the dimension of time; residuals beyond doubles (``NAME_lo``) are left out."""
    along = "time" if "time" in dataset.dims else next(iter(dataset.dims), None)
    units, given = {}, []
    for name in (*dataset.coords, *dataset.data_vars):
        variable = dataset.variables[name]
        if along not in variable.dims or str(name).endswith(("_lo", "_lo2")):
            continue
        variable = variable.squeeze(
            [dim for dim, size in variable.sizes.items() if size == 1 and dim != along]
        )
        others = [dim for dim in variable.dims if dim != along]
        labels: tuple[str, ...] = ()
        if len(others) == 1 and others[0] in dataset.coords:
            labels = tuple(map(str, dataset.coords[others[0]].values))
        if variable.dims[0] != along:
            variable = variable.transpose(along, *others).load()
        given.append((str(name), variable, labels))
        if isinstance(unit := variable.attrs.get("units"), str):
            units[str(name)] = unit
    return _made(given, source, units)


def _of_xarray_file(path: Path) -> Trajectory:
    import xarray

    engine = {".zarr": "zarr", ".h5": "h5netcdf", ".hdf5": "h5netcdf"}.get(path.suffix.lower())
    with xarray.open_dataset(path, engine=engine, decode_times=False) as dataset:
        return _of_dataset(dataset, str(path))


def _of_parquet(path: Path) -> Trajectory:
    if importlib.util.find_spec("pyarrow") is None:
        raise RigidsimError(f'{path}: needs pyarrow, which is missing: pip install "rigidsim[export]"')
    from pyarrow.parquet import read_table

    return _of_frame(read_table(path).to_pandas(ignore_metadata=True), str(path))


def _of_numpy(path: Path) -> Trajectory:
    with np.load(path) as arrays:
        return _made(((name, arrays[name], ()) for name in arrays.files), str(path))


def _of_42(path: Path) -> Trajectory:
    """Files of one run of the simulator 42, of which the one with the quaternions is given."""
    what = f"{path}: of a run of 42 the file of quaternions, qbn.42, is read, with those next to it"
    ensure(path.stem == "qbn", RigidsimError(f"{what}; give that one"))
    columns: dict[str, np.ndarray] = {}
    for stem, names in _OF_42.items():
        beside = path.with_name(f"{stem}.42")
        if not beside.is_file() and stem not in ("time", "qbn"):
            continue
        what = f"{path}: needs {beside.name} next to it, in which 42 writes the {stem}; copy it there"
        ensure(beside.is_file(), RigidsimError(what))
        table = open_table(partial(_lines, beside), usual={len(names): " ".join(names)})
        rows = np.array([list(map(table.number, cells)) for _, cells in table.rows()])
        what = f"{beside}: has {len(rows)} rows, where time.42 has {len(columns.get('time', rows))}"
        ensure(len(rows) == len(columns.get("time", rows)), RigidsimError(f"{what}; write both again"))
        columns |= dict(zip(names, rows.T, strict=True))
    return Trajectory(columns, str(path), counted="row")


def _of_text(path: Path) -> Trajectory:
    table = open_table(partial(_lines, path), usual=_UNNAMED)
    lines: list[int] = []
    rows, blocks = table.rows(), []
    while block := list(itertools.islice(rows, _BLOCK)):
        lines.extend(number for number, _ in block)
        blocks.append(np.array([list(map(table.number, cells)) for _, cells in block]))
    if not lines:
        raise TableError("no rows; a line of names and rows of values are needed")
    found = dict(zip(table.names, np.concatenate(blocks).T, strict=True))
    if table.names == _UNNAMED[8].split() and not table.head:
        norms = np.linalg.norm(np.stack([found[name] for name in table.names[4:]]), axis=0)
        if not abs(np.nanmedian(norms) - 1) < _NORM:
            raise TableError(
                "line 1 holds numbers; put a line of names above, such as t,qw,qx,qy,qz,wx,wy,wz"
            )
    kept = {name: values for name, values in found.items() if np.isfinite(values).any()}
    left_out = tuple(name for name in found if name not in kept)
    return Trajectory(
        kept, str(path), table.units, "line", left_out=left_out, lines=np.array(lines), text=table
    )


def _lines(path: Path) -> Iterator[str]:
    with path.open(encoding="utf-8-sig") as file:
        yield from file
