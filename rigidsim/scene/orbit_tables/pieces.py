"""Tabulated orbits in elements without singularities, interpolated over time.

With longitude of periapsis pi, node W and inclination i they are (Broucke & Cefalu 1972, Celestial Mechanics
5, 303, with sin(i/2) in place of the tangent)

    k = e cos pi, h = e sin pi,   q = sin(i/2) cos W, p = sin(i/2) sin W,   a,   mean longitude l = M + pi.

They are smooth where e or i passes zero, and angles that turn need not be unwrapped, but for the mean
longitude: its whole turns between two rows follow from Kepler's third law, or the table is refused. Between
rows all are interpolated (``rigidsim.scene.orbit_tables.interpolation``). Without a column of the anomaly
the mean longitude advances at the rate of Kepler's third law, or of ``period``.
"""

from bisect import bisect_right
from collections.abc import Callable, Mapping
from functools import cached_property
from operator import add, mul, neg
from typing import Any

import numpy as np

from rigidsim.scene.arithmetic import eccentric_anomaly
from rigidsim.scene.kepler import regular_place
from rigidsim.scene.orbit_tables.elements import ElementTable
from rigidsim.scene.orbit_tables.interpolation import (
    AXIS,
    EXCENTRIC,
    LONGITUDE,
    TILTED,
    Interpolation,
    InterpolationError,
    interpolation_error,
)
from rigidsim.scene.text_tables import TableError

_DOUBTFUL_TURN = 0.25  # of a turn, by which the mean longitude may be off what Kepler's law expects
_LARGEST_TILT = 0.9999  # of sin(i/2): 178.4 deg


class TabulatedOrbit:
    """An orbit with elements over time; numbers are mpf of the scene's precision, SI. ``motion`` gives the
    mean motion for a semi-major axis. The elements are the table's; with ``opposite`` they are the other
    body's: half a turn on in its plane.
    """

    def __init__(
        self,
        name: str,
        table: ElementTable,
        constants: Mapping[str, Any],
        motion: Callable[[Any], Any],
        *,
        opposite: bool = False,
    ) -> None:
        self.name, self.table, self.motion = name, table, motion
        self.context = table.context
        self._constants = constants
        self.opposite, self._half_turn = opposite, self.context.pi if opposite else self.context.zero
        self._rows = self._regular()
        moving = [name for name, values in self._rows.items() if isinstance(values, list)]
        self.moving: tuple[str, ...] = tuple(moving)
        """The elements that change, among axis, k, h, q, p, longitude."""
        columns = np.array([self._rows[name] for name in moving], dtype=object).T
        self._interpolation = Interpolation(np.diff(np.array(table.times, dtype=object)), columns)
        self._pieces: dict[int, dict[str, list[Any]]] = {}

    # --- rows -----------------------------------------------------------------------------------------------

    def _regular(self) -> dict[str, Any]:
        """The regular elements: for each a list over the rows, or one constant."""
        context, columns, zero = self.context, self.table.columns, self.context.zero
        given = {**self._constants, **columns}

        def pairs(size: Any, angle: Any) -> tuple[Any, Any]:
            if not isinstance(size, list) and size == 0:
                return zero, zero
            cosines, sines = (_by_row(f, angle) for f in (context.cos, context.sin))
            return _by_row(mul, size, cosines), _by_row(mul, size, sines)

        names = "eccentricity", "inclination", "ascending_node", "periapsis"
        axis, (e, tilt, node, argument) = given["semi_major_axis"], (given.get(x, zero) for x in names)
        periapsis = given.get("longitude_of_periapsis")
        if periapsis is None:
            periapsis = _by_row(add, argument, node)
        self._longitude_of_periapsis = periapsis
        half = _by_row(lambda x: context.sin(x / 2), tilt)
        self._check("semi_major_axis", axis, lambda x: x > 0, "a positive length")
        self._check("eccentricity", e, lambda x: 0 <= x < 1, "0 (a circle) to below 1")
        self._check("inclination", half, lambda x: 0 <= x < _LARGEST_TILT, "0 to 178 deg")
        k, h = pairs(e, periapsis)
        q, p = pairs(half, node)
        if self._half_turn:
            k, h = (_by_row(neg, x) for x in (k, h))
        found = {AXIS: axis, "k": k, "h": h, "q": q, "p": p}
        longitude = given.get("mean_longitude")
        if "mean_anomaly" in columns:
            longitude = _by_row(add, columns["mean_anomaly"], periapsis)
        if isinstance(longitude, list):
            longitude = _by_row(add, longitude, self._half_turn)
            found[LONGITUDE] = self._unwrapped(longitude, axis)
        return found

    def _check(self, name: str, values: Any, allowed: Callable[[Any], bool], words: str) -> None:
        for row, value in enumerate(values if isinstance(values, list) else [values]):
            if not allowed(value):
                at = f"row {row + 1}: " if isinstance(values, list) else ""
                raise TableError(f"{at}{name} is out of range; {words} is allowed")

    def _unwrapped(self, longitude: list[Any], axis: Any) -> list[Any]:
        """The mean longitude with the whole turns between rows that Kepler's law gives."""
        context, times = self.context, self.table.times
        rates, turn = _by_row(lambda a, _: self.motion(a), axis, times), 2 * context.pi
        found = [longitude[0]]
        for i in range(1, len(times)):
            expected = (rates[i - 1] + rates[i]) / 2 * (times[i] - times[i - 1])
            off = (longitude[i] - found[-1] - expected) / turn
            part = off - context.nint(off)
            if abs(part) > _DOUBTFUL_TURN:
                raise TableError(
                    f"rows {i} and {i + 1}: the mean longitude is {float(abs(part)):.2f} turns off the "
                    f"{float(expected / turn):.6g} turns of Kepler's third law between them, so that whole "
                    "turns can't be counted; give rows closer together, a column semi_major_axis, or period; "
                    "or leave the anomaly's column out for a mean longitude by Kepler's law"
                )
            found.append(found[-1] + expected + part * turn)
        return found

    # --- pieces ---------------------------------------------------------------------------------------------

    def piece(self, number: int) -> dict[str, list[Any]]:
        """For each changing element, the coefficients of the powers 0 to 5 of (t - t_i) / (t_{i+1} - t_i)."""
        if number not in self._pieces:
            _, coefficients = self._interpolation.pieces(np.array([number]))
            self._pieces[number] = {name: list(coefficients[0, :, i]) for i, name in enumerate(self.moving)}
        return self._pieces[number]

    def narrow_pieces(self, numbers: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Of many pieces in 80 bits: lengths (n,), s, and for each changing element coefficients (n, 6)."""
        lengths, found = self._narrow.pieces(numbers)
        return lengths, {name: found[:, :, i] for i, name in enumerate(self.moving)}

    @cached_property
    def _narrow(self) -> Interpolation:
        return self._interpolation.narrowed()

    def row(self, number: int) -> dict[str, Any]:
        """All elements of a row of the table."""
        return {name: x[number] if isinstance(x, list) else x for name, x in self._rows.items()}

    def number_at(self, time: Any) -> int:
        """Number of the piece that contains a time; the first or last beyond the table's ends."""
        return min(max(bisect_right(self.table.times, time) - 1, 0), len(self.table.times) - 2)

    def at(self, time: Any) -> dict[str, Any]:
        """All elements at a time (s), interpolated or constant."""
        number, times = self.number_at(time), self.table.times
        x = (time - times[number]) / (times[number + 1] - times[number])
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
        found = self.at(time)
        regular = tuple(found[x] for x in (*EXCENTRIC, *TILTED))
        longitude = self.eccentric_longitude(found, self.starting_longitude(time))
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
            if isinstance(periapsis, list):
                given_side = -1 if self._half_turn else 1
                periapsis = self.context.atan2(given_side * elements["h"], given_side * elements["k"])
            given = self._constants.get("mean_anomaly", self.context.zero) + periapsis
        return given + self._half_turn + self.motion(elements[AXIS]) * time

    @property
    def described(self) -> str:
        """Description for ``plan``: the table, and the errors of interpolation between its rows."""
        times, error = self.table.times, self.error
        nstr = self.context.nstr
        return (
            f'by the table "{self.name}" ({len(times)} rows, t = {nstr(times[0], 8)} to '
            f"{nstr(times[-1], 8)} s; with every other row left out interpolation misses the source's "
            f"direction by at most {error.direction:.1e} rad and its distance by {error.distance:.1e} of it, "
            f"with all rows by about {error.expected:.3f} of that where they follow smooth functions)"
        )

    # --- sizes ----------------------------------------------------------------------------------------------

    def _each(self, name: str) -> list[Any]:
        values = self._rows[name]
        return values if isinstance(values, list) else [values]

    @cached_property
    def semi_major_axis(self) -> Any:
        """Semi-major axis, constant or the mean over the rows, m."""
        axes = self._each(AXIS)
        return sum(axes, self.context.zero) / len(axes)

    @cached_property
    def largest_eccentricity(self) -> Any:
        """Largest eccentricity over the rows."""
        sizes = _by_row(lambda k, h: self.context.sqrt(k * k + h * h), self._rows["k"], self._rows["h"])
        return max(sizes) if isinstance(sizes, list) else sizes

    @property
    def smallest_axis(self) -> Any:
        """Smallest semi-major axis over the rows, m."""
        return min(self._each(AXIS))

    @property
    def pericentre(self) -> Any:
        """Least distance, m."""
        return self.smallest_axis * (1 - self.largest_eccentricity)

    def normal(self, time: Any) -> list[Any]:
        """Unit normal at a time (s) about which the motion is direct, space axes."""
        q, p = (self.at(time)[name] for name in TILTED)
        chi = self.context.sqrt(1 - p * p - q * q)
        return [2 * p * chi, -2 * q * chi, 1 - 2 * (p * p + q * q)]

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
        times, largest = self.table.times, self.context.zero
        if pair[0] not in self.moving:
            return largest
        one, other = (self._rows[name] for name in pair)
        for i in range(len(times) - 1):
            change = self.context.hypot(one[i + 1] - one[i], other[i + 1] - other[i])
            largest = max(largest, change / (times[i + 1] - times[i]))
        return largest

    @property
    def longitude_exponent(self) -> int:
        """Binary exponent of a unit (rad) of which the mean longitude passes less than one over the table."""
        span = self.table.times[-1] - self.table.times[0]
        return int(self.context.mag(self.motion(self.smallest_axis) * span)) + 1

    @cached_property
    def error(self) -> InterpolationError:
        """Interpolation errors, see ``interpolation_error``."""
        names, times = (AXIS, *EXCENTRIC, *TILTED), self.table.times
        elements = {name: _by_row(lambda x, _: x, self._rows[name], times) for name in names}
        if LONGITUDE in self.moving:
            elements[LONGITUDE] = self._rows[LONGITUDE]
        return interpolation_error(times, elements, self.moving)


def _by_row(function: Callable[..., Any], *values: Any) -> Any:
    """A function of columns or constants, row by row; of constants alone a constant."""
    count = next((len(x) for x in values if isinstance(x, list)), None)
    if count is None:
        return function(*values)
    columns = (x if isinstance(x, list) else [x] * count for x in values)
    return [function(*row) for row in zip(*columns, strict=True)]
