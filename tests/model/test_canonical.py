"""The canonical formulation: Hamilton's equations give the motion that Euler's equations give."""

from __future__ import annotations

import numpy as np
import pytest
from support import CONFIGS, Trial, amplification, angle_between, cases, law, run_text, tried

import rigidsim
from rigidsim import ConfigError
from rigidsim.scene.fields import EULER_SEQUENCES
from rigidsim.solve.problem import prepare

RECORD = 'output.record=["angular_velocity", "quaternion"]'
STABLE = (
    "asymmetric_top",
    "free_symmetric_top",
    "heavy_top_fast",
    "heavy_top_nutating",
    "heavy_top_regular_precession",
    "square_plate_corner",
    "tossed_plate",
)
SATELLITE = """
name = "satellite"
[body]
principal_moments = [1, 1.75, 2]
[initial]
angular_velocity = [0.1, 0, 1.5]
euler_angles = [0.3, 1.0, 0.2]
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {semi_major_axis = 1, eccentricity = 0.1, inclination = 0.3, node_rate = 0.01}
[time]
end = 20
samples = 201
"""


def both(text: str, *overrides: str) -> tuple[Trial, Trial]:
    return tried(text, "double", "quaternion", *overrides), tried(text, "double", "canonical", *overrides)


def fastest(text: str) -> float:
    """A bound of the absolute angular velocity, rad/s."""
    return float(prepare(rigidsim.parse(text)).system.rate_bound)


def agree(plain: Trial, canonical: Trial, rate: float, duration: float, growth: float = 0.0) -> None:
    """Within three times the law (or the motion's own growth of errors, where that is larger)."""
    steps = canonical.steps
    bound = 3 * max(law(2.0**-52, steps, rate, duration), 2.0**-53 * np.sqrt(steps) * growth)
    assert angle_between(plain.attitudes[0], canonical.attitudes[0]).max() < 4 * bound
    for drift in canonical.drifts.values():
        assert drift <= 50 * 2.0**-52 * np.sqrt(steps)


@pytest.mark.parametrize("name", cases(STABLE, list(STABLE)[:2]))
def test_ready_scenes_agree_with_the_quaternion(name: str) -> None:
    text = next(path for path in CONFIGS if path.stem == name).read_text()
    samples = prepare(rigidsim.parse(text)).scene.samples
    agree(*both(text), fastest(text), float(samples.last - samples.start))


# from an attitude in which no sequence is singular
TILTED = SATELLITE.replace("euler_angles = [0.3, 1.0, 0.2]", "quaternion = [0.7, 0.4, 0.5, 0.3]")


@pytest.fixture(scope="module")
def plain() -> Trial:
    return tried(TILTED, "double", "quaternion", "time.end=2")


@pytest.mark.parametrize("sequence", EULER_SEQUENCES[::4])
def test_every_sequence(sequence: str, plain: Trial) -> None:
    given = f'integrator.euler_sequence="{sequence}"'
    canonical = tried(TILTED, "double", "canonical", given, "time.end=2")
    agree(plain, canonical, fastest(TILTED), 2.0)


def test_a_potential_that_moves_with_an_orbit() -> None:
    agree(
        *both(SATELLITE),
        fastest(SATELLITE),
        20.0,
        amplification(rigidsim.parse(SATELLITE, overrides=[RECORD])),
    )


def test_an_ignorable_angle_has_a_constant_momentum() -> None:
    """The precession of a heavy top doesn't enter its Hamiltonian: p_phi = L_z is constant exactly."""
    path = next(path for path in CONFIGS if path.stem == "heavy_top_nutating")
    overrides = ['integrator.formulation="canonical"', 'output.record=["angular_velocity"]']
    system = prepare(rigidsim.load(path, overrides=overrides)).system
    assert system.states[:6] == ["phi", "theta", "psi", "p_phi", "p_theta", "p_psi"]
    equations = dict(zip(system.states, (str(right) for _, right in system.equations), strict=True))
    assert float(equations["p_phi"].strip("-() ")) == 0
    assert "theta" in equations["p_theta"]


def test_momenta_are_the_projections_of_the_angular_momentum() -> None:
    path = next(path for path in CONFIGS if path.stem == "asymmetric_top")
    system = prepare(rigidsim.load(path, overrides=['integrator.formulation="canonical"'])).system
    momenta = [float(np.ldexp(float(system.initial[3 + i]), system.state_exponents[3 + i])) for i in range(3)]
    phi, theta, psi = 0.0, 1.0, 0.0
    body = np.array([1, 2, 3]) * np.array([0.5, 0.25, 1.0])
    node = np.array([np.cos(psi), -np.sin(psi), 0])
    vertical = np.array([np.sin(theta) * np.sin(psi), np.sin(theta) * np.cos(psi), np.cos(theta)])
    assert phi == 0
    assert momenta == pytest.approx([body @ vertical, body @ node, body[2]], abs=1e-15)


def test_loads_without_a_potential_are_refused() -> None:
    text = """
    name = "damped"
    [body]
    principal_moments = [1, 2, 3]
    [initial]
    angular_velocity = [1, 1, 1]
    euler_angles = [0.1, 1, 0.2]
    [[loads]]
    kind = "viscous_torque"
    coefficients = [1, 1, 1]
    [time]
    end = 1
    """
    with pytest.raises(ConfigError, match='given "canonical", but viscous_torque has no potential'):
        run_text(text, 'integrator.formulation="canonical"')
