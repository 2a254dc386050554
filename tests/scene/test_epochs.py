"""Epochs: what time zero of a scene is, in five time scales, with leap seconds where they are."""

from decimal import Decimal
from fractions import Fraction

import pytest

from rigidsim.scene.epochs import leap_seconds, parse_epoch, tdb_minus_tt


@pytest.mark.parametrize(
    ("epoch", "seconds", "then"),
    [
        ("2020-02-28T23:59:59.5 TT", "0.5", "2020-02-29T00:00:00 TT"),
        ("2020-02-28 23:59 TDB", "60.00000000000001", "2020-02-29T00:00:00.00000000000001 TDB"),
        ("2029-04-13 TDB", "-1e-14", "2029-04-12T23:59:59.99999999999999 TDB"),
        ("2016-12-31T23:59:59 UTC", "1.75", "2016-12-31T23:59:60.75 UTC"),
        ("2016-12-31T23:59:59 UTC", "2", "2017-01-01T00:00:00 UTC"),
        ("2016-12-31T23:59:60.25 UTC", "-0.5", "2016-12-31T23:59:59.75 UTC"),
    ],
)
def test_time_goes_on_by_the_calendar(epoch: str, seconds: str, then: str) -> None:
    assert str(parse_epoch(epoch).after(Decimal(seconds))) == then
    assert parse_epoch(then) == parse_epoch(epoch).after(Decimal(seconds))


def test_scales_and_calendar_are_those_of_erfa() -> None:
    """Dates, Julian dates and leap seconds exactly; TDB - TT by the whole series of ``dtdb`` to 1e-5 s."""
    erfa = pytest.importorskip("erfa")
    for year, month, day in (
        (1, 1, 1),
        (1600, 2, 29),
        (1972, 1, 1),
        (2000, 1, 1),
        (2029, 4, 13),
        (9999, 12, 31),
    ):
        epoch = parse_epoch(f"{year:04}-{month:02}-{day:02}T18:00 TT")
        assert epoch.julian_date() == sum(
            map(Fraction, map(float, erfa.cal2jd(year, month, day)))
        ) + Fraction(3, 4)
    days, offsets, _ = leap_seconds()
    assert offsets == [int(erfa.dat(*erfa.jd2cal(2400000.5, day - 678576)[:3], 0.0)) for day in days]
    for day in range(-146000, 73000, 7301):  # 1600 to 2200
        expected = erfa.dtdb(2451545.0, float(day), 0.0, 0.0, 0.0, 0.0)
        assert tdb_minus_tt(86400.0 * day) == pytest.approx(float(expected), abs=1.1e-5)
    utc = parse_epoch("2020-06-01T12:00 UTC")
    tai = erfa.utctai(*erfa.dtf2d("UTC", 2020, 6, 1, 12, 0, 0.0))
    tt = erfa.taitt(*tai)
    assert float(utc.julian_date() - 2451545) == pytest.approx(tt[0] - 2451545 + tt[1], abs=1e-12)
    assert utc.uniform() == parse_epoch("2020-06-01T12:01:09.184 TT")
    tdb = erfa.tttdb(*tt, erfa.dtdb(*tt, 0.0, 0.0, 0.0, 0.0))
    # an ephemeris' argument: TDB since J2000
    assert float(utc.since_j2000()) == pytest.approx(((tdb[0] - 2451545) + tdb[1]) * 86400, abs=1.1e-5 + 1e-4)


@pytest.mark.parametrize(
    ("text", "phrase"),
    [
        (
            "2029-04-13T21:46:00",
            'write it behind the date, as "2029-04-13T21:46:00 TDB" (TDB, TT, TAI, GPS, UTC)',
        ),
        ("2001-02-29 TT", "a date and time"),
        ("2016-12-31T23:59:60 TT", "there was no leap second then"),
        ("2029-04-13T21:46:00Z TT", "name one scale only"),
        ("1959-12-31 UTC", "known from 1960-01-01 to"),
        ("2999-01-01 UTC", "write the date in TT, TAI or TDB"),
    ],
)
def test_what_is_no_instant_is_refused(text: str, phrase: str) -> None:
    with pytest.raises(ValueError, match=r"given ") as caught:
        parse_epoch(text)
    assert phrase in str(caught.value)


@pytest.mark.parametrize(("epoch", "seconds"), [("2020-01-01 UTC", "1e10"), ("9999-12-31 TDB", "1e5")])
def test_time_ends_where_its_scale_does(epoch: str, seconds: str) -> None:
    with pytest.raises(ValueError, match=r"known from|years 1 to 9999"):
        parse_epoch(epoch).after(Decimal(seconds))
