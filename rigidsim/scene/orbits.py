"""Prescribed orbits, from the side of the attracting body or of the body, as keys and worked out: by Kepler's
laws or by a table.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Annotated, Any, ClassVar, Literal, get_args

from pydantic import Field, StrictStr, Tag

from rigidsim.errors import ensure, required
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import (
    WORKING_BITS,
    Matrix,
    bits_in_use,
    cosine_and_sine,
    eccentric_anomaly,
    transpose,
)
from rigidsim.scene.exact import ZERO, ExactNumber, parse_number
from rigidsim.scene.fields import (
    NAME_OR_VECTOR,
    Angle,
    FileName,
    Positive,
    Rate,
    Rule,
    Second,
    Triple,
    excludes,
    name_or_vector,
    one_of,
    only_with,
    together,
)
from rigidsim.scene.kepler import Ellipse, combined, plane_vectors
from rigidsim.scene.orbit_tables import TabulatedOrbit, read_table
from rigidsim.scene.registry import LoadFields, Setting
from rigidsim.scene.space_axes import ECLIPTIC, obliquity, to_ecliptic, to_equator
from rigidsim.scene.swept import Swept, SweptExact, Untraceable
from rigidsim.scene.text_tables import TableError, text_of
from rigidsim.scene.validation_messages import nearest

TableFrame = Literal["HCI", "ecliptic J2000", "EME2000", "ICRF", "GCRF"]
_OF_TABLES = ("format", "frame", "window")
_HCI = "75.594 deg", "7.155 deg", "0 deg"
"""Node of the Sun's equator on the ecliptic of J2000 and its inclination, of snvec (Zeebe & Lourens 2022)."""
MEAN_MOTION_KEYS = ("period", "sidereal_period", "longitude_rate")
"""Keys of which one may replace the mean motion of Kepler's third law."""


class Elements(Ellipse):
    """A Kepler orbit, whose node and periapsis may move uniformly.

    Angles are those at time zero of the scene, as classical elements in space axes. One of ``period``,
    ``sidereal_period`` and ``longitude_rate`` may replace the mean motion of Kepler's third law. A ``table``
    gives elements over time; those that it hasn't are constant.

    Attributes:
        key: of a load, that this table is.
        opposite: whether the elements place the body as seen from the source.
    """

    key: ClassVar[str]
    opposite: ClassVar[bool] = False
    rules: ClassVar[tuple[Rule, ...]] = (
        one_of(*MEAN_MOTION_KEYS, least=0),
        excludes("table", "node_rate", "periapsis_rate"),
        only_with("table", *_OF_TABLES),
        together("plane_of", "node"),
        excludes("plane_of", "table", "ascending_node", "node_rate", "periapsis_rate"),
        excludes("plane_of", "periapsis", "mean_anomaly", *MEAN_MOTION_KEYS),
    )

    table: FileName | None = Field(None, examples=["mars_elements.csv"])
    """name of a file next to the config, with elements over time"""
    format: Literal["hnbody", "orbitn", "vplanet", "la2010"] | None = None
    """program whose columns the table has; without it the first line names the columns"""
    frame: (
        Annotated[
            Annotated[TableFrame, Tag(NAME_OR_VECTOR[0])] | Annotated[Triple[Angle], Tag(NAME_OR_VECTOR[1])],
            name_or_vector(f"one of {', '.join(get_args(TableFrame))} or Euler angles zxz [a, b, c]"),
        ]
        | None
    ) = Field(None, examples=["HCI", ["107.58 deg", "1.58 deg", "0 deg"]])
    """axes of the table's elements; HCI are the heliocentric ones of HNBody and snvec, with X at the node of
    the Sun's equator; or the turn from these axes to space axes; by default space axes
    """
    window: Positive[Second] | None = Field(None, examples=["2 kyr"])
    """time over which osculating elements are averaged, by Hann's weights"""
    plane_of: StrictStr | None = Field(None, examples=["sun"])
    """name of the load from whose moving orbit plane the inclination counts"""
    node: Literal["averaged"] | None = None
    """of an orbit in such a plane: averaged over the node, as of the Moon on the moving ecliptic"""
    node_rate: Rate = Field(ZERO, examples=["-19.3 deg/yr"])
    """rate of the ascending node"""
    periapsis_rate: Rate = ZERO
    """rate of the argument of periapsis"""
    period: Positive[Second] | None = Field(None, examples=["27.55455 day"])
    """anomalistic period, from periapsis to periapsis, of the mean anomaly (with a table without one, of the
    mean longitude); by default by Kepler's third law
    """
    sidereal_period: Positive[Second] | None = Field(None, examples=["27.321661 day"])
    """period of the mean longitude (node + periapsis + mean anomaly), such as a sidereal month or year,
    instead of period
    """
    longitude_rate: Positive[Rate] | None = Field(None, examples=["13.17639648 deg/day"])
    """rate of the mean longitude (node + periapsis + mean anomaly), instead of period"""


class Orbit(Elements):
    """Where the attracting body is, as seen from the body: by a Kepler orbit, or as one of [[bodies]]."""

    key = "orbit"
    rules = (*Elements.rules, excludes("body", *Elements.model_fields))

    body: StrictStr | None = Field(None, examples=["sun"])
    """name of the attracting point mass in [[bodies]]; excludes all other keys"""


class SatelliteOrbit(Elements):
    """The body's own Kepler orbit about the attracting body, which is seen on the opposite side."""

    key, opposite = "satellite_orbit", True


SIDES = (
    "orbit is the place of the source as seen from the body, satellite_orbit the body's own orbit about the "
    "source"
)


class OrbitFields(LoadFields):
    """Keys of a load whose source and body are on a prescribed orbit, which is given from either side."""

    rules: ClassVar[tuple[Rule, ...]] = (one_of("orbit", "satellite_orbit", least=0, why=SIDES),)

    orbit: Orbit | None = Field(
        default=None,
        description="place of the source as seen from the body, by elements: for a satellite's elements "
        "use satellite_orbit",
        examples=[{"semi_major_axis": "1 au", "eccentricity": 0.0167}],
    )
    satellite_orbit: SatelliteOrbit | None = Field(
        default=None,
        description="the body's own elements about the source, with the keys of orbit, instead of orbit",
        examples=[{"semi_major_axis": "7000 km", "inclination": "51.6 deg"}],
    )

    @property
    def elements(self) -> Orbit | SatelliteOrbit | None:
        """The one of both that is given."""
        return self.satellite_orbit if self.orbit is None else self.orbit


@dataclass(frozen=True)
class KeplerOrbit:
    """Orbit of an attracting body by elements at time zero (radians, m, rad/s) with secular rates.

    A circle has no periapsis: its given angle and rate are added to the anomaly and to the mean
    motion here, and so are the node's if the orbit lies in the plane from which inclinations count.

    Attributes:
        mean_motion: rate of the mean anomaly, rad/s, from Kepler's third law or the pace that was given.
    """

    semi_major_axis: Any
    eccentricity: Any
    inclination: Any
    ascending_node: Any
    periapsis: Any
    mean_anomaly: Any
    node_rate: Any
    periapsis_rate: Any
    mean_motion: Any

    def eccentric_anomaly(self, context: Any, time: Any) -> Any:
        """Solution E of Kepler's equation M = E - e sin E at a time, to the context's precision."""
        return eccentric_anomaly(context, self.mean_anomaly + self.mean_motion * time, self.eccentricity)

    @property
    def circular(self) -> bool:
        """Whether the distance is constant."""
        return bool(self.eccentricity == 0)

    @property
    def fixed_plane(self) -> bool:
        """Whether neither node nor periapsis moves (a circle's periapsis never does)."""
        return bool(self.node_rate == 0 and self.periapsis_rate == 0)

    def normal(self, context: Any) -> list[Any]:
        """Unit normal at time zero about which the motion is direct, space axes."""
        tilt, node = self.inclination, self.ascending_node
        across = context.sin(tilt)
        return [across * context.sin(node), -across * context.cos(node), context.cos(tilt)]

    def place(self, context: Any, time: Any) -> list[Any]:
        """Place of the attracting body at a time, m, space axes."""
        a, e, anomaly = self.semi_major_axis, self.eccentricity, self.eccentric_anomaly(context, time)
        node, periapsis = (
            self.ascending_node + self.node_rate * time,
            self.periapsis + self.periapsis_rate * time,
        )
        turns = (cosine_and_sine(context, angle) for angle in (self.inclination, node, periapsis))
        across = a * context.sqrt(1 - e * e) * context.sin(anomaly)
        return combined(plane_vectors(*turns), a * (context.cos(anomaly) - e), across)

    @property
    def pericentre(self) -> Any:
        """Least distance, m."""
        return self.semi_major_axis * (1 - self.eccentricity)

    def fastest_rate(self, context: Any) -> Any:
        """Angular rate of the direction at pericentre, rad/s."""
        e = self.eccentricity
        return abs(self.mean_motion) * context.sqrt(1 - e * e) / (1 - e) ** 2


def attracting_body(orbit: Orbit, around: Setting) -> int:
    """Index of the point mass that an orbit names."""
    names = () if around.bodies is None else around.bodies.names
    allowed = ", ".join(names) or "none, since there are no [[bodies]]"
    what = f'given "{orbit.body}"{nearest(str(orbit.body), names)}; allowed: {allowed}'
    ensure(orbit.body in names, around.fault("orbit.body", what))
    found = names.index(str(orbit.body))
    what = f'given "{orbit.body}", which is the body itself; name another'
    ensure(found != required(around.bodies).host, around.fault("orbit.body", what))
    return found


def _rate_given(table: Elements) -> tuple[str, ExactNumber] | None:
    """The key that replaces the mean motion of Kepler's third law, and its value; None if none is given."""
    given = ((key, getattr(table, key)) for key in MEAN_MOTION_KEYS)
    return next(((key, value) for key, value in given if value is not None), None)


def _rate_meant(pace: tuple[str, ExactNumber], context: Any) -> Any:
    """The rate (mpf, rad/s) that a pace means, of the mean anomaly for a period, else of the longitude."""
    key, value = pace
    return value.at(context) if key == "longitude_rate" else 2 * context.pi / value.at(context)


def _mean_motion(table: Elements, strength: Any | None, around: Setting) -> Any:
    """Rate of the mean anomaly (mpf, rad/s): from the pace that was given, or Kepler's third law if the
    gravitational parameter ``strength`` is known. Mean longitude is ascending node + periapsis + mean
    anomaly.
    """
    context, pace = around.context, _rate_given(table)
    if pace is None:
        what = "missing; give it, or gravitational_parameter for the one of Kepler's third law"
        ensure(strength is not None, around.fault(f"{table.key}.period", what))
        assert table.semi_major_axis is not None
        return context.sqrt(strength / table.semi_major_axis.at(context) ** 3)
    rate = _rate_meant(pace, context)
    if pace[0] == "period":
        return rate
    motion = rate - table.node_rate.at(context) - table.periapsis_rate.at(context)
    what = f"less node_rate and periapsis_rate leaves the mean anomaly {context.nstr(motion, 8)} rad/s; "
    ensure(motion > 0, around.fault(f"{table.key}.{pace[0]}", what + "a positive rate is allowed"))
    return motion


def resolve_orbit(table: Elements, strength: Any | None, around: Setting) -> KeplerOrbit:
    """Elements of the attracting body as seen from the body: as given, or the body's own with the periapsis
    half a turn back. ``strength`` is the gravitational parameter (mpf, m^3/s^2), if known.
    """
    context = around.context
    if table.semi_major_axis is None:
        raise around.fault(f"{table.key}.semi_major_axis", "missing; it is needed")
    axis, eccentricity = table.semi_major_axis.at(context), table.eccentricity.at(context)
    motion = _mean_motion(table, strength, around)
    node, node_rate = table.ascending_node.at(context), table.node_rate.at(context)
    periapsis, periapsis_rate = table.periapsis.at(context), table.periapsis_rate.at(context)
    if table.opposite:
        periapsis = periapsis - context.pi
    anomaly, zero = table.mean_anomaly.at(context), context.zero
    if table.inclination.sign == 0:  # node and periapsis turn about the same axis
        periapsis, periapsis_rate, node, node_rate = periapsis + node, periapsis_rate + node_rate, zero, zero
    if eccentricity == 0:
        anomaly, motion, periapsis, periapsis_rate = anomaly + periapsis, motion + periapsis_rate, zero, zero
    return KeplerOrbit(
        semi_major_axis=axis,
        eccentricity=eccentricity,
        inclination=table.inclination.at(context),
        ascending_node=node,
        periapsis=periapsis,
        mean_anomaly=anomaly,
        node_rate=node_rate,
        periapsis_rate=periapsis_rate,
        mean_motion=motion,
    )


@lru_cache(64)  # loads of a scene with one table have one orbit
def _tabulated_orbit(
    name: str,
    text: str,
    bits: int,
    constants: tuple[tuple[str, ExactNumber], ...],
    strength: tuple[Any, ...] | None,
    *,
    opposite: bool,
    narrow: bool,
    axes: str | None,
) -> TabulatedOrbit:
    """A table's orbit, made once: of its text, the elements it lacks, an mpf's parts for Kepler's law, and
    the name of space axes; ``opposite`` as in ``Elements``.
    """
    given: dict[str, Any] = dict(constants)
    format, frame, window = (given.pop(key, None) for key in _OF_TABLES)
    table = read_table(text, bits, narrow=narrow, format=format)
    context = table.context
    for key in given:
        what = f"has a column {key}, which is given in the config, too; remove one of them"
        ensure(key not in table.columns, TableError(what))
    what = "has no column semi_major_axis; add one, or give semi_major_axis with table"
    ensure("semi_major_axis" in {*table.columns, *given}, TableError(what))
    rates = [_rate_meant((key, given.pop(key)), context) for key in MEAN_MOTION_KEYS if key in given]
    ensure(rates or strength is not None, TableError("needs a mean motion; give period with table"))

    def motion(axis: Any) -> Any:
        return rates[0] if rates else context.sqrt(context.make_mpf(strength) / axis**3)

    columns = {key: value.at(context) for key, value in given.items()}
    orbit = TabulatedOrbit(
        name, table, columns, motion, opposite=opposite,
        axes=None if frame is None else _table_axes(frame, axes, context),
        window=None if window is None else window.at(context),
    )  # fmt: skip
    _ = orbit.error
    return orbit


def _table_axes(frame: str | tuple[ExactNumber, ...], axes: str | None, context: Any) -> Matrix:
    """The axes of a table (rows) in space axes, which are the ecliptic's of J2000 if they have no name."""
    angles = (ZERO,) * 3 if isinstance(frame, str) else frame
    if frame == "HCI":
        angles = tuple(parse_number(angle, "rad") for angle in _HCI)
    turn = attitude.quaternion_from_euler(context, [angle.at(context) for angle in angles], "zxz")
    found = transpose(attitude.rotation_matrix(turn))
    if isinstance(frame, str):
        of_ecliptic, ecliptic = frame in ("HCI", ECLIPTIC), axes in (None, ECLIPTIC)
        change = {(True, False): to_equator, (False, True): to_ecliptic}.get((of_ecliptic, ecliptic))
        found = found if change is None else [change(axis, obliquity(context)) for axis in found]
    return found


def resolve_tabulated_orbit(fields: Elements, strength: Any | None, around: Setting) -> TabulatedOrbit:
    """Work out a table's orbit; ``strength`` is the gravitational parameter of Kepler's law, if known."""
    name, texts, context = str(fields.table), around.config.texts, around.context
    given = [(key, getattr(fields, key)) for key in sorted(fields.model_fields_set - {"table"})]
    if isinstance(strength, Swept) or any(isinstance(value, SweptExact) for _, value in given):
        raise Untraceable("an orbit by a table depends on it")
    place = f"{fields.key}.table"
    text = text_of(texts, name, partial(around.fault, place))
    parts = None if strength is None else strength._mpf_
    constants = tuple(
        (key, tuple(value) if isinstance(value, list) else value) for key, value in given if value is not None
    )
    named = isinstance(fields.frame, str) and fields.frame not in ("HCI", ECLIPTIC)
    what = f'given "{fields.frame}", but the space axes have no name; give [frame] axes'
    ensure(not named or around.axes is not None, around.fault(f"{fields.key}.frame", what))
    try:
        orbit = _tabulated_orbit(
            name, text, context.prec, constants, parts,
            opposite=fields.opposite, narrow=bits_in_use(context) <= WORKING_BITS["double"], axes=around.axes,
        )  # fmt: skip
    except TableError as error:
        raise around.fault(place, f'given "{name}": {error}') from None
    start, end = sorted((around.start, around.end))
    ends = orbit.time(0), orbit.time(len(orbit.table.times) - 1)
    first, last, begin, until = (context.nstr(t, 8) for t in (*ends, start, end))
    what = f'given "{name}", which reaches from t = {first} s to {last} s, but the run goes from {begin} s '
    what += f"to {until} s; give more rows, or change [time] start or end"
    ensure(ends[0] <= start and end <= ends[1], around.fault(place, what))
    return orbit
