"""Announced errors under a kernel: followed through its blocks, at a part of the run's cost, and true."""

import pytest
from kernel_scenes import moon, satellite
from support import angle_between, assert_announced, config, loaded, run_estimated, run_text, unoptimised_code

START = (
    "euler_angles = [0.005, 0.382, 1.294]\n"
    'angular_velocity = ["4.58e-5 rad/day", "-2.19e-6 rad/day", "0.22994 rad/day"]'
)


def turning(days: int, more: str = "") -> str:
    body = f"principal_moments = [8.7899e34, 8.7919e34, 8.7955e34]\n{more}"
    text = moon(body=body, start=START, time=f'end = "{days} day"\nsamples = 201')
    return text + 'record = ["angular_velocity", "quaternion"]\n'


TUMBLING = config(
    'principal_moments = [1, 2, 2.5]\nhost = "earth"',
    "angular_velocity = [1e-4, 2e-5, 3e-4]",
    [f'kind = "gravity_gradient"\nsource = "{name}"' for name in ("moon", "sun")],
    'epoch = "1983-07-20T12:00:07 TDB"\nend = "{days} day"\nsamples = 201',
    more='[ephemeris]\nkernel = "de421"',
)
SCENES = [
    turning(400),
    turning(500, "core = {moment = 0.001, flattening = 2e-4}"),
    TUMBLING.format(days=10),
    TUMBLING.format(days=30),
    satellite(("earth", "moon")).replace("samples = 3", "samples = 201"),
    turning(1000) + '[integrator]\nformulation = "canonical"\n',
]


@pytest.mark.slow
@unoptimised_code()
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
