"""Errors of the schema's validator as problems of a config, which name the key and the remedy."""

from collections.abc import Callable, Collection, Mapping
from functools import partial
from itertools import islice
from typing import Any

from pydantic import BaseModel, ValidationError

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.paths import ARRAYS_OF_TABLES, Path
from rigidsim.scene.validation_messages import meant, shown

_WORDS = {
    "too_short": "given an empty array; at least one entry is needed",
    "too_long": "given {actual_length}; at most {max_length} are allowed",
    "kind_of_value": "given {given}; {msg}",
    "list_type": "given {given}; an array is allowed",
    "dict_type": "given {given}; a table of keys and their values is allowed",
    "model_type": "given {given}; a table is allowed",
    "model_attributes_type": "given {given}; a table is allowed",
    "int_type": "given {given}; a whole number, without point or exponent, is allowed",
    "int_from_float": "given {given}; a whole number, without point or exponent, is allowed",
    "string_type": "given {given}; a string is allowed",
    "bool_type": "given {given}; true or false is allowed",
    "greater_than_equal": "given {given}; at least {ge} is allowed",
    "less_than_equal": "given {given}; at most {le:g} is allowed",
}
"""Kinds of errors of pydantic, in the words of ``Problem``."""
_MOST_PROBLEMS = 200  # worth reporting; a file of a million wrong keys has said enough by then


def _what(allowed: Callable[[], list[str]], error: Mapping[str, Any]) -> str:
    kind, context = error["type"], error.get("ctx", {})
    location, given = tuple(error["loc"]), error["input"]
    effect = len(location) == 1 or location[0] in ("loads", "initial")
    if kind == "extra_forbidden":
        key, fields = str(location[-1]), allowed()
        return f"unknown key{meant(key, fields, effect=effect)}; allowed: {', '.join(fields)}"
    if kind in ("missing", "union_tag_not_found"):
        return "missing; it must be given"
    if kind in ("literal_error", "union_tag_invalid"):
        expected = context.get("expected", context.get("expected_tags", ""))
        names = [part.strip() for part in expected.replace("'", "").replace(" or ", ", ").split(",")]
        word = given if isinstance(given, str) else shown(given)
        near = meant(word, names, effect=effect)
        return f"given {shown(given)}{near}; allowed: {', '.join(names)}"
    name = ".".join(map(str, location))
    if kind == "list_type" and isinstance(given, Mapping) and name in ARRAYS_OF_TABLES:
        return f"given a table; an array of them is allowed: write [[{name}]] in double brackets"
    if kind in _WORDS:
        return _WORDS[kind].format(given=shown(given), msg=error["msg"], **context)
    return str(error["msg"])


def _of_the_user(location: tuple[str | int, ...], alternatives: Collection[str]) -> tuple[str | int, ...]:
    """A location without the names of alternatives, each of which follows a key; what stands in one is a key,
    even one of such a name.
    """
    found: list[str | int] = []
    within = False
    for part in location:
        within = bool(found) and part in alternatives and not within
        if not within:
            found.append(part)
    return tuple(found)


def config_error(
    model: type[BaseModel], tables: Mapping[str, Any], error: ValidationError, alternatives: Collection[str]
) -> ConfigError:
    """All problems found in a config's tables, one per key; names of unions' ``alternatives`` aren't part of
    the user's key.
    """
    problems: dict[str, Problem] = {}
    for item in islice(error.errors(include_url=False), _MOST_PROBLEMS):
        # the alternatives of a union each report; their names are no part of the user's key
        path, given = Path(_of_the_user(item["loc"], alternatives)), item["input"]
        if item["type"].startswith("union_tag"):  # kind chooses among tables: kind is the key at fault
            path, given = path / "kind", given.get("kind") if isinstance(given, Mapping) else None
        allowed = partial(path.parent.keys, model, tables)
        what = _what(allowed, {**item, "loc": path.steps, "input": given})
        problems.setdefault(path.where, Problem(path.where, what))
    return ConfigError(list(problems.values()))
