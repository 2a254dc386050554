"""A satellite with everything on against the same equations with heyoka alone, from other formulas."""

import pytest

from experiments import satellite_cost
from experiments.bare.satellite import Satellite
from experiments.common import simulate


@pytest.mark.slow(15)
def test_everything_on_agrees_with_a_script_of_other_formulas() -> None:
    """Field, gradients, air, light, shadow, magnet, eddy currents; the Sun sets, and faces turn away."""
    run = simulate(satellite_cost.scene(1.2), "output.estimate=false")
    found = Satellite().integrate(1.2)
    gaps = satellite_cost.apart(run, found)
    assert max(gaps.values()) < 1e-12
    assert run.steps <= 1.15 * found["steps"]
