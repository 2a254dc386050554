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
@pytest.mark.parametrize("precision", cases(["single", "extended"], ["extended"]))
def test_a_body_without_spin_is_seen_to_hit_the_ground(precision: str) -> None:
    run = run_text(THROWN, f'integrator.precision="{precision}"')
    # 10 + 3 t - 5 t^2 = 0
    exact = (3 + np.sqrt(209)) / 10
    assert run.summary["events"] == {"ground": 1}
    epsilon = max(float(np.finfo(np.float32 if precision == "single" else np.float64).eps), 0.0)
    assert run.summary["event_times"]["ground"]["first"] == pytest.approx(exact, rel=4 * epsilon)


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
