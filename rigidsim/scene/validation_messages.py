"""Messages for the schema validator's errors, which name the key and the remedy."""

import difflib
from collections.abc import Collection, Iterable, Mapping
from decimal import Decimal
from itertools import islice
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError

from rigidsim.errors import ConfigError, Problem

_TABLES = (
    "body", "initial", "loads", "bodies", "rotors", "states", "ephemeris", "frame", "time", "model",
    "integrator", "output", "limits", "parameters", "events", "sweep", "fit", "tables",
)  # fmt: skip
_ARRAYS_OF_TABLES = ("loads", "bodies", "rotors", "states", "events", "fit.data")
_MEANT = {
    "box": "cuboid", "brick": "cuboid", "ball": "sphere", "disc": "disk", "hoop": "ring", "bar": "rod",
    "stick": "rod", "pipe": "tube", "rectangle": "plate", "square": "plate", "donut": "torus",
    "friction": "viscous_torque torque", "thruster": "torque force",
    "cassini": "cassini_1 cassini_2 cassini_3 cassini_4", "filter": "states", "slosh": "states",
    "speed": "rate",
    "planet": "gravity_gradient central_gravity", "sun": "gravity_gradient", "moon": "gravity_gradient",
    "spin": "angular_velocity rate", "omega": "angular_velocity", "w": "angular_velocity",
    "rates": "angular_velocity", "attitude": "quaternion euler_angles", "inertia": "inertia_tensor moment",
    "moments": "principal_moments", "orientation": "quaternion euler_angles", "duration": "end",
    "stop": "end", "dt": "every", "step": "every", "dimensions": "size", "side": "size",
    "float": "single", "float32": "single", "float64": "double", "quad": "quadruple",
}  # fmt: skip
"""Common names of things that have another name here."""
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
_MOST_PROBLEMS = 200  # worth telling; a file of a million wrong keys has said enough by then
_LONGEST_NAME = 60
LONGEST_INTEGER = 10_000  # bits; Python refuses to write out integers not much longer


def shown(value: Any) -> str:
    """A TOML value as the user would write it, shortened, for messages."""
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list):
        inside = ", ".join(shown(x) for x in value[:4])
        return f"[{inside}{', ...' if len(value) > 4 else ''}]"
    if isinstance(value, str):
        return f'"{value}"' if len(value) <= 60 else f'"{value[:57]}..."'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and value.bit_length() > 200:
        if value.bit_length() > LONGEST_INTEGER:
            return f"a whole number of {value.bit_length()} bits"
        value = Decimal(value).normalize()
    text = str(value)
    if isinstance(value, float | Decimal):
        text = text.lower().replace("infinity", "inf")
    elif text.startswith("<"):
        text = f"an object of type {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."


def nearest(given: str, allowed: Iterable[str]) -> str:
    """``; did you mean "x"?`` if something similar is allowed, otherwise empty."""
    if len(given) > _LONGEST_NAME:  # comparing takes time, and nothing allowed is near
        return ""
    names = list(allowed)
    known = [name for name in _MEANT.get(given.lower(), "").split() if name in names]
    close = known or difflib.get_close_matches(given, names, n=1, cutoff=0.6)
    quoted = " or ".join(f'"{name}"' for name in close)
    return f"; did you mean {quoted}?" if close else ""


def meant(given: str, allowed: Iterable[str], *, effect: bool = False) -> str:
    """What a name that isn't allowed may mean: a similar one, or something that isn't modelled; of an
    ``effect`` on the body or a frame of its start also what has another name here.
    """
    from rigidsim.scene.scope import other_name, scope_answer  # of no use until something is refused

    return (effect and other_name(given)) or f"{nearest(given, allowed)}{scope_answer(given)}"


def key_path(location: Iterable[str | int]) -> str:
    """A key's path as written in TOML: ``[body] principal_moments[1]``."""
    parts = list(location)
    if not parts:
        return "config"
    names = [".".join(map(str, parts[:count])) for count in (1, 2)]
    if array := [name for name in names if name in _ARRAYS_OF_TABLES]:
        head, rest = f"[[{array[0]}]]", parts[names.index(array[0]) + 1 :]
        if rest and isinstance(rest[0], int):
            head, rest = f"{head} number {rest[0] + 1}", rest[1:]
    elif parts[0] in _TABLES:
        head, rest = f"[{parts[0]}]", parts[1:]
    else:
        head, rest = "", parts
    path = "".join(f"[{p}]" if isinstance(p, int) else f".{_key(p)}" for p in rest).removeprefix(".")
    return f"{head} {path}".strip()


def _key(key: str) -> str:
    """A key as it is, or quoted if it contains points, and shortened if it is empty, long or invisible."""
    plain = 0 < len(key) <= 60 and key.isprintable() and key.strip() and "." not in key
    return key if plain else shown(key)


def _model_at(
    model: type[BaseModel], location: tuple[str | int, ...], alternatives: Collection[str]
) -> type[BaseModel] | None:
    """The table that holds the last key of ``location``; alternatives are told apart by their ``kind``."""
    candidates, named = [model], False
    for key in location[:-1]:
        if isinstance(key, int):
            continue
        if key in alternatives:
            candidates = [m for m in candidates if key in _kinds(m)] or candidates
            continue
        if named:  # a key that the user chose: of an axis, say
            named = False
            continue
        fields = [m.model_fields[key] for m in candidates if key in m.model_fields]
        candidates = [m for field in fields for m in _models(field.annotation)]
        named = any(get_origin(field.annotation) is dict for field in fields)
    return candidates[0] if candidates else None


def _kinds(model: type[BaseModel]) -> tuple[Any, ...]:
    field = model.model_fields.get("kind")
    return get_args(field.annotation) if field else ()


def _models(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for argument in get_args(annotation) for model in _models(argument)]


def _what(table: type[BaseModel] | None, error: Mapping[str, Any]) -> str:
    kind, context = error["type"], error.get("ctx", {})
    location, given = tuple(error["loc"]), error["input"]
    effect = len(location) == 1 or location[0] in ("loads", "initial")
    if kind == "extra_forbidden":
        fields = sorted(table.model_fields) if table else []
        key = str(location[-1])
        return f"unknown key{meant(key, fields, effect=effect)}; allowed: {', '.join(fields)}"
    if kind in ("missing", "union_tag_not_found"):
        return "missing; it must be given"
    if kind in ("literal_error", "union_tag_invalid"):
        allowed = context.get("expected", context.get("expected_tags", ""))
        allowed = allowed.replace("'", "").replace(" or ", ", ")
        names = [part.strip() for part in allowed.split(",")]
        word = given if isinstance(given, str) else shown(given)
        near = meant(word, names, effect=effect)
        return f"given {shown(given)}{near}; allowed: {', '.join(names)}"
    name = ".".join(map(str, location))
    if kind == "list_type" and isinstance(given, Mapping) and name in _ARRAYS_OF_TABLES:
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
    model: type[BaseModel], error: ValidationError, alternatives: Collection[str]
) -> ConfigError:
    """All problems found, one per key; names of unions' ``alternatives`` aren't part of the user's key."""
    problems: dict[str, Problem] = {}
    for item in islice(error.errors(include_url=False), _MOST_PROBLEMS):
        # the alternatives of a union each report; their names are no part of the user's key
        location = _of_the_user(item["loc"], alternatives)
        given = item["input"]
        if item["type"].startswith("union_tag"):  # a table told apart by its kind: the key at fault is kind
            location = (*location, "kind")
            given = given.get("kind") if isinstance(given, Mapping) else None
        where = key_path(location)
        table = _model_at(model, tuple(item["loc"]), alternatives)
        problem = Problem(where, _what(table, {**item, "loc": location, "input": given}))
        problems.setdefault(where, problem)
    return ConfigError(list(problems.values()))
