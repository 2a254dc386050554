"""Keys of prescribed orbits, from the side of the attracting body or of the body."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field, StrictStr

from rigidsim.scene.exact import ZERO
from rigidsim.scene.fields import (
    Angle,
    ConfigTable,
    Eccentricity,
    Metre,
    Positive,
    Rate,
    Rule,
    Second,
    excludes,
    one_of,
)
from rigidsim.scene.registry import LoadFields

PACES = ("period", "sidereal_period", "longitude_rate")
"""Keys of which one may replace the mean motion of Kepler's third law."""


class Elements(ConfigTable):
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
        one_of(*PACES, least=0),
        excludes("table", "node_rate", "periapsis_rate"),
    )

    table: StrictStr | None = Field(None, examples=["mars_elements.csv"])
    """name of a CSV file next to the config, with elements over time"""
    semi_major_axis: Positive[Metre] | None = Field(None, examples=["7000 km"])
    """semi-major axis of the ellipse"""
    eccentricity: Eccentricity = ZERO
    """0 to below 1"""
    inclination: Angle = Field(ZERO, examples=["51.6 deg"])
    """inclination to the XY plane of the space axes"""
    ascending_node: Angle = ZERO
    """longitude of the ascending node from X, at time 0"""
    periapsis: Angle = ZERO
    """argument of periapsis from the ascending node, at time 0"""
    mean_anomaly: Angle = ZERO
    """mean anomaly at time 0"""
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
        description="place of the source as seen from the body, by elements: a satellite's source is "
        "opposite to the satellite's own elements, which are satellite_orbit",
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
