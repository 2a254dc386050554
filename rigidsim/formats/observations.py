"""Tables of observations: columns of numbers or dates by their names, and what the file calls each row."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.ck_reading import read_rows
from rigidsim.formats.trajectories import KINDS, Trajectory, read_trajectory
from rigidsim.scene.epochs import A_DATE, Epoch, parse_epoch
from rigidsim.scene.frame import ECLIPTIC, OBLIQUITY
from rigidsim.scene.rotations import product
from rigidsim.scene.units import is_unit
from rigidsim.scene.validation_messages import nearest

_TEXT = {".csv", ".txt", ".dat", ".tsv"}
_IN_NAME = re.compile(r".*[\[(]\s*([^\[\]()]+?)\s*[\])]")  # "wx [deg/s]"
_ENDINGS = {"deg": "deg", "arcsec": "arcsec", "rad": "rad", "deg_s": "deg/s", "degs": "deg/s",
            "rad_s": "rad/s", "rads": "rad/s"}  # fmt: skip
_OF_TIMES = re.compile(r"(?:t|time)_(s|min|h|day|yr|ms)")


@dataclass(frozen=True)
class Observations:
    """Columns of one file.

    Attributes:
        texts: of a text file, by name, as they are written; empty for others.
        numbers: of others, by name, (rows,) float64.
        units: as far as the file tells.
        rows: what each row is called: "line 12".
        epochs: dates of a message's rows.
        frames: names of the frames from and to which its attitude turns.
    """

    source: str
    texts: dict[str, list[str]] = field(default_factory=dict)
    numbers: dict[str, np.ndarray] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    rows: Sequence[str] = ()
    epochs: tuple[Epoch, ...] = ()
    frames: tuple[str, str] = ("", "")

    @property
    def names(self) -> list[str]:
        """Names of all columns."""
        return [*self.texts, *self.numbers]

    def column(self, name: str) -> np.ndarray:
        """Numbers of a column, (rows,) float64.

        Raises:
            RigidsimError: there is no such column, or a row holds no finite number.
        """
        if name in self.numbers:
            found = self.numbers[name]
        else:
            found = np.array([_number(text) for text in self._texts(name)])
        bad = np.flatnonzero(~np.isfinite(found))
        if len(bad):
            given = f' ("{self.texts[name][bad[0]][:40]}")' if name in self.texts else ""
            raise RigidsimError(
                f"{self.source}: {self.rows[bad[0]]}: {name} is no finite number{given}, as in "
                f"{len(bad):,} of {len(found):,} rows; remove these rows, or write their values"
            )
        return found

    def dates(self, name: str, scale: str) -> list[Epoch] | None:
        """Dates of a column in a time scale; None if it holds numbers.

        Raises:
            RigidsimError: there is no such column, or a row holds no date.
        """
        if self.epochs:
            return list(self.epochs)
        if name in self.numbers or not any(A_DATE.match(text) for text in self._texts(name)):
            return None
        found = []
        for text, row in zip(self._texts(name), self.rows, strict=True):
            try:
                found.append(parse_epoch(text, scale))
            except ValueError as error:
                raise RigidsimError(f"{self.source}: {row}: {error}") from None
        return found

    def _texts(self, name: str) -> list[str]:
        if name not in self.texts:
            near = nearest(name, self.names)
            raise RigidsimError(
                f'{self.source}: has no column "{name}"{near}; its columns are {", ".join(self.names)[:400]}'
            )
        return self.texts[name]


def read_observations(path: Path) -> Observations:
    """Read a table by the kind that its name says.

    Raises:
        RigidsimError: there is no such file, it is of no known kind, or it can't be read.
    """
    if path.is_file() and path.suffix.lower() in _TEXT:
        return _of_text(path)
    if not path.exists():
        raise RigidsimError(f"{path}: there is no such file; allowed: {KINDS}")
    if path.is_dir() and (path / "dataset.h5").is_file():  # the folder of a run
        path = path / "dataset.h5"
    found = read_trajectory(path)
    rows = [found.row(n) for n in range(_count(found))]
    return Observations(
        str(path), {}, dict(found.columns), dict(found.units), rows, found.epochs, found.frames
    )


def read_attitudes(path: Path, kernels: Sequence[Path], epoch: Epoch, axes: str) -> Observations:
    """The rows of a CK at its own times, with columns named as in exported tables.

    Args:
        kernels: those that it is read with. epoch: date of time 0.
        axes: space axes of its attitudes here, one of ``SpaceAxes``.

    Raises:
        RigidsimError: SPICE refuses a kernel, or the CK holds no rows.
    """
    found = read_rows(path, kernels, epoch.since_j2000())
    quaternions = found.quaternions
    if axes == ECLIPTIC:
        half = -float(OBLIQUITY) / 2
        quaternions = np.stack(product([np.cos(half), np.sin(half), 0.0, 0.0], [*quaternions.T]), axis=1)
    numbers = {"time": found.times, **{f"quaternion_{x}": quaternions[:, n] for n, x in enumerate("wxyz")}}
    if found.rates is not None:
        numbers |= {f"angular_velocity_{x}": found.rates[:, n] for n, x in enumerate("xyz")}
    units = {name: "rad/s" for name in numbers if name.startswith("angular")} | {"time": "s"}
    rows = [f"row {n}" for n in range(len(found.times))]
    return Observations(str(path), {}, numbers, units, rows)


def _count(found: Trajectory) -> int:
    return len(next(iter(found.columns.values()), ()))


def _of_text(path: Path) -> Observations:
    names: list[str] = []
    columns: list[list[str]] = []
    rows = []
    separator = ","
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise RigidsimError(f"{path}: can't be read ({error}); save it as UTF-8 text") from None
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if not names:
            separator = next((c for c in ",;\t" if c in line), " ")
        cells = [
            cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))
        ]
        if not names:
            names, columns = cells, [[] for _ in cells]
            if all(np.isfinite(_number(cell)) for cell in cells):
                raise RigidsimError(f"{path}: line {number} holds numbers; put a line of names above")
            continue
        if len(cells) != len(names):
            raise RigidsimError(
                f"{path}: line {number} has {len(cells)} values, where the line of names has {len(names)}"
            )
        rows.append(f"line {number}")
        for column, cell in zip(columns, cells, strict=True):
            column.append(cell)
    if not rows:
        raise RigidsimError(f"{path}: no rows; a line of names and rows of values are needed")
    units = {name: unit for name in names if (unit := _unit_in(name))}
    return Observations(str(path), dict(zip(names, columns, strict=True)), units=units, rows=rows)


def _unit_in(name: str) -> str | None:
    """The unit that the name of a column says: ``wx [deg/s]``, ``alpha_deg``, ``time_day``."""
    if match := _IN_NAME.fullmatch(name):
        return match[1] if is_unit(match[1]) else None
    if match := _OF_TIMES.fullmatch(name.lower()):
        return match[1]
    ending = next((end for end in _ENDINGS if name.lower().endswith(f"_{end}")), None)
    return _ENDINGS[ending] if ending else None


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")
