"""Compiled expressions against mpmath's values: each function, and powers at zero."""

import mpmath
import numpy as np
import pytest
from equations import CLOSE, derivative, prepared
from support import cases, config, run_text

from rigidsim.scene.exact import parse_number
from rigidsim.scene.expressions.names import BODY_NAMES
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import FUNCTIONS, evaluate

RATES = {"wx": 0.5, "wy": 1.0, "wz": 0.25}
ARGUMENTS = "0.7*wx - wz^3/(2 + wy)", "k^(1/3)*wy"
OTHERS = "2*wx^3 - wy/3", "(wx + 1e-3)^-2.5*pi", "-wx*wy*-wz/7.25^0.5"


SMOOTH = sorted(set(FUNCTIONS) - {"atan2"})  # whose cut is a switching surface


PAIRS = [SMOOTH[n : n + 2] for n in range(0, len(SMOOTH), 2)]


@pytest.mark.parametrize("names", cases(PAIRS, PAIRS[::3], daily=4), ids="-".join)
def test_what_is_compiled_is_mpmaths_value_within_rounding(names: list[str]) -> None:
    """Of a sphere of unit inertia, whose rates change as the torque says."""
    texts = [f"{name}({', '.join(ARGUMENTS[: FUNCTIONS[name]])})" for name in names]
    texts += OTHERS[: 3 - len(texts)]
    load = f'kind = "torque"\ncomponents = {texts}'.replace("'", '"')
    spin = f"angular_velocity = {list(RATES.values())}"
    system = prepared(
        "principal_moments = [1, 1, 1]", spin, load, '["angular_velocity"]', parameters='k = "1/3"'
    ).system
    state = np.zeros(len(system.states))
    state[:3] = list(RATES.values())
    known = {"k": parse_number("1/3", "1")}
    with mpmath.workdps(50):
        values = {key: mpmath.mpf(value) for key, value in RATES.items()}
        exact = [
            float(evaluate(parse_expression(text, BODY_NAMES, parameters=known), values, mpmath.mp))
            for text in texts
        ]
    np.testing.assert_allclose(derivative(system, state)[:3], exact, rtol=CLOSE)


@pytest.mark.parametrize("power", [1, 4, 5, 16])
def test_whole_powers_have_a_taylor_series_at_zero(power: int) -> None:
    """w' = t^n from rest gives w(1) = 1/(n+1); heyoka's own t**n is NaN at zero for n > 2. Powers up to the
    method's order, 20 in double: from zero it can't see the first n derivatives vanish.
    """
    load = f'kind = "torque"\ncomponents = ["t^{power}", 0, 0]'
    rest = "angular_velocity = [0, 0, 0]"
    run = run_text(config("principal_moments = [1, 1, 1]", rest, load, "end = 1\nsamples = 2"))
    assert abs(run.dataset["angular_velocity"].values[-1, 0] * (power + 1) - 1) < 64 * 2.0**-52
