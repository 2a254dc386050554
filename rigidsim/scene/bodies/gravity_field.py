"""``[body] gravity_field``: the body's gravity beyond its inertia tensor, by spherical harmonics.

The potential of the body at a distance r, in its body axes, is

    (G m / r) sum (R / r)^n P_nm(sin lat) (C_nm cos m lon + S_nm sin m lon)

with unnormalized coefficients (J_n = -C_n0). Those of degree 2 are the inertia tensor's: here, degree 3 is
the first.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from pydantic import Field, StrictInt, StrictStr, field_validator, model_validator

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.bodies.field_files import FieldFileError, read_field
from rigidsim.scene.exact import rounded
from rigidsim.scene.fields import ConfigTable, Dimensionless, Metre, Positive, excludes, one_of, refuse
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT
from rigidsim.scene.tracing.numbers import plain
from rigidsim.scene.validation_messages import shown

WHERE = "[body] gravity_field"
LEAST = 3
"""The first degree that isn't the inertia tensor's."""
MOST = 200
"""Of a degree: beyond, double precision loses the harmonics, and no compiler takes the expressions."""
_SAME_MASS = 0.01
"""Relative difference up to which a mass and a gravitational parameter mean the same body."""
_SAME_DEGREE_2 = 0.01
"""Difference over the largest coefficient of degree 2 up to which file and tensor mean the same body: tide
systems differ by 1e-5 of it, published moments and fields by 1e-3.
"""
_WITHIN = 2
"""Radii within which a body's mass is: reference radii of odd shapes may be less than their longest axis."""
_KEY = re.compile(r"(0|[1-9]\d{0,3}),(0|[1-9]\d{0,3})")

Harmonic = tuple[int, int, bool]
"""Degree n, order m, and whether it goes with sin m lon."""


class HarmonicsTable(ConfigTable):
    """Base of tables with unnormalized coefficients ``C`` and ``S`` by "degree,order"."""

    least: ClassVar[int]  # degree
    below: ClassVar[str]  # what gives those of lower degrees

    @field_validator("C", "S", check_fields=False)
    @classmethod
    def _orders(cls, value: dict[str, Any] | None, info: Any) -> dict[str, Any] | None:
        for key in value or ():
            match = _KEY.fullmatch(key)
            if match is None:
                what = f'degree and order are allowed, such as "{cls.least},0"'
                raise refuse(f"given the key {shown(key)}; {what}")
            n, m = int(match[1]), int(match[2])
            if not cls.least <= n <= MOST:
                what = f"degrees from {cls.least} to {MOST} are allowed (lower ones are those of {cls.below})"
                raise refuse(f'given "{key}"; {what}')
            if m > n:
                raise refuse(f'given "{key}", but the order is at most the degree: "{n},{n}"')
            if info.field_name == "S" and m == 0:
                raise refuse(f'given "{key}" in S, which has no order 0; zonal coefficients are in C')
        return value

    @model_validator(mode="after")
    def _some(self) -> Self:
        if not (self.C or self.S or getattr(self, "file", None)):  # type: ignore[attr-defined]
            raise refuse(f'missing coefficients; give C = {{"{self.least},0" = ..}} or S')
        return self

    def coefficients(self, context: Any, fault: Callable[[str], ConfigError]) -> dict[Harmonic, Any]:
        """All that are given (mpf), in the order of their degrees; refused where no mass has them."""
        found: dict[Harmonic, Any] = {}
        for given, sine in ((self.C, False), (self.S, True)):  # type: ignore[attr-defined]
            for key, value in (given or {}).items():
                n, m = map(int, key.split(","))
                found[n, m, sine] = value.at(context)
        refuse_impossible(found, context, fault)
        return dict(sorted(found.items()))


class GravityFieldTable(HarmonicsTable):
    """``[body] gravity_field``: coefficients in body axes, or a file of them."""

    rules = (one_of("file", "radius"), excludes("file", "C", "S"), excludes("radius", "degree"))
    least = LEAST
    below = "mass, centre of mass and moments of inertia"
    radius: Positive[Metre] | None = Field(None, examples=["1738 km"])
    """reference radius R of C and S"""
    C: dict[StrictStr, Dimensionless] | None = Field(None, examples=[{"3,0": -8.4e-6, "3,1": 2.8e-5}])
    """unnormalized coefficients of cos m lon by "degree,order", from degree 3 on: C_30 is minus J3"""
    S: dict[StrictStr, Dimensionless] | None = Field(None, examples=[{"3,1": 5.9e-6}])
    """likewise with sin m lon"""
    file: StrictStr | None = Field(None, examples=["FIELD.gfc"])
    """instead: a file next to the config, ICGEM (.gfc) or SHADR (.tab), whose text is copied here"""
    degree: StrictInt | None = Field(None, ge=LEAST, le=MOST, examples=[8])
    """highest degree that is read from the file; by default the highest that a load asks for"""


@dataclass(frozen=True, eq=False)
class GravityField:
    """The field of a body beyond degree 2.

    Attributes:
        radius: R, m (mpf).
        coefficients: C and S (mpf), unnormalized, by harmonic.
        degree: the highest that is known.
    """

    radius: Any
    coefficients: dict[Harmonic, Any]
    degree: int

    def to(self, degree: int) -> dict[Harmonic, Any]:
        """Coefficients from degree 3 to a degree, without zeros."""
        return {key: c for key, c in sorted(self.coefficients.items()) if key[0] <= degree and c != 0}


def asked_degree(table: GravityFieldTable, loads: Iterable[Any], sweep: Any = None) -> int:
    """The degree to which a file is read: the one beside it, or the highest that a load asks for, or a sweep
    over a load's.
    """
    if table.degree is not None:
        return table.degree
    given = [getattr(load, "degree", None) for load in loads]
    for key, axis in (sweep.axes if sweep is not None else {}).items():
        given += (axis.values or []) if key.endswith(".degree") else []
    return max((n for n in given if isinstance(n, int)), default=2)


def gravity_field_of(
    table: GravityFieldTable | None, body: Any, context: Any, texts: Mapping[str, str], degree: int
) -> GravityField | None:
    """The field that ``[body]`` describes; None without one.

    Args:
        body: mass, centre of mass and inertia (``RigidBody``).
        texts: of files, by name.
        degree: to which a file is read.

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
    if table.file is not None:
        return _of_file(table.file, body, context, texts, degree)
    assert table.radius is not None
    found = table.coefficients(context, fault)
    return GravityField(table.radius.at(context), found, max(n for n, _, _ in found))


def _of_file(name: str, body: Any, context: Any, texts: Mapping[str, str], degree: int) -> GravityField:
    given = f'given "{name}", '
    if name not in texts:
        known = ", ".join(texts) or "none"
        what = "but this config was given as text, without files next to it; put the file's text into "
        raise fault(f'{given}{what}[tables."{name}"] text (there now: {known})', " file")
    try:
        read = read_field(texts[name], degree)
    except FieldFileError as error:
        raise fault(f"{given}which {_sentence(error)}", " file") from None

    radius = rounded(read.radius, context)
    mass = rounded(read.strength, context) / context.mpf(GRAVITATIONAL_CONSTANT)
    if abs(mass - body.mass) > _SAME_MASS * body.mass:
        there, here = (context.nstr(x, 6) for x in (mass, body.mass))
        what = f"{given}whose G M makes the mass {there} kg, but [body] has {here} kg; "
        raise fault(what + "is it the field of another body?", " file")
    found: dict[Harmonic, Any] = {}
    for (n, m), row in read.rows.items():
        factor = context.sqrt(rounded(read.squared_factor(n, m), context))
        for sine, x in zip((False, True), row, strict=True):
            found[n, m, sine] = factor * rounded(x, context)
    _refuse_other_tensor(given, found, radius, body, context)
    refuse_impossible(found, context, lambda text: fault(text, " file"), given)
    beyond = {key: c for key, c in found.items() if key[0] >= LEAST}
    return GravityField(radius, beyond, degree)


def refuse_impossible(
    found: Mapping[Harmonic, Any], context: Any, fault: Callable[[str], ConfigError], given: str = ""
) -> None:
    """Refuse coefficients beyond those of any mass within some radii.

    Mass within s R has abs(C_nm) <= 2 s^n max abs(P_nm) (n - m)!/(n + m)!, and P_nm^2 <= (n + m)!/(n - m)!.
    """
    for (n, m, sine), value in found.items():
        ratio = context.mpf(math.factorial(n - m)) / math.factorial(n + m)
        most = 2 * _WITHIN**n * context.sqrt(ratio)
        if abs(value) > most:
            name, size = f"{'S' if sine else 'C'}{n},{m}", context.nstr(plain(value), 8)
            what = f"{given}whose {name} is {size}" if given else f'given {size} as "{n},{m}" in {name[0]}'
            what += f" (unnormalized); no mass within {_WITHIN} radii has more than {context.nstr(most, 3)}: "
            raise fault(what + "check radius, normalization and signs of exponents")


def _sentence(error: FieldFileError) -> str:
    text = str(error)
    return f"has in {text}" if text.startswith("line ") else text


def _refuse_other_tensor(
    given: str, found: dict[Harmonic, Any], radius: Any, body: Any, context: Any
) -> None:
    """Refuse coefficients of degree 2 that the inertia tensor doesn't have, but for tides and rounding."""
    tensor, unit = body.inertia, body.mass * radius**2
    expected = {
        (2, 0, False): ((tensor[0][0] + tensor[1][1]) / 2 - tensor[2][2]) / unit,
        (2, 1, False): -tensor[0][2] / unit,
        (2, 1, True): -tensor[1][2] / unit,
        (2, 2, False): (tensor[1][1] - tensor[0][0]) / (4 * unit),
        (2, 2, True): -tensor[0][1] / (2 * unit),
    }
    most = context.maximum([abs(x) for x in expected.values()])
    for (n, m, sine), value in expected.items():
        if (n, m, sine) in found and abs(found[n, m, sine] - value) > _SAME_DEGREE_2 * most:
            name = f"{'S' if sine else 'C'}{n}{m}"
            there, here = (context.nstr(x, 8) for x in (found[n, m, sine], value))
            what = f"{given}whose {name} is {there} (unnormalized), but the inertia tensor makes it {here} "
            what += "with this mass and radius; give moments of the same body, in the same body axes"
            raise fault(what, " file")


def fault(text: str, key: str = "") -> ConfigError:
    """The error that names ``[body] gravity_field``."""
    return ConfigError(Problem(f"{WHERE}{key}", text))
