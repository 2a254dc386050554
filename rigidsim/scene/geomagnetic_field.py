"""The Earth's main magnetic field: the coefficients of the International Geomagnetic Reference Field."""

from __future__ import annotations

from bisect import bisect_right
from datetime import date
from fractions import Fraction
from functools import lru_cache
from importlib.resources import files

from rigidsim.scene.bodies.gravity_field import Harmonic
from rigidsim.scene.epochs import DIGITS, Epoch

MOST = 13
"""Its degree."""
RADIUS = 6371200  # m, to which the coefficients refer


def igrf(epoch: Epoch, degree: int) -> dict[Harmonic, Fraction]:
    """Gauss coefficients at a date, nT, Schmidt semi-normalized: g_nm of cosines and h_nm of sines.

    Between two years of the table they are linear in time, as the IGRF is defined.

    Args:
        degree: up to which they are given, 1 to ``MOST``.

    Raises:
        ValueError: a date without coefficients.
    """
    years, table = _table()
    uniform = epoch.uniform()
    day = uniform.day + Fraction(uniform.ticks, 86400 * 10**DIGITS)
    begins = [date(year, 1, 1).toordinal() for year in years]
    if not begins[0] <= day <= begins[-1]:
        raise ValueError(f"the coefficients of IGRF-14 that are kept here are for {years[0]} to {years[-1]}")
    at = min(bisect_right(begins, day), len(years) - 1)
    share = Fraction(day - begins[at - 1], begins[at] - begins[at - 1])
    return {
        key: values[at - 1] + share * (values[at] - values[at - 1])
        for key, values in table.items()
        if key[0] <= degree
    }


@lru_cache(maxsize=1)
def _table() -> tuple[list[int], dict[Harmonic, list[Fraction]]]:
    """Years, and the values of each coefficient in them."""
    text = (files("rigidsim.scene") / "data" / "igrf14.txt").read_text(encoding="ascii")
    head, *rows = (line.split() for line in text.splitlines() if not line.startswith("#"))
    found = {}
    for n, m, *values in rows:
        found[int(n), abs(int(m)), int(m) < 0] = [Fraction(x) for x in values]
    return [int(year) for year in head[2:]], found
