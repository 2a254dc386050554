"""Names of space axes, and the rotation between those that other tools know and those that they don't."""

from __future__ import annotations

from fractions import Fraction
from typing import Literal

from rigidsim.scene.exact import ExactNumber

SpaceAxes = Literal["EME2000", "ICRF", "GCRF", "ecliptic J2000"]
ECLIPTIC: SpaceAxes = "ecliptic J2000"
"""Mean ecliptic and equinox of J2000: the axes of the ephemerides."""
EQUATOR: SpaceAxes = "EME2000"
"""Mean equator and equinox of J2000: the ecliptic's, turned about their common X axis, the equinox."""

OBLIQUITY = ExactNumber(Fraction(84381406, 1000 * 3600 * 180), pi_power=1)
"""Angle (rad) from the equator to the ecliptic of J2000, 84381.406 arcsec: IAU 2006 (resolution B1, the P03
precession of Capitaine et al. 2003, A&A 412, 567).
"""
