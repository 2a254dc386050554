"""Tables of orbital elements over time: names with units, then one row for each time.

    # comments begin with a hash
    time [kyr], semi_major_axis [au], eccentricity, inclination [deg], ascending_node [deg]
    0, 1.523679, 0.0934, 1.85, 49.56
    1, 1.523679, 0.0943, 1.84, 49.27

A column without a unit is in SI (radians). Programs that integrate the solar system write tables without
names: ``FORMATS`` has their columns, of which the mean anomalies are left out, since rows are centuries
apart. Their rows begin with the first line of as many numbers, with an eccentricity below 1.

Numbers keep their digits in mpf. For scenes of at most double precision they are read in 80 bits, in a
hundredth of the time; elements with an anomaly, which counts millions of turns, stay mpf.
"""

import re
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from typing import Any

import mpmath
import numpy as np

from rigidsim.scene.exact import parse_number
from rigidsim.scene.orbit_tables.interpolation import in_80_bits
from rigidsim.scene.text_tables import TableError, TextTable, as_number, name_and_unit, open_table
from rigidsim.scene.validation_messages import nearest, shown

TIME = "time"
_ANGLES = (
    "inclination", "ascending_node", "periapsis", "longitude_of_periapsis", "mean_anomaly", "mean_longitude"
)  # fmt: skip
UNITS = {TIME: "s", "semi_major_axis": "m", "eccentricity": "1"} | dict.fromkeys(_ANGLES, "rad")
"""Columns that a table may have, with the SI units into which they are read."""
REGULAR = ("k", "h", "q", "p")
"""Columns in place of eccentricity and angles, see ``rigidsim.scene.orbit_tables.pieces``."""
_PLANE = "inclination [deg], "
_LEFT_OUT = "-"
FORMATS: Mapping[str, str] = {
    "hnbody": f"time [day], semi_major_axis [au], eccentricity, {_PLANE}longitude_of_periapsis [deg], "
    "ascending_node [deg], -, -",
    "orbitn": f"time [day], semi_major_axis [au], eccentricity, {_PLANE}-, ascending_node [deg], "
    "longitude_of_periapsis [deg], -",
    "vplanet": f"time [yr], semi_major_axis [au], eccentricity, {_PLANE}periapsis [deg], "
    "ascending_node [deg], -",
    "la2010": "time [kyr], semi_major_axis [au], -, k, h, q, p",
}
"""Columns of tables without names: as HNBody writes them for snvec (Zeebe & Lourens 2022), as orbitN does
(Zeebe 2023), as VPLanet's DistRot reads them (Deitrick et al. 2018), and of La2010 (Laskar et al. 2011).
"""
FEWEST_ROWS = 8
"""Least number of rows, so that every other row still suffices for a check of the interpolation."""
_DECIMAL = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{1,3})?")
_IN_DECIMALS = frozenset("0123456789+-.eE")
_PLAIN = b"0123456789+-.eE \t\n"
_LONGEST_CELL = 400


@dataclass(frozen=True)
class ElementTable:
    """Numbers of a table, SI, in arrays (rows,) of mpf or of 80 bits: ascending times, and other columns."""

    times: np.ndarray
    columns: Mapping[str, np.ndarray]
    context: Any


@lru_cache(8)
def read_table(text: str, bits: int, *, narrow: bool = False, format: str | None = None) -> ElementTable:
    """Read a table's text; ``TableError`` names the line at fault.

    Args:
        bits: of the numbers.
        narrow: whether 80 bits suffice for elements without an anomaly.
        format: a key of ``FORMATS`` for a table without names.
    """
    context = mpmath.MPContext()
    context.prec = bits
    table = open_table(text.splitlines) if format is None else _of_format(text, format)
    factors = {name: factor.at(context) for name, factor in _factors(table, format).items()}
    narrow = narrow and not {"mean_anomaly", "mean_longitude"} & {*factors}
    lines, values = _numbers(table, list(factors), context, narrow=narrow)
    if len(lines) < FEWEST_ROWS:
        raise TableError(f"has {len(lines)} rows; {FEWEST_ROWS} or more are needed to interpolate")
    scales = np.array(list(factors.values()), dtype=object)
    values = values * (in_80_bits(scales) if narrow else scales)
    if values[0, 0] > values[-1, 0]:
        lines, values = lines[::-1], values[::-1]
    back = np.flatnonzero(values[1:, 0] <= values[:-1, 0])
    if len(back):
        raise TableError(f"line {max(lines[back[0] : back[0] + 2])}: its time doesn't continue the order of "
                         "the rows before; times must ascend, or descend, from row to row")  # fmt: skip
    columns = dict(zip(factors, np.ascontiguousarray(values.T), strict=True))
    for name in [name for name in columns if name.startswith(_LEFT_OUT)]:
        del columns[name]
    return ElementTable(columns.pop(TIME), columns, context)


def _numbers(
    table: TextTable, names: list[str], context: Any, *, narrow: bool
) -> tuple[list[int], np.ndarray]:
    """Numbers of the lines, and the numbers in them (rows, columns) as they are written."""
    if narrow and (plain := _plain_numbers(table)) is not None:
        return list(range(table.head + 1, table.head + 1 + len(plain))), plain
    rows = list(table.rows())
    flat = [cell for _, cells in rows for cell in cells]
    found = None
    if "," in (text := "".join(flat)):
        flat = [table.plain(cell) for cell in flat]
        text = "".join(flat)
    if narrow and _IN_DECIMALS.issuperset(text):
        with suppress(ValueError):  # the line at fault is found below
            found = np.array(flat, dtype="S").astype(np.longdouble)
    if found is None or not np.isfinite(found).all():
        for number, cells in rows:
            for name, cell in zip(names, map(table.plain, cells), strict=True):
                if len(cell) > _LONGEST_CELL or _DECIMAL.fullmatch(cell) is None:
                    raise TableError(f"line {number}: given {shown(cell)} as {name}; a decimal number is "
                                     "allowed, without a unit (the line of names has it)")  # fmt: skip
        found = np.array([context.mpf(cell) for cell in flat], dtype=object)
        found = in_80_bits(found) if narrow else found
    return [number for number, _ in rows], found.reshape(len(rows), len(names))


def _plain_numbers(table: TextTable) -> np.ndarray | None:
    """Numbers (rows, columns) of lines that hold nothing else, between white space, in a fifth of the time;
    None of other lines.
    """
    text, count = "\n".join([*islice(table.lines(), table.head, None), ""]), len(table.names)
    data = text.encode()
    if table.separator or data.translate(None, _PLAIN):
        return None
    gap = np.frombuffer(b" " + data, dtype=np.uint8) <= ord(" ")
    begins, lines = np.flatnonzero(gap[:-1] & ~gap[1:]), np.flatnonzero(gap[1:])
    ends = lines[np.frombuffer(data, dtype=np.uint8)[lines] == ord("\n")]
    if (np.diff(np.searchsorted(begins, ends), prepend=0) != count).any():
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # of what is no number
        with suppress(DeprecationWarning, ValueError):
            found = np.fromstring(text, dtype=np.longdouble, sep=" ")
            if found.size == len(ends) * count and np.isfinite(found).all():
                return found.reshape(-1, count)
    return None


def _of_format(text: str, format: str) -> TextTable:
    """A table without names, from its first row on."""
    names = FORMATS[format].split(", ")
    place = names.index("eccentricity") if "eccentricity" in names else names.index("k")

    lines = text.replace("D", "E").replace(",", " ").splitlines()
    for number, line in enumerate(lines):
        cells = list(map(as_number, line.split()))
        if len(cells) == len(names) and abs(cells[place]) < 1:
            return TextTable(lambda: lines, names, "", number)
    raise TableError(f'has no line of {len(names)} numbers, as format = "{format}" has: {FORMATS[format]}')


def _factors(table: TextTable, format: str | None) -> dict[str, Any]:
    """Exact factors to SI of the columns, by their names without units; columns to leave out are numbered."""
    found: dict[str, Any] = {}
    units = UNITS if format is None else {**UNITS, **dict.fromkeys(REGULAR, "1")}
    for place, given in enumerate(table.names):
        name, unit = name_and_unit(given)
        if format is not None and given == _LEFT_OUT:
            found[f"{_LEFT_OUT}{place}"] = parse_number(1)
            continue
        if name not in units:
            raise TableError(f"line {table.head}: given the column {shown(name)}{nearest(name, UNITS)}; "
                             f"allowed: {', '.join(UNITS)}")  # fmt: skip
        if name in found:
            raise TableError(f"line {table.head}: the column {name} is there twice; give each once")
        try:
            found[name] = parse_number(f"1 {unit}" if unit else 1, units[name])
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
