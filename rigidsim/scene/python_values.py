"""Python values as TOML text, for configs written in code."""

import numbers
from collections.abc import Mapping, Sequence
from datetime import date, time
from decimal import Decimal
from fractions import Fraction
from typing import Any

import tomlkit

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.exact import fraction_of
from rigidsim.scene.validation_messages import shown

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
        if value is not None:
            document[_key(key)] = _item(value, str(key))
    return document.as_string()


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


def _item(value: Any, where: str) -> Any:
    """A tomlkit item: tables and lists of tables as blocks, everything else on one line."""
    if isinstance(value, Mapping):
        table = tomlkit.table()
        for key, inner in value.items():
            if inner is not None:
                table[_key(key)] = tomlkit.value(inline(inner, f"{where}.{key}"))
        return table
    plain = _plain(value)
    if isinstance(plain, list) and plain and all(isinstance(entry, Mapping) for entry in plain):
        tables = tomlkit.aot()
        for number, entry in enumerate(plain):
            tables.append(_item(entry, f"{where}[{number}]"))
        return tables
    return tomlkit.value(inline(value, where))


def inline(value: Any, where: str = "value", depth: int = 0) -> str:
    """A TOML value on one line."""
    plain = _plain(value)
    if depth > _DEEPEST:
        raise ConfigError(Problem(where, "nested too deeply"))
    if isinstance(plain, str):
        return tomlkit.string(plain).as_string()
    if isinstance(plain, bool):
        return "true" if plain else "false"
    if isinstance(plain, int):
        return str(plain)
    if isinstance(plain, Decimal):
        if not plain.is_finite():
            raise ConfigError(Problem(where, f"given {plain}; finite numbers are allowed"))
        text = str(plain).lower().replace("e+", "e")
        return text if "." in text or "e" in text else f"{text}.0"
    if isinstance(plain, Mapping):
        inner = (
            f"{tomlkit.string(_key(k)).as_string()} = {inline(v, f'{where}.{k}', depth + 1)}"
            for k, v in plain.items()
        )
        return "{" + ", ".join(inner) + "}"
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
