"""Times as people read them: units that suit a span, dates that suit a step."""

from __future__ import annotations

import numpy as np
import pytest
import xarray

from rigidsim.look.figures.scales import time_axis_of
from rigidsim.scene.epochs import J2000, parse_epoch
from rigidsim.scene.readable_time import DAY, YEAR, TimeWords, instant_text, named_unit, span_text, unit_for

FLYBY = parse_epoch("2029-04-13T21:46:00 TDB")


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"),
        (2.5e-17, "25 1e-18 s"),
        (3e-15, "3 fs"),
        (1e-12, "1 ps"),
        (4.2e-9, "4.2 ns"),
        (1e-6, "1 µs"),
        (0.0999, "99.9 ms"),
        (0.99999, "1000 ms"),
        (90.0, "90 s"),
        (-600.0, "-10 min"),
        (7200.0, "2 h"),
        (303.62 * DAY, "304 d"),
        (2 * YEAR, "2 yr"),
        (999.9 * YEAR, "1000 yr"),
        (25772 * YEAR, "25.8 kyr"),
        (4.2e6 * YEAR, "4.2 Myr"),
        (3e13 * YEAR, "30000 Gyr"),
    ],
)
def test_a_span_reads_in_the_unit_that_suits_it(seconds: float, text: str) -> None:
    assert span_text(seconds) == text


def test_the_unit_that_is_asked_for_is_kept() -> None:
    assert span_text(303.62 * DAY, 5, named_unit("day")) == "303.62 day"
    assert named_unit("kyr").seconds == 1e3 * YEAR
    assert unit_for(float("nan")).symbol == "s"
    for name in ("m", "rad", "day^2", "2 s", "", "fortnight"):
        with pytest.raises(ValueError, match=r"unit"):
            named_unit(name)


@pytest.mark.parametrize(
    ("seconds", "span", "text"),
    [
        (40 * DAY, 5000 * DAY, "2029-05-23 TDB"),
        (40.0, 30 * DAY, "2029-04-13T21:47 TDB"),
        (40.0, 3000.0, "2029-04-13T21:46:40 TDB"),
        (2.51, 100.0, "2029-04-13T21:46:02.5 TDB"),
        (2.9996, 1.0, "2029-04-13T21:46:03.000 TDB"),
        (1e15, 1e15, "year 31690117.1 TDB"),
        (-1e12, 1e12, "year -29658.8054 TDB"),
    ],
)
def test_an_instant_is_as_fine_as_the_run(seconds: float, span: float, text: str) -> None:
    assert instant_text(FLYBY, seconds, span) == text


def test_an_instant_of_utc_goes_on_in_tt_where_nobody_knows_utc() -> None:
    epoch = parse_epoch("2016-12-31T23:59:59 UTC")
    assert instant_text(epoch, 1.5, 100.0) == "2016-12-31T23:59:60.5 UTC"
    assert instant_text(epoch, 100 * YEAR, 100 * YEAR) == "2117-01-02 TT"  # 36,525 days


def test_moments_of_a_run_are_told_in_one_unit_and_as_dates() -> None:
    assert TimeWords.of({}, 0.0, 7200.0).moment(2861.86209) == "2861.86209 s"
    assert TimeWords.of({}, 0.0, 1e-9).moment(5e-10) == "0.5 ns"
    assert TimeWords.of({}, 0.0, 400 * DAY).short(303.62 * DAY) == "303.62 d"
    assert TimeWords.of({"time_unit": "day"}, 0.0, 400 * DAY).short(303.62 * DAY) == "303.62 day"
    dated = TimeWords.of({"epoch": str(FLYBY)}, 0.0, 40 * DAY)
    assert dated.moment(1.5 * DAY) == "1.5 d (2029-04-15T09:46 TDB)"
    assert dated.moment(float("inf")).startswith("inf d")


@pytest.mark.parametrize(
    ("end", "attributes", "label", "last"),
    [
        (40 * DAY, {}, "time [d]", 40.0),
        (40 * DAY, {"time_unit": "h"}, "time [h]", 960.0),
        (40 * DAY, {"time_unit": "parsec"}, "time [d]", 40.0),
        (40 * DAY, {"epoch": str(FLYBY)}, "time since 2029-04-13T21:46:00 TDB [d]", 40.0),
        (200 * YEAR, {"epoch": str(J2000)}, "year (TDB)", 2200.0),
        (26e3 * YEAR, {"epoch": str(J2000)}, "time since J2000 [kyr]", 26.0),
    ],
)
def test_an_axis_of_time(end: float, attributes: dict[str, str], label: str, last: float) -> None:
    dataset = xarray.Dataset(coords={"time": [0.0, end]}, attrs=attributes)
    axis = time_axis_of(dataset)
    assert axis.label == label
    assert axis.numbers(np.array([end]))[0] == pytest.approx(last)
