"""Files of gravity fields: ICGEM (``.gfc``) and SHADR (``.tab`` of the Planetary Data System), told apart by
their contents.

ICGEM (Barthelmes & Foerste 2011): a header of keys and values up to ``end_of_head``, then rows
``gfc n m C S``, metres. SHADR: one line of radius (km), G M (km^3/s^2), its error, degree, order,
normalization (0 none, 1 full), longitude and latitude of reference, then rows ``n, m, C, S``. Numbers keep
their digits; exponents may be written with D.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from fractions import Fraction

from rigidsim.scene.exact import parse_number

HEAD_ENDS = "end_of_head"
_STRENGTH = ("earth_gravity_constant", "gravity_constant")
_DECIDING = (*_STRENGTH, "radius", "max_degree", "norm", "product_type", "tide_system")
_WHOLE = re.compile("[0-9]{1,6}")
_NORMALIZED = {"fully_normalized": True, "unnormalized": False}
_ZERO = 1e-9
"""What a coefficient of degree 1, or C00 less 1, may be by rounding."""


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
    if degree > found.degree:
        raise FieldFileError(f"ends at degree {found.degree}, and degree {degree} is asked for")
    for number, key, words in body:
        _add_row(found, number, key, words, degree)
    _refuse_shifted(found)
    for n in range(3, degree + 1):
        for m in range(n + 1):
            if (n, m) not in found.rows:
                what = f"has no row of degree {n}, order {m}; the file is cut short, or the text in [tables] "
                what += "was taken for a lower degree: remove that table to read the file again"
                raise FieldFileError(what)
    return found


def cut(lines: Iterable[str], degree: int) -> str:
    """The text of a file without rows of higher degrees."""
    kept, head = [], True
    icgem = None
    for line in lines:
        words = line.replace(",", " ").split()
        if icgem is None and words:
            icgem = not _is_number(words[0])
            head = icgem
            kept.append(line)
        elif head:
            kept.append(line)
            head = words[:1] != [HEAD_ENDS]
        else:
            degrees = words[1:2] if icgem else words[:1]
            if not degrees or not _WHOLE.fullmatch(degrees[0]) or int(degrees[0]) <= degree:
                kept.append(line)
    return "".join(kept)


Row = tuple[int, str, list[str]]


def _icgem(lines: list[tuple[int, str]]) -> tuple[FieldFile, Iterator[Row]]:
    end = next((i for i, (_, line) in enumerate(lines) if line.split()[:1] == [HEAD_ENDS]), None)
    if end is None:
        raise FieldFileError(f"has no line that begins with {HEAD_ENDS}")
    begin = next((i for i, (_, line) in enumerate(lines) if line.split()[:1] == ["begin_of_head"]), -1)
    head: dict[str, str] = {}
    for _, line in lines[begin + 1 : end]:
        words = line.split()
        if len(words) >= 2 and head.setdefault(words[0], words[1]) != words[1] and words[0] in _DECIDING:
            raise FieldFileError(f"has the {words[0]} {head[words[0]]} and {words[1]}; one is allowed")
    if head.get("product_type", "gravity_field") != "gravity_field":
        raise FieldFileError(f"is of product_type {head['product_type']}; gravity_field is read")
    strength = next((key for key in _STRENGTH if key in head), None)
    for key in ("radius", "max_degree", *([] if strength else _STRENGTH[:1])):
        if key not in head:
            raise FieldFileError(f"has no {key} before {HEAD_ENDS}")
    norm = head.get("norm", "fully_normalized")  # the format's own default
    if norm not in _NORMALIZED:
        raise FieldFileError(f"has norm {norm}; {' and '.join(_NORMALIZED)} are read")
    if not _WHOLE.fullmatch(head["max_degree"]):
        raise FieldFileError(f"has max_degree {head['max_degree']}; a whole number is expected")
    found = FieldFile(
        _positive(head["radius"], "radius"),
        _positive(head[strength or ""], strength or ""),
        _NORMALIZED[norm],
        int(head["max_degree"]),
    )
    rows = ((number, line.split()) for number, line in lines[end + 1 :])
    return found, ((number, words[0], words[1:]) for number, words in rows if words)


def _shadr(lines: list[tuple[int, str]]) -> tuple[FieldFile, Iterator[Row]]:
    rows = [(number, [x.strip() for x in line.split(",")]) for number, line in lines if line.strip()]
    if not rows or len(rows[0][1]) < 8 or not all(_is_number(x) for x in rows[0][1][:6]):
        raise FieldFileError(
            f"is neither ICGEM (a header up to {HEAD_ENDS}) nor SHADR (a line of radius, G M, its error, "
            "degree, order, normalization, longitude, latitude)"
        )
    radius, strength, _, degree, order, normalization, longitude, latitude = rows[0][1][:8]
    if _number(normalization) not in (0, 1):
        raise FieldFileError(f"has the normalization state {normalization}; 0 (none) and 1 (full) are read")
    for what, given in (("longitude", longitude), ("latitude", latitude)):
        if given and _number(given, f"has the {what} ") != 0:
            raise FieldFileError(f"refers to a {what} of {given} deg; fields that refer to 0 are read")
    if not _WHOLE.fullmatch(degree):
        raise FieldFileError(f"has the degree {degree}; a whole number is expected")
    if _number(order) < _number(degree):
        raise FieldFileError(f"goes to order {order} of degree {degree} only; whole degrees are read")
    found = FieldFile(
        1000 * _positive(radius, "radius"),
        10**9 * _positive(strength, "G M"),
        _number(normalization) == 1,
        int(degree),
    )
    return found, ((number, "", words) for number, words in rows[1:])


def _add_row(found: FieldFile, number: int, key: str, words: list[str], degree: int) -> None:
    where = f"line {number}: "
    if key not in ("", "gfc"):
        what = "time-variable terms aren't read" if key in ("gfct", "trnd", "dot", "asin", "acos") else ""
        raise FieldFileError(f"{where}a row {key}; {what or 'rows gfc are expected'}")
    if len(words) < 4 or not all(_WHOLE.fullmatch(x) for x in words[:2]):
        raise FieldFileError(f"{where}degree, order, C and S are expected, given {' '.join(words)[:60]}")
    n, m = int(words[0]), int(words[1])
    if n > degree:
        return
    c, s = (_number(x, where) for x in words[2:4])
    if m > n:
        raise FieldFileError(f"{where}the order {m} is above the degree {n}")
    if m == 0 and s != 0:
        raise FieldFileError(f"{where}S of order 0 is {float(s):g}; it is zero")
    if (n, m) in found.rows:
        raise FieldFileError(f"{where}degree {n}, order {m} comes twice")
    found.rows[n, m] = (c, s)


def _refuse_shifted(found: FieldFile) -> None:
    whole = found.rows.get((0, 0), (Fraction(1), Fraction(0)))[0]
    if abs(whole - 1) > _ZERO:
        raise FieldFileError(f"has C of degree 0 {float(whole):.10g}; it is 1")
    for m in (0, 1):
        for name, value in zip("CS", found.rows.get((1, m), ()), strict=False):
            if abs(value) > _ZERO:
                what = f"has {name} of degree 1, order {m} {float(value):g}: its origin isn't the centre of "
                what += "mass, from which rotations count; take a field about the centre of mass"
                raise FieldFileError(what)


def _is_number(text: str) -> bool:
    try:
        _number(text)
    except FieldFileError:
        return False
    return True


def _number(text: str, where: str = "") -> Fraction:
    """A decimal, perhaps with an exponent of Fortran's."""
    try:
        return parse_number(Decimal(text.strip().translate(_FORTRAN)), "1").rational
    except (InvalidOperation, ValueError):
        given = f"{text[:40]!r}" if where.startswith("has") else f"given {text[:40]!r}"
        raise FieldFileError(f"{where}{given}; a number is expected") from None


_FORTRAN = str.maketrans("dD", "ee")


def _positive(text: str, what: str) -> Fraction:
    found = _number(text, f"has the {what} ")
    if found <= 0:
        raise FieldFileError(f"has the {what} {text}; a positive number is expected")
    return found
