"""Compiled expressions against mpmath's values, within the rounding that their operations allow."""

from __future__ import annotations

from typing import Any

import heyoka as hy
import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rigidsim.model.heyoka_expressions import to_heyoka
from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.expressions import tree as expressions
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import Expression, ExpressionError, fold, operate
from rigidsim.solve.precision import Precision, precision_of

NAMES = ("t", "wx", "wy")
VALUES = {"t": 1.5, "wx": -0.6875, "wy": 2.25}
VARIABLES = dict(zip(NAMES, hy.make_vars(*NAMES), strict=True))


def compiled(expression: Expression, precision: Precision, values: dict[str, Any] = VALUES) -> Any:
    """The value by heyoka, as an mpf."""
    context = context_for(50)
    formula = to_heyoka(expression, VARIABLES, precision.number, context)
    function = hy.cfunc([formula], list(VARIABLES.values()), compact_mode=True, **precision.options)
    point = precision.array([mpmath.mpf(values[name]) for name in NAMES])
    return precision.exact(function(point)[0])


# ---- random expressions -----------------------------------------------------------------------------------

texts = st.recursive(
    st.sampled_from([*NAMES, "2", "0.1", "1/3", "1e-3", "pi", "e", "7.25"]),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from("+-*/"), inner).map("".join),
        inner.map(lambda a: f"({a})"),
        inner.map(lambda a: f"-{a}"),
        st.tuples(inner, st.sampled_from(["2", "3", "-1", "5", "-2", "(1/3)", "0.5", "sqrt(2)"])).map(
            "({0[0]})^{0[1]}".format
        ),
        st.tuples(st.sampled_from(sorted(set(expressions.FUNCTIONS) - {"atan2"})), inner).map(
            "{0[0]}({0[1]})".format
        ),
        st.tuples(inner, inner).map("atan2({0[0]}, {0[1]})".format),
    ),
    max_leaves=8,
)

SLOPES = {
    "sin": mpmath.cos, "cos": mpmath.sin, "tan": lambda x: 1 + mpmath.tan(x) ** 2,
    "asin": lambda x: (1 - x * x) ** -0.5, "acos": lambda x: (1 - x * x) ** -0.5, "atan": lambda x: 1,
    "sinh": mpmath.cosh, "cosh": mpmath.sinh, "tanh": lambda x: 1, "exp": mpmath.exp, "log": lambda x: 1 / x,
    "sqrt": lambda x: x**-0.5 / 2, "erf": lambda x: 2, "sigmoid": lambda x: 1,
}  # fmt: skip
EDGES = {"asin": (-1, 1), "acos": (-1, 1), "log": (0,), "sqrt": (0,)}


def value_and_bound(expression: Expression, epsilon: float) -> tuple[Any, Any]:
    """The value, and the error that rounding of relative size epsilon in every operation can add up to.

    Running error analysis (Higham, Accuracy and Stability of Numerical Algorithms, section 3.3), with
    four roundings for a division and sixteen for a library function.
    """
    context = context_for(50)

    def combine(node: Any, operands: list[tuple[Any, Any]]) -> tuple[Any, Any]:
        if isinstance(node, expressions.Name):
            return context.mpf(VALUES[node.name]), context.zero
        if isinstance(node, expressions.Constant):
            number = node.value.at(context)
            return number, abs(number) * epsilon
        value = operate(expression, node, [v for v, _ in operands], context)
        assume(value == 0 or 1e-200 < abs(value) < 1e200)
        sizes = [abs(v) for v, _ in operands]
        errors = [e for _, e in operands]
        x, e = sizes[0], errors[0]
        edges = EDGES.get(node.operator, ())
        assume(all(abs(operands[0][0] - edge) > 1000 * e + 1e-6 for edge in edges))
        if node.operator == "sign":
            assume(1000 * e < x)
            return value, context.zero
        if node.operator == "negative":
            return value, e
        if node.operator == "sum":
            return value, sum(errors) + len(sizes) * epsilon * sum(
                s + e for s, e in operands_of(sizes, errors)
            )
        if node.operator == "product":
            whole = context.one
            for s, error in operands_of(sizes, errors):
                whole *= s + error
            return value, whole - abs(value) + len(sizes) * epsilon * whole
        if node.operator == "quotient":
            assume(2 * errors[1] < sizes[1])
            whole = (x + e) / (sizes[1] - errors[1])
            return value, whole - abs(value) + 4 * epsilon * whole
        if node.operator == "power":
            exponent = operands[1][0]
            if exponent < 0 or exponent != int(exponent):
                assume(1000 * e < x)
            whole = (x + e if exponent > 0 else x - e) ** abs(exponent)
            whole = whole if exponent > 0 else 1 / whole
            digits = 16 + 2 * abs(exponent) + abs(exponent * context.log(x) if x else 0)
            return value, abs(whole - abs(value)) + digits * epsilon * whole
        if node.operator == "atan2":
            radius = context.hypot(*sizes)
            assume(1000 * sum(errors) < radius)
            assume(operands[0][0] == 0 or sizes[0] > 1000 * errors[0])  # else it may jump by 2 pi
            assume(operands[0][0] != 0 or operands[1][0] > 0)
            return value, 2 * sum(errors) / radius + 16 * epsilon * abs(value)
        assume(e < 1e-4)
        slope = max(abs(SLOPES[node.operator](operands[0][0] + d)) for d in (-e, 0, e))
        return value, 2 * slope * e + 16 * epsilon * abs(value)

    return fold(expression, combine)


def operands_of(sizes: list[Any], errors: list[Any]) -> Any:
    return zip(sizes, errors, strict=True)


def read(text: str) -> Expression:
    try:
        return parse_expression(text, NAMES)
    except ExpressionError:
        assume(False)
        raise


def check_random(text: str, precision: Precision) -> None:
    expression = read(text)
    epsilon = float(precision.epsilon)
    try:
        value, bound = value_and_bound(expression, epsilon)
    except ExpressionError:
        assume(False)
        raise
    got = compiled(expression, precision)
    assert abs(got - value) <= 2 * bound + 1e-290, (text, got, value, bound)


@settings(max_examples=40, deadline=None)
@given(texts)
def test_double_is_mpmaths_value_within_rounding(text: str) -> None:
    check_random(text, precision_of("double"))


# ---- chosen ones ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("power", [1, 2, 3, 4, 5, 7, 8, 15, 16])
def test_whole_powers_have_a_taylor_series_at_zero(power: int) -> None:
    """x' = 1, y' = x^n from zero gives y(1) = 1/(n+1); heyoka's own x**n is NaN there for n > 2.

    Powers up to the method's order, 20 in double: from zero it can't see the first n derivatives vanish.
    """
    number, context = precision_of("double").number, context_for("double")
    x, y = hy.make_vars("x", "y")
    slope = to_heyoka(parse_expression(f"x^{power}", ["x"]), {"x": x}, number, context)
    integrator = hy.taylor_adaptive([(x, hy.expression(1.0)), (y, slope)], [0.0, 0.0], compact_mode=True)
    assert integrator.propagate_until(1.0)[0] == hy.taylor_outcome.time_limit
    assert abs(integrator.state[1] * (power + 1) - 1) < 64 * np.finfo(float).eps
