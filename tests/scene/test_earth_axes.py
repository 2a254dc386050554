"""The Earth's axes at a date, against ERFA."""

import erfa
import numpy as np
import pytest

from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.epochs import parse_epoch
from rigidsim.scene.space_axes import earth_axes

ARCSEC = np.pi / (180 * 3600)


@pytest.mark.parametrize(
    "date", ["2025-06-01T03:04:05 UTC", "2016-12-31T23:59:59 UTC", "2000-01-01T12:00:00 TDB"]
)
def test_they_are_those_of_the_mean_pole_and_of_sidereal_time(date: str) -> None:
    epoch, context = parse_epoch(date), context_for("double")
    found = np.array([[float(x) for x in row] for row in earth_axes(epoch, "ICRF", context)])
    tt, ut = (divmod(x, 1) for x in (epoch.uniform().julian_date(), epoch.universal_date()))
    (tt1, tt2), (ut1, ut2) = (map(float, x) for x in (tt, ut))
    mean = erfa.rz(erfa.gmst06(ut1, ut2, tt1, tt2), erfa.pmat06(tt1, tt2))
    # the frame bias of ICRF, 0.017 arcsec about X and Y, is left out
    assert np.abs(found - mean).max() <= 0.02 * ARCSEC
    full = erfa.c2t06a(tt1, tt2, ut1, ut2, 0, 0)
    assert np.abs(found - full).max() <= 20 * ARCSEC  # nutation
    assert np.abs(found @ found.T - np.eye(3)).max() <= 1e-15


def test_in_axes_of_the_ecliptic_they_are_the_same_directions() -> None:
    epoch, context = parse_epoch("2025-06-01 TT"), context_for("double")
    equator, ecliptic = (
        np.array([[float(x) for x in row] for row in earth_axes(epoch, axes, context)])
        for axes in ("EME2000", "ecliptic J2000")
    )
    assert np.abs(ecliptic - equator @ erfa.rx(84381.406 * ARCSEC, np.eye(3)).T).max() <= 1e-15


def test_universal_time_counts_leap_seconds() -> None:
    assert parse_epoch("2016-12-31T12:00:00 UTC").universal_date() == 2457754
    assert parse_epoch("2020-01-01T12:01:09.184 TT").universal_date() == 2458850
    assert parse_epoch("2100-01-01T12:01:09.184 TT").universal_date() == 2488070  # none are known by then
    with pytest.raises(ValueError, match="UTC began in 1960"):
        parse_epoch("1959-12-31 TT").universal_date()
