"""Prescribed orbits worked out, by Kepler's laws or by a table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from rigidsim.scene.arithmetic import cosine_and_sine, eccentric_anomaly
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.kepler import combined, plane_vectors
from rigidsim.scene.orbit_keys import PACES, Elements, Orbit
from rigidsim.scene.orbit_tables.elements import read_table
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.registry import Setting
from rigidsim.scene.text_tables import TableError
from rigidsim.scene.tracing import Traced, TracedExact, Untraceable
from rigidsim.scene.validation_messages import nearest


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
    masses = around.bodies
    names = () if masses is None else masses.names
    if masses is None or orbit.body not in names:
        allowed = ", ".join(names) or "none, since there are no [[bodies]]"
        what = f'given "{orbit.body}"{nearest(str(orbit.body), names)}; allowed: {allowed}'
        raise around.fault("orbit.body", what)
    found = names.index(orbit.body)
    if found == masses.host:
        raise around.fault("orbit.body", f'given "{orbit.body}", which is the body itself; name another')
    return found


def pace_of(table: Elements) -> tuple[str, ExactNumber] | None:
    """The key that replaces the mean motion of Kepler's third law, and its value; None if none is given."""
    given = ((key, getattr(table, key)) for key in PACES)
    return next(((key, value) for key, value in given if value is not None), None)


def rate_of(pace: tuple[str, ExactNumber], context: Any) -> Any:
    """The rate (mpf, rad/s) that a pace means, of the mean anomaly for a period, else of the longitude."""
    key, value = pace
    return value.at(context) if key == "longitude_rate" else 2 * context.pi / value.at(context)


def mean_motion(table: Elements, strength: Any | None, around: Setting) -> Any:
    """Rate of the mean anomaly (mpf, rad/s): that of the pace that was given, or of Kepler's third law if the
    gravitational parameter ``strength`` is known. Mean longitude is ascending node + periapsis + mean
    anomaly.
    """
    context, pace = around.context, pace_of(table)
    if pace is None:
        if strength is None:
            what = "missing; give it, or gravitational_parameter for the one of Kepler's third law"
            raise around.fault(f"{table.key}.period", what)
        assert table.semi_major_axis is not None
        return context.sqrt(strength / table.semi_major_axis.at(context) ** 3)
    rate = rate_of(pace, context)
    if pace[0] == "period":
        return rate
    motion = rate - table.node_rate.at(context) - table.periapsis_rate.at(context)
    if not motion > 0:
        what = f"less node_rate and periapsis_rate leaves the mean anomaly {context.nstr(motion, 8)} rad/s; "
        raise around.fault(f"{table.key}.{pace[0]}", what + "a positive rate is allowed")
    return motion


def resolve_orbit(table: Elements, strength: Any | None, around: Setting) -> KeplerOrbit:
    """Elements of the attracting body as seen from the body: as given, or the body's own with the periapsis
    half a turn back. ``strength`` is the gravitational parameter (mpf, m^3/s^2), if known.
    """
    context = around.context
    if table.semi_major_axis is None:
        raise around.fault(f"{table.key}.semi_major_axis", "missing; it is needed")
    axis, eccentricity = table.semi_major_axis.at(context), table.eccentricity.at(context)
    motion = mean_motion(table, strength, around)
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
def tabulated_orbit(
    name: str,
    text: str,
    bits: int,
    constants: tuple[tuple[str, ExactNumber], ...],
    strength: tuple[Any, ...] | None,
    opposite: bool,
) -> TabulatedOrbit:
    """A table's orbit, made once: of its text, the elements it lacks, and an mpf's parts for Kepler's law;
    ``opposite`` as in ``Elements``.
    """
    table = read_table(text, bits)
    context = table.context
    given = dict(constants)
    for key in given:
        if key in table.columns:
            raise TableError(f"has a column {key}, which is given in the config, too; remove one of them")
    if "semi_major_axis" not in table.columns and "semi_major_axis" not in given:
        raise TableError("has no column semi_major_axis; add one, or give semi_major_axis with table")
    paces = [(key, given.pop(key)) for key in PACES if key in given]
    if paces:
        rate = rate_of(paces[0], context)
        motion: Callable[[Any], Any] = lambda axis: rate  # noqa: E731
    elif strength is None:
        raise TableError("needs a mean motion; give period with table")
    else:
        mass = context.make_mpf(strength)
        motion = lambda axis: context.sqrt(mass / axis**3)  # noqa: E731
    columns = {key: value.at(context) for key, value in given.items()}
    orbit = TabulatedOrbit(name, table, columns, motion, opposite=opposite)
    _ = orbit.error
    return orbit


def resolve_tabulated_orbit(fields: Elements, strength: Any | None, around: Setting) -> TabulatedOrbit:
    """Work out a table's orbit; ``strength`` is the gravitational parameter of Kepler's law, if known."""
    name = fields.table
    assert name is not None
    given = [(key, getattr(fields, key)) for key in sorted(fields.model_fields_set - {"table"})]
    if isinstance(strength, Traced) or any(isinstance(value, TracedExact) for _, value in given):
        raise Untraceable("an orbit by a table depends on it")
    if name not in around.config.texts:
        known = ", ".join(around.config.texts) or "none"
        what = f'given "{name}", but this config was given as text, without files next to it; put the '
        what += f'CSV into [tables."{name}"] text (there now: {known})'
        raise around.fault(f"{fields.key}.table", what)
    parts = None if strength is None else strength._mpf_
    constants = tuple((key, value) for key, value in given if value is not None)
    try:
        orbit = tabulated_orbit(
            name, around.config.texts[name], around.context.prec, constants, parts, fields.opposite
        )
    except TableError as error:
        raise around.fault(f"{fields.key}.table", f'given "{name}": {error}') from None
    times = orbit.table.times
    start, end = sorted((around.start, around.end))
    if not (times[0] <= start and end <= times[-1]):
        ends = times[0], times[-1], start, end
        first, last, start, end = (around.context.nstr(t, 8) for t in ends)
        what = (
            f'given "{name}", which reaches from t = {first} s to {last} s, but the run goes from {start} s '
        )
        what += f"to {end} s; give more rows, or change [time] start or end"
        raise around.fault(f"{fields.key}.table", what)
    return orbit
