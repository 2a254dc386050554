"""Orbits given by tables of elements over time: the tables, and the interpolation between their rows.

A table has names with units, then one row for each time.

    # comments begin with a hash
    time [kyr], semi_major_axis [au], eccentricity, inclination [deg], ascending_node [deg]
    0, 1.523679, 0.0934, 1.85, 49.56
    1, 1.523679, 0.0943, 1.84, 49.27

A column without a unit is in SI (radians). Programs that integrate the solar system write tables without
names: ``FORMATS`` has their columns, of which the mean anomalies are left out, since rows are centuries
apart. Their rows begin with the first line of as many numbers, with an eccentricity below 1.

Numbers keep their digits in mpf. For scenes of at most double precision they are read in 80 bits, in a
hundredth of the time; elements with an anomaly, which counts millions of turns, stay mpf.

An orbit has elements without singularities. With longitude of periapsis pi, node W and inclination i they are
(Broucke & Cefalu 1972, Celestial Mechanics 5, 303, with sin(i/2) in place of the tangent)

    k = e cos pi, h = e sin pi,   q = sin(i/2) cos W, p = sin(i/2) sin W,   a,   mean longitude l = M + pi.

They are smooth where e or i passes zero, and angles that turn need not be unwrapped, but for the mean
longitude: its whole turns between two rows follow from Kepler's third law, or the table is refused. Without a
column of the anomaly the mean longitude advances at the rate of Kepler's third law, or of ``period``.

Between rows elements are polynomials of fifth degree. Each has the rows' values and, at both ends, the first
and second derivatives of the polynomial through the seven nearest rows (as many as there are, in shorter
tables), so that the whole is twice differentiable. A piece depends on eight rows around it. Where the rows
follow a smooth function, errors fall with the sixth power of their distance. (Differentiation
matrices: Welfert 1997, SIAM J. Numer. Anal. 34, 1640.) Errors are measured by leaving out and interpolating
every other row.
"""

from __future__ import annotations

import math
import re
import warnings
from bisect import bisect_right
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import islice
from typing import Any

import mpmath
import numpy as np

from rigidsim.scene.arithmetic import Matrix, eccentric_anomaly
from rigidsim.scene.exact import parse_number
from rigidsim.scene.kepler import eccentric_anomalies, regular_place
from rigidsim.scene.text_tables import TableError, TextTable, as_number, name_and_unit, open_table
from rigidsim.scene.validation_messages import nearest, shown

AXIS, LONGITUDE = "axis", "longitude"
EXCENTRIC, TILTED = ("k", "h"), ("q", "p")
_LARGEST_ERROR = 0.1  # rad, of the direction when every other row is left out
NEAREST = 7
_MOST_ROWS = 4096


class Interpolation:
    """Interpolation between rows of ``values`` (rows, columns), which are ``lengths`` (rows - 1,) apart: of
    floats, or of mpf in arrays of objects.
    """

    def __init__(self, lengths: np.ndarray, values: np.ndarray) -> None:
        self.lengths, self.values = lengths, values
        self._even = bool((lengths == lengths[:1]).all())

    def pieces(self, begin: int, end: int) -> tuple[np.ndarray, list[np.ndarray]]:
        """Of pieces begin ... end-1 lengths (n,), and the coefficients (n, columns) of the powers 0 to 5
        of (t - t_i) / (t_{i+1} - t_i). Floats must not grow beyond order one.
        """
        lengths, values, count = self.lengths, self.values, min(NEAREST, len(self.values))
        rows = np.arange(begin, end + 1)
        first = np.clip(rows - count // 2, 0, len(values) - count)
        near, here = first[:, None] + np.arange(count), rows - first
        # rows at equal distances have equal weights, but near the table's ends
        alike, same = np.unique(here, return_index=True, return_inverse=True)[1:]
        if not self._even:
            alike, same = np.arange(len(rows)), np.arange(len(rows))
        steps = np.cumsum(lengths[near[alike, :-1]], axis=1)  # from the first of the rows around
        offsets = np.concatenate([np.zeros((len(alike), 1), lengths.dtype), steps], axis=1)
        place = here[alike, None]
        offsets = offsets - np.take_along_axis(offsets, place, axis=1)
        around = values[near]
        d, s = (np.einsum("ni,nic->nc", w[same], around) for w in _weights(offsets, place))
        length = lengths[begin:end]
        y, step = values[begin : end + 1], length[:, None]
        a, b = d[:-1] * step, s[:-1] * step * step / 2
        # remainder at the far end for the powers 3 to 5: value, derivative, and half the second derivative
        u, v, w = y[1:] - (y[:-1] + a + b), d[1:] * step - (a + b * 2), s[1:] * step * step / 2 - b
        return length, [y[:-1], a, b, u * 10 - v * 4 + w, v * 7 - u * 15 - w * 2, u * 6 - v * 3 + w]


def in_80_bits(exact: np.ndarray) -> np.ndarray:
    """Numbers (mpf, in an array of objects) in the platform's longest floating point."""
    if exact.dtype != object:
        return exact
    high = exact.astype(np.float64)
    return high.astype(np.longdouble) + (exact - high).astype(np.float64)


def _weights(offsets: np.ndarray, here: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights of values at offsets (..., n) in the first and second derivative where one of them, of index
    ``here``, is zero.
    """
    apart = offsets[..., :, None] - offsets[..., None, :]
    apart[..., np.arange(offsets.shape[-1]), np.arange(offsets.shape[-1])] = 1
    products = apart.prod(axis=-1)
    inner = -offsets  # from the others to the row itself
    np.put_along_axis(inner, here, 1, axis=-1)
    one = np.take_along_axis(products, here, axis=-1) / (products * inner)
    np.put_along_axis(one, here, 0, axis=-1)
    centre = -one.sum(axis=-1, keepdims=True)
    two = 2 * one * (centre - 1 / inner)
    np.put_along_axis(one, here, centre, axis=-1)
    np.put_along_axis(two, here, 0, axis=-1)
    np.put_along_axis(two, here, -two.sum(axis=-1, keepdims=True), axis=-1)
    return one, two


def left_out(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every other row's number, and values (rows, columns) interpolated there from the others, in float64."""
    kept = Interpolation(np.diff(times[::2]), values[::2])
    rows = np.arange(1, 2 * len(kept.values) - 2, 2)
    lengths, c = kept.pieces(0, len(kept.lengths))
    x = ((times[rows] - times[rows - 1]) / lengths)[:, None]
    return rows, ((((c[5] * x + c[4]) * x + c[3]) * x + c[2]) * x + c[1]) * x + c[0]


@dataclass(frozen=True)
class InterpolationError:
    """Largest errors of the source's direction (rad) and, relative, of its distance when every other row is
    left out; with all rows both shrink by a factor, ``expected`` where they follow smooth functions.
    """

    direction: float
    distance: float
    expected: float = 2.0**-6  # an error of the sixth order


def interpolation_error(
    times: np.ndarray, elements: Mapping[str, Any], moving: Collection[str]
) -> InterpolationError:
    """Measure errors of a table with ``elements``: arrays (rows,) if ``moving``, else numbers.

    Raises:
        TableError: rows are so far apart that the table means little between them.
    """
    seconds = (times - times[0]).astype(np.float64)
    exact = {name: np.broadcast_to(np.asarray(x, dtype=np.float64), seconds.shape)
             for name, x in elements.items() if name != LONGITUDE}  # fmt: skip
    timed = LONGITUDE in moving
    if timed:
        values = elements[LONGITUDE] - elements[LONGITUDE][0]
        linear = values[-1] / (times[-1] - times[0])
        exact[LONGITUDE] = (values - linear * (times - times[0])).astype(np.float64)
    rows, found = left_out(seconds, np.array([exact[name] for name in moving]).T)
    if len(rows) > _MOST_ROWS:  # of many those where elements are most in error
        given = np.array([exact[name][rows] for name in moving]).T
        sizes = np.abs((found - given) / np.maximum(np.abs(given).max(axis=0), 1e-300)).max(axis=1)
        worst = np.sort(np.argpartition(sizes, -_MOST_ROWS)[-_MOST_ROWS:])
        rows, found = rows[worst], found[worst]
    guessed = {name: values[rows] for name, values in exact.items()}
    tabulated = dict(guessed)
    for i, name in enumerate(moving):
        guessed[name] = found[:, i]
    direction = distance = 0.0
    # if the anomaly isn't tabulated, the worst of several places on the orbit counts
    phases = [0.0] if timed else [i * math.pi / 4 for i in range(8)]
    base = np.zeros(len(rows))
    if timed:
        turn = 2 * times[0].context.pi
        base = (elements[LONGITUDE][rows] % turn).astype(np.float64)
    for phase in phases:
        shift = guessed.get(LONGITUDE, 0.0) - tabulated.get(LONGITUDE, 0.0)
        one, r_one = _places(tabulated, base + phase)
        two, r_two = _places(guessed, base + phase + shift)
        direction = max(direction, float(np.linalg.norm(one - two, axis=0).max()))
        distance = max(distance, float(np.abs(r_two / r_one - 1).max()))
    if not direction <= _LARGEST_ERROR:
        raise TableError(
            f"its rows are too far apart: with every other row left out, interpolation misses the "
            f"direction by {direction:.2g} rad; {_LARGEST_ERROR} or less is allowed: give more rows"
        )
    return InterpolationError(direction, distance)


def _places(elements: Mapping[str, np.ndarray], longitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors (3, n) and distances (n,) of regular elements, in double precision."""
    regular = tuple(elements[name] for name in (*EXCENTRIC, *TILTED))
    k, h = regular[:2]
    periapsis = np.arctan2(h, k)
    eccentric = eccentric_anomalies(longitude - periapsis, np.hypot(k, h)) + periapsis
    turn = np.cos(eccentric), np.sin(eccentric)
    r = 1 - k * turn[0] - h * turn[1]
    return np.array(regular_place(np, regular, turn, 1 / r)), r * elements[AXIS]


# --- tables -------------------------------------------------------------------------------------------------


TIME = "time"
_ANGLES = (
    "inclination", "ascending_node", "periapsis", "longitude_of_periapsis", "mean_anomaly", "mean_longitude"
)  # fmt: skip
UNITS = {TIME: "s", "semi_major_axis": "m", "eccentricity": "1"} | dict.fromkeys(_ANGLES, "rad")
"""Columns that a table may have, with the SI units into which they are read."""
REGULAR = ("k", "h", "q", "p")
"""Columns in place of eccentricity and angles."""
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


# --- orbits -------------------------------------------------------------------------------------------------


_DOUBTFUL_TURN = 0.25  # of a turn, by which the mean longitude may be off what Kepler's law expects
_LARGEST_TILT = 0.9999  # of sin(i/2): 178.4 deg


class TabulatedOrbit:
    """An orbit with elements over time, SI: mpf of the scene's precision, or arrays over the rows.

    ``motion`` gives the mean motion for a semi-major axis. The elements are the table's; with ``opposite``
    they are the other body's: half a turn on in its plane. ``axes`` (rows) are the table's axes in space
    axes, if they differ. Over a ``window`` (s) elements are averaged with Hann's weights; rows are left out
    where it reaches beyond the ends.
    """

    def __init__(
        self,
        name: str,
        table: ElementTable,
        constants: Mapping[str, Any],
        motion: Callable[[Any], Any],
        *,
        opposite: bool = False,
        axes: Matrix | None = None,
        window: Any | None = None,
    ) -> None:
        self.name, self.table, self.motion = name, table, motion
        self.context = table.context
        self._constants = constants
        self.opposite, self._half_turn = opposite, self.context.pi if opposite else self.context.zero
        self._rows = self._regular(axes)
        if window is not None:
            self._average(window)
        self._rest()
        self.moving = tuple(name for name, values in self._rows.items() if isinstance(values, np.ndarray))
        """The elements that change, among axis, k, h, q, p, longitude."""
        columns = np.array([self._rows[name] for name in self.moving]).T
        self._interpolation = Interpolation(np.diff(self.table.times), columns)
        self._pieces: dict[int, dict[str, list[Any]]] = {}

    # --- rows -----------------------------------------------------------------------------------------------

    def _of_rows(self, name: str) -> Callable[..., Any]:
        """A function of the scene's context, or of numpy for arrays of 80 bits."""
        exact = getattr(self.context, name)
        by_row = np.frompyfunc(exact, 1, 1)

        def function(x: Any) -> Any:
            if not isinstance(x, np.ndarray):
                return exact(x)
            return by_row(x) if x.dtype == object else getattr(np, name)(x)

        return function

    def _regular(self, axes: Matrix | None) -> dict[str, Any]:
        """The regular elements: for each an array over the rows, or one constant."""
        columns, zero = self.table.columns, self.context.zero
        given = {**self._constants, **columns}
        cos, sin = map(self._of_rows, ("cos", "sin"))

        def pairs(size: Any, angle: Any) -> tuple[Any, Any]:
            if not isinstance(size, np.ndarray) and size == 0:
                return zero, zero
            size, angle = _alike(size, angle)
            return size * cos(angle), size * sin(angle)

        names = "eccentricity", "inclination", "ascending_node", "periapsis"
        axis, (e, tilt, node, argument) = given["semi_major_axis"], (given.get(x, zero) for x in names)
        periapsis = given.get("longitude_of_periapsis")
        if periapsis is None:
            periapsis = np.add(*_alike(argument, node))
        self._longitude_of_periapsis = periapsis
        half = sin(tilt / 2)
        if REGULAR[0] in given:
            k, h, q, p = (given[x] for x in REGULAR)
            e, half = (self._of_rows("sqrt")(x * x + y * y) for x, y in ((k, h), (q, p)))
            self._longitude_of_periapsis = None
        self._check("semi_major_axis", axis, lambda x: x > 0, "a positive length")
        self._check("eccentricity", e, lambda x: (x >= 0) & (x < 1), "0 (a circle) to below 1")
        self._check("inclination", half, lambda x: (x >= 0) & (x < _LARGEST_TILT), "0 to 178 deg")
        if REGULAR[0] not in given:
            (k, h), (q, p) = pairs(e, periapsis), pairs(half, node)
        if axes is not None:
            k, h, q, p = self._turned(axes, k, h, q, p)
        if self._half_turn:
            k, h = -k, -h
        found = {AXIS: axis, "k": k, "h": h, "q": q, "p": p}
        longitude = given.get("mean_longitude")
        if "mean_anomaly" in columns:
            longitude = columns["mean_anomaly"] + periapsis
        if isinstance(longitude, np.ndarray):
            found[LONGITUDE] = self._unwrapped(longitude + self._half_turn, axis)
        return found

    def _turned(self, axes: Matrix, *regular: Any) -> tuple[Any, ...]:
        """Regular elements against space axes, of such against other axes (rows)."""
        sqrt = self._of_rows("sqrt")
        k, h, q, p, *flat = _alike(*regular, *(x for axis in axes for x in axis))
        chi = sqrt(1 - p * p - q * q)
        # the plane's normal, and the pericentre's direction times e, from the axes of longitudes
        normal = [2 * p * chi, -2 * q * chi, 1 - 2 * (p * p + q * q)]
        along, across = [1 - 2 * p * p, 2 * p * q, -2 * p * chi], [2 * p * q, 1 - 2 * q * q, 2 * q * chi]
        towards = [k * x + h * y for x, y in zip(along, across, strict=True)]
        n, e = ([sum(flat[3 * j + i] * v[j] for j in range(3)) for i in range(3)] for v in (normal, towards))
        self._check("inclination", n[2], lambda z: z > 1 - 2 * _LARGEST_TILT**2, "0 to 178 deg")
        double = sqrt(2 * (1 + n[2]))
        q, p = -n[1] / double, n[0] / double
        along, across = [1 - 2 * p * p, 2 * p * q, -p * double], [2 * p * q, 1 - 2 * q * q, q * double]
        k, h = (sum(x * y for x, y in zip(e, v, strict=True)) for v in (along, across))
        return k, h, q, p

    def _check(self, name: str, values: Any, allowed: Callable[[Any], Any], words: str) -> None:
        bad = np.flatnonzero(~np.atleast_1d(allowed(values)).astype(bool))
        if len(bad):
            at = f"row {bad[0] + 1}: " if isinstance(values, np.ndarray) else ""
            raise TableError(f"{at}{name} is out of range; {words} is allowed")

    def _unwrapped(self, longitude: np.ndarray, axis: Any) -> np.ndarray:
        """The mean longitude with the whole turns between rows that Kepler's law gives."""
        times, turn = self.table.times, 2 * self.context.pi
        rates = np.array([self.motion(a) for a in np.broadcast_to(axis, times.shape)], dtype=object)
        expected = (rates[:-1] + rates[1:]) / 2 * np.diff(times)
        off = (np.diff(longitude) - expected) / turn
        part = off - np.frompyfunc(self.context.nint, 1, 1)(off)
        doubtful = np.flatnonzero((abs(part) > _DOUBTFUL_TURN).astype(bool))
        if len(doubtful):
            i = int(doubtful[0])
            raise TableError(
                f"rows {i + 1} and {i + 2}: the mean longitude is {float(abs(part[i])):.2f} turns off the "
                f"{float(expected[i] / turn):.6g} turns of Kepler's third law, so whole turns can't be "
                "counted; give closer rows, a column semi_major_axis, or period; or leave out the column of "
                "the anomaly: the mean longitude then follows Kepler's law"
            )
        return np.concatenate([longitude[:1], longitude[0] + np.cumsum(expected + part * turn)])

    def _average(self, window: Any) -> None:
        """Average all elements over a window, and leave out the rows whose window reaches beyond the ends."""
        times = self.table.times
        steps = np.diff(times)
        if LONGITUDE in self._rows:
            raise TableError("has an anomaly, which no average keeps; leave window or that column out")
        if (abs(steps - steps[0]) > abs(steps[0]) / 2**20).any():
            raise TableError("has rows at unequal distances, over which no window averages; leave window out")
        half = int(window / self.context.convert(steps[0]) / 2)  # rows within it, on either side
        if not 1 <= half <= (len(times) - FEWEST_ROWS) // 2:
            what = f"has {len(times)} rows, {float(steps[0]):.6g} s apart; the window takes"
            raise TableError(f"{what} {2 * half + 1}; 3 to {len(times) - FEWEST_ROWS} are allowed")
        weights = np.cos(np.arange(-half, half + 1) * (np.pi / (2 * half + 2))) ** 2
        weights /= weights.sum()
        for name, values in self._rows.items():
            if isinstance(values, np.ndarray):
                self._rows[name] = np.convolve(values, weights.astype(values.dtype), "valid")
        self.table = ElementTable(times[half:-half], {}, self.context)

    def _rest(self) -> None:
        """Make constants of columns that rest; of a table in which everything does, none."""
        columns = {name: x for name, x in self._rows.items() if isinstance(x, np.ndarray)}
        still = [name for name, x in columns.items() if (x == x[0]).all() and name != LONGITUDE]
        if len(still) < len(columns):
            self._rows |= {name: self.context.convert(columns[name][0]) for name in still}

    # --- pieces ---------------------------------------------------------------------------------------------

    def piece(self, number: int) -> dict[str, list[Any]]:
        """For each changing element, the coefficients of the powers 0 to 5 of (t - t_i) / (t_{i+1} - t_i)."""
        if number not in self._pieces:
            _, powers = self._interpolation.pieces(number, number + 1)
            self._pieces[number] = {
                name: [self.context.convert(c[0, i]) for c in powers] for i, name in enumerate(self.moving)
            }
        return self._pieces[number]

    def narrow_pieces(self, numbers: np.ndarray) -> tuple[np.ndarray, dict[str, list[np.ndarray]]]:
        """Of neighbouring pieces in 80 bits: lengths (n,), s, and for each changing element the coefficients
        (n,) of the powers 0 to 5.
        """
        begin = int(numbers.min())
        lengths, powers = self._narrow.pieces(begin, int(numbers.max()) + 1)
        picked = numbers - begin
        return lengths[picked], {name: [c[picked, i] for c in powers] for i, name in enumerate(self.moving)}

    @cached_property
    def _narrow(self) -> Interpolation:
        whole = self._interpolation
        return Interpolation(in_80_bits(whole.lengths), in_80_bits(whole.values))

    def row(self, number: int) -> dict[str, Any]:
        """All elements of a row of the table."""
        return {
            name: self.context.convert(x[number]) if isinstance(x, np.ndarray) else x
            for name, x in self._rows.items()
        }

    def time(self, number: int) -> Any:
        """Time of a row, s (mpf)."""
        return self.context.convert(self.table.times[number])

    def number_at(self, time: Any) -> int:
        """Number of the piece that contains a time; the first or last beyond the table's ends."""
        found = bisect_right(range(len(self.table.times)), time, key=self.time) - 1
        return min(max(found, 0), len(self.table.times) - 2)

    def at(self, time: Any) -> dict[str, Any]:
        """All elements at a time (s), interpolated or constant."""
        number = self.number_at(time)
        begin, end = self.time(number), self.time(number + 1)
        x = (time - begin) / (end - begin)
        found = {name: values for name, values in self._rows.items() if name not in self.moving}
        for name, c in self.piece(number).items():
            found[name] = ((((c[5] * x + c[4]) * x + c[3]) * x + c[2]) * x + c[1]) * x + c[0]
        return found

    def eccentric_longitude(self, elements: Mapping[str, Any], longitude: Any) -> Any:
        """Eccentric longitude K from l = K - k sin K + h cos K (Kepler's equation)."""
        context, k, h = self.context, elements["k"], elements["h"]
        e = context.sqrt(k * k + h * h)
        if e == 0:
            return longitude
        periapsis = context.atan2(h, k)
        return eccentric_anomaly(context, longitude - periapsis, e) + periapsis

    def place(self, time: Any) -> list[Any]:
        """Place of the attracting body at a time, m, space axes."""
        return self._place_of(self._moving_elements(time))

    def _moving_elements(self, time: Any) -> dict[str, Any]:
        return {**self.at(time), LONGITUDE: self.starting_longitude(time)}

    def _place_of(self, found: Mapping[str, Any]) -> list[Any]:
        regular = tuple(found[x] for x in (*EXCENTRIC, *TILTED))
        longitude = self.eccentric_longitude(found, found[LONGITUDE])
        turn = self.context.cos(longitude), self.context.sin(longitude)
        return [found[AXIS] * x for x in regular_place(self.context, regular, turn)]

    def starting_longitude(self, time: Any) -> Any:
        """The mean longitude at a time; without a column from that at time zero and the mean motion now."""
        elements = self.at(time)
        if LONGITUDE in elements:
            return elements[LONGITUDE]
        given = self._constants.get("mean_longitude")
        if given is None:
            periapsis = self._longitude_of_periapsis
            if periapsis is None or isinstance(periapsis, np.ndarray):
                given_side = -1 if self._half_turn else 1
                periapsis = self.context.atan2(given_side * elements["h"], given_side * elements["k"])
            given = self._constants.get("mean_anomaly", self.context.zero) + self.context.convert(periapsis)
        return given + self._half_turn + self.motion(elements[AXIS]) * time

    @property
    def described(self) -> str:
        """Description for ``plan``: the table, and the errors of interpolation between its rows."""
        count, error, nstr = len(self.table.times), self.error, self.context.nstr
        return (
            f'by the table "{self.name}" ({count} rows, t = {nstr(self.time(0), 8)} to '
            f"{nstr(self.time(count - 1), 8)} s; with every other row left out interpolation misses the "
            f"source's direction by at most {error.direction:.1e} rad and its distance by "
            f"{error.distance:.1e} of it, with all rows by about "
            f"{error.expected:.3f} of that where they follow smooth functions)"
        )

    # --- sizes ----------------------------------------------------------------------------------------------

    @cached_property
    def semi_major_axis(self) -> Any:
        """Semi-major axis, constant or the mean over the rows, m."""
        axes = self._rows[AXIS]
        return self.context.convert(axes.sum()) / len(axes) if isinstance(axes, np.ndarray) else axes

    @cached_property
    def largest_eccentricity(self) -> Any:
        """Largest eccentricity over the rows."""
        k, h = (self._rows[name] for name in EXCENTRIC)
        return self.context.sqrt(self.context.convert(np.max(k * k + h * h)))

    @cached_property
    def smallest_axis(self) -> Any:
        """Smallest semi-major axis over the rows, m."""
        return self.context.convert(np.min(self._rows[AXIS]))

    @property
    def pericentre(self) -> Any:
        """Least distance, m."""
        return self.smallest_axis * (1 - self.largest_eccentricity)

    def normal(self, time: Any) -> list[Any]:
        """Unit normal at a time (s) about which the motion is direct, space axes."""
        return self._normal_of(self.at(time))

    def _normal_of(self, found: Mapping[str, Any]) -> list[Any]:
        q, p = (found[name] for name in TILTED)
        chi = self.context.sqrt(1 - p * p - q * q)
        return [2 * p * chi, -2 * q * chi, 1 - 2 * (p * p + q * q)]

    def rate_of(self, quantity: str, time: Any) -> list[Any]:
        """Rate of change of the "place" or "normal" at a time (s), by differences of twice the digits."""
        number, begun = self.number_at(time), self._moving_elements(time)
        begin, end = self.time(number), self.time(number + 1)
        x, rates = (time - begin) / (end - begin), {LONGITUDE: self.motion(begun[AXIS])}
        for name, c in self.piece(number).items():
            slope = (((5 * c[5] * x + 4 * c[4]) * x + 3 * c[3]) * x + 2 * c[2]) * x + c[1]
            rates[name] = slope / (end - begin)
        function = self._place_of if quantity == "place" else self._normal_of

        def moved(seconds: Any, axis: int) -> Any:
            return function({n: v + rates.get(n, 0) * seconds for n, v in begun.items()})[axis]

        return [self.context.diff(lambda t, axis=axis: moved(t, axis), 0) for axis in range(3)]

    @property
    def mean_motion(self) -> Any:
        """Mean motion for the mean axis, rad/s."""
        return self.motion(self.semi_major_axis)

    def fastest_rate(self) -> Any:
        """Angular rate of the direction at the least pericentre, rad/s."""
        e = self.largest_eccentricity
        return self.motion(self.smallest_axis) * self.context.sqrt(1 - e * e) / (1 - e) ** 2

    @cached_property
    def normal_drift(self) -> Any:
        """Bound of the rate at which the plane turns, rad/s: twice that between neighbouring rows."""
        return 4 * self._fastest(TILTED)

    @cached_property
    def shape_drift(self) -> Any:
        """Bound of the rate of the periapsis (rad/s), twice that between rows at the largest eccentricity."""
        e = self.largest_eccentricity
        return 2 * self._fastest(EXCENTRIC) / e if e > 0 else self.context.zero

    def _fastest(self, pair: tuple[str, str]) -> Any:
        """Largest rate of a pair of elements between neighbouring rows, 1/s."""
        changes = [np.diff(x) for x in map(self._rows.get, pair) if isinstance(x, np.ndarray)]
        if not changes:
            return self.context.zero
        squares = np.max(sum(x * x for x in changes) / np.diff(self.table.times) ** 2)
        return self.context.sqrt(self.context.convert(squares))

    @property
    def longitude_exponent(self) -> int:
        """Binary exponent of a unit (rad) of which the mean longitude passes less than one over the table."""
        span = self.time(len(self.table.times) - 1) - self.time(0)
        return int(self.context.mag(self.motion(self.smallest_axis) * span)) + 1

    @cached_property
    def error(self) -> InterpolationError:
        """Interpolation errors, see ``interpolation_error``."""
        return interpolation_error(self.table.times, self._rows, self.moving)


def _alike(*values: Any) -> list[Any]:
    """Values of which mpf are rounded to 80 bits if a column has no more."""
    narrow = any(isinstance(x, np.ndarray) and x.dtype != object for x in values)
    return [x if isinstance(x, np.ndarray) or not narrow else in_80_bits(np.array([x], dtype=object))[0]
            for x in values]  # fmt: skip
