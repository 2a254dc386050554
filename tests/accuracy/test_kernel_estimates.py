"""Announced errors under a kernel: followed through its blocks, at a part of the run's cost, and true."""

import pytest
from support import angle_between, assert_announced, loaded, run_estimated, run_text

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
