"""Two-line elements: their two lines, checked column by column, and the date that they hold for.

Columns and checksum as in Hoots & Roehrich 1980 (Spacetrack Report No. 3) and Vallado et al. 2006
(AIAA 2006-6753).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import date
from typing import Any

from rigidsim.scene.epochs import DIGITS, UTC_BEGIN, Epoch

_LENGTH = 69
_NUMBER = r"[ \dA-HJ-NP-Z][ \d]{4}"  # Alpha-5 has a letter for the first digit
_FORMS = (
    re.compile(
        rf"1 ({_NUMBER})[A-Z ] [ \dA-Z]{{8}} \d\d[ \d]{{3}}\.[ \d]{{8}} [ +\-][. ][ \d]{{8}} "
        r"[ +\-][ \d]{5}[ +\-]\d [ +\-][ \d]{5}[ +\-]\d [ \d] [ \d]{4}\d"
    ),
    re.compile(
        rf"2 ({_NUMBER}) [ \d]{{3}}\.[ \d]{{4}} [ \d]{{3}}\.[ \d]{{4}} [ \d]{{7}} [ \d]{{3}}\.[ \d]{{4}} "
        r"[ \d]{3}\.[ \d]{4} [ \d]{2}\.[ \d]{8}[ \d]{5}\d"
    ),
)
_TICKS = 10**DIGITS  # of a second
_CENTURY = 57  # years from 57 on are 19xx: none flew before


@dataclass(frozen=True)
class TwoLineElements:
    """Mean elements for SGP4 of one object, as published.

    Attributes:
        lines: both lines, 69 characters each.
        epoch: the date that they hold for, UTC.
    """

    lines: tuple[str, str]
    epoch: Epoch


def parse_elements(value: Any) -> TwoLineElements:
    """Read ``["1 ...", "2 ..."]``; ``ValueError`` for what isn't the two lines of one object."""
    if not (isinstance(value, list) and len(value) == 2 and all(isinstance(x, str) for x in value)):
        raise ValueError(
            f'given {str(value)[:60]!r}; a list of two texts, ["1 25544U ...", "2 25544 ..."], is allowed: '
            "the two lines as published, without the name"
        )
    lines = tuple(line.rstrip("\r\n ") for line in value)
    for number, (line, form) in enumerate(zip(lines, _FORMS, strict=True), start=1):
        if form.fullmatch(line) is None:
            what = (
                f"line {number} (of {len(line)} characters) isn't in its columns; {_LENGTH} characters that "
            )
            raise _refused(lines, f'{what}begin with "{number} " are allowed: copy them with all blanks')
        if int(line[-1]) != (right := checksum(line)):
            what = f"line {number} ends with the checksum {line[-1]}, but its digits add up to {right}"
            raise _refused(lines, f"{what}; one of its characters is wrong: copy it again")
    one, other = (line[2:7].strip() for line in lines)
    if one != other:
        raise _refused(lines, f"the lines are of two objects, {one} and {other}; give both of the same")
    return TwoLineElements((lines[0], lines[1]), _epoch(lines))


def checksum(line: str) -> int:
    """Last digit of the sum of a line's digits but the last, each minus sign counted as 1."""
    return sum(int(c) if c.isdigit() else c == "-" for c in line[:-1]) % 10


def _epoch(lines: tuple[str, ...]) -> Epoch:
    """Year and day of the year, from 1 on, with eight decimals, of UTC: exact in ticks."""
    short, text = int(lines[0][18:20]), lines[0][20:32].replace(" ", "0")
    year = short + (1900 if short >= _CENTURY else 2000)
    whole, decimals = text.split(".")
    days = (date(year + 1, 1, 1) - date(year, 1, 1)).days
    if not 1 <= int(whole) <= days:
        raise _refused(lines, f"line 1 is for day {text} of {year}; days from 1 to {days} are allowed")
    day = date(year, 1, 1).toordinal() + int(whole) - 1
    if day < UTC_BEGIN:
        what = f"line 1 is for {date.fromordinal(day)}; dates from 1960-01-01 on, when UTC began, are allowed"
        raise _refused(lines, what)
    return Epoch("UTC", day, int(decimals) * 86400 * _TICKS // 10 ** len(decimals))


def _refused(lines: tuple[str, ...], what: str) -> ValueError:
    return ValueError(f'{what}; given "{lines[0][:80]}" and "{lines[1][:80]}"')
