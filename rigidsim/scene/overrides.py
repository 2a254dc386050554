"""``--set KEY=VALUE``: values replaced in a config's tables, and in place in its text."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.toml_text import DEEP_KEY, DEEPEST_KEY, decimal, parse_toml

_MOST_OVERRIDES = 1000
FLAG = "--set"
"""Name of overrides from the command line."""


def apply_overrides(table: dict[str, Any], overrides: Sequence[str], what: str = FLAG) -> None:
    """Replace values of a config's tables, in order.

    Each override is a dotted key with optional [index], an equals sign and a TOML value (anything else, such
    as a bare word or a number with its unit, is a string); nothing after the equals sign removes the key.
    Messages call them ``what``.
    """
    if len(overrides) > _MOST_OVERRIDES:
        many = f"given {len(overrides)} values to set; at most {_MOST_OVERRIDES} are allowed"
        raise ConfigError(Problem(what, many))
    for assignment in overrides:
        _apply(table, assignment, f"{what} {assignment[:60]}", _plain_value)


def written(text: str, overrides: Sequence[str], meant: dict[str, Any], source: str, what: str = FLAG) -> str:
    """A config's text with values replaced in place, in the digits given, so that it has the tables
    ``meant``; comments and order stay.
    """
    try:
        document = tomlkit.parse(text)
        for assignment in overrides:
            _apply(document, assignment, what, _written_value)
        result = document.as_string()
        if parse_toml(result, source) == meant:
            return result
    except (TOMLKitError, ConfigError, ValueError, TypeError, RecursionError):
        pass  # a text that the other reader takes and this one doesn't: none is known
    why = "can't be written into this text; edit the file instead"
    raise ConfigError(Problem(f"{what} {overrides[-1][:60]}", why), source)


def _apply(table: dict[str, Any], assignment: str, where: str, read: Callable[[str], Any]) -> None:
    key, value_text = _parts(assignment, where)
    if not value_text:
        _remove(table, key, where)
        return
    try:
        value = read(value_text)
    except (ValueError, RecursionError):
        value = value_text
    _assign(table, key, value, where)


def _plain_value(text: str) -> Any:
    return tomllib.loads(f"value = {text}", parse_float=decimal)["value"]


def _written_value(text: str) -> Any:
    value: Any = tomlkit.parse(f"value = {text}\n").item("value")
    value.trivia.comment = value.trivia.comment_ws = ""
    return value


def assignments(text: str, keys: Sequence[str]) -> list[str]:
    """``KEY=VALUE`` texts, in the config's own digits, for those of the given keys (``table.key``) that it
    has.
    """
    document = tomlkit.parse(text)
    found = []
    for key in keys:
        table, _, name = key.partition(".")
        if name in document.get(table, {}):
            found.append(f"{key}={document[table][name].as_string()}")
    return found


def _parts(assignment: str, where: str) -> tuple[str, str]:
    key, equals, value_text = assignment.partition("=")
    if not equals or not key.strip() or "\n" in assignment:
        raise ConfigError(Problem(where, "write KEY=VALUE on one line, such as time.end=10"))
    if DEEP_KEY.search(assignment):
        raise ConfigError(Problem(where, f"a key of more than {DEEPEST_KEY} parts"))
    return key.strip(), value_text.strip()


_KEY_PART = re.compile(r"""\s*(?:"([^"\n]+)"|'([^'\n]+)'|([^\[\].\"']+))((?:\[\d{1,9}\])*)\s*(\.|$)""")


def key_steps(key: str, where: str) -> list[str | int]:
    """The parts of a dotted key and its indices, counted from 0; a part that contains dots is quoted."""
    steps: list[str | int] = []
    begin = 0
    while True:
        match = _KEY_PART.match(key, begin)
        if match is None:
            part = key[begin:].split(".")[0]
            what = f'"{part}" is not a key, or a key with an index counted from 0, such as times[0]'
            raise ConfigError(Problem(where, what))
        steps.append(match[1] or match[2] or match[3].strip())
        steps.extend(int(index) for index in re.findall(r"\d+", match[4]))
        if not match[5]:
            return steps
        begin = match.end()


def _assign(table: dict[str, Any], key: str, value: Any, where: str) -> None:
    target, last = _found(table, key, where, new=True)
    try:
        if isinstance(target, list) == isinstance(last, str):
            raise TypeError
        target[last] = value
    except (TypeError, IndexError):
        raise ConfigError(Problem(where, _nothing(target, last))) from None


def _remove(table: dict[str, Any], key: str, where: str) -> None:
    target, last = _found(table, key, where, new=False)
    try:
        del target[last]
    except (TypeError, LookupError):
        raise ConfigError(Problem(where, _nothing(target, last, "remove"))) from None


def _found(table: dict[str, Any], key: str, where: str, *, new: bool) -> tuple[Any, str | int]:
    """The table or array that a key's last part is in, and that part."""
    steps = key_steps(key, where)
    target: Any = table
    for step, following in pairwise(steps):
        if isinstance(target, dict) and isinstance(step, str) and (new or step in target):
            if step not in target:
                target[step] = [] if isinstance(following, int) else {}
            target = target[step]
        elif isinstance(target, list) and isinstance(step, int) and 0 <= step < len(target):
            target = target[step]
        else:
            raise ConfigError(Problem(where, _nothing(target, step)))
    return target, steps[-1]


def _nothing(target: Any, step: str | int, purpose: str = "set") -> str:
    """What to say of a place that doesn't exist."""
    there = ""
    if isinstance(target, list) and isinstance(step, int):
        entries = f"entries 0 to {len(target) - 1}" if target else "no entries"
        there = f"; the array there has {entries}"
    return f'there is nothing at "{step}" to {purpose}{there}'
