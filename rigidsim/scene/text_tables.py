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
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from rigidsim.scene.epochs import A_DATE, Epoch, parse_epoch
from rigidsim.scene.exact import is_unit, parse_number

TIMES = (
    "t", "time", "times", "epoch", "seconds", "timestamp", "timestamps", "date", "datetime", "utc", "stamp",
    "sim_time", "simtime",
)  # fmt: skip
"""Names of columns of times or dates, without their units."""
NO_NAMES = "line {} holds numbers; put a line of names above, such as t,qw,qx,qy,qz,wx,wy,wz"
_BRACKETS = re.compile(r"(.*?[A-Za-z]\w*)\s*[\[(]\s*([^\[\]()]*?)\s*[\])]\s*")
_OF_TIMES = re.compile(r"(t|time|timestamp)_([a-z]+)", re.I)
_ENDINGS = {"deg_s": "deg/s", "degs": "deg/s", "rad_s": "rad/s", "rads": "rad/s", "deg": "deg",
            "arcsec": "arcsec", "rad": "rad", "rpm": "rpm"}  # fmt: skip


class TableError(ValueError):
    """A table that can't be read; the text says where and what is allowed."""


def text_of(texts: Mapping[str, str], name: str, fault: Callable[[str], Exception]) -> str:
    """The text of a file next to the config that is named in it; ``fault`` is raised without one."""
    if name not in texts:
        what = (
            f'given "{name}", but this config was given as text, without files next to it; put the file\'s '
        )
        raise fault(f'{what}text into [tables."{name}"] text (there now: {", ".join(texts) or "none"})')
    return texts[name]


@dataclass(frozen=True)
class TextTable:
    """A text of rows of cells.

    Attributes:
        lines: gives the lines of the text, from the first one.
        names: of the columns, as they are written.
        separator: of the cells; empty for white space.
        head: number of lines before the first row.
    """

    lines: Callable[[], Iterable[str]]
    names: list[str]
    separator: str
    head: int

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """Number of the line and the cells of each row.

        Raises:
            TableError: a row has another number of cells than there are names.
        """
        count = len(self.names)
        for number, line in enumerate(self.lines(), 1):
            if number <= self.head or not (text := line.partition("#")[0].strip()):
                continue
            alone = count == 1 and not self.separator  # so that blanks belong to the cell, as in a date
            cells = [text] if alone else _cells(text, self.separator)
            if len(cells) == count + 1 and not cells[-1]:  # a separator ends the line
                cells.pop()
            if len(cells) != count:
                commas = "; numbers with decimal commas need columns separated by semicolons"
                raise TableError(
                    f"line {number} has {len(cells)} values, where the line of names has {count}"
                    + (commas if self.separator == "," and len(cells) > count else "")
                )
            if "," in text and self.separator != "," and self._mixed(cells):
                raise TableError(
                    f"line {number} has decimal commas and decimal points; write all with points"
                )
            yield number, cells

    def _mixed(self, cells: list[str]) -> bool:
        points = any("." in cell and not math.isnan(as_number(cell)) for cell in cells)
        return points and any("," in cell and not math.isnan(self.number(cell)) for cell in cells)

    def column(self, name: str) -> Iterator[tuple[int, str]]:
        """Number of the line and the cell of each row in one column."""
        place = self.names.index(name)
        return ((number, cells[place]) for number, cells in self.rows())

    def plain(self, cell: str) -> str:
        """A cell with a point in place of a decimal comma."""
        commas = self.separator != "," and cell.count(",") == 1 and "." not in cell
        return cell.replace(",", ".") if commas else cell

    def number(self, cell: str) -> float:
        """The number in a cell; nan where it holds none."""
        return as_number(self.plain(cell))

    @cached_property
    def units(self) -> dict[str, str]:
        """Units by the names of columns, as far as these say them; for times also unknown ones."""
        return {
            name: unit for name, (bare, unit) in ({name: name_and_unit(name) for name in self.names}).items()
            if unit and (is_unit(unit) or bare.lower() in TIMES)
        }  # fmt: skip


def open_table(
    lines: Callable[[], Iterable[str]], unnamed: str = "", usual: Mapping[int, str] | None = None
) -> TextTable:
    """Find the names and the separator of a text.

    Args:
        lines: gives its lines, from the first one.
        unnamed: name of the first column of a table without names; empty if such tables are refused.
        usual: names of all columns of a table without names, by their number.

    Raises:
        TableError: it is empty, or names no columns.
    """
    comments: list[str] = []
    for number, line in enumerate(lines(), 1):
        text = line.strip()
        if not text or text.startswith("#"):
            comments.append(text.lstrip("#").strip())
            continue
        names, separator = _names(text)
        if any(map(_is_name, re.split(r"[;,\s]+", text))):
            return TextTable(lines, names, separator, number)
        for comment in reversed(comments):
            names, above = _names(comment)
            for one in (above, separator):
                if len(names) == len(_cells(text, one)) and all(map(_is_name, names)):
                    return TextTable(lines, names, one, number - 1)
        if (named := (usual or {}).get(len(_cells(text, separator)))) is not None:
            return TextTable(lines, named.split(), separator, number - 1)
        if unnamed:
            names = [unnamed, *(f"column {n}" for n in range(2, len(_cells(text, separator)) + 1))]
            return TextTable(lines, names, separator, number - 1)
        raise TableError(NO_NAMES.format(number))
    raise TableError("empty; a line of names and rows of numbers are needed")


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


def holds_times(name: str) -> bool:
    """Whether a column of this name, with a unit or without, holds times or dates."""
    bare = re.sub(r"[^a-z0-9]+", "_", name_and_unit(name)[0].lower()).strip("_")
    return bare in TIMES or bare.endswith("header_stamp")


def is_date(cell: str) -> bool:
    """Whether a cell holds a calendar date rather than a number."""
    return A_DATE.match(cell) is not None


# --- sample times -------------------------------------------------------------------------------------------


def time_column(lines: Callable[[], Iterable[str]]) -> str:
    """The column of time alone, as the text of a table, with the digits that are written there.

    The unit is s where the name says none; of a table without names the first column is taken.

    Raises:
        TableError: no column is one of times, or the table can't be read.
    """
    table = open_table(lines, unnamed="t")
    name = next(filter(holds_times, table.names), None)
    if name is None:
        raise TableError(f"names no column t or time; its columns are {', '.join(table.names)[:200]}")
    unit = name_and_unit(name)[1] or "s"
    return "\n".join([f"time [{unit}]", *(table.plain(cell) for _, cell in table.column(name))])


def times_in(text: str, context: Any, epoch: Epoch | None) -> list[Fraction]:
    """Times (s) in the column of time of a table, exactly as written; dates count from the epoch."""
    head, *cells = time_column(text.splitlines).splitlines()
    if not any(map(is_date, cells)):
        unit = head.removeprefix("time [").removesuffix("]")
        return [parse_number(f"{cell} {unit}", "s").fraction(context) for cell in cells]
    if epoch is None:
        raise TableError("it holds dates; give the date of time 0 as [time] epoch")
    return [parse_epoch(cell).since(epoch) for cell in cells]
