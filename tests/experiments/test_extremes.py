"""At the edges of what numbers hold, a run is right, says how wrong it is, or is refused with a message."""

from support import config
from support import run_estimated as run_text


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
