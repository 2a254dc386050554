"""Equations as they are written out: the same numbers as what is compiled, and nothing twice."""

import math

import heyoka as hy
import numpy as np
import pytest
from support import cases

import rigidsim
from rigidsim.solve.problem import prepare

SCENES = ["kovalevskaya_top", "satellite_libration", "mars_precession", "earth_precession_averaged"]


def value(text: str, known: dict[str, float]) -> float:
    """Of a line's right-hand side, by Python's arithmetic."""
    functions = {"sin": math.sin, "cos": math.cos, "sqrt": math.sqrt}
    return float(eval(text.replace("^", "**"), {"__builtins__": {}}, {**functions, **known}))


@pytest.mark.parametrize("name", cases(SCENES, SCENES[:1]))
def test_what_is_written_is_what_is_integrated(name: str) -> None:
    experiment = rigidsim.load(f"configs/{name}.toml")
    system, planned = prepare(experiment).system, rigidsim.plan(experiment, pilot_seconds=0.01)
    shared, lines = planned.shared_terms, planned.equations
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
