"""Reading TOML with every digit as written, within bounded time and memory."""

from __future__ import annotations

import re
import tomllib
from decimal import Decimal, InvalidOperation
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene import validation_messages as messages

# The TOML reader's time and memory grow with the square of a dotted key's length. (Runs of keys, quoted or
# bare, joined by points; the look-behind lets the search pass over each run once.)
DEEPEST_KEY = 100
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
DEEP_KEY = re.compile(rf"(?<![\w.-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{DEEPEST_KEY}}}")


def decimal(text: str) -> Decimal:
    """A number of a TOML text; ``ValueError`` if it is out of range."""
    try:
        return Decimal(text.replace("_", ""))
    except InvalidOperation:  # an exponent past what Decimal itself holds
        raise ValueError(f"the number {text[:40]} is out of range") from None


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """The tables of a TOML text, decimals kept as written."""
    deep = DEEP_KEY.search(text)
    if deep is not None:
        line = text.count("\n", 0, deep.start()) + 1
        what = f"can't be read: a key of more than {DEEPEST_KEY} parts (at line {line})"
        raise ConfigError(Problem("TOML", what), source)
    try:
        return tomllib.loads(text, parse_float=decimal)
    except RecursionError:
        raise ConfigError(Problem("TOML", "can't be read: nested too deeply"), source) from None
    except ValueError as error:
        why = re.sub(r"\(('[^()]*'),?\)", _dotted, str(error))
        raise ConfigError(Problem("TOML", f"can't be read: {why}{_remedy(text, why)}"), source) from None


def long_integers(table: dict[str, Any]) -> list[Problem]:
    """Problems of whole numbers too long to be shown; TOML sets no limit for hexadecimal ones."""
    problems = []
    waiting: list[tuple[tuple[str | int, ...], Any]] = [((), table)]
    while waiting:
        path, node = waiting.pop()
        if isinstance(node, dict):
            waiting += [((*path, key), child) for key, child in node.items()]
        elif isinstance(node, list):
            waiting += [((*path, index), child) for index, child in enumerate(node)]
        elif isinstance(node, int) and node.bit_length() > messages.LONGEST_INTEGER:
            most = messages.LONGEST_INTEGER
            what = f"given {messages.shown(node)}; whole numbers of at most {most} bits are allowed"
            problems.append(Problem(messages.key_path(path), what))
    return problems


_PLACE = re.compile(r"\(at line (\d+), column (\d+)\)")
_ASSIGNMENT = re.compile(r"\s*[\w.\"'-]+\s*=\s*(?P<value>[^\s#\"'\[{][^#\"'\[{]*?)\s*(?:#.*)?")
_LONGEST_SHOWN = 60


def _remedy(text: str, why: str) -> str:
    """The line at fault, and a remedy if a text or a unit lacks its quotes."""
    place = _PLACE.search(why)
    lines = text.split("\n")
    if place is None or not 0 < int(place[1]) <= len(lines):
        return ""
    line = lines[int(place[1]) - 1].strip()
    match = _ASSIGNMENT.fullmatch(line) if len(line) <= _LONGEST_SHOWN else None
    if match is None:
        return f": {line}" if 0 < len(line) <= _LONGEST_SHOWN else ""
    return f'; texts, and numbers with units, stand in quotes: "{match["value"]}"'


def _dotted(key: re.Match[str]) -> str:
    """A dotted key as the user wrote it; tomllib shows it as a Python tuple."""
    return '"' + key[1].strip("'").replace("', '", ".") + '"'
