"""Dates along time: years, Julian dates and calendar dates of samples and events, where time 0 is known."""

import warnings
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import xarray
from support import EAGER, config, run_text

from rigidsim.scene.epochs import parse_epoch

FLYBY = parse_epoch("2029-04-13T21:46:00 TDB")
FLIP = '[[events]]\nname = "flip"\nexpression = "t - 1"\n'


def exact(high: float, low: float) -> Fraction:
    return Fraction(float(high)) + Fraction(float(low))


@pytest.mark.parametrize(
    ("epoch", "begin", "end", "known"),
    [
        ("J2000", 0, 200 * 31557600, True),
        ("J2000", 0, 300 * 31557600, False),  # past the year 2262
        ("J2000", -400 * 31557600, 0, False),
        ("1600-01-01 TT", 100 * 31557600, 101 * 31557600, False),
        ("2016-12-31T23:59:30 UTC", 0, 60, True),
        ("2016-12-31T23:59:30 UTC", 0, 100 * 31557600, False),  # nobody knows UTC so far ahead
        ("1972-01-02 UTC", -(10**6), 0, False),
    ],
)
def test_dates_are_given_where_all_samples_have_one(epoch: str, begin: int, end: int, known: bool) -> None:
    time = f'start = {begin}\nend = {end}\nsamples = 5\nepoch = "{epoch}"'
    data = run_text(config(initial="angular_velocity = [0, 0, 0]", time=time)).dataset
    assert {"year", "julian_date"} <= set(data.coords)
    assert ("date" in data.coords) == known


def test_a_run_with_an_epoch_has_its_dates_as_coordinates(tmp_path: Path) -> None:
    text = config(
        time='end = 60\nsamples = 61\nepoch = "2029-04-13T21:46:00 TDB"\nunit = "min"',
        more=FLIP.replace("t - 1", "t - 7.5"),
    )
    run = run_text(text, out=tmp_path / "whole")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plain = xarray.open_dataset(run.folder.dataset).load()
    coordinates = {"year", "julian_date", "julian_date_lo", "date"}
    assert coordinates <= set(plain.coords)
    assert coordinates <= set(plain.quaternion.coords)
    assert plain.time.dtype == np.float64
    assert plain.date.values[-1] == np.datetime64("2029-04-13T21:47:00")
    assert plain.attrs["time_unit"] == "min"
    for i in (0, 17, 60):
        wanted = FLYBY.julian_date() + Fraction(i, 86400)
        got = exact(plain.julian_date.values[i], plain.julian_date_lo.values[i])
        assert abs(got - wanted) <= wanted / 2**104
    assert plain.flip_date.values.tolist() == [np.datetime64("2029-04-13T21:46:07.5", "ns").astype(int)]
    assert plain.flip_julian_date.dims == ("flip",)
    assert plain.swap_dims(time="date").sel(date="2029-04-13T21:46:30").time == 30
    # what a run that was stopped has saved so far reads the same
    cut = run_text(text, "limits.max_steps=40", tuning=EAGER, out=tmp_path / "cut")
    assert cut.status == "stopped: max_steps"
    with cut.dataset as part:
        rows = part.sizes["time"]
        assert 0 < rows < 61
        assert coordinates <= set(part.coords)
        for name in coordinates:
            np.testing.assert_array_equal(part[name].values, plain[name].values[:rows], strict=True)
        assert part.date[rows // 2 :].dtype.kind == "M"
    with cut.opened(indexed=False) as bare:
        assert not bare.xindexes
