"""Loads with every number worked out: what acts on the body, without saying how it enters equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene import load_tables
from rigidsim.scene.context import Vector
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions import Expression, ExpressionError, Number, names_used
from rigidsim.scene.load_tables import ATTITUDE_NAMES, FLIGHT_NAMES, RATE_NAMES
from rigidsim.scene.parser import parse_expression


@dataclass(frozen=True)
class UniformGravity:
    """A uniform field; ``acceleration`` in space axes, m/s^2."""

    acceleration: Vector


@dataclass(frozen=True)
class KeplerOrbit:
    """Where an attracting body is, as elements at time zero (radians, m, rad/s) with secular rates.

    A circle has no periapsis: what is given of it and of its motion is part of the anomaly and of the mean
    motion here, and so is the node where the orbit lies in the plane from which inclinations count.

    Attributes:
        mean_motion: rad/s, from Kepler's third law or from the period that was given.
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
        """Solution of Kepler's equation M = E - e sin E at a time, to the context's precision."""
        mean = self.mean_anomaly + self.mean_motion * time
        e = self.eccentricity
        anomaly = mean + e * context.sin(mean)
        # Newton converges quadratically; the count covers any precision from a start that is good to e^2
        for _ in range(12 + int(context.prec).bit_length()):
            step = (anomaly - e * context.sin(anomaly) - mean) / (1 - e * context.cos(anomaly))
            anomaly -= step
            if abs(step) <= context.ldexp(1, -context.prec // 2 - 2):
                break
        return anomaly

    @property
    def circular(self) -> bool:
        """Whether the distance is constant."""
        return bool(self.eccentricity == 0)

    @property
    def fixed_plane(self) -> bool:
        """Whether neither node nor periapsis moves (a circle's periapsis never does)."""
        return bool(self.node_rate == 0 and self.periapsis_rate == 0)


@dataclass(frozen=True)
class GravityGradient:
    """Torque of a distant body: on an ``orbit``, fixed at ``position`` (space axes, m), or where an analytic
    series has the Sun or the Moon as seen from the Earth (``ephemeris``; space axes are the mean ecliptic and
    equinox of J2000, time counts from J2000).
    """

    gravitational_parameter: Any
    orbit: KeplerOrbit | None = None
    position: Vector | None = None
    ephemeris: str | None = None


@dataclass(frozen=True)
class CentralGravity:
    """An attracting point at ``position`` (space axes, m); force and torque on a freely flying body."""

    gravitational_parameter: Any
    position: Vector


@dataclass(frozen=True)
class ViscousTorque:
    """Torque -c_i w_i about the body axes; ``coefficients`` in kg m^2/s."""

    coefficients: Vector


@dataclass(frozen=True)
class Applied:
    """A torque (N m) or a force (N) as expressions of time and the state.

    Attributes:
        kind: "torque" or "force".
        frame: "body" or "space", of the components.
        point: where a force acts, body axes, m; None for the centre of mass.
        number: place in the config, for messages.
    """

    kind: str
    components: tuple[Expression, Expression, Expression]
    frame: str
    point: Vector | None
    number: int

    @property
    def reads(self) -> frozenset[str]:
        """Names that the expressions use."""
        return frozenset().union(*(names_used(c) for c in self.components))


Load = UniformGravity | GravityGradient | CentralGravity | ViscousTorque | Applied


def acts(load: Load) -> bool:
    """False for a load that is zero whatever happens."""
    if isinstance(load, ViscousTorque):
        return any(c != 0 for c in load.coefficients)
    if isinstance(load, Applied):
        return not all(isinstance(c.root, Number) and c.root.value.sign == 0 for c in load.components)
    return True


def _fail(number: int, key: str, text: str) -> ConfigError:
    return ConfigError(Problem(f"[[loads]] number {number + 1} {key}", text))


def resolve_load(
    table: load_tables.LoadTable,
    number: int,
    context: Any,
    *,
    parameters: Mapping[str, ExactNumber],
    free_flight: bool,
) -> Load:
    """Work out one load.

    Args:
        number: its place in the config, for messages.
        parameters: named constants of expressions.
        free_flight: whether the body has a position that expressions may read.

    Raises:
        ConfigError: a contradiction or a value out of range.
    """
    if isinstance(table, load_tables.UniformGravity):
        return UniformGravity([a.at(context) for a in table.acceleration])
    if isinstance(table, load_tables.ViscousTorque):
        for i, coefficient in enumerate(table.coefficients):
            if coefficient.sign < 0:
                raise _fail(
                    number, f"coefficients[{i}]", f"given {float(coefficient):g}; zero or more is allowed"
                )
        return ViscousTorque([c.at(context) for c in table.coefficients])
    if isinstance(table, load_tables.AppliedTorque | load_tables.AppliedForce):
        return _applied(table, number, context, parameters, free_flight)
    strength = table.gravitational_parameter
    if strength.sign <= 0:
        raise _fail(
            number, "gravitational_parameter", f"given {float(strength):g}; a positive number is allowed"
        )
    if isinstance(table, load_tables.CentralGravity):
        return CentralGravity(strength.at(context), [x.at(context) for x in table.position])
    given = [key for key in ("orbit", "position", "ephemeris") if getattr(table, key) is not None]
    if len(given) != 1:
        found = " and ".join(given) or "none"
        raise _fail(number, "orbit", f"given {found}; exactly one of orbit, position and ephemeris is needed")
    if table.ephemeris is not None:
        return GravityGradient(strength.at(context), ephemeris=table.ephemeris)
    if table.position is not None:
        position = [x.at(context) for x in table.position]
        if all(x == 0 for x in position):
            raise _fail(number, "position", "given the origin, where the body is; another point is allowed")
        return GravityGradient(strength.at(context), position=position)
    assert table.orbit is not None
    return GravityGradient(
        strength.at(context), orbit=_orbit(table.orbit, strength.at(context), number, context)
    )


def _applied(
    table: load_tables.AppliedTorque | load_tables.AppliedForce,
    number: int,
    context: Any,
    parameters: Mapping[str, ExactNumber],
    free_flight: bool,
) -> Applied:
    names = ("t", *RATE_NAMES, *ATTITUDE_NAMES, *(FLIGHT_NAMES if free_flight else ()))
    components = []
    for i, text in enumerate(table.components):
        try:
            components.append(parse_expression(text, names, parameters=parameters))
        except ExpressionError as error:
            raise _fail(number, f"components[{i}]", str(error)) from None
    point = None
    if isinstance(table, load_tables.AppliedForce) and table.point is not None:
        point = [x.at(context) for x in table.point]
    first, second, third = components
    return Applied(table.kind, (first, second, third), table.frame, point, number)


def _orbit(table: load_tables.Orbit, strength: Any, number: int, context: Any) -> KeplerOrbit:
    axis, eccentricity = table.semi_major_axis.at(context), table.eccentricity.at(context)
    if not axis > 0:
        raise _fail(
            number, "orbit.semi_major_axis", f"given {context.nstr(axis, 8)} m; a positive length is allowed"
        )
    if not 0 <= eccentricity < 1:
        raise _fail(
            number,
            "orbit.eccentricity",
            f"given {context.nstr(eccentricity, 8)}; 0 (a circle) to below 1 is allowed",
        )
    motion = context.sqrt(strength / axis**3)
    if table.period is not None:
        if table.period.sign <= 0:
            raise _fail(
                number, "orbit.period", f"given {float(table.period):g} s; a positive time is allowed"
            )
        motion = 2 * context.pi / table.period.at(context)
    node, node_rate = table.ascending_node.at(context), table.node_rate.at(context)
    periapsis, periapsis_rate = table.periapsis.at(context), table.periapsis_rate.at(context)
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
