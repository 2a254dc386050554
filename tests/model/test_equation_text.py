"""Equations as they are written out: the same numbers as what is compiled, and nothing twice."""

from __future__ import annotations

import math
import re

import heyoka as hy
import numpy as np
import pytest

import rigidsim
from rigidsim.cli.screens.equations import MOST, print_equations, shortened
from rigidsim.cli.screens.page import Page
from rigidsim.model.equation_text import equation_texts
from rigidsim.solve.problem import prepare

SCENES = ["kovalevskaya_top", "satellite_libration", "mars_precession", "earth_precession_averaged"]


def value(text: str, known: dict[str, float]) -> float:
    """Of a line's right-hand side, by Python's arithmetic."""
    functions = {"sin": math.sin, "cos": math.cos, "sqrt": math.sqrt}
    return float(eval(text.replace("^", "**"), {"__builtins__": {}}, {**functions, **known}))


@pytest.mark.parametrize("name", SCENES)
def test_what_is_written_is_what_is_integrated(name: str) -> None:
    system = prepare(rigidsim.load(f"configs/{name}.toml")).system
    shared, lines = equation_texts(system.equations)
    variables = [variable for variable, _ in system.equations]
    state, time = np.random.default_rng(7).uniform(0.2, 1.0, len(variables)), 0.7
    function = hy.cfunc([right for _, right in system.equations], variables)
    wanted = function(state, time=time) if function.is_time_dependent else function(state)
    known = {str(variable): float(x) for variable, x in zip(variables, state, strict=True)} | {"t": time}
    for line in shared:
        symbol, _, text = line.partition(" = ")
        assert symbol not in known
        known[symbol] = value(text, known)
    found = {line.partition("' = ")[0]: value(line.partition("' = ")[2], known) for line in lines}
    assert list(found) == [str(variable) for variable in variables]
    # all digits are there: what is left is rounding, in another order
    np.testing.assert_allclose(list(found.values()), wanted, rtol=1e-13, atol=1e-30)
    for text in [line.partition(" = ")[2] for line in shared]:
        assert sum(text in line for line in [*shared, *lines]) == 1


def test_long_equations_are_whole_and_short() -> None:
    """heyoka's own text of Mars' equations ends after a thousand characters each."""
    system = prepare(rigidsim.load("configs/mars_precession.toml")).system
    assert any(str(right).endswith("...") for _, right in system.equations)
    shared, lines = equation_texts(system.equations)
    assert max(map(len, [*shared, *lines])) < 250


def test_operations_keep_their_meaning() -> None:
    x, y = hy.make_vars("x", "y")
    cases = [
        (x - (y - 2.0), 3.0 - (5.0 - 2.0)),
        (x / (y / 2.0), 3.0 / (5.0 / 2.0)),
        (-(x**2.0) * -3.0, 27.0),
        ((x + y) ** -2.0, 8.0**-2),
        (x ** (y - 3.0), 9.0),
        (hy.sin(x * y) * (x - y) / (x + y), math.sin(15.0) * -2 / 8),
        (hy.expression(0.0), 0.0),
        (y, 5.0),
        (0.1 * (0.3 * x), 0.1 * 0.3 * 3),
    ]
    for expression, wanted in cases:
        shared, lines = equation_texts([(x, expression), (y, expression)])
        known = {"x": 3.0, "y": 5.0}
        for line in shared:
            known[line.partition(" = ")[0]] = value(line.partition(" = ")[2], known)
        assert value(lines[0].partition(" = ")[2], known) == pytest.approx(wanted, rel=1e-15)


def test_numbers_on_the_screen_have_six_digits(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "110")
    assert shortened("wx' = 0.66666666666666663*wy - 1.29857290206803e-08*u7^2 + x_1") == (
        "wx' = 0.666667*wy - 1.29857e-08*u7^2 + x_1"
    )
    print_equations(
        ["u1 = 1"], [f"x{k}' = " + " + ".join(["0.123456789*y"] * 30) for k in range(MOST)], Page()
    )
    said = capsys.readouterr().out.splitlines()
    assert len(said) == MOST + 2
    assert max(map(len, said)) <= Page().width
    assert re.fullmatch(r"  and \d+ more lines; `--json` has all of them, with all digits", said[-1])
