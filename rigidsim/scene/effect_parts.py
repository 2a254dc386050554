"""Parts of what a load does, which a scene can be without (``plan --physics``)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class EffectPart:
    """Part of what a load does, from ``SceneLoad.effect_parts``.

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


def degree_parts(
    degrees: Sequence[int],
    words: str,
    without: Callable[[int], Mapping[str, Any]],
    prefix: str = "degree",
    wider: tuple[str, ...] = (),
) -> Iterator[EffectPart]:
    """Each degree of a field together with those above it.

    Args:
        degrees: rising.
        without: keys that leave out a degree and those above it.
    """
    for place, n in reversed(list(enumerate(degrees))):
        which = f"degrees {n} to {degrees[-1]}" if n < degrees[-1] else f"degree {n}"
        contain = *wider, *(f"{prefix}-{d}" for d in degrees[:place])
        yield EffectPart(f"{prefix}-{n}", f"{which} {words}", without(n), contain)
