"""Tables of observations: columns of numbers or dates by their names, and what the file calls each row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.ck_reading import read_rows
from rigidsim.formats.text_tables import TEXT, as_number, is_date, name_and_unit, open_text
from rigidsim.formats.trajectories import KINDS, Trajectory, read_trajectory
from rigidsim.scene.epochs import Epoch, parse_epoch
from rigidsim.scene.row_rotations import multiplied
from rigidsim.scene.space_axes import from_equator
from rigidsim.scene.validation_messages import nearest


@dataclass(frozen=True)
class Observations:
    """Columns of one file.

    Attributes:
        texts: of a text file, by name, as they are written; empty for others.
        numbers: of others, by name, (rows,) float64.
        units: as far as the file tells.
        rows: what each row is called: "line 12".
        epochs: dates of a message's rows. axes, settled: of a message, as of a ``Trajectory``.
        notes: what a user should know of how the file was read.
        number: the number in a cell of a text; nan where it holds none.
    """

    source: str
    texts: dict[str, list[str]] = field(default_factory=dict)
    numbers: dict[str, np.ndarray] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    rows: Sequence[str] = ()
    epochs: tuple[Epoch, ...] = ()
    axes: str = ""
    settled: bool = False
    notes: tuple[str, ...] = ()
    number: Callable[[str], float] = as_number

    @property
    def names(self) -> list[str]:
        """Names of all columns."""
        return [*self.texts, *self.numbers]

    def column(self, name: str) -> np.ndarray:
        """Numbers of a column, (rows,) float64.

        Raises:
            RigidsimError: there is no such column, or a row holds no finite number.
        """
        name = self.named(name)
        if name in self.numbers:
            found = self.numbers[name]
        else:
            found = np.array([self.number(text) for text in self.texts[name]])
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
        name = self.named(name)
        if name in self.numbers or not any(map(is_date, self.texts[name])):
            return None
        found = []
        for text, row in zip(self.texts[name], self.rows, strict=True):
            try:
                found.append(parse_epoch(text, scale))
            except ValueError as error:
                raise RigidsimError(f"{self.source}: {row}: {error}") from None
        return found

    def has(self, name: str) -> bool:
        """Whether there is a column of this name, with its unit or without."""
        return any(name in (one, name_and_unit(one)[0]) for one in self.names)

    def unit(self, name: str) -> str | None:
        """The unit of a column, as far as the file or the column's name says it."""
        return self.units.get(self.named(name))

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


def read_observations(path: Path, axes: str | None) -> Observations:
    """Read a table by the kind that its name says; a message is turned to these space axes where it can be.

    Raises:
        RigidsimError: there is no such file, it is of no known kind, or it can't be read.
    """
    if path.is_file() and path.suffix.lower() in TEXT:
        return _of_text(path)
    if not path.exists():
        raise RigidsimError(f"{path}: there is no such file; allowed: {KINDS}")
    if path.is_dir() and (path / "dataset.h5").is_file():  # the folder of a run
        path = path / "dataset.h5"
    found = read_trajectory(path).in_axes(axes)
    rows = [found.row(n) for n in range(_count(found))]
    return Observations(
        str(path), {}, dict(found.columns), dict(found.units), rows, found.epochs, found.axes, found.settled,
        found.notes,
    )  # fmt: skip


def read_attitudes(path: Path, kernels: Sequence[Path], epoch: Epoch, axes: str) -> Observations:
    """The rows of a CK at its own times, with columns named as in exported tables.

    Args:
        kernels: those that it is read with. epoch: date of time 0.
        axes: space axes of its attitudes here, one of ``SpaceAxes``.

    Raises:
        RigidsimError: SPICE refuses a kernel, or the CK holds no rows.
    """
    found = read_rows(path, kernels, epoch.since_j2000())
    quaternions = multiplied(np.array(from_equator(axes, np)), found.quaternions)
    numbers = {"time": found.times, **{f"quaternion_{x}": quaternions[:, n] for n, x in enumerate("wxyz")}}
    if found.rates is not None:
        numbers |= {f"angular_velocity_{x}": found.rates[:, n] for n, x in enumerate("xyz")}
    units = {name: "rad/s" for name in numbers if name.startswith("angular")} | {"time": "s"}
    rows = [f"row {n}" for n in range(len(found.times))]
    return Observations(str(path), {}, numbers, units, rows)


def _count(found: Trajectory) -> int:
    return len(next(iter(found.columns.values()), ()))


def _of_text(path: Path) -> Observations:
    table = open_text(path)
    rows = list(table.rows())
    if not rows:
        raise RigidsimError(f"{path}: no rows; a line of names and rows of values are needed")
    columns = zip(*(cells for _, cells in rows), strict=True)
    texts = {name: list(cells) for name, cells in zip(table.names, columns, strict=True)}
    lines = [f"line {number}" for number, _ in rows]
    return Observations(str(path), texts, units=table.units, rows=lines, number=table.number)
