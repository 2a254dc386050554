"""Runs that break down: the status, the reason in words, and the good samples kept.

Euler angles in canonical form, which have no other chart to change to, break down in their singularity. For
the sequence xyz, whose middle angle is singular at 90 degrees, a body that turns about its y axis with psi =
offset passes it at a distance of about ``offset``: phi and psi then turn by half a turn within a time of
offset / |w|, and a Taylor step is about e^-2 of that.
"""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import cases

import rigidsim

Config = Callable[..., str]
Command = Callable[..., Any]

START = 0.1  # theta at the start, rad; the singularity is reached at t = pi/2 - 0.1 s
REACHED = math.pi / 2 - START


def into_singularity(config: Config, offset: float, precision: str, form: str = "canonical") -> str:
    aside = offset / 1000  # rad/s, so that each of the momenta has digits of its own
    return config(
        time="end = 3\nsamples = 301",
        integrator=f'precision = "{precision}"\nformulation = "{form}"\neuler_sequence = "xyz"',
        rest='record = ["angular_velocity", "quaternion", "euler_angles", "angular_momentum"]',
        body="principal_moments = [1, 2, 3]",
        initial=f"angular_velocity = [0, 1, {aside}]\neuler_angles = [0.3, {START}, {offset}]",
    )


BREAKDOWNS = {
    # float32 ends at 3e38: dH/dtheta goes with distance^-3, its coefficients of order 11 with distance^-14
    "single": (1e-6, "stopped: non-finite state", "the state stopped being finite", 3e38 ** (-1 / 14)),
    # the distance is below the spacing of numbers near 90 degrees (1.1e-19): no step gets on
    "extended": (1e-20, "stopped: step size collapsed", "the steps became too small", 1e-17),
}


@pytest.mark.parametrize("precision", cases(BREAKDOWNS, list(BREAKDOWNS)[:1]))
def test_euler_angles_break_down_in_their_singularity(
    precision: str, config: Config, rigidsim_command: Command
) -> None:
    offset, status, words, nearest = BREAKDOWNS[precision]
    result = rigidsim_command("run", into_singularity(config, offset, precision))
    assert result.exit_code == 3
    assert isinstance(result.exception, SystemExit)
    summary = json.loads(Path("runs/free/summary.json").read_text())
    assert summary["status"] == status
    assert summary["exit_code"] == 3
    message = summary["message"]
    assert message.startswith(words)
    assert "the middle Euler angle theta = 1.570" in message
    assert "of the singularity of xyz" in message
    assert 'choose formulation = "quaternion"' in message
    assert ("exceed the range of single precision" in message) == (precision == "single")
    assert (
        f"last good state at {summary['engine_time']:.9g} s after {summary['cost']['steps']} steps" in message
    )
    assert message in result.stderr
    near = float(message.split("came within ")[1].split()[0])
    assert near < nearest  # rad, of 90 degrees
    # at about a radian per second, of which the summary has a double
    assert summary["engine_time"] == pytest.approx(REACHED, rel=2.0**-52, abs=nearest)

    run = rigidsim.open_run("runs/free")
    assert not run.folder.segments.exists()
    with run.dataset as dataset:
        assert dataset.attrs["status"] == status
        assert dataset.attrs["status_message"] == message
        count = dataset.sizes["time"]
        # every sample up to the last good state: t = i / 100
        assert count == summary["samples"] == math.floor(summary["engine_time"] * 100) + 1
        assert all(np.isfinite(dataset[name]).all() for name in dataset.data_vars)
        epsilon = 2.0**-23 if precision == "single" else 2.0**-52
        # theta = 0.1 + t until phi and psi turn over, since psi is tiny: second order in the offset,
        # and rounding of some steps
        np.testing.assert_allclose(
            dataset.euler_angles[:, 1], START + np.arange(count) / 100, rtol=0, atol=100 * epsilon
        )
    info = rigidsim_command("info", "runs/free")
    assert info.exit_code == 0
    assert status in info.stdout
    advised = into_singularity(config, offset, precision, form="quaternion")
    assert rigidsim_command("run", advised, "--force").exit_code == 0
