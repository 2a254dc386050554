"""``[[bodies]]``: the keys of point masses that move beside the body."""

from __future__ import annotations

from pydantic import Field, StrictStr

from rigidsim.scene.exact import ZERO
from rigidsim.scene.fields import (
    Angle,
    ConfigTable,
    Dimensionless,
    GravitationalParameter,
    Later,
    Metre,
    Speed,
    Triple,
)


class StartingOrbit(ConfigTable):
    """Osculating elements at the start, about another of the bodies."""

    about: StrictStr = Field(
        description="name of the point mass to which the elements are relative", examples=["sun"]
    )
    semi_major_axis: Metre = Field(description="semi-major axis of the ellipse", examples=["1 au"])
    eccentricity: Dimensionless = Field(default=ZERO, description="0 to below 1")
    inclination: Angle = Field(default=ZERO, description="inclination to the XY plane of the space axes")
    ascending_node: Angle = Field(default=ZERO, description="longitude of the ascending node from X")
    periapsis: Angle = Field(default=ZERO, description="argument of periapsis from the ascending node")
    mean_anomaly: Angle = Field(default=ZERO, description="mean anomaly at the start")


class PointMassBody(ConfigTable):
    """A point mass under the gravity of all others."""

    name: StrictStr = Field(
        description="letters, digits and underscores, beginning with a letter", examples=["sun"]
    )
    gravitational_parameter: GravitationalParameter = Field(
        description="G M", examples=["1.32712440018e20 m^3/s^2"]
    )
    position: Triple[Metre] | None = Field(default=None, description="position at the start, space axes")
    velocity: Triple[Speed] | None = Field(default=None, description="velocity at the start, space axes")
    orbit: Later[StartingOrbit] | None = Field(
        default=None,
        description="osculating elements at the start, instead of position and velocity",
        examples=[{"about": "sun", "semi_major_axis": "1 au", "eccentricity": 0.0167}],
    )
