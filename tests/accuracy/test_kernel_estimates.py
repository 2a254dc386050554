"""Announced errors under a kernel: followed through its blocks, at a part of the run's cost, and true."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support import angle_between, assert_announced, loaded, run_estimated, run_text

import rigidsim
from rigidsim.solve.problem import prepare
from rigidsim.solve.shadow import carriers
from rigidsim.solve.shadow.ensemble import PERTURBED

DAY = 86400.0
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


@pytest.mark.slow
def test_a_long_run_is_followed_in_windows(noted: dict[str, list[float]]) -> None:
    run = run_estimated(TUMBLING.format(days=2000))
    steps, accuracy = run.summary["cost"]["steps"], run.summary["accuracy"]
    assert steps > 80_000
    assert "windows" in accuracy["estimated_how"]
    assert len(noted["compiled"]) == 1
    assert not noted["alone"]
    assert sum(noted["together"]) < steps / 2


def test_a_short_run_compiles_nothing(noted: dict[str, list[float]]) -> None:
    run_estimated(MOON.format(core="", days=100))
    assert not noted["compiled"]
    assert sum(noted["alone"]) > 0


def test_code_compiled_for_shadows_goes_through_the_blocks_as_the_run_does() -> None:
    """From the start to the end in one stretch, with clocks that differ: the run's own motion."""
    text = MOON.format(core="", days=400)
    prepared = prepare(rigidsim.parse(text))
    system = prepared.system
    carrier = carriers.BatchCarrier(system, 1000, carriers.TIGHT)
    initial = np.array([float(x) for x in system.initial])
    states = np.repeat(initial[:, None, None], 1 + PERTURBED, axis=2)
    late = 1e-9 * np.arange(1 + PERTURBED)[None]
    begin, end = (np.full((1, 1), float(x)) + late for x in (prepared.clock.start, prepared.clock.at(200)))
    moved, steps, reached = carrier.advance(np.zeros(1, dtype=int), states, begin, end, np.array([10_000]))
    assert reached[0] == end[0, 0]
    assert steps[0] >= 200
    run = loaded(run_text(text))
    places = [system.states.index(name) for name in ("qw", "qx", "qy", "qz")]
    ours = moved[places, 0].T
    theirs = np.repeat(run["quaternion"].values[-1:], 1 + PERTURBED, axis=0)
    apart = angle_between(ours, theirs)
    assert apart[0] < 1e-12
    assert apart.max() < 1e-8  # who is late sees the Earth a little later


def test_a_gravity_field_is_followed_in_long_stretches(noted: dict[str, list[float]]) -> None:
    """Long expressions alone are no series of time, whose roundings last for four steps at most."""
    field = 'mass = "7.3e22 kg"\ngravity_field = {radius = "1738 km", C = {"4,1" = -5.7e-6}}'
    text = MOON.format(core=field, days=2000).replace('"earth"', '"earth"\ndegree = 4', 1)
    assert prepare(rigidsim.parse(text)).system.wide
    run_estimated(text)
    assert len(noted["together"]) < 50
