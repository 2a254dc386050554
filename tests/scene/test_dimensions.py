"""Units in expressions: what they mean, exactly, and what is refused for its dimension."""

import re
from fractions import Fraction
from pathlib import Path

import pytest
from support import config

from rigidsim import ConfigError, parse
from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.exact import ExactNumber, parse_number
from rigidsim.scene.expressions.names import BODY_NAMES
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import Constant, Expression, ExpressionError, evaluate
from rigidsim.scene.scene import build_scene

PAGE = Path(__file__).parents[2] / "docs" / "expressions.md"
GIVEN = {
    "k": "0.25", "c": "2e-4 N m s", "tau": "0.1 N m", "w0": "30 deg/s", "m": "2", "l": "10 cm", "T": "3 T",
}  # fmt: skip
PARAMETERS = {name: parse_number(value) for name, value in GIVEN.items()}
CONTEXT = context_for(50)


def read(text: str, unit: str | None = None) -> Expression:
    return parse_expression(text, BODY_NAMES, parameters=PARAMETERS, unit=unit)


def refused(text: str, unit: str | None = None) -> str:
    with pytest.raises(ExpressionError) as caught:
        read(text, unit)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "rational", "pi_power"),
    [
        ("90 deg", Fraction(1, 2), 1),
        ("0.1 N m", Fraction(1, 10), 0),
        ("5 mN m", Fraction(5, 1000), 0),
        ("9.81 m/s^2", Fraction(981, 100), 0),
        ("3 kg m^2/s^2", Fraction(3), 0),
        ("(2 min)^2", Fraction(14400), 0),
        ("1 deg/h", Fraction(1, 180 * 3600), 1),
        ("w0/(1 deg/s)", Fraction(30), 0),
    ],
)
def test_a_quantity_is_exact(text: str, rational: Fraction, pi_power: int) -> None:
    root = read(text)
    assert isinstance(root, Constant)
    assert root.value == ExactNumber(rational, pi_power)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("theta - 90 deg", None),
        ("-c*wz", "N m"),
        ("tau*pulse(t, 5 s, 10 s)", "N m"),
        ("tau*min(1, t/(5 s)) - c*abs(wz)", "N m"),
        ("sqrt(4 N^2 m^2) + atan2(wx, wy)*(1 J)", "N m"),
        ("k*sin(t)^2 + tau", "N m"),
        ("tau*sin(t)", "N m"),
        ("0.3*wz*t", "N m"),
    ],
)
def test_what_fits_is_taken(text: str, unit: str | None) -> None:
    read(text, unit)


@pytest.mark.parametrize(
    ("text", "unit", "message"),
    [
        ("t - 90 deg", None, 'column 5: a value in "s" and a number or an angle can\'t be added or compared'),
        ("x + 5 s", None, 'a value in "m" and a value in "s"'),
        ("pulse(t, 5 km, 10 s)", None, "can't be added or compared"),
        ("sin(t - 5 s)", None, '"sin" takes a number or an angle, given a value in "s"; divide by "(1 s)"'),
        ("tau*wz", "N m", 'the expression is a value in "W", where "N m" is needed'),
        ("90 deg", "N m", 'the expression is a number or an angle, where "N m" is needed'),
        ("1/2 s", None, 'column 2: a number with a unit needs parentheses next to "/" and "^"'),
        ("2 t", None, '("t" is no unit here, but a name of this scene)'),
        ("2 m", None, '("m" is no unit here, but a name of this scene)'),
        ("5 s*T", None, '"T" is a name of this scene, and a unit as well; write the unit without "*"'),
        ("90*deg", None, 'unknown name "deg"; a unit follows a number, as in 2 deg'),
    ],
)
def test_what_does_not_fit_is_refused(text: str, unit: str | None, message: str) -> None:
    assert message in refused(text, unit)


def scene(parameters: str, component: str, event: str) -> str:
    return config(
        loads=f'kind = "torque"\ncomponents = ["0", "0", "{component}"]',
        more=f'[parameters]\n{parameters}\n[[events]]\nname = "turned"\nexpression = "{event}"',
    )


def test_a_config_with_units_is_the_one_without() -> None:
    one = build_scene(parse(scene('c = "200 mN m s"', "-c*wz", "phi - 90 deg")))
    other = build_scene(parse(scene("c = 0.2", "-c*wz", "phi - pi/2")))
    values = {name: CONTEXT.mpf(n + 1) / 7 for n, name in enumerate(BODY_NAMES)}
    for first, second in (
        (one.loads[0].components[2], other.loads[0].components[2]),  # type: ignore[attr-defined]
        (one.events[0].expression, other.events[0].expression),
    ):
        assert first == second
        assert evaluate(first, values, CONTEXT) == evaluate(second, values, CONTEXT)
    with pytest.raises(ConfigError, match=re.escape('where "N m" is needed')):
        build_scene(parse(scene('c = "0.2 N m"', "-c*wz", "phi - 1")))
    with pytest.raises(ConfigError, match=r'\[parameters\] c: given "0.2 Nm": unknown unit "Nm"'):
        parse(scene('c = "0.2 Nm"', "-c*wz", "phi - 1"))


# ---- the documentation -----------------------------------------------------------------------------------

_ROW = re.compile(r"^\| `(\w+)\([^|]*\| [^|]* \| `([^|]+)` \| ([-\d.]+) \|$", re.MULTILINE)
STATE = {"t": 2, "wx": 0.5, "wy": -1, "wz": 2, "phi": 0.5, "theta": 1, "psi": 20, "x": 3, "y": -4}
ROWS = _ROW.findall(PAGE.read_text(encoding="utf-8"))


@pytest.mark.parametrize(("name", "example", "shown"), ROWS, ids=[row[0] for row in ROWS])
def test_every_example_of_the_page_has_the_value_shown(name: str, example: str, shown: str) -> None:
    assert f"{name}(" in example
    values = {key: CONTEXT.mpf(value) for key, value in STATE.items()}
    found = evaluate(read(example), values, CONTEXT)
    digits = len(shown.lstrip("-0.").replace(".", ""))
    allowed = abs(found) * CONTEXT.mpf(10) ** -digits if digits > 4 else CONTEXT.mpf(10) ** -40
    assert abs(found - CONTEXT.mpf(shown)) <= 5 * allowed
