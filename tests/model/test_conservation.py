"""Every load with a potential keeps what it must, in double and in 80-bit arithmetic.

A good integration lets an invariant wander like a random walk of its steps' roundings: 50 eps sqrt(steps),
relative to the invariant's scale, leaves each step some tens of them (Brouwer 1937).
"""

from __future__ import annotations

import math

import pytest
from support import EPSILON, config, run_text, tried

import rigidsim
from rigidsim.solve.problem import prepare

ASYMMETRIC, SYMMETRIC = (
    "principal_moments = [1, 1.75, 2]\nmass = 1",
    "principal_moments = [1, 1, 1.5]\nmass = 1",
)
TURNING = "angular_velocity = [0.3, 0.9, 0.4]\nquaternion = [0.7, 0.4, 0.5, 0.3]"
FLYING = TURNING + "\nposition = [1.5, 0.2, 0]\nvelocity = [-0.1, 0.85, 0.3]"
GRAVITY = 'kind = "uniform_gravity"\nacceleration = [0, 0.5, -2]'
GRADIENT = 'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
CIRCLE = "semi_major_axis = 1, inclination = 0.4, ascending_node = 0.3, mean_anomaly = 0.2"
CENTRAL = 'kind = "central_gravity"\ngravitational_parameter = 1'
VERTICAL = "angular_momentum_vertical"

# body, start, load, what is kept
SCENES: dict[str, tuple[str, str, str, set[str]]] = {
    "heavy body about a fixed point": (
        ASYMMETRIC + "\ncenter_of_mass = [0.3, 0.1, 0.5]", TURNING, GRAVITY, {"energy", VERTICAL},
    ),
    "heavy symmetric top": (
        SYMMETRIC + "\ncenter_of_mass = [0, 0, 0.5]", TURNING, GRAVITY,
        {"energy", VERTICAL, "angular_momentum_axial"},
    ),
    "free flight in uniform gravity": (
        ASYMMETRIC, FLYING, GRAVITY,
        {
            "energy", "rotational_energy", "angular_momentum", "angular_momentum_norm",
            "linear_momentum_horizontal",
        },
    ),
    "fixed source": (
        ASYMMETRIC, TURNING, GRADIENT + "position = [1, 0.5, 0.3]",
        {"energy", "angular_momentum_source", "brun_constant"},
    ),
    "circular orbit": (ASYMMETRIC, TURNING, GRADIENT + f"orbit = {{{CIRCLE}}}", {"jacobi_constant"}),
    "circular orbit with a moving periapsis": (
        ASYMMETRIC, TURNING, GRADIENT + f"orbit = {{{CIRCLE}, periapsis = 1, periapsis_rate = 0.25}}",
        {"jacobi_constant"},
    ),
    "circular orbit in the plane of reference with a moving node": (
        ASYMMETRIC, TURNING, GRADIENT + "orbit = {semi_major_axis = 1, node_rate = -0.25}",
        {"jacobi_constant"},
    ),
    "central gravity": (
        "principal_moments = [0.01, 0.0175, 0.02]\nmass = 1", FLYING, CENTRAL,
        {"energy", "total_angular_momentum"},
    ),
    "Kovalevskaya's top": (
        "principal_moments = [2, 2, 1]\nmass = 1\ncenter_of_mass = [1, 0, 0]", TURNING, GRAVITY,
        {"energy", VERTICAL, "kovalevskaya_constant"},
    ),
    "Goryachev's and Chaplygin's top": (
        "principal_moments = [4, 4, 1]\nmass = 1\ncenter_of_mass = [1, 0, 0]",
        "angular_momentum = [1.5, 0, 0]\nquaternion = [0.7, 0.4, 0.5, 0.3]",
        'kind = "uniform_gravity"\nacceleration = [0, 0, -1]',
        {"energy", VERTICAL, "goryachev_chaplygin_constant"},
    ),
}  # fmt: skip
OF_THE_FLIGHT = {"energy", "linear_momentum_horizontal"}
UNCARRIED = ["free flight in uniform gravity"]


@pytest.mark.parametrize(
    ("precision", "formulation"),
    [
        ("double", "quaternion"),
        pytest.param("double", "canonical", marks=pytest.mark.slow),
        pytest.param("extended", "quaternion", marks=pytest.mark.slow),
        pytest.param("extended", "canonical", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("name", SCENES)
def test_invariants_are_kept(name: str, formulation: str, precision: str) -> None:
    body, start, load, expected = SCENES[name]
    text = config(body, start, load, "end = 20\nsamples = 101")
    assert {i.name for i in prepare(rigidsim.parse(text)).system.invariants if not i.numerical} == expected
    trial = tried(text, precision, formulation)
    # a trial records the attitude alone, so that it needn't carry a path that no torque depends on
    assert trial.drifts.keys() >= expected - (OF_THE_FLIGHT if name in UNCARRIED else set())
    bound = 50 * EPSILON[precision] * math.sqrt(trial.steps)
    for invariant, drift in trial.drifts.items():
        assert drift <= bound, invariant
    assert any(drift > 0 for drift in trial.drifts.values())


@pytest.mark.parametrize("precision", ["double", "extended"])
@pytest.mark.parametrize("name", UNCARRIED)
def test_energy_of_a_flight_is_kept(name: str, precision: str) -> None:
    text = config(*SCENES[name][:3], "end = 20\nsamples = 101", f'precision = "{precision}"')
    run = run_text(text, 'output.record=["position", "energy"]')
    row = run.summary["invariants"]["energy"]
    assert 0 < row["largest_drift"] <= 50 * EPSILON[precision] * math.sqrt(run.summary["cost"]["steps"])
