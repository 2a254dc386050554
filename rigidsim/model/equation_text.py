"""Equations of motion as people write them: products of sums, and what occurs more than once under a name.

heyoka's own text of an expression repeats every shared part in full, and ends after a thousand characters.
What its compiler makes of all equations together is used instead: expressions, each of earlier ones.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from typing import Any, TypeAlias

import heyoka as hy

Node: TypeAlias = "str | Decimal | Call"

_NUMBER = re.compile(r"(?<![\w.#])\d+(?:\.\d*)?(?:e[+-]?\d+)?(?![\w.])")
_COMPOSITE = re.compile(r"composite\|(?P<tree>.*)\((?P<arguments>[^()]*)\)", re.DOTALL)
_EXACT = Context(prec=2000)
_SHORT = 14  # characters of a part that needs no name
_OPERATORS = {ast.Add: "sum", ast.Sub: "sub", ast.Mult: "prod", ast.Div: "div", ast.Pow: "pow"}
_SUM, _PRODUCT, _POWER, _LEAF = range(4)  # how tightly a text holds together


@dataclass(frozen=True)
class Call:
    """An operation on others, by heyoka's name for it."""

    name: str
    arguments: tuple[Node, ...]


def equation_texts(equations: Sequence[tuple[Any, Any]], **options: Any) -> tuple[list[str], list[str]]:
    """``u1 = ...`` for each shared part, of earlier ones, and ``wx' = ...`` for each equation, as compiled
    with ``options`` in the precision of the run.
    """
    names = [str(variable) for variable, _ in equations]
    function = hy.cfunc(
        [right for _, right in equations],
        [variable for variable, _ in equations],
        compact_mode=True,
        **options,
    )
    try:
        steps = [_parsed(str(step)) for step in function.dc]
    except (SyntaxError, ValueError):  # longer than heyoka writes out
        return [], [f"{name}' = {right}" for name, (_, right) in zip(names, equations, strict=True)]
    return _written(names, steps)


def _written(names: list[str], steps: list[Node]) -> tuple[list[str], list[str]]:
    count = len(names)
    inner, outer = steps[count : len(steps) - count], steps[len(steps) - count :]
    known: dict[str, Node] = {f"u_{k}": name for k, name in enumerate(names)}
    uses = Counter(leaf for step in steps[count:] for leaf in _leaves(step))
    shared: list[str] = []
    taken = set(names)
    for k, step in enumerate(inner, count):
        node = _simple(_with(step, known))
        if uses[f"u_{k}"] > 1 and len(_text(node)[0]) > _SHORT:
            number = len(shared) + 1
            name = f"u{number}" if f"u{number}" not in taken else f"u_{number}"
            shared.append(f"{name} = {_text(node)[0]}")
            node = name
        known[f"u_{k}"] = node
    texts = [_text(_simple(_with(step, known)))[0] for step in outer]
    return shared, [f"{name}' = {text}" for name, text in zip(names, texts, strict=True)]


# --- reading ------------------------------------------------------------------------------------------------


def _parsed(text: str) -> Node:
    """``SyntaxError`` or ``ValueError`` if it isn't a whole expression."""
    composite = _COMPOSITE.fullmatch(text)
    if composite is None:
        return _tree(text)
    arguments = _tree(f"list({composite['arguments']})")
    assert isinstance(arguments, Call)
    return _with(
        _tree(composite["tree"].replace("#", "_")), {f"_{k}": a for k, a in enumerate(arguments.arguments)}
    )


def _tree(text: str) -> Node:
    numbers: list[str] = []

    def noted(found: re.Match[str]) -> str:
        numbers.append(found[0])
        return f"number_{len(numbers) - 1}"

    def read(node: ast.AST) -> Node:
        if isinstance(node, ast.Name):
            kind, _, place = node.id.partition("_")
            return Decimal(numbers[int(place)]) if kind == "number" else node.id
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return Call("prod", (Decimal(-1), read(node.operand)))
        if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            return Call(_OPERATORS[type(node.op)], (read(node.left), read(node.right)))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            return Call(node.func.id, tuple(map(read, node.args)))
        raise ValueError(f"not an expression: {text}")

    return read(ast.parse(_NUMBER.sub(noted, text).strip(), mode="eval").body)


def _with(node: Node, known: dict[str, Node]) -> Node:
    if isinstance(node, Call):
        return Call(node.name, tuple(_with(argument, known) for argument in node.arguments))
    return known.get(node, node) if isinstance(node, str) else node


def _leaves(node: Node) -> list[str]:
    if isinstance(node, Call):
        return [leaf for argument in node.arguments for leaf in _leaves(argument)]
    return [node] if isinstance(node, str) else []


# --- writing ------------------------------------------------------------------------------------------------


def _simple(node: Node) -> Node:
    """The same with sums and products in one piece each, and powers of two taken together, which is exact."""
    if not isinstance(node, Call):
        return node
    arguments = tuple(map(_simple, node.arguments))
    if node.name == "sub":
        first, second = arguments
        return _simple(Call("sum", (first, Call("prod", (Decimal(-1), second)))))
    if node.name == "pow":
        return _power(*arguments)
    if node.name not in ("sum", "prod"):
        return Call(node.name, arguments)
    flat: list[Node] = []
    for argument in arguments:
        same = isinstance(argument, Call) and argument.name == node.name
        flat += argument.arguments if same else [argument]  # type: ignore[union-attr]
    if node.name == "prod":
        flat = _joined(flat)
    return flat[0] if len(flat) == 1 else Call(node.name, tuple(flat))


def _power(base: Node, exponent: Node) -> Node:
    """A whole power of a whole power is one."""
    if isinstance(base, Call) and base.name == "pow" and _whole(base.arguments[1]) and _whole(exponent):
        return Call("pow", (base.arguments[0], base.arguments[1] * exponent))  # type: ignore[operator]
    return Call("pow", (base, exponent))


def _whole(node: Node) -> bool:
    return isinstance(node, Decimal) and node == node.to_integral_value()


def _joined(factors: list[Node]) -> list[Node]:
    """Factors with their numbers first, as one where that is exact, and their squares as powers."""
    given = [factor for factor in factors if isinstance(factor, Decimal)]
    minus = sum(factor.is_signed() for factor in given) % 2
    numbers: list[Decimal] = []
    for factor in map(_EXACT.abs, given):
        if numbers and (_power_of_two(factor) or _power_of_two(numbers[-1])):
            numbers[-1] = _EXACT.multiply(numbers[-1], factor)
        else:
            numbers.append(factor)
    numbers = [number for number in numbers if number != 1]
    if minus:
        numbers = [_EXACT.minus(numbers[0]), *numbers[1:]] if numbers else [Decimal(-1)]
    others = Counter(factor for factor in factors if not isinstance(factor, Decimal))
    powers: list[Node] = [
        factor if times == 1 else Call("pow", (factor, Decimal(times))) for factor, times in others.items()
    ]
    return [*numbers, *powers] or [Decimal(1)]


def _power_of_two(number: Decimal) -> bool:
    top, bottom = abs(number).as_integer_ratio()
    return top > 0 and not (top & (top - 1) or bottom & (bottom - 1))


def _text(node: Node) -> tuple[str, int]:
    """A text, and how tightly it holds together."""
    if isinstance(node, str):
        return node, _LEAF
    if isinstance(node, Decimal):
        plain = not node or -5 <= node.adjusted() < 15
        return f"{node.normalize(_EXACT):{'f' if plain else 'e'}}", _LEAF if node >= 0 else _SUM
    if node.name == "sum":
        text = _text(node.arguments[0])[0]
        for argument in node.arguments[1:]:
            minus, rest = _sign(argument)
            text += f" {'-' if minus else '+'} {_within(rest, _PRODUCT)}"
        return text, _SUM
    if node.name == "prod":
        minus, rest = _sign(node)
        if minus:
            return f"-{_within(rest, _PRODUCT)}", _SUM
        return "*".join(_within(argument, _PRODUCT) for argument in node.arguments), _PRODUCT
    if node.name == "div":
        above, below = node.arguments
        return f"{_within(above, _PRODUCT)}/{_within(below, _POWER)}", _PRODUCT
    if node.name == "pow":
        base, exponent = node.arguments
        power = _text(exponent)[0] if isinstance(exponent, Decimal) else _within(exponent, _LEAF)
        return f"{_within(base, _LEAF)}^{power}", _POWER
    if node.name == "time":
        return "t", _LEAF
    name = node.name.removeprefix("combined_")
    return f"{name}({', '.join(_text(argument)[0] for argument in node.arguments)})", _LEAF


def _sign(node: Node) -> tuple[bool, Node]:
    """Whether a term has a minus, and it without."""
    if isinstance(node, Decimal):
        return node < 0, _EXACT.abs(node)
    if isinstance(node, Call) and node.name == "prod" and isinstance(node.arguments[0], Decimal):
        first = node.arguments[0]
        if first < 0:
            return True, _simple(Call("prod", (_EXACT.minus(first), *node.arguments[1:])))
    return False, node


def _within(node: Node, least: int) -> str:
    text, holds = _text(node)
    return text if holds >= least else f"({text})"
