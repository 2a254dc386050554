"""Sample times from a table of text: its column of time, with the digits that are written there."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fractions import Fraction
from typing import Any

from rigidsim.scene.epochs import A_DATE, Epoch, parse_epoch
from rigidsim.scene.exact import parse_number
from rigidsim.scene.validation_messages import shown

_SEPARATORS = re.compile(r"\s*[,;\t]\s*|\s+")
_HEAD = re.compile(
    r"(?:t|time|times|seconds|timestamp)(?:_([A-Za-z]+)|\s*[\[(]\s*([A-Za-z]+)\s*[\])])?", re.I
)
_UNIT = re.compile(r"\s+(?=[\[(])")  # between a name and its unit


def time_column(lines: Iterable[str]) -> str:
    """The column of time alone, as a table of its own; ``ValueError`` says what is wrong.

    Args:
        lines: of a table with a line of names, one of which is t or time, with a unit (s if there is none) as
            in ``t [day]`` or ``time_day``; or of numbers alone, the first column of which is taken.
    """
    place, unit, cells = None, "s", list[str]()
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        row = _SEPARATORS.split(_UNIT.sub("", line.strip().strip('"')))
        if place is None:
            place, unit, named = _place(row)
            if named:
                continue
        if place >= len(row):
            raise ValueError(f"has no time in line {number}")
        cells.append(row[place])
    if place is None:
        raise ValueError("is empty; a line of names, such as t [s], and a time in each row are needed")
    return "\n".join([f"time [{unit}]", *cells])


def _place(row: list[str]) -> tuple[int, str, bool]:
    """Number of the column of time, its unit, and whether the row names columns."""
    for n, name in enumerate(row):
        if (found := _HEAD.fullmatch(name.strip().strip('"'))) is not None:
            return n, found[1] or found[2] or "s", True
    if _is_number(row[0]):
        return 0, "s", False
    raise ValueError(f"names no column t or time in its first line, which is {shown(' '.join(row)[:60])}")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def times_in(text: str, context: Any, epoch: Epoch | None) -> list[Fraction]:
    """Times (s) of such a table of a single column, exactly as written; dates count from the epoch."""
    head, *cells = time_column(text.splitlines()).splitlines()
    unit = head[len("time [") : -1]
    if not any(map(A_DATE.match, cells)):
        return [parse_number(f"{cell} {unit}", "s").fraction(context) for cell in cells]
    if epoch is None:
        raise ValueError("holds dates; give the date of time 0 as [time] epoch")
    return [parse_epoch(cell).since(epoch) for cell in cells]
