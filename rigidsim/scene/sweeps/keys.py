"""Unit and length of a swept key, from the schema."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

from rigidsim.scene.schema import config_model
from rigidsim.scene.toml_text import apply_overrides, key_steps
from rigidsim.scene.validation_messages import nearest


@lru_cache(maxsize=4)
def _json_schema(model: Any) -> dict[str, Any]:
    found: dict[str, Any] = model.model_json_schema()
    return found


def unit_and_length(key: str, tables: Mapping[str, Any]) -> tuple[str, int]:
    """SI unit of the numbers that a key takes ("1" for none), and their count (0 for a plain number).

    Args:
        tables: tables of the config, since a load's keys depend on its kind.

    Raises:
        ValueError: no such key.
    """
    schema = _json_schema(config_model())
    nodes: list[Mapping[str, Any]] = [schema]
    value: Any = tables
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
        nodes = found
        value = _inside(value, step)
    return _unit(nodes, schema), _length(nodes, schema)


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


def _inside(value: Any, step: str | int) -> Any:
    if isinstance(value, Mapping) and isinstance(step, str):
        return value.get(step)
    if isinstance(value, list) and isinstance(step, int) and step < len(value):
        return value[step]
    return None


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
