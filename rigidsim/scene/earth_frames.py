"""Frames about the Earth (ITRF, TEME) against GCRF, and SGP4: for starts of flights.

GCRF to ITRF follows the IERS Conventions 2010 (ch. 5): precession and nutation IAU 2006/2000A with the
measured offsets of the pole, Earth rotation angle, polar motion, by ERFA. UT1, the pole and its offsets are
the IERS's (finals2000A), as heyoka brings them. TEME is Vallado et al.'s (AIAA 2006-6753): the Earth-fixed
axes without polar motion, turned back by the sidereal time GMST of 1982; its axes are taken at rest.
"""

from __future__ import annotations

import importlib
import math
from datetime import date
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from rigidsim.scene.epochs import Epoch, leap_seconds, tdb_minus_tt
from rigidsim.scene.two_line_elements import TwoLineElements

Rotation = tuple[list[list[float]], list[float]]
"""Matrix from a frame to GCRF, and the frame's angular velocity in GCRF (rad/s)."""
LONGEST = 30
"""Days from the date of two-line elements: errors of SGP4 grow by 1 to 3 km a day (Vallado et al. 2006)."""
_WATCHED = 5.0  # minutes between moments at which SGP4 is asked whether there is an orbit, 18 in the lowest
_EXTRA = "pip install 'rigidsim[tle]'"
_ARCSECOND = math.pi / 648000
_TT_MINUS_TAI = 32.184
_J2000 = 2451545.0
_MJD_OF_DAY_0 = 678576  # ordinal of 1858-11-17
_TURNING = 2 * math.pi * 1.00273781191135448 / 86400  # rad per second of UT1 (IERS 2010, eq. 5.15)


def package(name: str) -> Any:
    """A package of the extra ``tle``; ``ValueError`` where it isn't installed."""
    try:
        return importlib.import_module(name)
    except ImportError:
        top = {"erfa": "pyerfa"}.get(name, name.split(".")[0])
        raise ValueError(f"needs the package {top}, which isn't installed: {_EXTRA}") from None


@cache
def _orientation() -> np.ndarray:
    """Columns: seconds of TAI since MJD 0, UT1 - TAI (s), pole (rad, two), its offsets (rad, two)."""
    from heyoka import eop_data  # which few scenes need

    table = np.array([tuple(row) for row in eop_data().table], dtype=float)
    days, offsets, _ = leap_seconds()
    found = np.searchsorted(np.array(days) - _MJD_OF_DAY_0, table[:, 0], side="right") - 1
    tai = np.array(offsets, dtype=float)[found]
    return np.column_stack(
        [
            table[:, 0] * 86400 + tai,
            table[:, 1] - tai,
            table[:, 2:4] * _ARCSECOND,
            table[:, 4:6] * _ARCSECOND / 1e3,
        ]
    )


def _terrestrial(epoch: Epoch) -> Fraction:
    """Seconds of TT since J2000."""
    uniform = epoch.uniform()
    elapsed = (uniform.julian_date() - int(_J2000)) * 86400
    if uniform.scale == "TDB":
        elapsed -= Fraction(tdb_minus_tt(float(elapsed)))
    return elapsed


def _orientation_at(epoch: Epoch, known: bool) -> tuple[np.ndarray, float]:
    """UT1 - TT (s), pole and offsets (rad), and seconds of UT1 in one of TAI; outside the table its ends, or
    ``ValueError`` where they must be ``known``.
    """
    table = _orientation()
    tai = float(_terrestrial(epoch)) - _TT_MINUS_TAI + 51544.5 * 86400
    if known and not table[0, 0] <= tai <= table[-1, 0]:
        ends = (int(row[0] // 86400) for row in (table[0], table[-1]))
        first, last = (date.fromordinal(_MJD_OF_DAY_0 + day) for day in ends)
        newer = "; a newer heyoka knows later ones" if tai > table[-1, 0] else ""
        raise ValueError(
            f"the date {epoch} is outside what is known of the Earth's rotation, {first} to {last} (the "
            f"IERS's table in heyoka{newer}); give the state in TEME or GCRF, which need none of it"
        )
    after = int(np.clip(np.searchsorted(table[:, 0], tai), 1, len(table) - 1))
    low, high = table[after - 1], table[after]
    share = min(max((tai - low[0]) / (high[0] - low[0]), 0.0), 1.0)
    values = low[1:] + share * (high[1:] - low[1:])
    values[0] -= _TT_MINUS_TAI
    return values, 1 + (high[1] - low[1]) / (high[0] - low[0])


def _intermediate(
    epoch: Epoch, known: bool
) -> tuple[Any, tuple[float, float], np.ndarray, np.ndarray, float]:
    """ERFA, the Julian date of UT1 in two parts, matrix from GCRF to the Earth-fixed axes without polar
    motion, the values of ``_orientation_at``, and the pace of UT1.
    """
    erfa = package("erfa")
    values, pace = _orientation_at(epoch, known)
    elapsed = _terrestrial(epoch)
    day, seconds = divmod(elapsed, 86400)
    tt = _J2000 + float(day), float(seconds) / 86400
    ut1 = tt[0], float(seconds + Fraction(float(values[0]))) / 86400
    x, y, s = erfa.xys06a(*tt)
    celestial = erfa.c2ixys(x + values[3], y + values[4], s)
    return erfa, ut1, erfa.rz(erfa.era00(*ut1), celestial), values, pace


def itrf(epoch: Epoch) -> Rotation:
    """ITRF at a date; ``ValueError`` beyond the table of the Earth's rotation."""
    erfa, ut1, fixed, values, pace = _intermediate(epoch, known=True)
    moved = erfa.pom00(values[1], values[2], erfa.sp00(*ut1))
    turning = fixed.T @ np.array([0.0, 0.0, _TURNING * pace])
    return (moved @ fixed).T.tolist(), turning.tolist()


def teme(epoch: Epoch) -> Rotation:
    """TEME at a date. UT1 cancels but for precession: 1 s of it is worth 0.1 mm in low orbits."""
    erfa, ut1, fixed, *_ = _intermediate(epoch, known=False)
    plain = erfa.rz(-erfa.gmst82(*ut1), fixed)
    return plain.T.tolist(), [0.0, 0.0, 0.0]


def sgp4(elements: TwoLineElements, epoch: Epoch) -> tuple[list[float], list[float]]:
    """Position and velocity in TEME (m, m/s) at a date.

    Raises:
        ValueError: the date is far from the elements' date, or SGP4 has no orbit then.
    """
    api = package("sgp4.api")
    minutes = float(_terrestrial(epoch) - _terrestrial(elements.epoch)) / 60
    one, two = elements.lines
    if abs(minutes) > LONGEST * 1440:
        raise ValueError(
            f"its date {elements.epoch} is {abs(minutes) / 1440:.1f} days from the start, {epoch}; up to "
            f"{LONGEST} days are allowed, as SGP4's errors grow by 1 to 3 km a day: take newer lines, or "
            f'remove [time] epoch; given "{one}" and "{two}"'
        )
    satellite = api.Satrec.twoline2rv(one, two)
    # on the way, too: SGP4 reports only once that a satellite has come down, and goes on
    for moment in np.linspace(0.0, minutes, math.ceil(abs(minutes) / _WATCHED) + 1)[::-1]:
        code, found, moving = satellite.sgp4_tsince(float(moment))
        if code:
            why = str(api.SGP4_ERRORS.get(code, f"error {code}"))
            raise ValueError(
                f"SGP4 finds no orbit {moment:.0f} minutes after {elements.epoch}: {why}; take other lines; "
                f'given "{one}" and "{two}"'
            )
        if moment == minutes:
            place, speed = found, moving
    return [1e3 * x for x in place], [1e3 * v for v in speed]
