"""What is told of an analysis: arguments as in tables, constants, and no period from a part of a turn."""

from __future__ import annotations

import numpy as np
import pytest
import xarray

import rigidsim
from rigidsim.analysis.labels import Known, named
from rigidsim.cli.screens.analysis import print_analysis
from rigidsim.workflows.analyse import Saved

ARGUMENTS = [Known(name, 1.0) for name in ("l", "lp", "F", "D", "Om")]
DAY = 86400.0


@pytest.mark.parametrize(
    ("multipliers", "text"),
    [  # rows of the IAU 2000B tables
        ((0, 0, 2, -2, 2), "2F-2D+2Om"),
        ((0, 0, 0, 0, 1), "Om"),
        ((0, 1, 2, -2, 2), "lp+2F-2D+2Om"),
        ((-1, 0, 2, 0, 2), "-l+2F+2Om"),
    ],
)
def test_arguments_of_nutation_are_written_as_in_tables(multipliers: tuple[int, ...], text: str) -> None:
    assert named(multipliers, ARGUMENTS) == text
    assert named((2, -1), [Known("orbit", 1.0), Known("node", 1.0)]) == "2 orbit - node"


def told(values: np.ndarray, name: str, known: dict[str, float], capsys: pytest.CaptureFixture[str]) -> str:
    time = np.arange(len(values)) * DAY
    dataset = xarray.Dataset({name: ("time", values, {"units": "rad"})}, coords={"time": time})
    analysis = rigidsim.analyse(dataset, name, known=known)
    print_analysis(analysis, Saved("a.h5", "a.png"))  # type: ignore[arg-type]
    return " ".join(capsys.readouterr().out.split())


def test_a_constant_is_called_one(capsys: pytest.CaptureFixture[str]) -> None:
    noise = np.random.default_rng(1).integers(-1, 2, 200) * 2.0**-54
    text = told(0.4 + noise, "obliquity", {}, capsys)
    assert "constant to rounding" in text
    assert "secular" not in text


@pytest.mark.parametrize("days", [40, 800])
def test_no_precession_is_told_of_less_than_the_nutation_goes_round(
    days: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """A node that falls by 50 arcsec a year and nutates by 1.3 arcsec twice a year."""
    year, t = 365.25 * DAY, np.arange(days) * DAY
    turn = 4 * np.pi / year
    arcsec = np.pi / 648000
    node = arcsec * (-50 * t / year + 1.3 * np.sin(turn * t + 0.4))
    text = told(node, "node_longitude", {"season": turn}, capsys)
    assert ("known frequency" in text and "precession" in text) == (days == 800)
