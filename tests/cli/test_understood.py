"""What was understood of a config is echoed in units that show a mistake at once."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from typing import Any

import pytest
from rich.console import Console

from rigidsim.cli.screens import summary as tables
from rigidsim.cli.screens.understood import body_text, start_text, time_text, understood
from rigidsim.scene.config import parse
from rigidsim.scene.scene import build_scene
from rigidsim.session.understood import body_of, span_of, start_of

Config = Callable[..., str]
Command = Callable[..., Any]


def texts(body: str, initial: str, time: str, more: str = "") -> tuple[str, str, str]:
    text = f'name = "echo"\n{more}\n[body]\n{body}\n[initial]\n{initial}\n[time]\n{time}\n'
    scene = build_scene(parse(text))
    return body_text(body_of(scene)), start_text(start_of(scene)), time_text(span_of(scene))


def test_radians_instead_of_degrees_are_seen() -> None:
    plate = 'shape = "plate"\nsize = [1, 1]\nmass = 12\nreference = "corner"'
    body, start, time = texts(
        plate, "angular_velocity = [0, 0, 2]\neuler_angles = [40, 60, 30]", "end = 120\nevery = 0.01"
    )
    assert body == (
        "from shape, mass 12 kg, centre of mass at (0.5, 0.5, 0) m from the point it turns about\n"
        "principal moments 1, 7, 8 kg m^2 about (0.7071, 0.7071, 0), (0.7071, -0.7071, 0), -z"
    )
    assert start == (
        "attitude zxz 2291.83, 3437.75, 1718.87 deg\n"
        "angular velocity 0, 0, 2 rad/s about x, y, z (114.6 deg/s, a turn in 3.142 s)"
    )
    assert time == "0 to 2 min, 12,001 samples, one every 10 ms"


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


def test_it_reads_well_at_80_columns_without_colour() -> None:
    text = (
        'name = "w"\nbody = {points = [{mass = 1, position = [1, 2, 3]}, {mass = 2, position = [-3, 1, 1]}, '
        "{mass = 3, position = [0, 1, -2]}]}\ninitial = {angular_velocity = [0.123456, 1, 2], "
        "position = [7e6, 1, 2]}\ntime.end = 1\n"
    )
    scene = build_scene(parse(text))
    out = io.StringIO()
    parts = body_of(scene), start_of(scene), span_of(scene)
    tables.print_understood(*parts, Console(file=out, width=80, highlight=False))
    lines = out.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    assert "\x1b" not in out.getvalue()
    words = [word for _, told in understood(*parts) for word in told.split()]
    assert [word for line in lines for word in line[9:].split()] == words  # beside the labels
