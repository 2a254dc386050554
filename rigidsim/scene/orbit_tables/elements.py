"""Tables of orbital elements over time: names with units, then one row for each time.

    # comments begin with a hash
    time [kyr], semi_major_axis [au], eccentricity, inclination [deg], ascending_node [deg]
    0, 1.523679, 0.0934, 1.85, 49.56
    1, 1.523679, 0.0943, 1.84, 49.27

A column without a unit is in SI (radians). Numbers keep their digits, as everywhere in a config.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import mpmath

from rigidsim.scene.exact import parse_number
from rigidsim.scene.text_tables import TableError, TextTable, name_and_unit, open_table
from rigidsim.scene.validation_messages import nearest, shown

TIME = "time"
_ANGLES = (
    "inclination", "ascending_node", "periapsis", "longitude_of_periapsis", "mean_anomaly", "mean_longitude"
)  # fmt: skip
UNITS = {TIME: "s", "semi_major_axis": "m", "eccentricity": "1"} | dict.fromkeys(_ANGLES, "rad")
"""Columns that a table may have, with the SI units into which they are read."""
FEWEST_ROWS = 8
"""Least number of rows, so that every other row still suffices for a check of the interpolation."""
_DECIMAL = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{1,3})?")
_LONGEST_CELL = 400


@dataclass(frozen=True)
class ElementTable:
    """Numbers of a table (mpf, SI): ascending times, and for each a value of the other columns."""

    times: Sequence[Any]
    columns: Mapping[str, Sequence[Any]]
    context: Any


@lru_cache(8)
def read_table(text: str, bits: int) -> ElementTable:
    """Read a table's text in numbers of so many bits; ``TableError`` names the line at fault."""
    context = mpmath.MPContext()
    context.prec = bits
    table = open_table(text.splitlines)
    factors = {name: factor.at(context) for name, factor in _factors(table).items()}
    lines: list[int] = []
    rows: list[list[Any]] = []
    for number, cells in table.rows():
        lines.append(number)
        plain = [table.plain(cell) for cell in cells]
        for name, cell in zip(factors, plain, strict=True):
            if len(cell) > _LONGEST_CELL or _DECIMAL.fullmatch(cell) is None:
                raise TableError(f"line {number}: given {shown(cell)} as {name}; a decimal number is "
                                 "allowed, without a unit (the line of names has it)")  # fmt: skip
        rows.append([context.mpf(x) * factor for x, factor in zip(plain, factors.values(), strict=True)])
    if len(rows) < FEWEST_ROWS:
        raise TableError(f"has {len(rows)} rows; {FEWEST_ROWS} or more are needed to interpolate")
    columns = {name: list(values) for name, values in zip(factors, zip(*rows, strict=True), strict=True)}
    if columns[TIME][0] > columns[TIME][-1]:
        lines, columns = lines[::-1], {name: values[::-1] for name, values in columns.items()}
    times = columns.pop(TIME)
    for i in range(len(times) - 1):
        if not times[i] < times[i + 1]:
            raise TableError(f"line {max(lines[i : i + 2])}: its time doesn't go on from the row before; "
                             "times must ascend, or descend, from row to row")  # fmt: skip
    return ElementTable(times, columns, context)


def _factors(table: TextTable) -> dict[str, Any]:
    """Exact factors to SI of the columns, by their names without units."""
    found: dict[str, Any] = {}
    for given in table.names:
        name, unit = name_and_unit(given)
        if name not in UNITS:
            raise TableError(f"line {table.head}: given the column {shown(name)}{nearest(name, UNITS)}; "
                             f"allowed: {', '.join(UNITS)}")  # fmt: skip
        if name in found:
            raise TableError(f"line {table.head}: the column {name} is there twice; give each once")
        try:
            found[name] = parse_number(f"1 {unit}" if unit else 1, UNITS[name])
        except ValueError as error:
            raise TableError(f"line {table.head}: column {name}: {error}") from None
    if TIME not in found:
        raise TableError(f"line {table.head}: has no column {TIME}; it is needed, such as time [yr]")
    if len(found) < 2:
        raise TableError(f"line {table.head}: has no column except {TIME}; at least one element is needed")
    for one, other in (("periapsis", "longitude_of_periapsis"), ("mean_anomaly", "mean_longitude")):
        if one in found and other in found:
            raise TableError(f"line {table.head}: has both {one} and {other}; give one of them")
    return found
