"""``[body] gravity_field``: the body's gravity beyond its inertia tensor, by spherical harmonics.

The potential of the body at a distance r, in its body axes, is

    (G m / r) sum (R / r)^n P_nm(sin lat) (C_nm cos m lon + S_nm sin m lon)

with unnormalized coefficients (J_n = -C_n0). Those of degree 2 are the inertia tensor's: here, degree 3 is
the first.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from pydantic import Field, StrictInt, StrictStr, field_validator, model_validator

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.fields import ConfigTable, Dimensionless, Metre, refuse
from rigidsim.scene.validation_messages import shown

WHERE = "[body] gravity_field"
LEAST = 3
"""The first degree that isn't the inertia tensor's."""
MOST = 200
"""Of a degree: beyond, double precision loses the harmonics, and no compiler takes the expressions."""
_KEY = re.compile(r"(0|[1-9]\d{0,3}),(0|[1-9]\d{0,3})")

Harmonic = tuple[int, int, bool]
"""Degree n, order m, and whether it goes with sin m lon."""


class GravityFieldTable(ConfigTable):
    """``[body] gravity_field``: coefficients in body axes, or a file of them."""

    radius: Metre | None = Field(None, examples=["1738 km"])
    """reference radius R of C and S"""
    C: dict[StrictStr, Dimensionless] | None = Field(None, examples=[{"3,0": -8.4e-6, "3,1": 2.8e-5}])
    """unnormalized coefficients of cos m lon by "degree,order", from degree 3 on: C_30 is minus J3"""
    S: dict[StrictStr, Dimensionless] | None = Field(None, examples=[{"3,1": 5.9e-6}])
    """those of sin m lon"""
    file: StrictStr | None = Field(None, examples=["FIELD.gfc"])
    """instead: a file beside the config, ICGEM (.gfc) or SHADR (.tab), whose text is taken into the config"""
    degree: StrictInt | None = Field(None, ge=LEAST, le=MOST, examples=[8])
    """highest degree that is read from the file; by default the highest that a load asks for"""

    @field_validator("C", "S")
    @classmethod
    def _orders(cls, value: dict[str, Any] | None, info: Any) -> dict[str, Any] | None:
        for key in value or ():
            _refuse_key(key, info.field_name)
        return value

    @model_validator(mode="after")
    def _one_source(self) -> GravityFieldTable:
        listed = [key for key in ("radius", "C", "S") if getattr(self, key) is not None]
        if self.file is not None and listed:
            raise refuse(f"given file beside {' and '.join(listed)}; either file, or radius with C and S")
        if self.file is None:
            if self.radius is None:
                raise refuse("missing radius, the reference radius of C and S; or give file")
            if not self.C and not self.S:
                raise refuse('missing coefficients; give C = {"3,0" = ..} and S = {"3,1" = ..}, or file')
            if self.degree is not None:
                raise refuse("given degree without file; leave out the coefficients that aren't wanted")
        return self

    @field_validator("radius")
    @classmethod
    def _positive(cls, value: ExactNumber | None) -> ExactNumber | None:
        if value is not None and value.sign <= 0:
            raise refuse(f"given {float(value):g}; a positive length is allowed")
        return value


def _refuse_key(key: str, table: str) -> None:
    match = _KEY.fullmatch(key)
    if match is None:
        raise refuse(f'given the key {shown(key)}; degree and order are allowed, such as "3,0"')
    n, m = int(match[1]), int(match[2])
    if n < LEAST:
        what = "the centre of mass is the origin" if n == 1 else "the inertia tensor says it"
        raise refuse(
            f'given "{key}", but degree {n} isn\'t given here, since {what}; remove it (degrees from {LEAST})'
        )
    if n > MOST:
        raise refuse(f'given "{key}"; degrees up to {MOST} are allowed')
    if m > n:
        raise refuse(f'given "{key}", but the order is at most the degree: "{n},{n}"')
    if table == "S" and m == 0:
        raise refuse(f'given "{key}" in S, which has no order 0; zonal coefficients are in C')


@dataclass(frozen=True, eq=False)
class GravityField:
    """The field of a body beyond degree 2.

    Attributes:
        radius: R, m (mpf).
        coefficients: C and S (mpf), unnormalized, by harmonic.
        degree: the highest that is known.
        described: where it comes from; empty for the config itself.
    """

    radius: Any
    coefficients: dict[Harmonic, Any]
    degree: int
    described: str = ""

    def to(self, degree: int) -> dict[Harmonic, Any]:
        """Coefficients from degree 3 to a degree, without zeros."""
        return {key: c for key, c in sorted(self.coefficients.items()) if key[0] <= degree and c != 0}


def gravity_field_of(table: GravityFieldTable | None, body: Any, context: Any) -> GravityField | None:
    """The field that ``[body]`` describes; None without one.

    Args:
        body: mass and centre of mass (``RigidBody``).

    Raises:
        ConfigError: it contradicts the rest of the body.
    """
    if table is None:
        return None
    if body.mass is None:
        raise fault("given, but [body] mass is missing, by which it attracts; give it")
    if any(x != 0 for x in body.center_of_mass):
        raise fault(
            "given, but the body turns about another point than its centre of mass, from which the harmonics "
            "count; remove center_of_mass or reference"
        )
    if table.radius is None:
        raise fault("given file, but files aren't read yet; list C and S")
    found: dict[Harmonic, Any] = {}
    for given, sine in ((table.C, False), (table.S, True)):
        for key, value in (given or {}).items():
            n, m = map(int, key.split(","))
            found[n, m, sine] = value.at(context)
    return GravityField(table.radius.at(context), found, max(n for n, _, _ in found))


def fault(text: str, key: str = "") -> ConfigError:
    """The error that names ``[body] gravity_field``."""
    return ConfigError(Problem(f"{WHERE}{key}", text))
