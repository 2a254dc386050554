"""Announced errors under a kernel: followed through its blocks, at a part of the run's cost, and true."""

from __future__ import annotations

from typing import Any

import pytest
from support import angle_between, assert_announced, loaded, run_estimated, run_text

from rigidsim.solve.shadow import carriers

MOON = """
name = "moon"
[body]
principal_moments = [8.7899e34, 8.7919e34, 8.7955e34]
{core}
host = "moon"
[initial]
euler_angles = [0.005, 0.382, 1.294]
angular_velocity = ["4.58e-5 rad/day", "-2.19e-6 rad/day", "0.22994 rad/day"]
[ephemeris]
kernel = "de421"
[[loads]]
kind = "gravity_gradient"
source = "earth"
[[loads]]
kind = "gravity_gradient"
source = "sun"
[time]
epoch = "1969-06-28T00:00:00 TDB"
end = "{days} day"
samples = 201
[output]
record = ["angular_velocity", "quaternion"]
"""
TUMBLING = """
name = "tumbling"
[body]
principal_moments = [1, 2, 2.5]
host = "earth"
[initial]
angular_velocity = [1e-4, 2e-5, 3e-4]
[ephemeris]
kernel = "de421"
[[loads]]
kind = "gravity_gradient"
source = "moon"
[[loads]]
kind = "gravity_gradient"
source = "sun"
[time]
epoch = "1983-07-20T12:00:07 TDB"
end = "{days} day"
samples = 201
"""
SATELLITE = """
name = "satellite"
[body]
principal_moments = [1, 2, 2.5]
mass = 10
host = "earth"
[initial]
position = ["42164 km", 0, 0]
velocity = [0, "3.0747 km/s", "0.1 km/s"]
angular_velocity = [1e-4, 0, 2e-4]
[ephemeris]
kernel = "de421"
[[loads]]
kind = "central_gravity"
source = "earth"
[[loads]]
kind = "central_gravity"
source = "moon"
[time]
epoch = "1969-07-20T12:00:00 TDB"
end = "10 day"
samples = 201
"""
SCENES = [
    MOON.format(core="", days=400),
    MOON.format(core="core = {moment = 0.001, flattening = 2e-4}", days=500),
    TUMBLING.format(days=10),
    TUMBLING.format(days=30),
    SATELLITE,
    MOON.format(core="", days=1000) + '[integrator]\nformulation = "canonical"\n',
]


@pytest.mark.slow
def test_announced_errors_are_true() -> None:
    """The Moon with a core, without and in momenta, tumbling bodies and a flight, tight and loose."""
    truths = [
        loaded(run_text(text, 'integrator.precision="extended"'))["quaternion"].values for text in SCENES
    ]
    for tolerance in ('"auto"', "1e-9"):
        announced, true = [], []
        for text, truth in zip(SCENES, truths, strict=True):
            run = run_estimated(text, f"integrator.tolerance={tolerance}")
            announced.append(run.summary["accuracy"]["estimated_attitude_error"])
            true.append(angle_between(loaded(run)["quaternion"].values, truth).max())
        assert_announced(announced, true)


@pytest.fixture
def noted(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[float]]:
    """Of what carries shadows: code compiled, motions carried by themselves, steps taken together."""
    found: dict[str, list[float]] = {"compiled": [], "alone": [], "together": []}
    compiled, alone = carriers.BatchCarrier.__init__, carriers.StepperCarrier.__init__
    together, by_itself = carriers.BatchCarrier.advance, carriers.OwnCarrier.advance

    def compile_(self: carriers.BatchCarrier, *given: Any) -> None:
        found["compiled"].append(1)
        compiled(self, *given)

    def make(self: carriers.StepperCarrier, *given: Any) -> None:
        found["alone"].append(1)
        alone(self, *given)

    def advance(self: carriers.BatchCarrier, *given: Any) -> Any:
        went = together(self, *given)
        found["together"].append(float(went[1][0]))
        return went

    def advance_alone(self: carriers.OwnCarrier, *given: Any) -> Any:
        went = by_itself(self, *given)
        found["alone"].append(float(went[1][0]))
        return went

    monkeypatch.setattr(carriers.BatchCarrier, "__init__", compile_)
    monkeypatch.setattr(carriers.StepperCarrier, "__init__", make)
    monkeypatch.setattr(carriers.BatchCarrier, "advance", advance)
    monkeypatch.setattr(carriers.OwnCarrier, "advance", advance_alone)
    return found


@pytest.mark.parametrize("tolerance", ['"auto"', "1e-9"])
def test_motions_are_followed_side_by_side_in_long_stretches(
    noted: dict[str, list[float]], tolerance: str
) -> None:
    """Four at once, at a low order: not one by one by the run's own steps, which took four times the run."""
    run = run_estimated(MOON.format(core="", days=5000), f"integrator.tolerance={tolerance}")
    steps = run.summary["cost"]["steps"]
    assert len(noted["compiled"]) == 1
    assert not noted["alone"]
    assert sum(noted["together"]) < 2 * steps
    assert len(noted["together"]) < 50
    assert run.summary["accuracy"]["estimated_how"].endswith("over the run")
