"""What was understood of a config is echoed in units that show a mistake at once."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from rigidsim.cli.screens.understood import body_text, start_text, time_text
from rigidsim.scene.config import parse
from rigidsim.scene.scene import build_scene
from rigidsim.session.understood import body_of, span_of, start_of

Config = Callable[..., str]
Command = Callable[..., Any]


def texts(body: str, initial: str, time: str, more: str = "") -> tuple[str, str, str]:
    text = f'name = "echo"\n{more}\n[body]\n{body}\n[initial]\n{initial}\n[time]\n{time}\n'
    scene = build_scene(parse(text))
    return body_text(body_of(scene)), start_text(start_of(scene)), time_text(span_of(scene))


def test_a_planet_in_days_and_dates() -> None:
    body, start, time = texts(
        'preset = "earth"',
        'angular_velocity = [0, 0, "1 turn/sidereal_day"]\nquaternion = [1, 1, 0, 0]',
        'end = "200 yr"\nevery = "20 day"\nepoch = "2000-01-01T12:00:00 TDB"',
        'integrator.euler_sequence = "xyz"',
    )
    assert body.startswith("from preset earth, mass 5.9722e+24 kg, turns about its centre of mass\n")
    assert start.startswith("attitude xyz 90, 0, 0 deg\n")
    assert start.endswith("(0.004178 deg/s, a turn in 23.93 h)")
    first, dates = time.split("\n")
    assert first == "0 to 199.973 yr, 3,653 samples, one every 20 d"
    assert dates.startswith("2000-01-01 TDB to 2199-12-")


def test_a_free_flight_has_its_place() -> None:
    _, start, time = texts(
        "principal_moments = [1, 2, 2]\nmass = 1",
        'angular_velocity = [0, 0, 0]\nposition = ["7000 km", 0, 0]\nvelocity = [0, "7.5 km/s", 0]',
        "start = 5\ntimes = [5, 6, 60]",
    )
    assert start == (
        "attitude: body axes along space axes\nangular velocity 0, 0, 0 rad/s about x, y, z\n"
        "position 7000, 0, 0 km, velocity 0, 7500, 0 m/s in space axes"
    )
    assert time == "5 s to 60 s, 3 samples, at listed times"


@pytest.fixture
def degrees(config: Config) -> str:
    return config(initial="angular_velocity = [0.1, 1, 0.05]\neuler_angles = [40, 60, 30]")


def test_run_and_info_and_plan_say_it(degrees: str, rigidsim_command: Command) -> None:
    ran = rigidsim_command("run", degrees)
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
