"""What other tools wrote, as named columns of doubles: text, Parquet, netCDF and CCSDS messages.

Nothing is known here of what the columns mean, nor is anything left out, sorted or filled in.
"""

from __future__ import annotations

import importlib.util
import itertools
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.messages import MESSAGE_COLUMNS, message_columns
from rigidsim.scene.epochs import Epoch, parse_epoch
from rigidsim.scene.row_rotations import conjugated, multiplied, turned
from rigidsim.scene.space_axes import ECLIPTIC, SpaceAxes, from_equator
from rigidsim.scene.text_tables import TableError, TextTable, holds_times, is_date, name_and_unit, open_table
from rigidsim.scene.units import is_unit
from rigidsim.scene.validation_messages import nearest

if TYPE_CHECKING:
    import pandas
    import xarray

KINDS = (
    "CSV (.csv, .txt, .dat, .tsv), Parquet, netCDF or HDF5 that xarray reads (.nc, .h5, .zarr), AEM, CK (.bc)"
)
KNOWN_AXES = frozenset(get_args(SpaceAxes))
"""Space axes whose turns to each other are known."""
TEXT = {".csv", ".txt", ".dat", ".tsv"}
"""Endings of the names of text files."""
_XARRAY = {".nc", ".nc4", ".cdf", ".h5", ".hdf5", ".zarr"}
_MOST_COLUMNS = 500
_BLOCK = 65_536  # rows of a text that are held as words


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
        settled: whether a message says that its attitudes are those from body to space axes.
        resolution: half the last digits of a message's quaternions and rates, whose numbers were converted.
        left_out: names of columns that hold no real numbers.
        notes: what a user should know of how the file was read.
        lines: numbers of the rows as the file counts them; None: from 0.
        text: the text that the columns are from; cells that are no numbers are read there again.
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

    def dates(self, name: str, scale: str) -> list[Epoch] | None:
        """Dates of a message, or of a column in a time scale; None if it holds numbers.

        Raises:
            RigidsimError: there is no such column, or a row holds no date.
        """
        if self.epochs:
            return list(self.epochs)
        name = self.named(name)
        if self.text is None or name in self.columns:
            return None
        if not any(is_date(cell) for _, cell in self.text.column(name)):
            return None
        found = []
        for number, cell in self.text.column(name):
            try:
                found.append(parse_epoch(cell, scale))
            except ValueError as error:
                raise RigidsimError(f"{self.source}: line {number}: {error}") from None
        return found

    def dated(self) -> Trajectory:
        """With the dates of a column of times, read as UTC; the same if times are numbers."""
        timed = list(filter(holds_times, self.names))
        if self.text is None or any(name in self.columns for name in timed):
            return self
        for name in timed:
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
    return suffix in {*TEXT, ".parquet", ".pq", ".aem", ".apm", ".oem", ".xml"}


def read_columns(path: Path) -> Trajectory:
    """Read a file by the kind that its name and its first line say.

    Raises:
        RigidsimError: there is no such file, it is of no known kind, or it can't be read.
    """
    if not path.exists():
        raise RigidsimError(f"{path}: there is no such file; allowed: {KINDS}")
    suffix = path.suffix.lower()
    if suffix in (*_XARRAY, ".parquet", ".pq"):
        try:
            return _of_xarray_file(path) if suffix in _XARRAY else _of_parquet(path)
        except (RigidsimError, MemoryError):
            raise
        except Exception as error:  # readers of other packages raise many kinds on files of other contents
            raise _unreadable(path, error) from None
    try:
        if path.is_file():
            with path.open(errors="replace") as file:
                head = file.read(4096)
            if (found := re.search(r"CCSDS_(AEM|APM|OEM)_VERS", head)) is not None:
                return Trajectory(source=str(path), **message_columns(path, found[1]))
            if suffix in TEXT:
                return _of_text(path)
    except TableError as error:
        raise RigidsimError(f"{path}: {error}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise _unreadable(path, error) from None
    raise RigidsimError(f"{path}: of no known kind; allowed: {KINDS}, or the folder of a run")


def read_trajectory(path: Path) -> Trajectory:
    """The same, with dates where a text has them in place of times."""
    return read_columns(path).dated()


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
    left_out, narrow = [], False
    for name, value, labels in given:
        places = list(itertools.product(*map(range, value.shape[1:])))
        if not value.ndim or len(places) > _MOST_COLUMNS:
            continue
        if value.dtype.kind not in "fiu":
            left_out.append(name)
            continue
        narrow = narrow or value.dtype == np.float32
        table = np.asarray(value).reshape(len(value), -1).astype(np.float64)
        parts = labels or ["".join(map(str, place)) for place in places]
        for part, column in zip(parts, table.T, strict=True):
            columns[name if value.ndim == 1 else f"{name}_{part}"] = column
    sizes = {len(column) for column in columns.values()}
    if len(sizes) > 1:
        raise RigidsimError(f"{source}: columns of different lengths ({sorted(sizes)[:5]}); give equal ones")
    return Trajectory(columns, source, units or {}, narrow=narrow, left_out=tuple(left_out))


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


def _of_text(path: Path) -> Trajectory:
    table = open_table(partial(_lines, path))
    lines: list[int] = []
    rows, blocks = table.rows(), []
    while block := list(itertools.islice(rows, _BLOCK)):
        lines.extend(number for number, _ in block)
        blocks.append(np.array([list(map(table.number, cells)) for _, cells in block]))
    if not lines:
        raise TableError("no rows; a line of names and rows of values are needed")
    found = dict(zip(table.names, np.concatenate(blocks).T, strict=True))
    kept = {name: values for name, values in found.items() if np.isfinite(values).any()}
    left_out = tuple(name for name in found if name not in kept)
    return Trajectory(
        kept, str(path), table.units, "line", left_out=left_out, lines=np.array(lines), text=table
    )


def _lines(path: Path) -> Iterator[str]:
    with path.open(encoding="utf-8-sig") as file:
        yield from file
