"""The canonical formulation: Hamilton's equations give the motion that Euler's equations give."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support import CONFIGS, amplification, angle_between, law, run_text

import rigidsim
from rigidsim.errors import ConfigError
from rigidsim.prepare import prepare
from rigidsim.scene.schema import EULER_SEQUENCES

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


def both(experiment_text: str, out: Path, *overrides: str) -> tuple[rigidsim.Run, rigidsim.Run]:
    plain = run_text(experiment_text, out, RECORD, 'name="plain"', *overrides)
    canonical = run_text(
        experiment_text, out, RECORD, 'name="canonical"', 'integrator.formulation="canonical"', *overrides
    )
    return plain, canonical


def agree(plain: rigidsim.Run, canonical: rigidsim.Run, growth: float = 0.0) -> None:
    """Within three times the law (or the motion's own growth of errors, where that is larger)."""
    assert not canonical.summary["warnings"]
    q, c = plain.dataset, canonical.dataset
    rate = float(np.sqrt((q["angular_velocity"].values ** 2).sum(axis=1)).max())
    steps = canonical.summary["cost"]["steps"]
    bound = 3 * max(law(2.0**-52, steps, rate, float(q["time"][-1])), 2.0**-53 * np.sqrt(steps) * growth)
    assert angle_between(q["quaternion"].values, c["quaternion"].values).max() < 4 * bound
    for row in canonical.summary["invariants"].values():
        assert row["largest_drift"] <= row["bound"]


@pytest.mark.parametrize("name", STABLE)
def test_ready_scenes_agree_with_the_quaternion(name: str, runs: Path) -> None:
    text = next(path for path in CONFIGS if path.stem == name).read_text()
    plain, canonical = both(text, runs)
    assert canonical.summary["states"][:6] == ["phi", "theta", "psi", "p_phi", "p_theta", "p_psi"]
    agree(plain, canonical)


@pytest.mark.parametrize("sequence", EULER_SEQUENCES)
def test_every_sequence(sequence: str, runs: Path) -> None:
    text = SATELLITE.replace("euler_angles = [0.3, 1.0, 0.2]", "quaternion = [0.7, 0.4, 0.5, 0.3]")
    plain, canonical = both(text, runs, f'integrator.euler_sequence="{sequence}"', "time.end=2")
    agree(plain, canonical)


def test_a_potential_that_moves_with_an_orbit(runs: Path) -> None:
    agree(*both(SATELLITE, runs), growth=amplification(rigidsim.parse(SATELLITE, overrides=[RECORD])))


def test_an_ignorable_angle_has_a_constant_momentum() -> None:
    """The precession of a heavy top doesn't enter its Hamiltonian: p_phi = L_z is constant exactly."""
    path = next(path for path in CONFIGS if path.stem == "heavy_top_nutating")
    overrides = ['integrator.formulation="canonical"', 'output.record=["angular_velocity"]']
    system = prepare(rigidsim.load(path, overrides=overrides)).system
    equations = dict(zip(system.states, (str(right) for _, right in system.equations), strict=True))
    assert float(equations["p_phi"].strip("-() ")) == 0
    assert "theta" in equations["p_theta"]


def test_momenta_are_the_projections_of_the_angular_momentum(runs: Path) -> None:
    path = next(path for path in CONFIGS if path.stem == "asymmetric_top")
    system = prepare(rigidsim.load(path, overrides=['integrator.formulation="canonical"'])).system
    momenta = [float(np.ldexp(float(system.initial[3 + i]), system.state_exponents[3 + i])) for i in range(3)]
    phi, theta, psi = 0.0, 1.0, 0.0
    body = np.array([1, 2, 3]) * np.array([0.5, 0.25, 1.0])
    node = np.array([np.cos(psi), -np.sin(psi), 0])
    vertical = np.array([np.sin(theta) * np.sin(psi), np.sin(theta) * np.cos(psi), np.cos(theta)])
    assert phi == 0
    assert momenta == pytest.approx([body @ vertical, body @ node, body[2]], abs=1e-15)


def test_loads_without_a_potential_are_refused(runs: Path) -> None:
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
        run_text(text, runs, 'integrator.formulation="canonical"')
