"""Every documented function of time, the state and swept numbers: no combination ends in a traceback."""

from __future__ import annotations

import random
import re
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import rigidsim
from rigidsim import RigidsimError
from rigidsim.cli.app import app
from rigidsim.scene.expressions.tree import FUNCTIONS, PIECEWISE

FAULTS = Path(__file__).parents[1] / "data" / "faults"
DOCUMENTED = Path(__file__).parents[2] / "docs" / "expressions.md"
SCENE = """name = "functions"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.1, 1, 0.2]
euler_angles = [0.1, 0.7, 0.2]
[parameters]
k = 1
[[loads]]
kind = "torque"
components = ["0.01*({torque})", "0", "0"]
[integrator]
formulation = "{formulation}"
[time]
end = 2
samples = 3
[output]
timeline = false
"""


SWEPT = """[sweep]
keep = ["final"]
batch = {batch}
axes."parameters.k" = {{values = [1, 1.5, 2]}}
"""
ONE = [name for name, count in {**FUNCTIONS, **PIECEWISE}.items() if count == 1]


def test_every_function_is_documented() -> None:
    named = set(re.findall(r"^\| `(\w+)\(", DOCUMENTED.read_text(), re.M))
    assert named == {*FUNCTIONS, *PIECEWISE}


@pytest.mark.slow
def test_a_swept_parameter_within_a_function_of_time(tmp_path: Path) -> None:
    text = (FAULTS / "sweep_parameter_crash.toml").read_text()
    path = tmp_path / "swept.toml"
    path.write_text(text)
    assert CliRunner().invoke(app, ["check", str(path)]).exit_code == 0
    found = rigidsim.sweep(rigidsim.load(path), out=tmp_path).dataset["quaternion_final"].values
    for n, k in enumerate((1, 2, 3, 4)):
        single = rigidsim.parse(
            text.split("[sweep]")[0], overrides=[f"parameters.k={k}", "output.estimate=false"]
        )
        alone = rigidsim.run(single, out=None).dataset["quaternion"].values[-1]
        assert np.abs(np.squeeze(found[n]) - alone).max() <= 1e-14  # rounding of some twenty steps


def test_what_has_no_value_is_refused() -> None:
    """Or no series: sqrt(t) has a value at t = 0."""
    for torque, words in (
        ("-0.1*wrap(psi)", "reads psi, which the start leaves open"),
        ("sqrt(-t)", "no finite value after t = 0"),
        ("log(2 - t)", "no finite value after t = 2.0 s"),
    ):
        text = (FAULTS / "wrap_crash.toml").read_text().replace("-0.1*wrap(psi)", torque)
        with pytest.raises(rigidsim.ConfigError, match=words):
            rigidsim.run(rigidsim.parse(text), out=None)
    with pytest.raises(rigidsim.ConfigError, match="no finite derivative at the start"):
        rigidsim.run(rigidsim.parse(SCENE.format(torque="sqrt(t)", formulation="quaternion")), out=None)


def _argument(generator: random.Random) -> str:
    name = generator.choice(["t", "t", "wx", "wz", "qx*qy", "phi", "theta", "psi", "t*wz"])
    form = generator.choice(
        ["{n}", "k*{n}", "{n} - k", "k - {n}", "({n} - k)/0.01", "({n} - k)^2", "-{n}", "k"]
    )
    return form.format(n=name)


def _torque(generator: random.Random) -> str:
    argument = _argument(generator)
    return generator.choice(
        [f"{generator.choice(ONE)}({argument})"] * 6
        + [
            f"1/({argument})",
            f"1/(1 + ({argument})^2)",
            f"exp(-({argument})^2)",
            f"pulse({argument}, 0.3, k)",
        ]
        + [f"{name}({argument}, {_argument(generator)})" for name in ("min", "max", "atan2")]
        + [f"({argument})^{power}" for power in ("3", "-2", "0.5", "20")]
        + [f"{generator.choice(ONE)}({generator.choice(ONE)}({argument}))"]
    )


def _tried(number: int, folder: Path) -> None:
    """Run, sweep, check and plan one random torque: each ends, or is refused in words."""
    generator = random.Random(number)
    formulation = generator.choice(["auto", "quaternion", "euler_angles", "rotation_matrix"])
    # (2 t)^20 makes it spin at 1e9 rad/s
    text = SCENE.format(torque=_torque(generator), formulation=formulation) + "[limits]\nwall_time = 0.5\n"
    swept = text + SWEPT.format(batch=generator.choice(["true", "false"]))
    path = folder / "tried.toml"
    path.write_text(swept)
    CliRunner().invoke(app, ["check", str(path)], catch_exceptions=False)
    for action in (
        lambda: rigidsim.run(rigidsim.parse(text), out=None),
        lambda: rigidsim.sweep(rigidsim.parse(swept), out=folder, force=True),
        lambda: CliRunner().invoke(app, ["plan", str(path)], catch_exceptions=False),
    ):
        with suppress(RigidsimError):  # anything else fails the test
            action()


@pytest.mark.slow
def test_functions_end_in_no_traceback(tmp_path: Path) -> None:
    for number in range(4):
        _tried(number, tmp_path)
