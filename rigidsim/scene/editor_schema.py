"""The config's JSON schema in the form that editors use: ``rigidsim schema``, and the reference of keys.

pydantic's own schema describes a Python object: keys that are left out are null there, defaults are exact
numbers, and every key has a title. A TOML file has no null, and an editor shows descriptions, so the schema
is rewritten in TOML's terms; it stays within draft 7, which every editor's checker knows.
"""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from rigidsim.scene.bodies.presets import PRESETS
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.schema import Config, config_model

DRAFT = "http://json-schema.org/draft-07/schema#"
_LIMITS = {"x-above": "exclusiveMinimum", "x-below": "exclusiveMaximum", "x-at-most": "maximum"}


def editor_schema(model: type[Config] | None = None) -> dict[str, Any]:
    """The JSON schema of a config, for editors and other tools.

    Args:
        model: by default ``config_model()``, with every registered kind of load.

    Returns:
        A schema of draft 7. Each key has a ``description`` that ends with its unit in square brackets, which
        stands alone as ``x-unit`` too ("" for a number in any unit), and where there are such, ``default``
        and ``examples`` as a user would write them.
    """
    made = (model or config_model()).model_json_schema()
    # a config's own states can be recorded, too, and a schema can't know their names
    items = made["$defs"]["Output"]["properties"]["record"]["anyOf"][0]["items"]
    strictly = {"properties": {"record": {"items": items["anyOf"][0]}}}
    without = {"if": {"not": {"required": ["states"]}}, "then": {"properties": {"output": strictly}}}
    for name in _brought(made):  # a preset may have the rest of their keys
        made["$defs"][name].pop("required", None)
    return {"$schema": DRAFT, **_table(made), **without, "title": "rigidsim config"}


def _brought(made: Mapping[str, Any]) -> set[str]:
    """Names of the tables of ``[body]`` that presets bring."""
    keys = made["$defs"]["Body"]["properties"]
    kinds = [kind for preset in PRESETS.values() for name in preset.tables for kind in keys[name]["anyOf"]]
    return {kind["$ref"].rsplit("/", 1)[1] for kind in kinds if "$ref" in kind}


def _table(node: Mapping[str, Any]) -> dict[str, Any]:
    """A table of keys, or the whole schema with its definitions."""
    table = {key: value for key, value in node.items() if key not in ("title", "$defs")}
    if "description" in table:
        table["description"] = " ".join(table["description"].replace("``", "").split())
    if "properties" in node:
        table["properties"] = {key: _key(value) for key, value in node["properties"].items()}
        kind = table["properties"].get("kind", {})
        if "const" in kind:
            kind["description"] = table["description"]
    if "$defs" in node:
        table["$defs"] = {name: _table(value) for name, value in node["$defs"].items()}
    return table


def _key(node: Mapping[str, Any]) -> dict[str, Any]:
    """One key of a table."""
    key = _without_null({name: value for name, value in node.items() if name != "title"})
    if "description" in key:
        key["description"] = " ".join(key["description"].split())
    units = _units(key)
    if len(units) == 1:
        (unit,) = units
        key["x-unit"] = unit
        if unit != "1":
            shown = f"[{unit}]" if unit else "[SI, or any unit]"
            key["description"] = f"{key.get('description', '')} {shown}".strip()
    _bounded(key)
    if "default" in key:
        key["default"] = as_written(key["default"])
    if "$ref" in key and len(key) > 1:  # draft 7 ignores anything beside a reference
        key["allOf"] = [{"$ref": key.pop("$ref")}]
    return key


def _without_null(key: dict[str, Any]) -> dict[str, Any]:
    """The key without null: a key that may be left out needn't be null."""
    if key.get("default", ...) is None:
        del key["default"]
    kinds = key.get("anyOf")
    if kinds is None:
        return key
    kept = [kind for kind in kinds if kind != {"type": "null"}]
    rest = {name: value for name, value in key.items() if name != "anyOf"}
    return {**rest, "anyOf": kept} if len(kept) > 1 else {**kept[0], **rest}


def _units(node: Any) -> set[str]:
    """Units of all numbers of a key, except those in tables of their own."""
    if isinstance(node, Mapping):
        own = {node["x-unit"]} if "x-unit" in node else set()
        inner = (value for name, value in node.items() if name not in ("default", "examples"))
        return own.union(*map(_units, inner))
    return set().union(*map(_units, node)) if isinstance(node, list) else set()


def _bounded(key: dict[str, Any]) -> None:
    """Restrict limits to numbers; numbers written as strings are checked by rigidsim."""
    limits = {_LIMITS[name]: key.pop(name) for name in list(key) if name in _LIMITS}
    if limits:
        for kind in _kinds(key):
            if kind.get("type") == "number":
                kind.update(limits)


def _kinds(node: dict[str, Any]) -> list[dict[str, Any]]:
    """The alternatives of a key, nested ones included."""
    inner = [found for kind in node.get("anyOf", []) for found in _kinds(kind)]
    return inner or [node]


def as_written(value: Any) -> Any:
    """A default as a user would write it; pydantic would take an exact number apart."""
    if isinstance(value, list):
        return [as_written(item) for item in value]
    if not (isinstance(value, Mapping) and "rational" in value):
        return value
    number = ExactNumber(Fraction(value["rational"]), value["pi_power"])
    return int(number.rational) if number.rational.denominator == 1 and not number.pi_power else float(number)
