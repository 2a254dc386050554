"""Reading TOML with every digit as written, within bounded time and memory; and values replaced in a config's
tables, and in place in its text (``--set KEY=VALUE``).
"""

import re
import tomllib
from collections.abc import Callable, Sequence
from decimal import Decimal, InvalidOperation
from itertools import pairwise
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene import validation_messages as messages

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
    target, last = _found(table, key, where, new=bool(value_text))
    try:
        value = read(value_text)
    except (ValueError, RecursionError):
        value = value_text
    try:
        if not value_text:
            del target[last]
        elif isinstance(target, list) == isinstance(last, str):
            raise TypeError
        else:
            target[last] = value
    except (TypeError, LookupError):
        purpose = "set" if value_text else "remove"
        raise ConfigError(Problem(where, _nothing(target, last, purpose))) from None


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
