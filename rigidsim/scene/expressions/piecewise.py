"""Functions with kinks and jumps, rewritten in smooth functions and signs.

Every kink or jump lies where an argument u passes zero, and ``sign(u)`` is all that is piecewise about it. On
either side of u = 0 a sign is a constant, so that both sides are smooth: see ``rigidsim.scene.surfaces``.
What hides a kink is written out likewise: an even root of an even power is one of abs, and the inverse of a
sine or cosine of x is a triangle wave.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import partial, reduce
from operator import mul

from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import (
    Constant,
    Expression,
    Operation,
    constant,
    fold,
    operation,
    placed,
    rational_value,
)

_HALF = Fraction(1, 2)
_QUARTER = constant(ExactNumber(_HALF, 1))
"""A quarter of a turn, rad."""


def written_out(operator: str, *operands: Expression) -> Expression:
    """An operation or function of the grammar in smooth functions and signs."""
    return _WAYS.get(operator, partial(operation, operator))(*operands)


def sign(u: Expression) -> Expression:  # noqa: D103
    return Operation("sign", (u,))


def _step(u: Expression) -> Expression:
    return _HALF * (1 + sign(u))


def _abs(u: Expression) -> Expression:
    while isinstance(u, Operation) and u.operator == "negative":
        (u,) = u.operands
    return sign(u) * u


def _max(a: Expression, b: Expression) -> Expression:
    over = _step(a - b)
    return over * a + (1 - over) * b


def _min(a: Expression, b: Expression) -> Expression:
    over = _step(a - b)
    return (1 - over) * a + over * b


def _pulse(x: Expression, begin: Expression, end: Expression) -> Expression:
    return _step(x - begin) * _step(end - x)


def _wrap(x: Expression) -> Expression:
    """x less full turns, in (-pi, pi]: twice the angle of its half, turned to a positive cosine."""
    cosine, sine = (operation(name, _HALF * x) for name in ("cos", "sin"))
    side = sign(cosine)
    return 2 * operation("atan2", side * sine, side * cosine)


def _atan2(y: Expression, x: Expression) -> Expression:
    """From the quarter turn, which it passes smoothly, on either side of y = 0."""
    if isinstance(y, Constant):
        return operation("atan2", y, x)
    return sign(y) * (_QUARTER - operation("atan2", x, sign(y) * y))


def _inverse(name: str, u: Expression) -> Expression:
    """asin or acos: of a sine or cosine a triangle wave."""
    if not isinstance(u, Operation) or u.operator not in ("sin", "cos"):
        return operation(name, u)
    (x,) = u.operands
    wave = _abs(_wrap(x - _QUARTER if u.operator == "sin" else x))
    return _QUARTER - wave if name == "asin" else wave


def _sqrt(u: Expression) -> Expression:
    found = _power(u, constant(_HALF))
    same = isinstance(found, Operation) and found.operator == "power" and found.operands[0] == u
    return operation("sqrt", u) if same or isinstance(found, Constant) else found


def _power(base: Expression, exponent: Expression) -> Expression:
    """Even roots of even powers are taken of the absolute value."""
    rest = rational_value(exponent)
    if rest is None or isinstance(base, Constant):
        return base**exponent
    root = base
    while rest.denominator % 2 == 0 and (inner := _square_root(root)) is not None:
        root, rest = inner, 2 * rest
    if root is base:
        return base**exponent
    if (rest.numerator % 2 or rest.denominator != 1) and _square_root(root) is None:
        root = _abs(root)
    return root if rest == 1 else root ** constant(rest)


def _square_root(node: Expression) -> Expression | None:
    """That whose square this is by its form, up to sign; None if it isn't a square."""
    if isinstance(node, Constant):
        return operation("sqrt", node) if node.value.sign >= 0 else None
    if not isinstance(node, Operation):
        return None
    if node.operator == "power":
        base, exponent = node.operands
        rational = rational_value(exponent)
        if rational is None or rational % 2 != 0:
            return None
        return base if rational == 2 else base ** (rational / 2)
    if node.operator == "quotient":
        above, below = map(_square_root, node.operands)
        return None if above is None or below is None else Operation("quotient", (above, below))
    if node.operator != "product":
        return None
    roots, waiting = [], list(node.operands)
    while waiting:
        factor = waiting.pop(0)
        root = _square_root(factor)
        if root is None:
            if factor not in waiting:
                return None
            waiting.remove(factor)
            root = factor
        roots.append(root)
    return reduce(mul, roots)


_WAYS: Mapping[str, Callable[..., Expression]] = {
    **{"abs": _abs, "sign": sign, "step": _step, "max": _max, "min": _min, "pulse": _pulse, "wrap": _wrap},
    **{"atan2": _atan2, "asin": partial(_inverse, "asin"), "acos": partial(_inverse, "acos")},
    **{"sqrt": _sqrt, "power": _power, "e": lambda: operation("exp", constant(1))},
}


def on_sides(
    expression: Expression, places: Mapping[Expression, tuple[int, int]], sides: Sequence[int]
) -> Expression:
    """An expression with every sign in it replaced by its value: of the argument's surface, whose index and
    ratio ``places`` gives; a sign stays where ``sides`` has neither 1 nor -1.
    """

    def of_operation(node: Operation, operands: list[Expression]) -> Expression:
        if node.operator == "sign" and node.operands[0] in places:
            index, ratio = places[node.operands[0]]
            if abs(sides[index]) == 1:
                return placed(constant(ratio * sides[index]), node.place)
        if len(operands) > 2:  # a chain, made two by two
            found = reduce(lambda a, b: operation(node.operator, a, b), operands)
        else:
            found = operation(node.operator, *operands)
        return placed(found, node.place)

    return fold(expression, lambda node: node, lambda node: node, of_operation)
