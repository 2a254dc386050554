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
from typing import Any

import numpy as np

from rigidsim.scene.arithmetic import Matrix, eccentric_anomaly
from rigidsim.scene.kepler import regular_place
from rigidsim.scene.orbit_tables.elements import FEWEST_ROWS, REGULAR, ElementTable
from rigidsim.scene.orbit_tables.interpolation import (
    AXIS,
    EXCENTRIC,
    LONGITUDE,
    TILTED,
    Interpolation,
    InterpolationError,
    in_80_bits,
    interpolation_error,
)
from rigidsim.scene.text_tables import TableError

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
            _, coefficients = self._interpolation.pieces(np.array([number]))
            columns = coefficients[0].T
            self._pieces[number] = {
                name: list(map(self.context.convert, c)) for name, c in zip(self.moving, columns, strict=True)
            }
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
