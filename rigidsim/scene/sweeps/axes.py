"""Axes of a sweep: keys, with unit and length from the schema, values, and names, with those that the dataset
derives from them.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from rigidsim.errors import Problem
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.schema import config_model
from rigidsim.scene.sweeps.written import AxisValues
from rigidsim.scene.toml_text import apply_overrides, key_steps
from rigidsim.scene.validation_messages import nearest, shown

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,60}")
_OF_LINES = ("_frequency", "_amplitude", "_rate")
"""Suffixes of what is kept of signals' frequencies."""


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
        return tuple(number.exact for number in self.values.entry(index))


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


# --- keys ---------------------------------------------------------------------------------------------------


@lru_cache(maxsize=4)
def _json_schema(model: Any) -> dict[str, Any]:
    found: dict[str, Any] = model.model_json_schema()
    return found


def unit_and_length(key: str, tables: Mapping[str, Any]) -> tuple[str, int]:
    """SI unit of the numbers that a key takes ("1" for none), and their count (0 for a plain number), in a
    config of these tables, since a load's keys depend on its kind; ValueError if there is no such key.
    """
    schema = _json_schema(config_model())
    nodes: list[Mapping[str, Any]] = [schema]
    value: Any = tables
    table: Any = None
    for step in key_steps(key, "axes"):
        found: list[Mapping[str, Any]] = []
        for node in _alternatives(nodes, schema, value):
            if isinstance(step, int) and "items" in node:
                found.append(node["items"])
            elif isinstance(step, str) and step in node.get("properties", {}):
                found.append(node["properties"][step])
            elif isinstance(step, str) and isinstance(node.get("additionalProperties"), Mapping):
                found.append(node["additionalProperties"])
        if not found and isinstance(step, str):
            _refuse_unknown(step, nodes, schema, value)
        nodes, table = found, value
        try:
            value = value[step]
        except (TypeError, LookupError):
            value = None
    beside = [table.get(node.get("x-unit-key")) for node in nodes if isinstance(table, Mapping)]
    unit = next((unit for unit in beside if isinstance(unit, str)), None)  # written beside the number
    return unit or _unit(nodes, schema), _length(nodes, schema)


def refuse_unsettable(key: str, tables: dict[str, Any]) -> None:
    """Refuse a key that a config (``tables``) has no place for, or whose value changes nothing."""
    steps = key_steps(key, "axes")
    if steps[0] == "parameters" and len(steps) == 2:
        name, known = str(steps[1]), list(tables.get("parameters", {}))
        word = re.compile(rf"\b{re.escape(name)}\b")
        if name not in known and not any(word.search(text) for text in _texts(tables)):
            there = f"allowed: {', '.join(known)}" if known else "[parameters] has none"
            raise ValueError(f'no expression uses the parameter "{name}"{nearest(name, known)}; {there}')
    apply_overrides(tables, [f"{key}=0"], "axes")


def _texts(value: Any) -> Iterator[str]:
    """All texts in a config that may be expressions."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, list):
        for entry in value:
            yield from _texts(entry)
    elif isinstance(value, Mapping):
        for key, entry in value.items():
            if key not in ("name", "description", "sweep", "parameters"):
                yield from _texts(entry)


def _refuse_unknown(
    key: str, nodes: Sequence[Mapping[str, Any]], schema: Mapping[str, Any], value: Any
) -> None:
    """Raise an error for a key that no table at this place has."""
    allowed = sorted({n for node in _alternatives(nodes, schema, value) for n in node.get("properties", {})})
    if allowed:
        raise ValueError(f'unknown key "{key[:60]}"{nearest(key, allowed)}; allowed: {", ".join(allowed)}')


def _alternatives(
    nodes: Sequence[Mapping[str, Any]], schema: Mapping[str, Any], value: Any
) -> Iterator[Mapping[str, Any]]:
    """Schemas that nodes refer to, without those for another kind of table."""
    for node in nodes:
        if "$ref" in node:
            yield from _alternatives([schema["$defs"][node["$ref"].rpartition("/")[2]]], schema, value)
        elif "discriminator" in node and isinstance(value, Mapping):
            target = node["discriminator"].get("mapping", {}).get(value.get("kind"))
            yield from _alternatives([{"$ref": target}] if target else [], schema, value)
        elif "anyOf" in node or "oneOf" in node:
            yield from _alternatives([*node.get("anyOf", []), *node.get("oneOf", [])], schema, value)
            if "x-unit" in node:
                yield {"x-unit": node["x-unit"]}
        else:
            yield node


def _unit(nodes: Sequence[Mapping[str, Any]], schema: Mapping[str, Any]) -> str:
    for node in [*nodes, *_alternatives(nodes, schema, None)]:
        if node.get("x-unit"):
            return str(node["x-unit"])
        if "items" in node:
            inner = _unit([node["items"]], schema)
            if inner != "1":
                return inner
    return "1"


def _length(nodes: Sequence[Mapping[str, Any]], schema: Mapping[str, Any]) -> int:
    lists = [node for node in _alternatives(nodes, schema, None) if "items" in node]
    return next((int(of["minItems"]) for of in lists if of.get("minItems") == of.get("maxItems", 0)), 0)
