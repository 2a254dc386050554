"""The Sun, the planets and the Moon, recognised by their gravitational parameters."""

from __future__ import annotations

from dataclasses import dataclass

_ALIKE = 0.01
"""Relative difference up to which a gravitational parameter is that of a known body: for what is written in
few digits (4e14), and less than what the Moon adds to the Earth (0.0123).
"""


@dataclass(frozen=True)
class KnownBody:
    """A body that attracts others.

    Attributes:
        gravitational_parameter: m^3/s^2.
        radius: at the equator, m.
        distance: semi-major axis of its orbit about the Sun, of the Moon's about the Earth, m; 0 for the Sun.
    """

    name: str
    gravitational_parameter: float
    radius: float
    distance: float

    @property
    def called(self) -> str:
        """Its name in a sentence: ``the Sun``, ``Saturn``."""
        return f"the {self.name}" if self.name in ("Sun", "Earth", "Moon") else self.name

    @property
    def owner(self) -> str:
        """Its name as the owner of something: ``the Sun's``, ``Mars'``."""
        return f"{self.called}'" if self.name.endswith("s") else f"{self.called}'s"


KNOWN: tuple[KnownBody, ...] = (
    # nominal G M and equatorial radii of IAU 2015 Resolution B3 for Sun, Earth and Jupiter; else G M of JPL's
    # planetary ephemerides and radii of Archinal et al. 2018, Celest. Mech. Dyn. Astr. 130, 22; semi-major
    # axes of Standish's mean elements at J2000 (JPL), rounded
    KnownBody("Sun", 1.3271244e20, 6.957e8, 0.0),
    KnownBody("Mercury", 2.2031868e13, 2.4397e6, 5.7909e10),
    KnownBody("Venus", 3.24858592e14, 6.0518e6, 1.08209e11),
    KnownBody("Earth", 3.986004e14, 6.3781e6, 1.49598e11),
    KnownBody("Moon", 4.902800e12, 1.7374e6, 3.84400e8),
    KnownBody("Mars", 4.2828375e13, 3.39619e6, 2.27944e11),
    KnownBody("Jupiter", 1.2668653e17, 7.1492e7, 7.78341e11),
    KnownBody("Saturn", 3.7931206e16, 6.0268e7, 1.426666e12),
    KnownBody("Uranus", 5.7939512e15, 2.5559e7, 2.870658e12),
    KnownBody("Neptune", 6.8350999e15, 2.4764e7, 4.498396e12),
)


def known_body(strength: float) -> KnownBody | None:
    """The body with a gravitational parameter (m^3/s^2); None if it is that of no known one."""
    near = min(KNOWN, key=lambda one: abs(one.gravitational_parameter - strength))
    return near if abs(strength / near.gravitational_parameter - 1) < _ALIKE else None
