"""Axes of a sweep: their keys and values, their names, and those that the dataset derives from them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from rigidsim.errors import Problem
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.sweeps.written import AxisValues
from rigidsim.scene.toml_text import key_steps
from rigidsim.scene.validation_messages import shown

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,60}")
_OF_LINES = ("_frequency", "_amplitude", "_rate")
"""Suffixes of what is kept of signals' frequencies."""


@dataclass(frozen=True)
class Axis:
    """One swept key.

    Attributes:
        key: dotted key, with indices from 0.
        name: name of its dimension (product) or variable (zip).
        unit: SI unit of its numbers; "1" for none.
    """

    key: str
    name: str
    unit: str
    values: AxisValues

    @property
    def numeric(self) -> bool:
        """Whether its values are numbers or vectors."""
        return self.values.entry is not None

    @property
    def columns(self) -> tuple[str, ...]:
        """The keys of its single numbers: ``initial.angular_velocity[0]`` ..."""
        components = self.values.components
        return tuple(f"{self.key}[{i}]" for i in range(components)) if components else (self.key,)

    def exact(self, index: int) -> tuple[ExactNumber, ...]:
        """The numbers of one value, SI, in the order of ``columns``."""
        assert self.values.entry is not None
        return tuple(number.exact for number in self.values.entry(index))


def axis_name(key: str, given: str | None) -> str:
    """The name given, or the last part of an axis's key: all of it where that is something recorded."""
    name = given
    if name is None:
        parts = [re.sub(r"\[(\d+)\]", r"_\1", re.sub("[\"']", "", part)) for part in key.split(".")]
        name = "_".join(parts) if parts[-1] in OBSERVABLES else parts[-1]
    if not _NAME.fullmatch(name):
        raise ValueError(
            f"given the name {shown(name)}; allowed: letters, digits and underscores, beginning with a letter"
        )
    return name


def clashes(axes: Sequence[Axis], events: Sequence[str], *, product: bool) -> list[Problem]:
    """Names that the dataset would need twice (events give some, too), and keys that contain one another."""
    problems: list[Problem] = []
    names: dict[str, str] = {}
    keys: dict[str, tuple[str | int, ...]] = {}
    for axis in axes:
        where = f'[sweep] axes."{axis.key}"'
        double = next((name for name in _needed(axis, product=product) if name in names), None)
        if double is not None:
            also = f'named "{double}"' if double == axis.name else f'named so that it needs "{double}",'
            what = f'is {also} like axes."{names[double]}"; give one of them another name'
            problems.append(Problem(where, what))
        elif axis.name.startswith(tuple(f"{event}_" for event in events)) or (
            axis.name.endswith(_OF_LINES) and axis.name.startswith(tuple(OBSERVABLES))
        ):
            what = f'is named "{axis.name}", a name that the dataset may need itself; give it another name'
            problems.append(Problem(where, what))
        names |= dict.fromkeys(_needed(axis, product=product), axis.key)
        steps = tuple(key_steps(axis.key, "axes"))
        for other, others in keys.items():
            shorter = min(len(steps), len(others))
            if steps[:shorter] == others[:shorter]:
                what = f'sets what axes."{other}" sets, too; sweep one of them'
                problems.append(Problem(where, what))
        keys[axis.key] = steps
    return problems


def _needed(axis: Axis, *, product: bool) -> list[str]:
    """Names of an axis's dimensions and variables."""
    if not axis.values.components:
        return [axis.name]
    return [axis.name, f"{axis.name}_component", *([f"{axis.name}_value"] if product else [])]
