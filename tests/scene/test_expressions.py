"""Expressions mean what Python's arithmetic means, stay exact, and nothing else gets past the parser."""

import re
import time
from fractions import Fraction
from typing import Any

import mpmath
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.exact import ExactNumber, parse_number
from rigidsim.scene.expressions.names import BODY_NAMES
from rigidsim.scene.expressions.parser import DEEPEST_NESTING, parse_expression
from rigidsim.scene.expressions.tree import FUNCTIONS, Constant, Expression, ExpressionError, evaluate

NAMES = {name: BODY_NAMES[name] for name in ("t", "wx", "wy")}
CONTEXT = context_for(50)
# A few dozen operations, each right to the context's last bit, on numbers of order one.
CLOSE = mpmath.mpf(2) ** (12 - CONTEXT.prec)
PARAMETERS = {
    "k": parse_number("1/4", "1"),
    "zero": parse_number("0", "1"),
    "turn": parse_number("1 deg", "rad"),
}


def parse(text: str) -> Expression:
    return parse_expression(text, NAMES, parameters=PARAMETERS)


def value(text: str, **values: Any) -> Any:
    return evaluate(parse(text), {n: CONTEXT.mpf(v) for n, v in values.items()}, CONTEXT)


def exact(text: str) -> Fraction:
    """The number that an expression was folded to."""
    root = parse(text)
    assert isinstance(root, Constant), root
    assert root.value.pi_power == 0
    return root.value.rational


def refused(text: str) -> ExpressionError:
    with pytest.raises(ExpressionError) as caught:
        parse(text)
    return caught.value


# ---- meaning ----------------------------------------------------------------------------------------------


def test_decimals_and_parameters_stay_exact() -> None:
    assert exact("0.1 + 0.2") == Fraction(3, 10)
    assert exact("1/3 + 1/6 - k") == Fraction(1, 4)
    assert exact("0.1^20") == Fraction(1, 10**20)
    assert exact("pi/pi") == 1
    assert exact("zero*5") == 0
    assert parse("180*turn") == Constant(ExactNumber(Fraction(1), 1))
    assert parse("2*pi*3") == parse("6*pi")


rational = st.recursive(
    st.sampled_from([*NAMES, "2", "3", "0.1", "1.5e-1", "7."]),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*", "/", " - ", " / "]), inner).map("".join),
        inner.map(lambda a: f"({a})"),
        inner.map(lambda a: f"-{a}"),
        st.tuples(inner, st.sampled_from(["^2", "**3", "^-1", "^(1+1)", "^-2"])).map("".join),
    ),
    max_leaves=10,
)
RATIONALS = {"t": Fraction(3, 4), "wx": Fraction(-5, 8), "wy": Fraction(7, 2)}


@settings(max_examples=80)
@given(rational)
def test_arithmetic_is_that_of_pythons_fractions(text: str) -> None:
    """Python reads the same text, written in the test itself, with its own precedence and exact fractions."""
    try:
        expression = parse(text)
    except ExpressionError as error:
        assume("beyond 64" not in str(error))
        assert "division by" in str(error) or "isn't real" in str(error)  # noqa: PT017
        expression = None
    python = re.sub(r"(?<![\w.])(\d+\.?\d*(?:e-?\d+)?)", r"F('\1')", text.replace("^", "**"))
    python = python.replace("7.'", "7'")
    try:
        expected = eval(python, {"__builtins__": {}, "F": Fraction}, dict(RATIONALS))
    except (ZeroDivisionError, OverflowError):
        return  # what is zero only after rounding needn't be noticed
    assume(isinstance(expected, Fraction))  # a fractional power makes it a float
    assert expression is not None
    context = mpmath.MPContext()
    context.prec = 4000
    assume(max(abs(expected.numerator), expected.denominator).bit_length() < 500)
    values = {name: context.mpf(x.numerator) / x.denominator for name, x in RATIONALS.items()}
    got = evaluate(expression, values, context)
    assert abs(got - context.mpf(expected.numerator) / expected.denominator) < context.mpf(2) ** -2000


def test_functions_are_mpmaths_own() -> None:
    x = CONTEXT.mpf("0.3")
    for name in set(FUNCTIONS) - {"sigmoid", "atan2"}:
        assert abs(value(f"{name}(wx)", wx=x) - getattr(CONTEXT, name)(x)) < CLOSE
    assert abs(value("atan2(wx, -1)", wx=x) - CONTEXT.atan2(x, -1)) < CLOSE
    for y in (x, -x, CONTEXT.mpf(400)):
        assert abs(value("sigmoid(wx)", wx=y) - 1 / (1 + CONTEXT.exp(-y))) < CLOSE
    assert value("sigmoid(wx)", wx=-(10**9)) >= 0
    assert abs(value("e^(1/2)*pi") - CONTEXT.sqrt(CONTEXT.e) * CONTEXT.pi) < CLOSE


# ---- refusals ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "column", "message"),
    [
        ("", None, "an empty expression; write a number or a formula"),
        ("wx + why", 6, 'unknown name "why"; did you mean "wy"?; allowed: t, wx, wy, k, zero, turn, pi, e'),
        ("1+sine(t)", 3, 'unknown function "sine"; did you mean "sin"?; allowed: sin, cos, '),
        ("sin()", 4, 'given 0 arguments; "sin" takes 1; write sin(x)'),
        ("2*(t+1", 7, 'a ")" is missing for the "(" in column 3'),
        ("2 t", 3, 'an operator is missing before "t"; a product has its *, as in 2*t'),
        ("1.2.3", 1, '"1.2.3" is no number, such as 2, 0.5 or 1e-3'),
        ("wx^t", 4, "an exponent must be constant; write exp(y*log(x)) for x^y"),
        ("wx^65", 4, 'the exponent "65" is beyond 64; -64 to 64 are allowed'),
        ("wx/(0.1+0.2-0.3)", 5, 'division by the zero in "0.1+0.2-0.3"'),
        ("zero^-1", 1, 'a power that isn\'t real and finite (of zero or of a negative number) in "zero^-1"'),
        ("t*(1e4000*1e4000)", 4, "a value beyond 1e6000"),
    ],
)
def test_errors_say_what_is_wrong_and_where(text: str, column: int | None, message: str) -> None:
    error = refused(text)
    assert message in str(error)
    assert error.column == column
    if column is not None:
        first, shown, caret = str(error).split("\n")
        assert first.startswith(f"column {column}: ")
        assert shown == "  " + text.replace("\t", " ")
        assert caret == "  " + " " * (column - 1) + "^"


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("wx.__class__", 3),
        ("t # comment", 3),
        ("\ufefft", 1),
        ("wх", 2),
        ("10**10**10", 5),
        ("exp(exp(exp(20)))", 5),
        ("(" * 1000, DEEPEST_NESTING + 2),
        ("(" * 10**5 + ")" * 10**5, None),
        ("t+" * 10**6 + "t", None),
    ],
)
def test_hostile_texts_are_refused_quickly(text: str, column: int | None) -> None:
    start = time.process_time()
    error = refused(text)
    assert time.process_time() - start < 1.0  # a hang is what this is about; a refusal takes well under 0.1 s
    assert len(str(error)) < 500
    assert column is None or error.column == column


@pytest.mark.parametrize(
    ("text", "wx", "message"),
    [
        ("1 + 1/(wx-1)", 1, 'column 5: division by zero in "1/(wx-1)"'),
        ("wx^0.5", -1, "a power that isn't real and finite"),
        ("cosh(wx)", -20000, 'a value beyond 1e6000 in "cosh(wx)"'),
    ],
)
def test_evaluation_names_the_part_at_fault(text: str, wx: Any, message: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        value(text, wx=wx)
    assert message in str(caught.value)
    assert str(caught.value).endswith("^")
