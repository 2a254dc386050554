"""Expressions without a value at the start of a run are refused, with the place and the values there."""

import pytest
from support import run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare

SCENE = """name = "start"
[body]
principal_moments = [1, 2, 3]
mass = 1
[initial]
angular_velocity = [0, 0.5, 1]
euler_angles = [0.25, 1, 0]
{initial}
{loads}
[time]
start = 2
end = 10
[integrator]
precision = "{precision}"
"""


def refused(loads: str, initial: str = "", precision: str = "double") -> str:
    with pytest.raises(ConfigError) as caught:
        prepare(rigidsim.parse(SCENE.format(initial=initial, loads=loads, precision=precision)))
    return str(caught.value)


@pytest.mark.parametrize("precision", ["double", "quadruple"])
@pytest.mark.parametrize(
    ("expression", "says"),
    [
        ("1/wx", "(wx = 0.0)"),
        ("1/(t-2)", "(t = 2.0)"),
        ("log(wy - 1)", "(wy = 0.5)"),
        ("exp(wy*1e6)", "(wy = 0.5)"),
        ("atan2(wx, psi)", "(wx = 0.0, psi = 0.0)"),
    ],
)
def test_components(expression: str, says: str, precision: str) -> None:
    for frame in ("body", "space"):
        load = f'[[loads]]\nkind = "viscous_torque"\ncoefficients = [1, 1, 1]\n[[loads]]\nkind = "torque"\n' \
               f'components = [1, "{expression}", 0]\nframe = "{frame}"'  # fmt: skip
        text = refused(load, precision=precision)
        assert "[[loads]] number 2 components[1]: no finite value at the start" in text
        assert says in text
        assert "column" in text


def test_a_value_that_is_lost_later_is_no_matter_of_the_start() -> None:
    load = '[[loads]]\nkind = "torque"\ncomponents = ["1/(t-5)", 0, 0]'
    run = run_text(SCENE.format(initial="", loads=load, precision="double"))
    assert run.status in ("stopped: non-finite state", "stopped: step size collapsed")
    assert 4 < run.summary["engine_time"] <= 5


NO_DERIVATIVE = "has no finite derivative at the start"


@pytest.mark.parametrize("precision", ["double", "quadruple"])
@pytest.mark.parametrize("derivative", ["sqrt(s)", "asin(1 - s)", "s^1.5"])
def test_a_derivative_without_derivative_at_the_start_is_refused(derivative: str, precision: str) -> None:
    state = f'[[states]]\nname = "s"\nderivative = "{derivative}"\n'
    said = refused(state, precision=precision)
    assert f'[[states]] number 1 derivative: "{derivative}" {NO_DERIVATIVE} (s = 0.0)' in said
    assert "start elsewhere" in said


def test_roots_of_zero_at_the_start_are_refused_wherever_they_stand() -> None:
    torque = '[[loads]]\nkind = "torque"\ncomponents = ["sqrt(t - 2)", "-sqrt(wx^2 + psi^2)", 0]\n'
    event = '[[events]]\nname = "e"\nexpression = "sqrt(wx) - 1"\n'
    motor = '[[rotors]]\nname = "r"\naxis = [0, 0, 1]\nmoment = 0.1\ntorque = "sqrt(wy - 1/2)"\n'
    said = refused(torque + event + motor)
    assert f'components[0]: "sqrt(t - 2)" {NO_DERIVATIVE} (t = 2.0)' in said
    assert f'"-sqrt(wx^2 + psi^2)" {NO_DERIVATIVE} (psi = 0.0, wx = 0.0)' in said
    assert f'[[events]] number 1 expression: "sqrt(wx) - 1" {NO_DERIVATIVE}' in said
    assert f'[[rotors]] number 1 torque: "sqrt(wy - 1/2)" {NO_DERIVATIVE}' in said
    moved = SCENE.replace("[1, 2, 3]", '["1 + sqrt(t - 2)/20", 2, 2.5]')
    with pytest.raises(ConfigError, match="principal_moments"):
        rigidsim.run(rigidsim.parse(moved.format(initial="", loads="", precision="double")), out=None)
