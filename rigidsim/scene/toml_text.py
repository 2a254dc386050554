"""TOML with every digit as written: read within bounded time and memory, with values replaced in a config's
tables and in place in its text (``--set KEY=VALUE``), and written of Python values, for configs in code.
"""

import copy
import numbers
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from datetime import date, time
from decimal import Decimal, InvalidOperation
from fractions import Fraction
from functools import lru_cache
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.scene.exact import fraction_of
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
    return copy.deepcopy(_parsed(text, source))


@lru_cache(4)
def _parsed(text: str, source: str) -> dict[str, Any]:
    """The tables, read once for all members of a sweep: a table of an orbit may have megabytes."""
    hindrances = (
        (_DEEP_KEY, f"a key of more than {_DEEPEST_KEY} parts (at line {{}})"),
        # of an argument or a file name that isn't UTF-8
        (_SURROGATE, "holds bytes that are no UTF-8 text (at line {}); write it in UTF-8"),
    )
    for pattern, what in hindrances:
        if found := pattern.search(text):
            line = text.count("\n", 0, found.start()) + 1
            raise ConfigError(Problem("TOML", f"can't be read: {what.format(line)}"), source)
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
    return f'; texts, and numbers with units, need quotes: "{match["value"]}"'


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
    many = f"given {len(overrides)} values to set; at most {_MOST_OVERRIDES} are allowed"
    ensure(len(overrides) <= _MOST_OVERRIDES, ConfigError(Problem(what, many)))
    _apply(table, overrides, what, _plain_value)


def written(text: str, overrides: Sequence[str], meant: dict[str, Any], source: str, what: str = FLAG) -> str:
    """A text with values replaced in place, in the digits given, so that its tables are ``meant``."""
    try:
        document = tomlkit.parse(text)
        _apply(document, overrides, what, _written_value)
        result = document.as_string()
        if parse_toml(result, source) == meant:
            return result
    except (TOMLKitError, ConfigError, ValueError, TypeError, RecursionError):
        pass  # a text that the other reader takes and this one doesn't: none is known
    why = "can't be written into this text; edit the file instead"
    raise ConfigError(Problem(f"{what} {overrides[-1][:60]}", why), source)


def _apply(table: dict[str, Any], overrides: Sequence[str], what: str, read: Callable[[str], Any]) -> None:
    for assignment in overrides:
        where = f"{what} {assignment[:60]}"
        key, equals, text = (part.strip() for part in assignment.partition("="))
        fault = Problem(where, "write KEY=VALUE on one line, such as time.end=10")
        ensure(equals and key and "\n" not in assignment, ConfigError(fault))
        deep = Problem(where, f"a key of more than {_DEEPEST_KEY} parts")
        ensure(not _DEEP_KEY.search(assignment), ConfigError(deep))
        try:
            value = read(text) if text else None
        except (ValueError, RecursionError):
            value = text
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
    """``KEY=VALUE`` in the config's own digits for the keys (``table.key``) that it has."""
    document = tomlkit.parse(text)
    found = []
    for key in keys:
        table, _, name = key.partition(".")
        if name in document.get(table, {}):
            found.append(f"{key}={document[table][name].as_string()}")
    return found


# --- Python values ------------------------------------------------------------------------------------------

_DEEPEST = 50
_ALLOWED = (
    "numbers (int, float, Decimal, Fraction, mpf, numpy's), strings, booleans, dates, lists, "
    "arrays and dictionaries are allowed"
)


def toml_text(tables: Mapping[str, Any]) -> str:
    """The TOML text of a config given as nested dictionaries; None counts as not given.

    Floats, numpy's too, count as the shortest decimal that denotes them, which is how they print: ``0.1`` is
    one tenth. Decimals, fractions and mpmath's numbers count exactly.
    """
    document = tomlkit.document()
    for key, value in tables.items():
        plain = _plain(value)
        if isinstance(plain, Mapping):
            document[_key(key)] = _table(plain, key)
        elif isinstance(plain, list) and plain and all(isinstance(entry, Mapping) for entry in plain):
            document[_key(key)] = tomlkit.aot()
            for number, entry in enumerate(plain):
                document[key].append(_table(entry, f"{key}[{number}]"))
        elif value is not None:
            document[_key(key)] = tomlkit.value(inline(value, str(key)))
    return document.as_string()


def _table(tables: Mapping[str, Any], where: str) -> Any:
    table = tomlkit.table()
    for key, value in tables.items():
        if value is not None:
            table[_key(key)] = tomlkit.value(inline(value, f"{where}.{key}"))
    return table


def assignments_of(changes: Mapping[str, Any]) -> list[str]:
    """Values to replace as ``KEY=VALUE``; a dictionary changes its keys of a table, None removes a key."""
    found = []
    for key, value in changes.items():
        if isinstance(value, Mapping):
            mark = '"' if key == "sweep.axes" else ""  # whose keys are dotted themselves
            found += assignments_of(
                {f"{key}.{mark}{_key(inner)}{mark}": given for inner, given in value.items()}
            )
        else:
            found.append(f"{_key(key)}={'' if value is None else inline(value, str(key))}")
    return found


def inline(value: Any, where: str = "value", depth: int = 0) -> str:
    """A TOML value on one line."""
    plain = _plain(value)
    ensure(depth <= _DEEPEST, ConfigError(Problem(where, "nested too deeply")))
    if isinstance(plain, str):
        return tomlkit.string(plain).as_string()
    if isinstance(plain, bool | int):
        return str(plain).lower()
    if isinstance(plain, Decimal):
        fault = Problem(where, f"given {plain}; finite numbers are allowed")
        ensure(plain.is_finite(), ConfigError(fault))
        text = str(plain).lower().replace("e+", "e")
        return text if "." in text or "e" in text else f"{text}.0"
    if isinstance(plain, Mapping):
        named = (
            (tomlkit.string(_key(k)).as_string(), inline(v, f"{where}.{k}", depth + 1))
            for k, v in plain.items()
        )
        return "{" + ", ".join(f"{key} = {text}" for key, text in named) + "}"
    if isinstance(plain, list):
        entries = (inline(entry, f"{where}[{n}]", depth + 1) for n, entry in enumerate(plain))
        return "[" + ", ".join(entries) + "]"
    raise ConfigError(Problem(where, f"given {shown(value)}; {_ALLOWED}"))


def _plain(value: Any) -> Any:
    """A value of Python's own, or of a related type, as bool, int, Decimal, str, list or mapping."""
    if isinstance(value, bool | str | int | Decimal | Mapping):
        return value
    if isinstance(value, date | time):
        return value.isoformat()
    kind = value.dtype.kind if hasattr(value, "dtype") else ""
    if kind and value.shape:  # an array; its elements keep their kind
        return list(value)
    if kind == "b":
        return bool(value)
    if isinstance(value, Fraction):
        return f"{value.numerator}/{value.denominator}" if value.denominator != 1 else value.numerator
    if hasattr(value, "_mpf_"):
        _, mantissa, exponent, _ = value._mpf_
        if exponent and not mantissa:  # infinite, or not a number
            return value
        exact = fraction_of(value)
        power = exact.denominator.bit_length() - 1  # of two
        return Decimal(f"{exact.numerator * 5**power}e{-power}")
    if isinstance(value, numbers.Integral):
        return int(value)
    if isinstance(value, numbers.Real) or kind == "f":
        return Decimal(_shortest(value))
    if hasattr(value, "magnitude") and hasattr(value, "units"):  # a quantity of pint
        return f"{_shortest(value.magnitude)} {value.units:~C}"
    if isinstance(value, Sequence):
        return list(value)
    return value


def _shortest(value: Any) -> str:
    """The shortest decimal that denotes a number, without numpy's wrapping."""
    text = str(value)
    return text[text.find("(") + 1 : text.find(")")].strip("'") if "(" in text else text


def _key(key: Any) -> str:
    if not isinstance(key, str) or not key:
        raise ConfigError(Problem("config", f'given the key {shown(key)}; a key is a text, such as "end"'))
    return key
