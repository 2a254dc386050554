"""Prescribed Kepler orbits: their config keys, and the elements worked out."""

from __future__ import annotations

from typing import Any

from pydantic import Field, StrictStr

from rigidsim.scene.exact import ZERO
from rigidsim.scene.fields import Angle, ConfigTable, Dimensionless, Metre, Rate, Second
from rigidsim.scene.kepler import eccentric_anomaly
from rigidsim.scene.records import dataclass
from rigidsim.scene.registry import Surroundings
from rigidsim.scene.validation_messages import nearest


class Orbit(ConfigTable):
    """A Kepler orbit of the attracting body, whose node and periapsis may move uniformly.

    Angles are those at time zero of the scene, as classical elements in space axes. ``period`` replaces
    the one of Kepler's third law. A ``table`` gives elements over time; those that it hasn't are constant.
    """

    body: StrictStr | None = Field(
        default=None,
        description="name of the attracting point mass in [[bodies]]; excludes all other keys",
        examples=["sun"],
    )
    table: StrictStr | None = Field(
        default=None,
        description="name of a CSV file beside the config, with elements over time",
        examples=["mars_elements.csv"],
    )
    semi_major_axis: Metre | None = Field(
        default=None, description="semi-major axis of the ellipse", examples=["7000 km"]
    )
    eccentricity: Dimensionless = Field(default=ZERO, description="0 to below 1")
    inclination: Angle = Field(
        default=ZERO, description="inclination to the XY plane of the space axes", examples=["51.6 deg"]
    )
    ascending_node: Angle = Field(
        default=ZERO, description="longitude of the ascending node from X, at time 0"
    )
    periapsis: Angle = Field(
        default=ZERO, description="argument of periapsis from the ascending node, at time 0"
    )
    mean_anomaly: Angle = Field(default=ZERO, description="mean anomaly at time 0")
    node_rate: Rate = Field(default=ZERO, description="rate of the ascending node", examples=["-19.3 deg/yr"])
    periapsis_rate: Rate = Field(default=ZERO, description="rate of the argument of periapsis")
    period: Second | None = Field(
        default=None,
        description="orbital period, instead of that from Kepler's third law",
        examples=["27.3 day"],
    )


@dataclass(frozen=True)
class KeplerOrbit:
    """Orbit of an attracting body by elements at time zero (radians, m, rad/s) with secular rates.

    A circle has no periapsis: its given angle and rate are added to the anomaly and to the mean
    motion here, and so are the node's if the orbit lies in the plane from which inclinations count.

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

    @property
    def pericentre(self) -> Any:
        """Least distance, m."""
        return self.semi_major_axis * (1 - self.eccentricity)

    def fastest_rate(self, context: Any) -> Any:
        """Angular rate of the direction at pericentre, rad/s."""
        e = self.eccentricity
        return abs(self.mean_motion) * context.sqrt(1 - e * e) / (1 - e) ** 2


def attracting_body(orbit: Orbit, around: Surroundings) -> int:
    """Index of the point mass that an orbit names.

    Raises:
        ConfigError: there is no such body, or it is this body itself.
    """
    more = sorted(orbit.model_fields_set - {"body"})
    if more:
        raise around.fault(f"orbit.{more[0]}", "given beside body, whose motion is integrated; remove it")
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


def resolve_orbit(table: Orbit, strength: Any | None, around: Surroundings) -> KeplerOrbit:
    """Work out the orbit's elements.

    Args:
        strength: gravitational parameter (mpf, m^3/s^2) of Kepler's third law; None if unknown.

    Raises:
        ConfigError: the elements describe no orbit.
    """
    context = around.context
    if table.semi_major_axis is None:
        raise around.fault("orbit.semi_major_axis", "missing; it is needed")
    axis, eccentricity = table.semi_major_axis.at(context), table.eccentricity.at(context)
    if not axis > 0:
        raise around.fault(
            "orbit.semi_major_axis", f"given {context.nstr(axis, 8)} m; a positive length is allowed"
        )
    if not 0 <= eccentricity < 1:
        raise around.fault(
            "orbit.eccentricity",
            f"given {context.nstr(eccentricity, 8)}; 0 (a circle) to below 1 is allowed",
        )
    if table.period is not None:
        if table.period.sign <= 0:
            raise around.fault("orbit.period", f"given {float(table.period):g} s; a positive time is allowed")
        motion = 2 * context.pi / table.period.at(context)
    elif strength is None:
        raise around.fault(
            "orbit.period", "missing; give it, or gravitational_parameter for the one of Kepler's third law"
        )
    else:
        motion = context.sqrt(strength / axis**3)
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
