"""What a dataset's variables are called and how they are labelled (the interface's section 3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

LABELS: dict[str, list[str]] = {
    "body_axis": ["x", "y", "z"],
    "space_axis": ["X", "Y", "Z"],
    "quaternion_component": ["w", "x", "y", "z"],
    "euler_angle": ["phi", "theta", "psi"],
}
"""Coordinates beside time, with their labels."""

SCHEMA_VERSION = 3
"""1: without seals. 2: files end with the SHA-256 of their content; checkpoints. 3: what was put back of held
invariants along time (runs that hold none have the same variables as before)."""


@dataclass(frozen=True)
class Variable:
    """A variable along time.

    Attributes:
        dims: beside time; each is a key of ``LABELS``.
        attributes: units, long_name, frame, ...
        parts: how many float64 numbers hold one value exactly; part 0 has the plain name.
    """

    name: str
    dims: tuple[str, ...]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    parts: int = 1

    @property
    def shape(self) -> tuple[int, ...]:
        """Beside time."""
        return tuple(len(LABELS[dim]) for dim in self.dims)

    def part_names(self) -> list[str]:
        """``name``, ``name_lo``, ``name_lo2``, ..."""
        suffixes = ["", "_lo", *(f"_lo{n}" for n in range(2, self.parts))]
        return [self.name + suffix for suffix in suffixes[: self.parts]]

    def part_attributes(self, part: int) -> dict[str, Any]:
        """Attributes of one part; residuals say what they belong to."""
        if part == 0:
            attributes = dict(self.attributes)
            if self.parts > 1:
                names = " + ".join(reversed(self.part_names()))
                attributes["exact_value"] = f"{names}, summed in this order beyond double precision"
            return attributes
        return {
            "units": self.attributes.get("units", "1"),
            "long_name": f"residual {part} of {self.name}",
            "residual_of": self.name,
        }


def time_variable(parts: int) -> Variable:
    """The coordinate; ``units = "s"`` keeps readers from turning it into dates."""
    return Variable(
        "time",
        (),
        {"units": "s", "long_name": "time since the start of the scene", "axis": "T"},
        parts,
    )


@dataclass(frozen=True)
class Extra:
    """A variable with dimensions of its own, small enough to be held in memory.

    Attributes:
        dims: names; a variable with the name of its only dimension is that dimension's coordinate.
        values: float64.
    """

    name: str
    dims: tuple[str, ...]
    values: np.ndarray
    attributes: Mapping[str, Any] = field(default_factory=dict)
