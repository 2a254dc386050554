"""Starts of flights by two-line elements and by dated states in frames of the Earth."""

import re
from datetime import datetime, timedelta
from decimal import Decimal
from importlib.resources import files
from typing import Any

import numpy as np
import pytest

from rigidsim.errors import ConfigError
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.workflows.read import as_experiment

pytest.importorskip("sgp4")
pytest.importorskip("erfa")

# Vanguard 1, the first of SGP4's verification cases (Vallado et al. 2006, AIAA 2006-6753)
LINES = [
    "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753",
    "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667",
]
# one state in three frames (Vallado, Fundamentals of Astrodynamics and Applications, example 3-15)
DATE = "2004-04-06T07:51:28.386009 UTC"
GCRF = [5102.5089592, 6123.0114036, 6378.1369247, -4.743220157, 0.790536497, 5.533755727]
ITRF = [-1033.4793830, 7901.2952754, 6380.3565958, -3.225636520, -2.872451450, 5.531924446]
TEME = [5094.18016210, 6127.64465950, 6380.34453270, -4.746131487, 0.785818041, 5.531931288]
EARTH = {"kind": "central_gravity", "gravitational_parameter": "3.986004418e14 m^3/s^2"}


def tables(initial: dict[str, Any], **others: Any) -> dict[str, Any]:
    body = {"principal_moments": [1, 2, 2.5], "mass": 1}
    rates = {"angular_velocity": [0.1, 0, 0]}
    time = {"end": 10, "samples": 2} | others.pop("time", {})
    return {"name": "x", "body": body, "loads": [EARTH], "initial": rates | initial, "time": time} | others


def start(initial: dict[str, Any], **others: Any) -> Scene:
    return build_scene(as_experiment(tables(initial, **others)))


def state(scene: Scene) -> np.ndarray:
    """Position (km) and velocity (km/s)."""
    assert scene.position is not None
    assert scene.velocity is not None
    return np.array([float(x) for x in (*scene.position, *scene.velocity)]) / 1e3


def given(values: list[float], frame: str) -> dict[str, Any]:
    texts = [f"{x} km" for x in values[:3]], [f"{x} km/s" for x in values[3:]]
    return {"position": texts[0], "velocity": texts[1], "frame": frame}


def verification_cases(satellite: str) -> tuple[list[str], list[tuple[float, list[float]]]]:
    """Elements and states in TEME (minutes; km, km/s) of a satellite in the files of AIAA 2006-6753."""
    folder = files("sgp4")
    texts = (folder / "SGP4-VER.TLE").read_text().splitlines()
    lines = [next(x for x in texts if x.startswith(f"{n} {satellite}"))[:69] for n in (1, 2)]
    blocks = re.split(r"(?m)^(\d+) xx\n", (folder / "tcppver.out").read_text())
    rows = blocks[blocks.index(str(int(satellite))) + 1].splitlines()
    numbers = [[float(x) for x in row.split()[:7]] for row in rows if row.strip()]
    return lines, [(row[0], row[1:]) for row in numbers]


@pytest.mark.parametrize("satellite", ["06251", "08195", "28129"])
def test_an_orbit_starts_where_sgp4_is_published_to_be(satellite: str) -> None:
    """Low with drag, a Molniya in resonance, and one of GPS."""
    lines, states = verification_cases(satellite)
    year, day = 2000 + int(lines[0][18:20]), Decimal(lines[0][20:32])
    for minutes, expected in states[:: max(1, len(states) // 3)]:
        seconds = float((day - 1) * 86400) + 60 * minutes
        moment = datetime(year, 1, 1) + timedelta(seconds=seconds)
        date = f"{moment.isoformat(timespec='microseconds')} UTC"
        found = state(start({"tle": lines}, time={"epoch": date}))
        same = state(start(given(expected, "TEME"), time={"epoch": date}))
        assert np.abs(found - same)[:3].max() < 2e-8  # as printed, km
        assert np.abs(found - same)[3:].max() < 2e-9


def test_time_0_is_the_date_of_the_lines_and_the_axes_are_gcrf() -> None:
    scene = start({"tle": LINES})
    assert str(scene.epoch) == "2000-06-27T18:50:19.733568 UTC"
    assert scene.axes == "GCRF"
    hours = {"start": "6 hr", "end": "7 hr"}
    later = start({"tle": LINES}, time={"epoch": "2000-06-28T00:50:19.733568 UTC"})
    assert np.abs(state(start({"tle": LINES}, time=hours)) - state(later)).max() < 1e-9


@pytest.mark.parametrize(
    ("values", "frame", "metres"),
    [
        (TEME, "TEME", 0.03),  # 0.4 mas: the published pole is a day's own
        (ITRF, "ITRF", 0.4),  # and its UT1 that of the day's beginning, 0.5 ms from the moment's
        (GCRF, "J2000", 1e-6),
    ],
)
def test_one_state_is_the_same_in_every_frame(values: list[float], frame: str, metres: float) -> None:
    apart = np.abs(state(start(given(values, frame), time={"epoch": DATE})) - GCRF) * 1e3
    assert apart[:3].max() < metres
    assert apart[3:].max() < max(metres * 1e-3, 1e-4)  # m/s


DECAYING = [  # of the same test cases: down within the hour
    "1 28872U 05037B   05333.02012661  .25992681  00000-0  24476-3 0  1534",
    "2 28872  96.4736 157.9986 0303955 244.0492 110.6523 16.46015938 10708",
]


@pytest.mark.parametrize(
    ("initial", "others", "texts"),
    [
        ({"tle": LINES, "position": [1, 0, 0]}, {}, ["position", "given position with tle"]),
        (
            {"tle": LINES},
            {"loads": [EARTH | {"gravitational_parameter": "4.28e13 m^3/s^2"}]},
            ["tle", "is about the Earth", "4.28e+13"],
        ),
        ({"tle": LINES}, {"time": {"epoch": "2001-06-27 UTC"}}, ["days from the start", "up to 30", *LINES]),
        ({"tle": DECAYING}, {"time": {"epoch": "2005-11-29T01:28:59 UTC"}}, ["finds no orbit", "decayed"]),
        (
            given(ITRF, "ITRF"),
            {"time": {"epoch": "2060-01-01 TT"}},
            ["outside the IERS", "1973-01-02", "newer heyoka"],
        ),
    ],
)
def test_what_can_not_be_is_refused(initial: Any, others: Any, texts: list[str]) -> None:
    with pytest.raises(ConfigError) as refused:
        start(initial, **others)
    for text in texts:
        assert text in str(refused.value)
