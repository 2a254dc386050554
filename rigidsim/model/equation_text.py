"""Equations of motion as people write them: products of sums, and what occurs more than once under a name.

heyoka's own text of an expression repeats every shared part in full, and ends after a thousand characters.
What its compiler makes of all equations together is used instead: expressions, each of earlier ones.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from decimal import Decimal
from functools import partial, reduce
from typing import Any, NamedTuple

import heyoka as hy

_NUMBER = re.compile(r"(?<![\w.#])\d+(?:\.\d*)?(?:e[+-]?\d+)?(?![\w.])")
_COMPOSITE = re.compile(r"composite\|(?P<tree>.*)\((?P<arguments>[^()]*)\)", re.DOTALL)
_WHOLE, _EXPONENT = re.compile(r"-?\d+"), re.compile(r"-?[\d.]+")
_SHORT = 14  # characters of a part that needs no name
_OPERATORS = {ast.Add: "sum", ast.Sub: "sub", ast.Mult: "prod", ast.Div: "div", ast.Pow: "pow"}
_SUM, _NEGATIVE, _PRODUCT, _POWER, _LEAF = range(5)


class _Text(NamedTuple):
    """A text, and how tightly it holds together."""

    text: str
    holds: int

    def within(self, least: int) -> str:
        return self.text if self.holds >= least else f"({self.text})"


def equation_texts(equations: Sequence[tuple[Any, Any]], **options: Any) -> tuple[list[str], list[str]]:
    """``u1 = ...`` for each shared part, of earlier ones, and ``wx' = ...`` for each equation, as compiled
    with ``options`` in the precision of the run.
    """
    names, count = [str(variable) for variable, _ in equations], len(equations)
    function = hy.cfunc(
        [right for _, right in equations],
        [variable for variable, _ in equations],
        compact_mode=True,
        **options,
    )
    steps = [str(step) for step in function.dc[count:]]
    uses = Counter(name for step in steps for name in re.findall(r"\bu_\d+\b", step))
    known = {f"u_{k}": _Text(name, _LEAF) for k, name in enumerate(names)}
    shared: list[str] = []
    try:
        for k, step in enumerate(steps[:-count], count):
            found = _read(step, known)
            if uses[f"u_{k}"] > 1 and len(found.text) > _SHORT:
                name = f"u{len(shared) + 1}"
                name = f"{name}_" if name in names else name
                shared.append(f"{name} = {found.text}")
                found = _Text(name, _LEAF)
            known[f"u_{k}"] = found
        texts = [_read(step, known).text for step in steps[-count:]]
    except (SyntaxError, ValueError):  # longer than heyoka writes out
        shared, texts = [], [str(right) for _, right in equations]
    return shared, [f"{name}' = {text}" for name, text in zip(names, texts, strict=True)]


def _read(step: str, known: Mapping[str, _Text]) -> _Text:
    """One of heyoka's steps, with what is known put into it; ``SyntaxError`` or ``ValueError`` if it isn't
    whole.
    """
    if (composite := _COMPOSITE.fullmatch(step)) is not None:
        arguments = composite["arguments"].split(", ")
        known = {f"_{k}": _read(argument, known) for k, argument in enumerate(arguments)}
        step = composite["tree"].replace("#", "_")
    return _written(ast.parse(_NUMBER.sub(r"'\g<0>'", step).strip(), mode="eval").body, known)


def _written(node: ast.AST, known: Mapping[str, _Text]) -> _Text:
    if isinstance(node, ast.Name):
        return known.get(node.id, _Text(node.id, _LEAF))
    if isinstance(node, ast.Constant):
        number = Decimal(str(node.value))
        digits = f"{number:{'f' if not number or -5 <= number.adjusted() < 15 else 'e'}}"
        return _Text(re.sub(r"\.?0+(?=e|$)", "", digits) if "." in digits else digits, _LEAF)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return _negative(_written(node.operand, known))
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return _operated(_OPERATORS[type(node.op)], [_written(x, known) for x in (node.left, node.right)])
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        return _operated(node.func.id, [_written(x, known) for x in node.args])
    raise ValueError("no operation")


def _operated(name: str, given: Sequence[_Text]) -> _Text:
    if name == "time":
        return _Text("t", _LEAF)
    if name not in _OPERATORS.values():
        return _Text(f"{name.removeprefix('combined_')}({', '.join(x.text for x in given)})", _LEAF)
    return reduce(partial(_joined, name), given)


def _joined(name: str, first: _Text, second: _Text) -> _Text:
    if name in ("sum", "sub"):
        second = second if name == "sum" else _negative(second)
        minus, text = second.text.startswith("-"), second.text.removeprefix("-")
        return _Text(f"{first.text} {'-' if minus else '+'} {text}", _SUM)
    if name == "pow":
        base, _, inner = first.text.rpartition("^")
        if first.holds == _POWER and second.text.isdigit() and _WHOLE.fullmatch(inner):
            return _Text(f"{base}^{int(inner) * int(second.text)}", _POWER)
        power = second.text if _EXPONENT.fullmatch(second.text) else second.within(_LEAF)
        return _Text(f"{first.within(_LEAF)}^{power}", _POWER)
    minus = (first.holds == _NEGATIVE) != (second.holds == _NEGATIVE)
    first, second = (_negative(x) if x.holds == _NEGATIVE else x for x in (first, second))
    if name == "div":
        found = _Text(f"{first.within(_PRODUCT)}/{second.within(_POWER)}", _PRODUCT)
    elif "1" in (first.text, second.text):
        found = second if first.text == "1" else first
    elif first == second:
        found = _Text(f"{first.within(_LEAF)}^2", _POWER)
    else:
        parts = sorted((first, second), key=lambda x: not (x.text[0].isdigit() and x.holds >= _PRODUCT))
        found = _Text("*".join(x.within(_PRODUCT) for x in parts), _PRODUCT)
    return _negative(found) if minus else found


def _negative(given: _Text) -> _Text:
    if given.holds == _NEGATIVE:
        return _Text(given.text[1:], _LEAF if given.text[1:].isidentifier() else _PRODUCT)
    return _Text(f"-{given.within(_PRODUCT)}", _NEGATIVE)
