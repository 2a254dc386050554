"""Functions with kinks and jumps, rewritten in smooth functions and signs.

Every kink or jump lies where an argument u passes zero, and ``sign(u)`` is all that is piecewise about it:

    abs(u) = sign(u) u                     step(u) = (1 + sign(u)) / 2
    max(a, b) = step(a - b) a + step(b - a) b                pulse(x, a, b) = step(x - a) step(b - x)
    wrap(x) = 2 atan2(c sin(x/2), c cos(x/2)), c = sign(cos(x/2)): x less full turns, in (-pi, pi]
    atan2(y, x) = s (pi/2 - atan2(x, s y)), s = sign(y)

On either side of u = 0 a sign is a constant, so that both sides are smooth: see ``rigidsim.scene.surfaces``.
What hides a kink is written out likewise: an even root of an even power is one of abs, and the inverse of a
sine or cosine of x is a triangle wave.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import reduce

from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import Constant, Expression, Node, Operation, fold, operation

Span = tuple[int, int]


def written_out(name: str, operands: Sequence[Node], span: Span) -> Node:
    """A function of the grammar rewritten in smooth functions and signs; smooth ones are unchanged."""
    write = _WAYS.get(name)
    found = None if write is None else write(operands, span)
    return Operation(name, tuple(operands), span) if found is None else found


def power(base: Node, exponent: Node, span: Span) -> Node:
    """``base^exponent``; even roots of even powers are taken of the absolute value."""
    whole = isinstance(exponent, Constant) and exponent.value.pi_power == 0
    if not whole or isinstance(base, Constant) or exponent.value.rational.denominator % 2:  # type: ignore
        return operation("power", (base, exponent), span)
    rest: Fraction = exponent.value.rational  # type: ignore[union-attr]
    root = None
    while rest.denominator % 2 == 0 and (inner := _square_root(base if root is None else root)) is not None:
        root, rest = inner, 2 * rest
    if root is None:
        return operation("power", (base, exponent), span)
    if (rest.numerator % 2 or rest.denominator != 1) and _square_root(root) is None:
        root = _abs([root], span)
    return root if rest == 1 else operation("power", (root, Constant(ExactNumber(rest), exponent.span)), span)


def on_sides(
    expression: Expression, places: Mapping[Node, tuple[int, int]], sides: Sequence[int]
) -> Expression:
    """An expression with every sign in it replaced by its value: of the argument's surface, whose index and
    ratio ``places`` gives; a sign stays where ``sides`` has neither 1 nor -1.
    """

    def combine(node: Node, operands: list[Node]) -> Node:
        if not isinstance(node, Operation):
            return node
        if node.operator == "sign" and node.operands[0] in places:
            index, ratio = places[node.operands[0]]
            if abs(sides[index]) == 1:
                return _number(ratio * sides[index], node.span)
        if len(operands) > 2:  # a chain, made two by two
            return reduce(lambda a, b: operation(node.operator, (a, b), node.span), operands)
        return operation(node.operator, tuple(operands), node.span)

    return Expression(expression.text, fold(expression, combine))


def _square_root(node: Node) -> Node | None:
    """The node whose square this one is by its form, up to sign; None if it isn't a square."""
    if isinstance(node, Constant):
        return Operation("sqrt", (node,), node.span) if node.value.sign >= 0 else None
    if not isinstance(node, Operation):
        return None
    if node.operator == "power":
        base, exponent = node.operands
        if not isinstance(exponent, Constant) or exponent.value.pi_power:
            return None
        half = exponent.value.rational / 2
        if half.denominator != 1:
            return None
        return base if half == 1 else operation(
            "power", (base, Constant(ExactNumber(half), exponent.span)), node.span
        )  # fmt: skip
    if node.operator == "quotient":
        parts = [_square_root(part) for part in node.operands]
        return None if None in parts else Operation("quotient", tuple(parts), node.span)  # type: ignore[arg-type]
    if node.operator != "product":
        return None
    roots: list[Node] = []
    waiting = list(node.operands)
    while waiting:
        factor = waiting.pop(0)
        root = _square_root(factor)
        if root is None:
            if factor not in waiting:
                return None
            waiting.remove(factor)
            root = factor
        roots.append(root)
    result = roots[0]
    for root in roots[1:]:
        result = operation("product", (result, root), node.span)
    return result


def _number(value: int | Fraction, span: Span) -> Constant:
    return Constant(ExactNumber(Fraction(value)), span)


def _negative(node: Node, span: Span) -> Node:
    return operation("negative", (node,), span)


def _sign(u: Node, span: Span) -> Node:
    return Operation("sign", (u,), span)


def _step(u: Node, span: Span) -> Node:
    both = operation("sum", (_number(1, span), _sign(u, span)), span)
    return operation("product", (_number(Fraction(1, 2), span), both), span)


def _less(a: Node, b: Node, span: Span) -> Node:
    """The difference a - b."""
    return operation("sum", (a, _negative(b, b.span)), span)


def _abs(operands: Sequence[Node], span: Span) -> Node:
    return operation("product", (_sign(operands[0], span), operands[0]), span)


def _largest(operands: Sequence[Node], span: Span, *, least: bool = False) -> Node:
    a, b = operands
    over = _step(_less(a, b, span), span)
    under = operation("sum", (_number(1, span), _negative(over, span)), span)
    if least:
        over, under = under, over
    return operation(
        "sum", (operation("product", (over, a), span), operation("product", (under, b), span)), span
    )


def _pulse(operands: Sequence[Node], span: Span) -> Node:
    x, begin, end = operands
    return operation("product", (_step(_less(x, begin, span), span), _step(_less(end, x, span), span)), span)


def _wrap(operands: Sequence[Node], span: Span) -> Node:
    half = operation("product", (_number(Fraction(1, 2), span), operands[0]), span)
    cosine, sine = Operation("cos", (half,), span), Operation("sin", (half,), span)
    side = _sign(cosine, span)
    signed = [operation("product", (side, part), span) for part in (sine, cosine)]
    return operation("product", (_number(2, span), Operation("atan2", tuple(signed), span)), span)


def _atan2(operands: Sequence[Node], span: Span) -> Node | None:
    y, x = operands
    if isinstance(y, Constant):
        return None
    side = _sign(y, span)
    turned = Operation("atan2", (x, operation("product", (side, y), span)), span)
    quarter = Constant(ExactNumber(Fraction(1, 2), 1), span)
    return operation("product", (side, _less(quarter, turned, span)), span)


def _inverse(operands: Sequence[Node], span: Span, *, sine: bool) -> Node | None:
    """asin or acos of a sine or cosine: a triangle wave; None for any other argument."""
    (inner,) = operands
    if not isinstance(inner, Operation) or inner.operator not in ("sin", "cos"):
        return None
    (x,) = inner.operands
    quarter = Constant(ExactNumber(Fraction(1, 2), 1), span)
    if inner.operator == "sin":
        x = _less(x, quarter, span)
    found = _abs([_wrap([x], span)], span)
    return _less(quarter, found, span) if sine else found


_WAYS = {
    "abs": _abs,
    "sign": lambda operands, span: _sign(operands[0], span),
    "step": lambda operands, span: _step(operands[0], span),
    "max": _largest,
    "min": lambda operands, span: _largest(operands, span, least=True),
    "pulse": _pulse,
    "wrap": _wrap,
    "atan2": _atan2,
    "asin": lambda operands, span: _inverse(operands, span, sine=True),
    "acos": lambda operands, span: _inverse(operands, span, sine=False),
    "sqrt": lambda operands, span: _root(operands[0], span),
}


def _root(node: Node, span: Span) -> Node | None:
    found = power(node, _number(Fraction(1, 2), span), span)
    same = isinstance(found, Operation) and found.operator == "power" and found.operands[0] == node
    return None if same or isinstance(found, Constant) else found
