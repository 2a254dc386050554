"""The end of a run's screen: verdict, advice, what to do next, in eighty columns."""

import json
from collections.abc import Callable
from typing import Any

import pytest

Config = Callable[..., str]
Command = Callable[..., Any]
NEXT = """next     rigidsim resume runs/free
         rigidsim info runs/free   (invariants, start, cost by phase)
"""


def test_a_run_that_a_guard_stopped_is_resumed_next(
    config: Config, rigidsim_command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    shown = rigidsim_command("run", config(), "--set", "limits.max_steps=1").stdout
    assert NEXT in shown
    assert "advice" not in shown


# ---- what was understood of a config is echoed in units that show a mistake at once


@pytest.fixture
def degrees(config: Config) -> str:
    return config(initial="angular_velocity = [0.1, 1, 0.05]\neuler_angles = [40, 60, 30]")


def test_run_and_info_and_plan_say_it(degrees: str, rigidsim_command: Command) -> None:
    ran = rigidsim_command("run", degrees, "--verbose")
    assert "rigidsim: warning: free.toml: [initial] euler_angles: given 40, 60, 30" in ran.stderr
    info = rigidsim_command("info", "runs/free")
    plan = rigidsim_command("plan", degrees)
    for shown in (ran.stdout, info.stdout, plan.stdout):
        assert "start    attitude zxz 2291.83, 3437.75, 1718.87 deg" in shown
        assert '"40 deg" if degrees' in " ".join(shown.split())
    of_run = json.loads(rigidsim_command("info", "runs/free", "--json").stdout)
    of_plan = json.loads(rigidsim_command("plan", degrees, "--json").stdout)
    assert of_run["start"] == of_plan["start"]
    assert of_run["start"]["euler_angles_deg"] == pytest.approx([2291.8311805, 3437.7467708, 1718.8733854])
    assert of_run["body"] == of_plan["body"]
    assert of_run["time"] == of_plan["time"] == {
        "start_s": 0.0, "end_s": 3.0, "samples": 49, "every_s": 0.0625, "epoch": "", "unit": ""
    }  # fmt: skip
    assert of_run["warning_codes"][0] == of_plan["warning_codes"][0] == "angle_without_unit"
