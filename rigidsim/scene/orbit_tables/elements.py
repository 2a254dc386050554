"""Tables of orbital elements over time in CSV: a header of names with units, then one row for each time.

    # comments begin with a hash
    time [kyr], semi_major_axis [au], eccentricity, inclination [deg], ascending_node [deg]
    0, 1.523679, 0.0934, 1.85, 49.56
    1, 1.523679, 0.0943, 1.84, 49.27

A column without a unit is in SI (radians). Numbers keep their digits, as everywhere in a config.
"""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import mpmath

from rigidsim.scene.exact import parse_number
from rigidsim.scene.validation_messages import nearest, shown

TIME = "time"
_ANGLES = (
    "inclination", "ascending_node", "periapsis", "longitude_of_periapsis", "mean_anomaly", "mean_longitude"
)  # fmt: skip
UNITS = {TIME: "s", "semi_major_axis": "m", "eccentricity": "1"} | dict.fromkeys(_ANGLES, "rad")
"""Columns that a table may have, with the SI units into which they are read."""
FEWEST_ROWS = 8
"""Least number of rows, so that every other row still suffices for a check of the interpolation."""

_HEAD = re.compile(r"\s*([A-Za-z_]\w*)\s*(?:\[([^\]]*)\]|\(([^)]*)\))?\s*")
_DECIMAL = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{1,3})?")
_LONGEST_CELL = 400


class TableError(ValueError):
    """A table that can't be read; the text says where and what is allowed."""


@dataclass(frozen=True)
class ElementTable:
    """Numbers of a table (mpf, SI): ascending times, and for each a value of the other columns."""

    times: Sequence[Any]
    columns: Mapping[str, Sequence[Any]]
    context: Any


@lru_cache(8)
def read_table(text: str, bits: int) -> ElementTable:
    """Read a table's text in numbers of so many bits; ``TableError`` tells the line at fault."""
    context = mpmath.MPContext()
    context.prec = bits
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise TableError("is empty; a header such as time [yr], eccentricity, ... and rows are needed")
    names, factors = _header(*lines[0], context)
    rows = [_row(number, line, names, context) for number, line in lines[1:]]
    if len(rows) < FEWEST_ROWS:
        raise TableError(f"has {len(rows)} rows; {FEWEST_ROWS} or more are needed to interpolate")
    columns = {
        name: [row[i] * factors[i] for row in rows] if factors[i] != 1 else [row[i] for row in rows]
        for i, name in enumerate(names)
    }
    numbers = [number for number, _ in lines[1:]]
    times = columns.pop(TIME)
    if times[0] > times[-1]:
        times, numbers = times[::-1], numbers[::-1]
        columns = {name: values[::-1] for name, values in columns.items()}
    for i in range(len(times) - 1):
        if not times[i] < times[i + 1]:
            line = max(numbers[i], numbers[i + 1])
            raise TableError(f"line {line}: its time doesn't go on from the row before; times must ascend, "
                             "or descend, from row to row")  # fmt: skip
    return ElementTable(times, columns, context)


def _header(number: int, line: str, context: Any) -> tuple[list[str], list[Any]]:
    names: list[str] = []
    factors = []
    for cell in line.split(","):
        found = _HEAD.fullmatch(cell)
        if found is None:
            raise TableError(f"line {number}: given {shown(cell.strip())} in the header; names of columns "
                             "with their units are allowed, such as inclination [deg]")  # fmt: skip
        name, unit = found[1], (found[2] or found[3] or "").strip()
        if name not in UNITS:
            raise TableError(f"line {number}: given the column {shown(name)}{nearest(name, UNITS)}; "
                             f"allowed: {', '.join(UNITS)}")  # fmt: skip
        if name in names:
            raise TableError(f"line {number}: the column {name} is there twice; give each once")
        try:
            factor = parse_number(f"1 {unit}" if unit else 1, UNITS[name])
        except ValueError as error:
            raise TableError(f"line {number}: column {name}: {error}") from None
        names.append(name)
        factors.append(factor.at(context))
    if TIME not in names:
        raise TableError(f"line {number}: has no column {TIME}; it is needed, such as time [yr]")
    if len(names) < 2:
        raise TableError(f"line {number}: has no column beside {TIME}; at least one element is needed")
    for one, other in (("periapsis", "longitude_of_periapsis"), ("mean_anomaly", "mean_longitude")):
        if one in names and other in names:
            raise TableError(f"line {number}: has both {one} and {other}; give one of them")
    return names, factors


def _row(number: int, line: str, names: Sequence[str], context: Any) -> list[Any]:
    cells = next(csv.reader([line]))
    if len(cells) != len(names):
        raise TableError(f"line {number}: has {len(cells)} cells; the header names {len(names)} columns")
    values = []
    for name, cell in zip(names, cells, strict=True):
        given = cell.strip()
        if len(given) > _LONGEST_CELL or _DECIMAL.fullmatch(given) is None:
            raise TableError(f"line {number}: given {shown(given)} as {name}; a decimal number is allowed, "
                             "without a unit (the header has it)")  # fmt: skip
        values.append(context.mpf(given))
    return values
