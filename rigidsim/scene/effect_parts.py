"""Parts of what a load does, which a scene can be without (``plan --physics``)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class EffectPart:
    """Part of what a load does, told by ``SceneLoad.effect_parts``.

    Attributes:
        name: short; after the load's own name, its code.
        words: what it is.
        without: keys of the load's table with the values that leave it out; None removes a key.
        wider: names of parts of the same load that contain it.
        missing: why a scene has none of it, if so.
    """

    name: str
    words: str
    without: Mapping[str, Any] = field(default_factory=dict)
    wider: tuple[str, ...] = ()
    missing: str = ""


def degree_parts(degree: int | None, least: int) -> Iterator[EffectPart]:
    """Each degree of the body's field that a source feels, from ``least`` on, with those above it."""
    most, field_ = degree or least - 1, "of the body's field"
    for n in range(most, least - 1, -1):
        words = f"degrees {n} to {most}" if n < most else f"degree {n}"
        wider = tuple(f"degree-{d}" for d in range(least, n))
        yield EffectPart(f"degree-{n}", f"{words} {field_}", {"degree": n - 1}, wider)
    if degree is None:
        yield EffectPart("field", f"degree {least} and more {field_}", missing="no degree is given")
