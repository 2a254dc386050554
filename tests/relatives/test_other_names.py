"""Loads asked for by names of other programs: each answer names the key or page of it here."""

import random
import re
from pathlib import Path

import pytest
from support import config, seeds

import rigidsim
from rigidsim.scene.registry import LOADS
from rigidsim.scene.scope import NAMED_OTHERWISE
from rigidsim.workflows.ready_scenes import ready_scenes

ROOT = Path(__file__).parents[2]
WANTED = {
    "[[rotors]]": "reaction_wheel momentum_wheel flywheel wheel gyrostat control_moment_gyro cmg vscmg",
    "magnetic_dipole": "magnetorquer torque_rod coil magnet residual_dipole bdot geomagnetic_field igrf",
    "are a hysteresis_rod": "hysteresis magnetic_hysteresis permeable_rod",
    "figure = {J2": "j2 oblateness zonal_harmonic j2_perturbation",
    "gravity_field": "spherical_harmonic geopotential gravity_model egm96 egm2008",
    "[[bodies]]": "third_body perturber point_mass lunisolar third_body_perturbation",
    "is a drag": "atmospheric_drag air_drag aerodynamic_drag aero_drag atmosphere air nrlmsise00",
    "radiation_pressure": "solar_radiation_pressure srp solar_pressure light_pressure sunlight solar_sail",
    "uniform_gravity is a weight": "gravity gravitation gravitational_torque",
    "central_gravity": "two_body kepler newtonian_gravity earth_gravity",
    "[body] elasticity": "tide tidal_torque",
    "viscous_torque": "damping damper nutation_damper viscous_damping",
    "eddy_currents": "eddy_current eddy",
    "[[states]]": "controller control pid_control pd attitude_control motor spring",
    "mass_loss": "jet_damping mass_flow",
    "is_force": "external_force applied_force",
    "a thruster is a force": "thruster thrust engine",
}
NAMES = [(name, said) for said, names in WANTED.items() for name in names.split()]


def refusal(kind: str) -> str:
    with pytest.raises(rigidsim.ConfigError) as caught:
        rigidsim.parse(config(loads=f'kind = "{kind}"'))
    return str(caught.value)


@pytest.mark.parametrize("seed", seeds(1, 70))
def test_a_load_is_found_by_other_names(seed: int) -> None:
    """In capitals, in the plural, with hyphens or spaces."""
    draw = random.Random(seed)
    for name, said in draw.sample(NAMES, 12):
        asked = name + draw.choice(["", "s"])
        asked = draw.choice(
            [asked, asked.upper(), asked.title(), asked.replace("_", "-"), asked.replace("_", " ")]
        )
        found = refusal(asked)
        assert said.replace("is_force", "body is force") in found, asked
        assert "sensors and chance" not in found


def test_what_answers_name_is_there() -> None:
    kinds, said = "|".join(LOADS["kind"]), " ".join(NAMED_OTHERWISE)
    assert all((ROOT / page).is_file() for page in re.findall(r"docs/[\w/]+\.md", said))
    assert set(re.findall(r"rigidsim new (\w+)", said)) <= set(ready_scenes())
    assert len(set(re.findall(kinds, said))) >= 8
    names = [name for every in NAMED_OTHERWISE.values() for name in every]
    assert len(names) == len(set(names)) > 100
    assert not set(names) & set(LOADS["kind"])
