"""What is told of an analysis: arguments as in tables, constants, and no period from a part of a turn."""

import numpy as np
import pytest
import xarray

import rigidsim
from rigidsim.cli.screens.analysis import print_analysis
from rigidsim.workflows.analyse import Saved

DAY = 86400.0


def told(values: np.ndarray, name: str, known: dict[str, float], capsys: pytest.CaptureFixture[str]) -> str:
    time = np.arange(len(values)) * DAY
    dataset = xarray.Dataset({name: ("time", values, {"units": "rad"})}, coords={"time": time})
    analysis = rigidsim.analyse(dataset, name, known=known)
    print_analysis(analysis, Saved("a.h5", "a.png"))  # type: ignore[arg-type]
    return " ".join(capsys.readouterr().out.split())


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
