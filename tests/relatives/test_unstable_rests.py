"""Runs that begin at an unstable rest, in more than double precision: no false small error is announced.

The truth: the body turns steadily, or rests, for ever, by a closed form. Rounding of the digits given makes
it leave, e-fold by e-fold, and sooner in fewer bits; where it arrives errors no longer grow, so that whoever
follows it in double precision sees none.
"""

import math

import mpmath
import numpy as np
import pytest
from support import config, run_estimated, seeds

from rigidsim.scene.parts_of_values import parts_in

PRECISIONS = {'"extended"': 2.0**-63, '"quadruple"': 2.0**-112, "40": 1e-40}


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_random_torques_at_rest(seed: int) -> None:
    """Each of the angle from a steady turn, pushed off a place by k and held beyond by a cube, and damped."""
    rng = np.random.default_rng(seed)
    precision = list(PRECISIONS)[rng.integers(len(PRECISIONS))]
    place, k, d = (
        round(float(x), 5) for x in (rng.uniform(0.1, 0.9), rng.uniform(0.5, 4), rng.uniform(0, 1))
    )
    inertia = round(float(rng.uniform(0.5, 2)), 3)
    rate = -d / (2 * inertia) + math.sqrt((d / (2 * inertia)) ** 2 + k / inertia)
    end = int(math.log(10 ** rng.uniform(-8, -4) / PRECISIONS[precision]) / rate)
    spin = int(rng.integers(2))  # without one nothing but the run's length shows how fast anything may become
    law = f"{k}*lean - 9*(lean - {place})^3 - {round(k * place, 10)} - {d}*(wx - {spin})"
    if rng.integers(2):  # a controller's saturation, which isn't reached
        law = f"max(-1e3, min(1e3, {law}))"
    text = config(
        f"principal_moments = [{inertia}, 3, 3.1]",
        f"angular_velocity = [{spin}, 0, 0]",
        f'kind = "torque"\ncomponents = ["{law}", 0, 0]',
        f"end = {end}\nsamples = 2",
        f"precision = {precision}",
        more=f'[[states]]\nname = "lean"\nderivative = "wx - {spin}"\ninitial = {place}\n',
    )
    run = run_estimated(text)
    with run.dataset as data, mpmath.workdps(50):
        half = spin * mpmath.mpf(float(data["time"][-1])) / 2
        found = [data[part].values[-1] for part in parts_in(data, "quaternion")]
        steady = [mpmath.cos(half), mpmath.sin(half), 0, 0]
        apart = [
            mpmath.fsum(map(float, x)) - y for x, y in zip(zip(*found, strict=True), steady, strict=True)
        ]
        true = 2 * float(mpmath.norm(apart))
    assert true <= 3 * run.summary["accuracy"]["estimated_attitude_error"]
