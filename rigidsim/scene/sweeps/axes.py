"""Axes of a sweep: keys, values, and names, with those that the dataset derives from them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rigidsim.errors import Problem
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.paths import Path, leaves
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.sweeps.values import AxisValues
from rigidsim.scene.validation_messages import nearest, shown

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,60}")
_OF_LINES = ("_frequency", "_amplitude", "_rate")
"""Suffixes of what is kept of signals' frequencies."""
_NO_EXPRESSIONS = {"name", "description", "sweep", "parameters"}


@dataclass(frozen=True)
class Axis:
    """One swept key."""

    key: str  # dotted, with indices from 0
    name: str  # of its dimension (product) or variable (zip)
    unit: str  # SI unit of its numbers; "1" for none
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
        return self.values.entry(index)


def axis_name(key: str, given: str | None) -> str:
    """The name given, or the last part of an axis's key: all of it where that is something recorded."""
    name = given
    if name is None:
        parts = [re.sub(r"\[(\d+)\]", r"_\1", re.sub("[\"']", "", part)) for part in key.split(".")]
        parts = [part.replace(",", "_") for part in parts]
        whole = parts[-1] in OBSERVABLES
        name = "_".join(parts if whole else parts[-2:] if parts[-1][:1].isdigit() else parts[-1:])
    if not _NAME.fullmatch(name):
        raise ValueError(
            f"given the name {shown(name)}; allowed: letters, digits and underscores, beginning with a letter"
        )
    return name


def clashes(axes: Sequence[Axis], events: Sequence[str], *, product: bool) -> list[Problem]:
    """Names that the dataset would need twice (events give some, too), and keys that contain one another."""
    problems: list[Problem] = []
    names: dict[str, str] = {}
    keys: dict[str, Path] = {}
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
        path = Path.of(axis.key)
        for other, place in keys.items():
            if all(one == another for one, another in zip(path.steps, place.steps, strict=False)):
                what = f'sets what axes."{other}" sets, too; sweep one of them'
                problems.append(Problem(where, what))
        keys[axis.key] = path
    return problems


def _needed(axis: Axis, *, product: bool) -> list[str]:
    """Names of an axis's dimensions and variables."""
    if not axis.values.components:
        return [axis.name]
    return [axis.name, f"{axis.name}_component", *([f"{axis.name}_value"] if product else [])]


# --- keys ---------------------------------------------------------------------------------------------------


def refuse_unsettable(path: Path, tables: dict[str, Any]) -> None:
    """Refuse a key that a config (``tables``) has no place for, or whose value changes nothing."""
    if path.steps[0] == "parameters" and len(path.steps) == 2:
        name, known = str(path.steps[1]), list(tables.get("parameters", {}))
        word = re.compile(rf"\b{re.escape(name)}\b")
        texts = (
            value
            for place, value in leaves(tables)
            if isinstance(value, str) and not _NO_EXPRESSIONS & {*place.steps}
        )
        if name not in known and not any(word.search(text) for text in texts):
            there = f"allowed: {', '.join(known)}" if known else "[parameters] has none"
            raise ValueError(f'no expression uses the parameter "{name}"{nearest(name, known)}; {there}')
    path.set(tables, 0)
