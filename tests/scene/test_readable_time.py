"""Times as people read them: units that suit a span, dates that suit a step."""

from __future__ import annotations

import pytest

from rigidsim.scene.epochs import parse_epoch
from rigidsim.scene.readable import DAY, YEAR, instant_text, span_text

FLYBY = parse_epoch("2029-04-13T21:46:00 TDB")


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"),
        (4.2e-9, "4.2 ns"),
        (0.99999, "1000 ms"),
        (-600.0, "-10 min"),
        (7200.0, "2 h"),
        (303.62 * DAY, "304 d"),
        (2 * YEAR, "2 yr"),
        (25772 * YEAR, "25.8 kyr"),
        (3e13 * YEAR, "30000 Gyr"),
    ],
)
def test_a_span_reads_in_the_unit_that_suits_it(seconds: float, text: str) -> None:
    assert span_text(seconds) == text


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
