"""Tables of elements: what is read, what is refused, and how well they are interpolated."""

from pathlib import Path

import mpmath
import pytest
from support import config

from rigidsim import ConfigError, load, parse
from rigidsim.scene.scene import build_scene

HEADER = "time [day], semi_major_axis [au], eccentricity, mean_anomaly [deg]"
CONFIG = config(
    "principal_moments = [1, 1.01, 1.02]",
    'angular_velocity = [0, 0, "1 deg/s"]',
    'kind = "gravity_gradient"\ngravitational_parameter = "1.32712440018e20 m^3/s^2"\n'
    'orbit = {table = "elements.csv"%s}',
    'end = "60 day"\nsamples = 3',
)


def rows(count: int = 9, every: float = 10.0, header: str = HEADER, shift: float = 0.0) -> str:
    """Of an orbit like the Earth's, 0.9856 deg a day, from the anomaly 350 deg on."""
    lines = [
        f"{every * i}, 1, 0.02, {(350 + 0.98560767 * every * i + shift * i) % 360}" for i in range(count)
    ]
    return "\n".join(["# made for a test", "", header, *lines])


def with_table(text: str, more: str = "", end: str = "60 day", start: str = "0") -> str:
    given = (CONFIG % more).replace('end = "60 day"', f'start = "{start}"\nend = "{end}"')
    return given + f"[tables.\"elements.csv\"]\ntext = '''\n{text}\n'''\n"


def test_numbers_units_and_order() -> None:
    text = "# late rows first\ntime (yr), inclination [deg]\n" + "\n".join(f"{-i}, 0.1" for i in range(8))
    given = with_table(text, ', semi_major_axis = "1 au"', end="0", start="-5 yr")
    experiment = parse(given, overrides=['integrator.precision="quadruple"'])
    table = build_scene(experiment).loads[0].table.table  # type: ignore[attr-defined]
    assert table.times[0] == -7 * 31557600
    assert table.times[-1] == 0
    with mpmath.workprec(200):
        tenth = mpmath.mpf(1) / 10 * mpmath.pi / 180
        assert abs(table.columns["inclination"][3] - tenth) < mpmath.ldexp(1, -185)


BAD = {
    "no time": ("eccentricity\n1", "has no column time"),
    "unknown": ("time, eccentricty\n", 'line 1: given the column "eccentricty"; did you mean "ecc'),
    "both": ("time, mean_anomaly, mean_longitude\n", "has both mean_anomaly and mean_longitude"),
    "cells": ("time, eccentricity\n0, 0.1\n1, 0.1, 3", "line 3 has 3 values, where the line of names has 2"),
    "no number": ("time, eccentricity\n0, nan", 'line 2: given "nan" as eccentricity; a decimal number'),
    "few": ("time, periapsis\n0, 3\n1, 3", "has 2 rows; 8 or more are needed"),
    "back": (
        "time, periapsis\n" + "\n".join(f"{i % 7}, 1" for i in range(9)),
        "line 9: its time doesn't continue the order",
    ),
}


@pytest.mark.parametrize("which", BAD)
def test_a_bad_table_is_refused_with_its_line(which: str) -> None:
    text, says = BAD[which]
    with pytest.raises(ConfigError) as caught:
        build_scene(parse(with_table(text, ', semi_major_axis = "1 au"')))
    assert says in str(caught.value)


REFUSED = {
    "no such table": (CONFIG % "", "was given as text, without files next to it"),
    "a column twice": (with_table(rows(), ', semi_major_axis = "1 au"'), "given in the config, too"),
    "no axis": (
        with_table("time [day], eccentricity\n" + "\n".join(f"{10 * i}, 0.1" for i in range(9))),
        "has no column semi_major_axis; add one, or give semi_major_axis with table",
    ),
    "too short": (with_table(rows(every=7.0)), "but the run goes from 0.0 s to 5184000.0 s"),
    "a rate": (with_table(rows(), ', node_rate = "1 deg/day"'), "given node_rate with table, which"),
    "turns": (with_table(rows(shift=-95.0)), "whole turns can't be counted"),
    "hyperbola": (with_table(rows().replace("0.02", "1.02")), "row 1: eccentricity is out of range"),
}


@pytest.mark.parametrize("which", REFUSED)
def test_an_orbit_that_no_table_gives(which: str) -> None:
    text, says = REFUSED[which]
    with pytest.raises(ConfigError) as caught:
        build_scene(parse(text))
    assert "[[loads]] number 1 orbit" in str(caught.value)
    assert says in str(caught.value)


def test_a_file_becomes_part_of_the_text(tmp_path: Path) -> None:
    path = tmp_path / "planet.toml"
    path.write_text(CONFIG % "", encoding="utf-8")
    with pytest.raises(ConfigError, match="can't be read") as caught:
        load(path)
    assert str(tmp_path / "elements.csv") in str(caught.value)
    (tmp_path / "elements.csv").write_bytes(rows().replace("\n", "\r\n").encode())
    found = load(path, overrides=["time.samples=5"])
    (tmp_path / "elements.csv").unlink()
    again = parse(found.text)
    assert again.config.tables["elements.csv"].text.strip() == rows()
    assert "samples = 5" in found.text
    assert "samples = 3" in found.given
    assert rows() in found.given
    (orbit,) = {load_.table for scene in (found, again) for load_ in build_scene(scene).loads}  # type: ignore[attr-defined]
    assert len(orbit.table.times) == 9
