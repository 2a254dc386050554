"""What an analysis prints: units that fit the size, and no precession from a part of a turn."""

import re

import numpy as np
import pytest
import xarray

import rigidsim
from rigidsim.cli.screens.analysis import print_analysis
from rigidsim.workflows.analyse import Saved

DAY = 86400.0


def printed(
    values: np.ndarray, name: str, known: dict[str, float], capsys: pytest.CaptureFixture[str]
) -> str:
    time = np.arange(len(values)) * DAY
    dataset = xarray.Dataset({name: ("time", values, {"units": "rad"})}, coords={"time": time})
    analysis = rigidsim.analyse(dataset, name, known=known)
    print_analysis(analysis, Saved("a.h5", "a.png"))  # type: ignore[arg-type]
    return " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("days", [40, 800])
def test_no_precession_is_printed_for_less_than_the_nutation_goes_round(
    days: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """A node that falls by 50 arcsec a year and nutates by 1.3 arcsec twice a year."""
    year, t = 365.25 * DAY, np.arange(days) * DAY
    turn = 4 * np.pi / year
    arcsec = np.pi / 648000
    node = arcsec * (-50 * t / year + 1.3 * np.sin(turn * t + 0.4))
    text = printed(node, "node_longitude", {"season": turn}, capsys)
    assert ("known frequency" in text and "precession" in text) == (days == 800)


@pytest.mark.parametrize(
    ("arcseconds", "value", "unit"),
    [(3e-7, 0.3, "µas"), (4e-3, 4, "mas"), (0.5, 0.5, "arcsec"), (7200, 2, "deg")],
)
def test_an_angle_is_printed_in_the_unit_that_fits_it(
    arcseconds: float, value: float, unit: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mean angle beside a nutation of a thousandth of it."""
    t = np.arange(400) * DAY
    angle = np.pi / 648000 * arcseconds * (1 + 1e-3 * np.sin(2 * np.pi * t / (20 * DAY)))
    mean = re.search(r" tilt (\S+) (\S+) at mid-span", printed(angle, "tilt", {}, capsys))
    assert mean is not None
    assert (float(mean[1]), mean[2]) == (pytest.approx(value, rel=1e-9), unit)


def test_a_line_is_printed_with_the_digits_that_noise_leaves(capsys: pytest.CaptureFixture[str]) -> None:
    """30 arcsec, noise of 0.1: some 0.01 arcsec and 0.02 deg are uncertain, and no digit beyond is shown."""
    day = np.arange(400)
    noise = 0.1 * np.random.default_rng(1).standard_normal(400)
    angle = np.pi / 648000 * (30 * np.cos(2 * np.pi * day / 20 + 0.5) + noise)
    row = re.search(
        r"amplitude, arcsec phase, deg line \W+\S+ d \S+ \S+ (\S+) (\S+)", printed(angle, "tilt", {}, capsys)
    )
    assert row is not None
    assert [len(x.replace(".", "")) for x in row.groups()] == [5, 5]
    assert float(row[1]) == pytest.approx(30, abs=0.03)
    # the frequency errs by some 1e-10 rad/s, over 200 days from the middle of the samples
    assert float(row[2]) == pytest.approx(np.degrees(0.5), abs=0.3)
