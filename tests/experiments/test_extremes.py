"""At the edges of what numbers hold, a run is right, says how wrong it is, or is refused with a message."""

import pytest
from support import config
from support import run_estimated as run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare


def scene(
    moments: str = "[1, 2, 3]",
    rates: str = "[0.3, 1, 0.2]",
    end: str = "20",
    integrator: str = "",
    record: str = "quaternion",
) -> str:
    return config(
        f"principal_moments = {moments}",
        f"angular_velocity = {rates}\nquaternion = [4, 3, 2, 1]",
        time=f"end = {end}\nsamples = 3",
        integrator=integrator,
        output=f'record = ["{record}"]',
    )


def test_rates_without_an_attitude_say_that_their_digits_are_gone() -> None:
    text = scene(rates="[1e-15, 1, 1e-15]", end="400", record="angular_velocity")
    run = run_text(text, 'integrator.formulation="rates"')
    assert any("angular velocity is uncertain" in warning for warning in run.summary["warnings"])
    assert run.summary["accuracy"]["estimated_attitude_error"] is None
    stable = run_text(scene(record="angular_velocity"), 'integrator.formulation="rates"')
    assert not stable.summary["warnings"]


def test_canonical_momenta_of_a_thin_rod_lose_the_ratio_of_its_moments() -> None:
    """A rounded momentum is divided by the smallest moment to give a rate."""
    text = scene("[1e-12, 1, 1]", "[0.1, 1, 0.5]", end="50")
    canonical = run_text(text, 'integrator.formulation="canonical"').summary
    quaternion = run_text(text).summary
    lost = canonical["accuracy"]["estimated_attitude_error"]
    assert lost > 1e10 * quaternion["accuracy"]["estimated_attitude_error"]  # of 1e12, in a sample or two
    assert any("digits are gone" in warning for warning in canonical["warnings"])
    assert not quaternion["warnings"]


@pytest.mark.parametrize("formulation", ["quaternion", "canonical"])
@pytest.mark.parametrize("rates", ['["5e-324", 1, 0.2]', '["1e-400", 1, "1e-400"]'])
def test_numbers_beyond_doubles_are_refused_in_every_formulation(formulation: str, rates: str) -> None:
    record = "angular_velocity"
    text = scene(rates=rates, integrator=f'formulation = "{formulation}"', record=record)
    with pytest.raises(ConfigError, match=r"\[initial\] angular_velocity: given .*check its unit"):
        prepare(rigidsim.parse(text))


@pytest.mark.parametrize("rate", ["1e-46"])
def test_numbers_beyond_single_precision_are_refused_there(rate: str) -> None:
    """A zero in their place would stay zero, where the rate itself grows beside the middle axis."""
    text = scene(rates=f'["{rate}", 1, 0]', integrator='precision = "{}"')
    prepare(rigidsim.parse(text.replace("{}", "double")))
    with pytest.raises(ConfigError, match="below the range of single"):
        prepare(rigidsim.parse(text.replace("{}", "single")))
