"""A run, a sweep and a fit, made by commands, for the tests of what other commands do with them."""

from pathlib import Path
from typing import Any

import support
from typer.testing import CliRunner

from rigidsim.cli.app import app

FIT = """[fit]
parameters = ["initial.angular_velocity[0]"]
[[fit.data]]
file = "seen.csv"
observable = "angular_velocity"
columns = ["x", "y", "z"]
sigma = 0.01"""
AXES = "[sweep]\naxes.'initial.angular_velocity[0]' = {values = [0.1, 0.2]}"
LOAD = "[[loads]]\nkind = 'torque'\ncomponents = [1e-3, 0, 0]"


def called(line: list[str]) -> Any:
    result = CliRunner().invoke(app, line, prog_name="rigidsim")
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exc_info
    return result


def make() -> None:
    """Write configs, their tables and data into the current folder, and what is made of them."""
    for name, more in {"swept": AXES, "watched": FIT, "pushed": LOAD}.items():
        Path(f"{name}.toml").write_text(support.config(more=more, name=name))
    Path("free.toml").write_text(support.config(time='times = "moments.csv"', name="free"))
    Path("moments.csv").write_text("time\n" + "\n".join(f"{n / 8}" for n in range(33)) + "\n")
    Path("seen.csv").write_text("time,x,y,z\n0,0.1,1,0.05\n0.1,0.1,1,0.05\n")
    Path("clock.tsc").write_text("no kernel")
    Path("other").write_text("of somebody else")
    for line in ("run free.toml", "sweep swept.toml", "fit watched.toml"):
        assert called(line.split()).exit_code == 0, line
    assert called(["export", "runs/free", "--format", "csv", "--out", "theirs.csv"]).exit_code == 0
