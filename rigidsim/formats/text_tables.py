"""Delimited text as named columns, by one rule.

- Names stand in the first line, or in a comment above the first row, as numpy and TUM write them.
- Cells are separated by semicolons, tabs, commas, or white space: the first of these in the line of names.
- A comma within a number is a decimal comma where commas don't separate the cells.
- A unit stands in the name: ``wx [deg/s]``, ``alpha_deg``, ``time (min)``, ``time_day``.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from rigidsim.errors import RigidsimError
from rigidsim.scene.epochs import A_DATE
from rigidsim.scene.units import is_unit

TEXT = {".csv", ".txt", ".dat", ".tsv"}
"""Endings of the names of text files."""
TIMES = ("t", "time", "times", "epoch", "seconds", "timestamp", "date", "datetime", "utc")
"""Names of columns of times or dates, without their units."""
_BRACKETS = re.compile(r"(.*?[A-Za-z]\w*)\s*[\[(]\s*([^\[\]()]*?)\s*[\])]\s*")
_OF_TIMES = re.compile(r"(t|time|timestamp)_([a-z]+)", re.I)
_ENDINGS = {"deg_s": "deg/s", "degs": "deg/s", "rad_s": "rad/s", "rads": "rad/s", "deg": "deg",
            "arcsec": "arcsec", "rad": "rad", "rpm": "rpm"}  # fmt: skip


@dataclass(frozen=True)
class TextTable:
    """A text file of rows of cells.

    Attributes:
        names: of the columns, as they are written.
        separator: of the cells; empty for white space.
        head: number of lines before the first row.
    """

    path: Path
    names: list[str]
    separator: str
    head: int

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """Number of the line and the cells of each row.

        Raises:
            RigidsimError: a row has another number of cells than there are names.
        """
        count = len(self.names)
        with self.path.open(encoding="utf-8-sig") as file:
            for number, line in enumerate(file, 1):
                if number <= self.head or not (text := line.partition("#")[0].strip()):
                    continue
                cells = _cells(text, self.separator)
                if len(cells) == count + 1 and not cells[-1]:  # a separator ends the line
                    cells.pop()
                if len(cells) != count:
                    commas = "; numbers with decimal commas need columns separated by semicolons"
                    raise RigidsimError(
                        f"{self.path}: line {number} has {len(cells)} values, where the line of names has "
                        f"{count}" + (commas if self.separator == "," and len(cells) > count else "")
                    )
                if "," in text and self.separator != "," and self._mixed(cells):
                    raise RigidsimError(
                        f"{self.path}: line {number} has decimal commas and decimal points; "
                        "write all with points"
                    )
                yield number, cells

    def _mixed(self, cells: list[str]) -> bool:
        points = any("." in cell and not math.isnan(as_number(cell)) for cell in cells)
        return points and any("," in cell and not math.isnan(self.number(cell)) for cell in cells)

    def number(self, cell: str) -> float:
        """The number in a cell; nan where it holds none."""
        try:
            return float(cell)
        except ValueError:
            commas = self.separator != "," and cell.count(",") == 1 and "." not in cell
            return as_number(cell.replace(",", ".")) if commas else float("nan")

    @cached_property
    def units(self) -> dict[str, str]:
        """Units by the names of columns, as far as these say them; for times also unknown ones."""
        said = {name: name_and_unit(name) for name in self.names}
        return {
            name: unit for name, (bare, unit) in said.items()
            if unit and (is_unit(unit) or bare.lower() in TIMES)
        }  # fmt: skip


def open_text(path: Path) -> TextTable:
    """Find the names and the separator of a text file.

    Raises:
        RigidsimError: it is no text, is empty, or names no columns.
    """
    comments: list[str] = []
    try:
        with path.open(encoding="utf-8-sig") as file:
            for number, line in enumerate(file, 1):
                text = line.strip()
                if text and not text.startswith("#"):
                    return _headed(path, number, text, comments)
                comments.append(text.lstrip("#").strip())
    except (OSError, UnicodeDecodeError) as error:
        raise RigidsimError(f"{path}: can't be read ({error}); save it as UTF-8 text") from None
    raise RigidsimError(f"{path}: empty; a line of names and rows of numbers are needed")


def _headed(path: Path, number: int, line: str, comments: list[str]) -> TextTable:
    """The table whose first line that is no comment is this one."""
    names, separator = _names(line)
    if any(map(_is_name, re.split(r"[;,\s]+", line))):
        return TextTable(path, names, separator, number)
    for comment in reversed(comments):
        names, above = _names(comment)
        for one in (above, separator):
            if len(names) == len(_cells(line, one)) and all(map(_is_name, names)):
                return TextTable(path, names, one, number - 1)
    raise RigidsimError(
        f"{path}: line {number} holds numbers; put a line of names above, such as t,qw,qx,qy,qz,wx,wy,wz"
    )


def _names(line: str) -> tuple[list[str], str]:
    """Names in a line, and what separates them: white space, but for that before a unit."""
    separator = next((c for c in ";\t," if c in line), "")
    names = _cells(line if separator else re.sub(r"\s+(?=[\[(])", "", line), separator)
    return (names[:-1] if names and not names[-1] else names), separator


def _is_name(cell: str) -> bool:
    return any(map(str.isalpha, cell)) and not is_date(cell) and math.isnan(as_number(cell))


def _cells(text: str, separator: str) -> list[str]:
    if not separator:
        return text.split()
    if '"' not in text:
        return [cell.strip() for cell in text.split(separator)]
    return [cell.strip() for cell in next(csv.reader([text], delimiter=separator, skipinitialspace=True))]


def as_number(text: str) -> float:
    """The number that a text is; nan where it is none."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def name_and_unit(name: str) -> tuple[str, str | None]:
    """The name of a column without its unit, and the unit, if the name says one."""
    match = _BRACKETS.fullmatch(name)
    if match and match[2] and not match[2].isdigit():
        return match[1], match[2]
    if match := _OF_TIMES.fullmatch(name):
        return match[1], match[2]
    ending = next((end for end in _ENDINGS if name.lower().endswith(f"_{end}")), None)
    return (name[: -len(ending) - 1], _ENDINGS[ending]) if ending else (name, None)


def is_date(cell: str) -> bool:
    """Whether a cell holds a calendar date rather than a number."""
    return A_DATE.match(cell) is not None
