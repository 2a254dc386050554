"""``[body] gravity_field``: the body's gravity beyond its inertia tensor, by spherical harmonics.

The potential of the body at a distance r, in its body axes, is

    (G m / r) sum (R / r)^n P_nm(sin lat) (C_nm cos m lon + S_nm sin m lon)

with unnormalized coefficients (J_n = -C_n0). Degree 2 follows from the inertia tensor: here, degree 3 is
the first.

A file of a field is ICGEM (``.gfc``) or SHADR (``.tab`` of the Planetary Data System), recognised by its
contents. ICGEM (Barthelmes & Foerste 2011): a header of keys and values up to ``end_of_head``, then rows
``gfc n m C S``, metres. SHADR: one line of radius (km), G M (km^3/s^2), its error, degree, order,
normalization (0 none, 1 full), longitude and latitude of reference, then rows ``n, m, C, S``. Numbers keep
their digits; exponents may be written with D.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from fractions import Fraction
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, StrictInt, StrictStr, field_validator, model_validator

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.scene.exact import parse_number, rounded
from rigidsim.scene.fields import (
    Beside,
    ConfigTable,
    Dimensionless,
    Metre,
    Positive,
    excludes,
    one_of,
    refuse,
)
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT
from rigidsim.scene.swept import plain
from rigidsim.scene.text_tables import as_number, text_of
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
    below: ClassVar[str]  # what gives lower degrees

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
                what = f"degrees from {cls.least} to {MOST} are allowed (lower ones follow from {cls.below})"
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
    file: Annotated[StrictStr, Beside("field")] | None = Field(None, examples=["FIELD.gfc"])
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
    """The degree to which a file is read: the key next to it, or the highest that a load asks for, or a sweep
    over a load's.
    """
    if table.degree is not None:
        return table.degree
    given = [getattr(load, "degree", None) for load in loads]
    for key, axis in (sweep.axes if sweep is not None else {}).items():
        given += (axis.values or []) if key.endswith(".degree") else []
    return max((n for n in given if isinstance(n, int)), default=2)


def gravity_field_of(
    table: GravityFieldTable, body: Any, context: Any, texts: Mapping[str, str], degree: int
) -> GravityField:
    """The field that ``[body]`` describes.

    Args:
        body: mass, centre of mass and inertia (``RigidBody``).
        texts: of files, by name.
        degree: to which a file is read.

    Raises:
        ConfigError: it contradicts the rest of the body.
    """
    ensure(body.mass is not None, _fault("given, but [body] mass is missing, by which it attracts; give it"))
    what = "given, but the body turns about another point than its centre of mass, from which the harmonics "
    what += "count; remove center_of_mass or reference"
    ensure(all(x == 0 for x in body.center_of_mass), _fault(what))
    if table.file is not None:
        return _of_file(table.file, body, context, texts, degree)
    assert table.radius is not None
    found = table.coefficients(context, _fault)
    return GravityField(table.radius.at(context), found, max(n for n, _, _ in found))


def _of_file(name: str, body: Any, context: Any, texts: Mapping[str, str], degree: int) -> GravityField:
    given = f'given "{name}", '
    try:
        read = read_field(text_of(texts, name, lambda what: _fault(what, " file")), degree)
    except FieldFileError as error:
        what = f"has in {error}" if str(error).startswith("line ") else str(error)
        raise _fault(f"{given}which {what}", " file") from None
    radius = rounded(read.radius, context)
    mass = rounded(read.strength, context) / context.mpf(GRAVITATIONAL_CONSTANT)
    there, here = (context.nstr(x, 6) for x in (mass, body.mass))
    what = (
        f"{given}whose G M makes the mass {there} kg, but [body] has {here} kg; is it the field of another "
    )
    ensure(abs(mass - body.mass) <= _SAME_MASS * body.mass, _fault(what + "body?", " file"))
    found: dict[Harmonic, Any] = {}
    for (n, m), row in read.rows.items():
        factor = context.sqrt(rounded(read.squared_factor(n, m), context))
        for sine, x in zip((False, True), row, strict=True):
            found[n, m, sine] = factor * rounded(x, context)
    _refuse_other_tensor(given, found, radius, body, context)
    refuse_impossible(found, context, lambda text: _fault(text, " file"), given)
    return GravityField(radius, {key: c for key, c in found.items() if key[0] >= LEAST}, degree)


def refuse_impossible(
    found: Mapping[Harmonic, Any], context: Any, fault: Callable[[str], ConfigError], given: str = ""
) -> None:
    """Refuse coefficients that no mass within some radii has.

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
        there = found.get((n, m, sine), value)
        what = f"{given}whose {'S' if sine else 'C'}{n}{m} is {context.nstr(there, 8)} (unnormalized), but "
        what += f"the inertia tensor makes it {context.nstr(value, 8)} with this mass and radius; give "
        fault = _fault(what + "moments of the same body, in the same body axes", " file")
        ensure(abs(there - value) <= _SAME_DEGREE_2 * most, fault)


def _fault(text: str, key: str = "") -> ConfigError:
    return ConfigError(Problem(f"{WHERE}{key}", text))


# --- files --------------------------------------------------------------------------------------------------

HEAD_ENDS = "end_of_head"
_STRENGTH = ("earth_gravity_constant", "gravity_constant")
_DECIDING = (*_STRENGTH, "radius", "max_degree", "norm", "product_type", "tide_system")
_WHOLE = re.compile("[0-9]{1,6}")
_NORMALIZED = {"fully_normalized": True, "unnormalized": False}
_FORTRAN = str.maketrans("dD", "ee")
_ZERO = 1e-9
"""What a coefficient of degree 1, or C00 less 1, may be by rounding."""
_Row = tuple[int, str, list[str]]


class FieldFileError(ValueError):
    """What a file lacks, or has too much of."""


@dataclass
class FieldFile:
    """A field as its file has it; numbers are exact, m and m^3/s^2."""

    radius: Fraction
    strength: Fraction
    normalized: bool
    degree: int
    rows: dict[tuple[int, int], tuple[Fraction, Fraction]] = field(default_factory=dict)

    def squared_factor(self, n: int, m: int) -> Fraction:
        """The square of what the file's coefficients are multiplied by, to be unnormalized."""
        if not self.normalized:
            return Fraction(1)
        ratio = Fraction(math.factorial(n - m), math.factorial(n + m))
        return (1 if m == 0 else 2) * (2 * n + 1) * ratio


def read_field(text: str, degree: int) -> FieldFile:
    """A field to a degree (2 at least).

    Raises:
        FieldFileError: the text is no such file, contradicts itself, or ends before that degree.
    """
    lines = list(enumerate(text.splitlines(), 1))
    found, body = _icgem(lines) if HEAD_ENDS in text else _shadr(lines)
    what = f"ends at degree {found.degree}, and degree {degree} is asked for"
    ensure(degree <= found.degree, FieldFileError(what))
    for number, key, words in body:
        _add_row(found, f"line {number}: ", key, words, degree)
    whole = found.rows.get((0, 0), (Fraction(1), Fraction(0)))[0]
    what = f"has C of degree 0 {float(whole):.10g}; it is 1"
    ensure(abs(whole - 1) <= _ZERO, FieldFileError(what))
    for m in (0, 1):
        for name, value in zip("CS", found.rows.get((1, m), ()), strict=False):
            what = (
                f"has {name} of degree 1, order {m} {float(value):g}: its origin isn't the centre of mass, "
            )
            what += "from which rotations count; take a field about the centre of mass"
            ensure(abs(value) <= _ZERO, FieldFileError(what))
    for n in range(3, degree + 1):
        for m in range(n + 1):
            what = f"has no row of degree {n}, order {m}; the file is cut short, or the text in [tables] was "
            what += "taken for a lower degree: remove that table to read the file again"
            ensure((n, m) in found.rows, FieldFileError(what))
    return found


def cut(lines: Iterable[str], degree: int) -> str:
    """The text of a file without rows of higher degrees."""
    kept, head = [], True
    icgem = None
    for line in lines:
        words = line.replace(",", " ").split()
        if icgem is None and words:
            icgem = head = math.isnan(as_number(words[0].translate(_FORTRAN)))
            kept.append(line)
        elif head:
            kept.append(line)
            head = words[:1] != [HEAD_ENDS]
        else:
            degrees = words[1:2] if icgem else words[:1]
            if not degrees or not _WHOLE.fullmatch(degrees[0]) or int(degrees[0]) <= degree:
                kept.append(line)
    return "".join(kept)


def _icgem(lines: list[tuple[int, str]]) -> tuple[FieldFile, Iterator[_Row]]:
    rows = [(number, line.split()) for number, line in lines]
    end = next((i for i, (_, words) in enumerate(rows) if words[:1] == [HEAD_ENDS]), -1)
    ensure(end >= 0, FieldFileError(f"has no line that begins with {HEAD_ENDS}"))
    begin = next((i for i, (_, words) in enumerate(rows) if words[:1] == ["begin_of_head"]), -1)
    head: dict[str, str] = {}
    for _, words in rows[begin + 1 : end]:
        key, value = (*words, "", "")[:2]
        if value and head.setdefault(key, value) != value and key in _DECIDING:
            raise FieldFileError(f"has the {key} {head[key]} and {value}; one is allowed")
    product = head.get("product_type", "gravity_field")
    ensure(product == "gravity_field", FieldFileError(f"is of product_type {product}; gravity_field is read"))
    strength = next((key for key in _STRENGTH if key in head), _STRENGTH[0])
    for key in ("radius", "max_degree", strength):
        ensure(key in head, FieldFileError(f"has no {key} before {HEAD_ENDS}"))
    norm, degree = head.get("norm", "fully_normalized"), head["max_degree"]  # the format's own default
    ensure(norm in _NORMALIZED, FieldFileError(f"has norm {norm}; {' and '.join(_NORMALIZED)} are read"))
    ensure(_WHOLE.fullmatch(degree), FieldFileError(f"has max_degree {degree}; a whole number is expected"))
    numbers = _positive(head["radius"], "radius"), _positive(head[strength], strength)
    found = FieldFile(*numbers, _NORMALIZED[norm], int(degree))
    return found, ((number, words[0], words[1:]) for number, words in rows[end + 1 :] if words)


def _shadr(lines: list[tuple[int, str]]) -> tuple[FieldFile, Iterator[_Row]]:
    rows = [(number, [x.strip() for x in line.split(",")]) for number, line in lines if line.strip()]
    what = f"is neither ICGEM (a header up to {HEAD_ENDS}) nor SHADR (a line of radius, G M, its error, "
    what += "degree, order, normalization, longitude, latitude)"
    head = rows[0][1] if rows else []
    ensure(len(head) >= 8 and "" not in head[:6], FieldFileError(what))
    numbers = [as_number(x.translate(_FORTRAN)) for x in head[:6]]
    ensure(all(map(math.isfinite, numbers)), FieldFileError(what))
    radius, strength, _, degree, order, normalization, longitude, latitude = head[:8]
    what = f"has the normalization state {normalization}; 0 (none) and 1 (full) are read"
    ensure(_number(normalization) in (0, 1), FieldFileError(what))
    for name, given in (("longitude", longitude), ("latitude", latitude)):
        what = f"refers to a {name} of {given} deg; fields that refer to 0 are read"
        ensure(not given or _number(given, f"has the {name} ") == 0, FieldFileError(what))
    ensure(_WHOLE.fullmatch(degree), FieldFileError(f"has the degree {degree}; a whole number is expected"))
    what = f"goes to order {order} of degree {degree} only; whole degrees are read"
    ensure(_number(order) >= _number(degree), FieldFileError(what))
    size, mass = 1000 * _positive(radius, "radius"), 10**9 * _positive(strength, "G M")
    found = FieldFile(size, mass, _number(normalization) == 1, int(degree))
    return found, ((number, "", words) for number, words in rows[1:])


def _add_row(found: FieldFile, where: str, key: str, words: list[str], degree: int) -> None:
    what = "time-variable terms aren't read" if key in ("gfct", "trnd", "dot", "asin", "acos") else ""
    ensure(key in ("", "gfc"), FieldFileError(f"{where}a row {key}; {what or 'rows gfc are expected'}"))
    what = f"{where}degree, order, C and S are expected, given {' '.join(words)[:60]}"
    whole = len(words) >= 4 and all(_WHOLE.fullmatch(x) for x in words[:2])
    ensure(whole, FieldFileError(what))
    n, m = int(words[0]), int(words[1])
    if n > degree:
        return
    c, s = (_number(x, where) for x in words[2:4])
    ensure(m <= n, FieldFileError(f"{where}the order {m} is above the degree {n}"))
    ensure(m or s == 0, FieldFileError(f"{where}S of order 0 is {float(s):g}; it is zero"))
    ensure((n, m) not in found.rows, FieldFileError(f"{where}degree {n}, order {m} comes twice"))
    found.rows[n, m] = (c, s)


def _number(text: str, where: str = "") -> Fraction:
    """A decimal, perhaps with an exponent of Fortran's."""
    try:
        return parse_number(Decimal(text.strip().translate(_FORTRAN)), "1").rational
    except (InvalidOperation, ValueError):
        given = f"{text[:40]!r}" if where.startswith("has") else f"given {text[:40]!r}"
        raise FieldFileError(f"{where}{given}; a number is expected") from None


def _positive(text: str, what: str) -> Fraction:
    found = _number(text, f"has the {what} ")
    ensure(found > 0, FieldFileError(f"has the {what} {text}; a positive number is expected"))
    return found
