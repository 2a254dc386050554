"""Steps of motions whose series end, which could be as long as anything: what happens within is found."""

import math

import numpy as np
import pytest
from support import cases, config, run_text

THROWN = config(
    "principal_moments = [1, 1, 1]\nmass = 1",
    "angular_velocity = [0, 0, 0]\nposition = [0, 0, 10]\nvelocity = [1, 0, 3]",
    'kind = "uniform_gravity"\nacceleration = [0, 0, -10]',
    "end = 3\nsamples = 2",
    more='[[events]]\nname = "ground"\nexpression = "z"',
)
# scene 852 of seed 5 of the campaign, in round numbers; its natural step is as long as it is let to be
KINKED = config(
    "principal_moments = [3, 3, 3]",
    "angular_velocity = [0, 0, 0.026]",
    'kind = "torque"\ncomponents = ["0", "0", "3e-6*sqrt((t - 241)^2)"]',
    "end = 1738\nsamples = 3",
)


@pytest.mark.parametrize("precision", cases(["single", "extended"], ["extended"]))
def test_a_body_without_spin_is_seen_to_hit_the_ground(precision: str) -> None:
    run = run_text(THROWN, f'integrator.precision="{precision}"')
    # 10 + 3 t - 5 t^2 = 0
    exact = (3 + np.sqrt(209)) / 10
    assert run.summary["events"] == {"ground": 1}
    epsilon = max(float(np.finfo(np.float32 if precision == "single" else np.float64).eps), 0.0)
    assert run.summary["event_times"]["ground"]["first"] == pytest.approx(exact, rel=4 * epsilon)


@pytest.mark.parametrize(("precision", "formulation"), [("double", "euler_angles")])
@pytest.mark.slow
@pytest.mark.unoptimised
def test_a_kink_far_within_a_long_step_is_one_of_its_ends(precision: str, formulation: str) -> None:
    run = run_text(KINKED, f'integrator.precision="{precision}"', f'integrator.formulation="{formulation}"')
    # 3 w' = 3e-6 |t - 241|
    late, end = 241.0, 1738.0
    exact = 0.026 + 1e-6 * (late**2 + (end - late) ** 2) / 2
    epsilon = np.finfo(np.float32 if precision == "single" else np.float64).eps
    rounding = 16 * epsilon * np.sqrt(max(run.summary["cost"]["steps"], 1))
    assert run.dataset.angular_velocity.values[-1, 2] == pytest.approx(exact, rel=rounding)
    without = 0.026 + 1e-6 * end * (end / 2 - late)  # had it been stepped over
    assert abs(without - exact) > 0.04 * exact


@pytest.mark.parametrize("power", cases([1, 4], [4]))
def test_a_series_with_gaps_bounds_the_step(power: int) -> None:
    """From rest under k t^n a quaternion has every (n + 2)th term: where those are neither of the last two,
    the engine would take all in one step (4e-6 rad off by t = 4).
    """
    end, k = 4.0, 0.1
    turned = k * end ** (power + 2) / ((power + 1) * (power + 2))
    text = config(
        "principal_moments = [1, 1, 1]",
        "angular_velocity = [0, 0, 0]",
        f'kind = "torque"\ncomponents = ["0", "0", "{k}*t^{power}"]',
        f"end = {end}\nsamples = 3",
    )
    sparse, dense = run_text(text), run_text(text, "time.samples=2001")
    quaternion = sparse.dataset["quaternion"].values
    assert (quaternion == dense.dataset["quaternion"].values[::1000]).all()  # whichever way it goes
    exact = np.array([math.cos(turned / 2), 0, 0, math.sin(turned / 2)])
    # roundings of a few steps, and of an angle of some turns
    steps = sparse.summary["cost"]["steps"]
    assert np.abs(quaternion[-1] - exact).max() < 8 * 2.0**-52 * max(turned, 1.0) * math.sqrt(steps)
