"""Names and labels of a dataset's variables (the interface's section 3)."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rigidsim.scene.parts_of_values import part_name
from rigidsim.scene.parts_of_values import parts_in as parts_in

LABELS: dict[str, list[str]] = {
    "body_axis": ["x", "y", "z"],
    "space_axis": ["X", "Y", "Z"],
    "quaternion_component": ["w", "x", "y", "z"],
    "euler_angle": ["phi", "theta", "psi"],
    "axis": ["figure", "spin", "momentum"],
    "polar_motion_component": ["m1", "m2"],
    "andoyer_momentum": ["L", "G", "H"],
    "andoyer_angle": ["l", "g", "h"],
    "roll_pitch_yaw_component": ["roll", "pitch", "yaw"],
    "tensor_component": ["xx", "yy", "zz", "xy", "xz", "yz"],
    "libration_angle": ["in_plane", "out_of_plane"],
}
"""Coordinates besides time, with their labels."""

OF_THE_RUN = ("point_mass", "rotor", "rigid_body", "source", "parameter")
"""Coordinates whose labels depend on the run: names of ``[[bodies]]``, ``[[rotors]]``,
``[[rigid_bodies]]``, of bodies of a kernel that loads see, and the keys of sensitivities.
"""

SCHEMA_VERSION = 4
"""Of versions 1.x and 2.x. Earlier versions were never released; files of any other version are refused."""


@dataclass(frozen=True)
class Variable:
    """A variable along time.

    Attributes:
        dims: dimensions besides time; each is a key of ``LABELS``, or among ``OF_THE_RUN``.
        parts: number of float64 that hold one value exactly; part 0 has the plain name.
    """

    name: str
    dims: tuple[str, ...]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    parts: int = 1
    own_labels: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def labels(self, dim: str) -> Sequence[str]:
        """Labels of one of its dimensions."""
        return LABELS[dim] if dim in LABELS else self.own_labels[dim]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of a sample, without time."""
        return tuple(len(self.labels(dim)) for dim in self.dims)

    def part_names(self) -> list[str]:
        """The value's own name, then its residuals' names."""
        return [part_name(self.name, part) for part in range(self.parts)]

    def part_attributes(self, part: int) -> dict[str, Any]:
        """Attributes of one part; a residual's say what it belongs to."""
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


def used_labels(variables: Iterable[Variable]) -> dict[str, Sequence[str]]:
    """Dimensions of the variables besides time, in the order of a dataset, with their labels."""
    found = {dim: variable.labels(dim) for variable in variables for dim in variable.dims}
    return {dim: found[dim] for dim in (*LABELS, *OF_THE_RUN) if dim in found}


def time_variable(parts: int) -> Variable:
    """The time coordinate; ``units = "s"`` keeps readers from turning it into dates."""
    return Variable("time", (), {"units": "s", "long_name": "time of the scene"}, parts)


@dataclass(frozen=True)
class Extra:
    """A variable with separate dimensions, small enough for memory; one named like its only dimension is a
    coordinate.
    """

    name: str
    dims: tuple[str, ...]
    values: np.ndarray
    attributes: Mapping[str, Any] = field(default_factory=dict)
