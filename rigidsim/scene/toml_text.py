"""Reading TOML with every digit as written, within bounded time and memory; and values replaced in a config's
tables, and in place in its text (``--set KEY=VALUE``).
"""

import re
import tomllib
from collections.abc import Callable, Sequence
from decimal import Decimal, InvalidOperation
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.paths import Path, leaves
from rigidsim.scene.validation_messages import LONGEST_INTEGER, shown

# The TOML reader's time and memory grow with the square of a dotted key's length. (Runs of keys, quoted or
# bare, joined by points; the look-behind lets the search pass over each run once.)
_DEEPEST_KEY = 100
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_DEEP_KEY = re.compile(rf"(?<![\w.-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{_DEEPEST_KEY}}}")
_SURROGATE = re.compile("[\ud800-\udfff]")


def decimal(text: str) -> Decimal:
    """A number of a TOML text; ``ValueError`` if it is out of range."""
    try:
        return Decimal(text.replace("_", ""))
    except InvalidOperation:  # an exponent past what Decimal itself holds
        raise ValueError(f"the number {text[:40]} is out of range") from None


_FINE_DATE = re.compile(r"^[^#\"'\n]*=\s*(\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d:\d\d\.\d{7,})", re.MULTILINE)


def _refuse_fine_dates(text: str) -> None:
    """Refuse dates of TOML's own whose seconds have more decimals than its reader keeps."""
    if (found := _FINE_DATE.search(text)) is not None:
        line = text.count("\n", 0, found.start(1)) + 1
        raise ValueError(f"a date with more than 6 decimals of a second (at line {line}); write it in quotes")


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """The tables of a TOML text, decimals kept as written."""
    deep = _DEEP_KEY.search(text)
    if deep is not None:
        line = text.count("\n", 0, deep.start()) + 1
        what = f"can't be read: a key of more than {_DEEPEST_KEY} parts (at line {line})"
        raise ConfigError(Problem("TOML", what), source)
    broken = _SURROGATE.search(text)
    if broken is not None:  # of an argument or a file name that isn't UTF-8
        line = text.count("\n", 0, broken.start()) + 1
        what = f"can't be read: holds bytes that are no UTF-8 text (at line {line}); write it in UTF-8"
        raise ConfigError(Problem("TOML", what), source)
    try:
        _refuse_fine_dates(text)
        return tomllib.loads(text, parse_float=decimal)
    except RecursionError:
        raise ConfigError(Problem("TOML", "can't be read: nested too deeply"), source) from None
    except ValueError as error:
        why = re.sub(r"\(('[^()]*'),?\)", _dotted, str(error))
        raise ConfigError(Problem("TOML", f"can't be read: {why}{_remedy(text, why)}"), source) from None


def long_integers(table: dict[str, Any]) -> list[Problem]:
    """Problems of whole numbers too long to be shown; TOML sets no limit for hexadecimal ones."""
    most = LONGEST_INTEGER
    return [
        Problem(path.where, f"given {shown(value)}; whole numbers of at most {most} bits are allowed")
        for path, value in leaves(table)
        if isinstance(value, int) and value.bit_length() > most
    ]


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
    """A text with values replaced in place, in the digits given, so that its tables are ``meant``."""
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
    key, equals, value_text = (part.strip() for part in assignment.partition("="))
    if not equals or not key or "\n" in assignment:
        raise ConfigError(Problem(where, "write KEY=VALUE on one line, such as time.end=10"))
    if _DEEP_KEY.search(assignment):
        raise ConfigError(Problem(where, f"a key of more than {_DEEPEST_KEY} parts"))
    try:
        value = read(value_text) if value_text else None
    except (ValueError, RecursionError):
        value = value_text
    try:
        Path.of(key).set(table, value)
    except ValueError as error:
        raise ConfigError(Problem(where, str(error))) from None


def _plain_value(text: str) -> Any:
    _refuse_fine_dates(f"= {text}")
    return tomllib.loads(f"value = {text}", parse_float=decimal)["value"]


def _written_value(text: str) -> Any:
    _refuse_fine_dates(f"= {text}")
    value: Any = tomlkit.parse(f"value = {text}\n").item("value")
    value.trivia.comment = value.trivia.comment_ws = ""
    return value


def assignments(text: str, keys: Sequence[str]) -> list[str]:
    """``KEY=VALUE`` in the config's own digits for those of the keys (``table.key``) that it has."""
    document = tomlkit.parse(text)
    found = []
    for key in keys:
        table, _, name = key.partition(".")
        if name in document.get(table, {}):
            found.append(f"{key}={document[table][name].as_string()}")
    return found
