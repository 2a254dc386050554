"""Time goes back to a single number by the one step that heyoka's own propagation would take."""

from __future__ import annotations

import numpy as np
import pytest

import rigidsim
from rigidsim.solve.assembly import assemble
from rigidsim.solve.problem import prepare

TUMBLER = """
name = "tumbler"
[body]
principal_moments = [1, 2, 3]
[initial]
angular_velocity = [0.5, 0.25, 1]
[time]
end = 1000
samples = 2
[integrator]
precision = "{precision}"
"""


@pytest.mark.parametrize("precision", ["double", "extended", "quadruple"])
def test_one_step_leads_where_a_propagation_does(precision: str) -> None:
    stepper = assemble(prepare(rigidsim.parse(TUMBLER.format(precision=precision)))).stepper
    directions = set()
    for _ in range(12):
        stepper.skip(5)
        mark, engine = stepper.mark(), stepper.integrator
        engine.propagate_until(mark.time[0])
        expected = np.array(engine.state), engine.dtime
        stepper.back_to(mark)
        assert stepper.to_whole_time()
        assert stepper.at_whole_time
        assert engine.dtime == expected[1]
        assert all(x == y for x, y in zip(engine.state, expected[0], strict=True))
        directions.add(mark.time[1] > 0)
        stepper.back_to(mark)
    assert directions == {True, False}  # forward and back
