"""The tables that ``[[loads]]`` takes, told apart by ``kind`` (the interface's section 1)."""

from __future__ import annotations

from decimal import Decimal
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, WithJsonSchema

from rigidsim.scene.exact import ZERO, ExactNumber, parse_number
from rigidsim.scene.messages import shown
from rigidsim.scene.tables import (
    Acceleration,
    Angle,
    Damping,
    Dimensionless,
    GravitationalParameter,
    Metre,
    Rate,
    Second,
    Table,
    Triple,
    refuse,
)

RATE_NAMES = ("wx", "wy", "wz")
ATTITUDE_NAMES = ("qw", "qx", "qy", "qz", "phi", "theta", "psi")
FLIGHT_NAMES = ("x", "y", "z", "vx", "vy", "vz")
"""Names of the state in expressions, beside t."""


def _standard_gravity() -> list[ExactNumber]:
    return [parse_number(a, "m/s^2") for a in ("0", "0", "-9.80665")]


class UniformGravity(Table):
    """A uniform field; a torque about the fixed point, or free fall in a scene with a position."""

    kind: Literal["uniform_gravity"]
    acceleration: Triple[Acceleration] = Field(default_factory=_standard_gravity)


class Orbit(Table):
    """A Kepler orbit of the attracting body, whose node and periapsis may move uniformly.

    Angles are those at time zero of the scene, as classical elements in space axes. ``period`` replaces
    the one of Kepler's third law.
    """

    semi_major_axis: Metre
    eccentricity: Dimensionless = ZERO
    inclination: Angle = ZERO
    ascending_node: Angle = ZERO
    periapsis: Angle = ZERO
    mean_anomaly: Angle = ZERO
    node_rate: Rate = ZERO
    periapsis_rate: Rate = ZERO
    period: Second | None = None


class GravityGradient(Table):
    """Torque of a distant attracting body, to second degree (MacCullagh's formula)."""

    kind: Literal["gravity_gradient"]
    gravitational_parameter: GravitationalParameter
    orbit: Orbit | None = None
    position: Triple[Metre] | None = None
    ephemeris: Literal["sun", "moon"] | None = None


class CentralGravity(Table):
    """A point that attracts a freely flying body: force and torque to second degree."""

    kind: Literal["central_gravity"]
    gravitational_parameter: GravitationalParameter
    position: Triple[Metre] = Field(default_factory=lambda: [ZERO] * 3)


class ViscousTorque(Table):
    """A torque -c_i w_i about each body axis."""

    kind: Literal["viscous_torque"]
    coefficients: Triple[Damping]


def _component(value: Any) -> str:
    """An expression; a bare number is one too."""
    if isinstance(value, bool) or not isinstance(value, str | int | Decimal | float):
        raise refuse(f'given {shown(value)}; an expression in quotes is allowed, such as "k*sin(t)^2"')
    return value if isinstance(value, str) else str(value)


Formula = Annotated[
    str, PlainValidator(_component), WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "number"}]})
]


class AppliedTorque(Table):
    """A torque as expressions of t, the state and [parameters], N m."""

    kind: Literal["torque"]
    components: Triple[Formula]
    frame: Literal["body", "space"] = "body"


class AppliedForce(Table):
    """A force as expressions, N, at a point of the body (from the reference point; default the centre of
    mass).
    """

    kind: Literal["force"]
    components: Triple[Formula]
    frame: Literal["body", "space"] = "space"
    point: Triple[Metre] | None = None


LoadTable = Annotated[
    UniformGravity | GravityGradient | CentralGravity | AppliedTorque | AppliedForce | ViscousTorque,
    Field(discriminator="kind"),
]
"""Any of them."""
