"""Angles that were probably meant in degrees are pointed out, and nothing else is."""

import pytest
from support import config

from rigidsim import parse
from rigidsim.scene.scene import build_scene
from rigidsim.session.understood import cautions_of

CONFIG = config(
    initial="angular_velocity = [40, 60, 1000]\neuler_angles = {angles}",
    loads='kind = "gravity_gradient"\ngravitational_parameter = 4e14\n'
    "orbit = {{semi_major_axis = 7e6, inclination = {inclination}, mean_anomaly = {anomaly}}}",
    time="end = 1",
)


def found(angles: str = "[0, 1, 0]", inclination: str = "1", anomaly: str = "0") -> list[str]:
    text = CONFIG.format(angles=angles, inclination=inclination, anomaly=anomaly)
    return [caution.text for caution in cautions_of(build_scene(parse(text)))]


@pytest.mark.parametrize(
    "angles", ["[6.28, -6.28, 0]", '["40 deg", "60 deg", "30 deg"]', '["3*pi", "-10*pi/3", "20 pi"]']
)
def test_no_false_alarm(angles: str) -> None:
    assert found(angles) == []


def test_degrees_without_their_unit() -> None:
    (first,) = found("[40, 60, 30]")
    assert first == (
        "[initial] euler_angles: given 40, 60, 30 without a unit, which is taken as radians: "
        '2291.83, 3437.75, 1718.87 deg; write "40 deg" if degrees are meant, "40 rad" if not'
    )
    (only_one,) = found('[0, "-23.5", 0]')
    assert "euler_angles: given -23.5 without" in only_one
    two = found(inclination="51.6", anomaly='"100"')
    assert [text.partition(":")[0] for text in two] == [
        "[[loads]] number 1 orbit.inclination",
        "[[loads]] number 1 orbit.mean_anomaly",
    ]


@pytest.mark.parametrize(
    ("time", "said"),
    [
        ('end = 30\nunit = "day"', 'write "30 day" if that is meant, "30 s" if not'),
        ('end = "30 s"\nunit = "day"', ""),
        ("end = 30", ""),
    ],
)
def test_an_end_meant_in_the_unit_of_times_is_pointed_out(time: str, said: str) -> None:
    text = CONFIG.format(angles="[0, 1, 0]", inclination="1", anomaly="0").replace("end = 1", time)
    problems = [caution.text for caution in cautions_of(build_scene(parse(text)))]
    assert len(problems) == bool(said)
    assert all(
        problem.startswith("[time] end: given 30 without a unit") and said in problem for problem in problems
    )
