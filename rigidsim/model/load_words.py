"""Numbers in messages: with a unit, spans of time, lengths."""

from __future__ import annotations

from typing import Any

from rigidsim.scene.readable import number_text, span_text

_DIGITS = 4
_KILOMETRES = 1e4  # m, from where on km read better
ASTRONOMICAL_UNIT = 149597870700.0  # m
_FAR = 1e10  # m, from where on au do


def value_text(value: Any, unit: str, digits: int = _DIGITS) -> str:
    """A number with its unit."""
    return f"{number_text(float(value), digits)} {unit}"


def span_words(seconds: Any) -> str:
    """A time span in the unit that suits it."""
    return span_text(float(seconds), _DIGITS)


def length_text(length: float) -> str:
    """A length in m, km or au."""
    size, unit = next(
        (size, unit)
        for least, size, unit in ((_FAR, ASTRONOMICAL_UNIT, "au"), (_KILOMETRES, 1e3, "km"), (0.0, 1.0, "m"))
        if length >= least
    )
    return f"{number_text(length / size, _DIGITS)} {unit}"
