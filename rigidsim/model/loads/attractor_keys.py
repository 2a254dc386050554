"""``gravity_field`` of ``central_gravity``: the gravity of the attracting body beyond a point."""

from __future__ import annotations

import math
import re
from typing import Any

from pydantic import Field, StrictStr, field_validator, model_validator

from rigidsim.scene.bodies.gravity_field import MOST, Harmonic
from rigidsim.scene.exact import ZERO, ExactNumber
from rigidsim.scene.fields import Angle, ConfigTable, Dimensionless, Metre, Positive, Rate, Triple, refuse
from rigidsim.scene.registry import Setting
from rigidsim.scene.validation_messages import shown

_KEY = re.compile(r"(0|[1-9]\d{0,3}),(0|[1-9]\d{0,3})")
_WITHIN = 2
"""Radii within which the attracting body's mass is (see ``rigidsim.scene.bodies.gravity_field``)."""


class AttractorFieldTable(ConfigTable):
    """``gravity_field`` of ``central_gravity``: coefficients in axes that turn about the pole at a rate."""

    radius: Positive[Metre] = Field(examples=["6378.1366 km"])
    """reference radius R of C and S"""
    C: dict[StrictStr, Dimensionless] = Field(default_factory=dict, examples=[{"2,0": -1.0826e-3}])
    """unnormalized coefficients of cos m lon by "degree,order", from degree 2 on: C_20 is minus J2"""
    S: dict[StrictStr, Dimensionless] = Field(default_factory=dict, examples=[{"2,2": -9.0387e-7}])
    """likewise with sin m lon"""
    pole: Triple[Dimensionless] = Field(examples=[[0, 0, 1]])
    """direction of its axis of rotation, space axes"""
    rate: Rate = Field(ZERO, examples=["7.2921151e-5 rad/s"], json_schema_extra={"default": 0})
    """rate at which it turns about the pole"""
    prime_meridian: Angle = Field(ZERO, examples=["100 deg"], json_schema_extra={"default": 0})
    """angle of longitude 0 at time 0 from its equator's node on the plane XY (from X if they coincide)"""

    @field_validator("C", "S")
    @classmethod
    def _orders(cls, value: dict[str, Any], info: Any) -> dict[str, Any]:
        for key in value:
            _refuse_key(key, info.field_name)
        return value

    @field_validator("pole")
    @classmethod
    def _directed(cls, value: list[ExactNumber]) -> list[ExactNumber]:
        if all(x.sign == 0 for x in value):
            raise refuse("given [0, 0, 0]; a vector along the axis of rotation is allowed")
        return value

    @model_validator(mode="after")
    def _some(self) -> AttractorFieldTable:
        if not self.C and not self.S:
            raise refuse('missing coefficients; give C = {"2,0" = ..} and S = {"2,2" = ..}')
        return self


def _refuse_key(key: str, table: str) -> None:
    match = _KEY.fullmatch(key)
    if match is None:
        raise refuse(f'given the key {shown(key)}; degree and order are allowed, such as "2,0"')
    n, m = int(match[1]), int(match[2])
    if n < 2:
        what = "the attracting point is its centre of mass" if n == 1 else "gravitational_parameter says it"
        raise refuse(f'given "{key}", but degree {n} isn\'t given here, since {what}; remove it')
    if n > MOST:
        raise refuse(f'given "{key}"; degrees up to {MOST} are allowed')
    if m > n:
        raise refuse(f'given "{key}", but the order is at most the degree: "{n},{n}"')
    if table == "S" and m == 0:
        raise refuse(f'given "{key}" in S, which has no order 0; zonal coefficients are in C')


def coefficients_of(table: AttractorFieldTable, around: Setting) -> dict[Harmonic, Any]:
    """Coefficients (mpf), unnormalized, without zeros; refused where no mass has them."""
    context, found = around.context, {}
    for name, given in (("C", table.C), ("S", table.S)):
        for key, value in given.items():
            n, m = map(int, key.split(","))
            ratio = context.mpf(math.factorial(n - m)) / math.factorial(n + m)
            most = 2 * _WITHIN**n * context.sqrt(ratio)
            if abs(float(value)) > most:
                what = f'given {float(value):.8g} as "{key}" (unnormalized); no mass within {_WITHIN} radii '
                what += f"has more than {context.nstr(most, 3)}: check normalization and signs of exponents"
                raise around.fault(f"gravity_field.{name}", what)
            if value.sign != 0:
                found[n, m, name == "S"] = value.at(context)
    return dict(sorted(found.items()))
