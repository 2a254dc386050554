"""Apophis about the Earth in April 2029: the published orbit at perigee, carried back under DE421."""

import math

import numpy as np
from numpy.polynomial import chebyshev
from scipy.integrate import solve_ivp

from experiments.bare import blocks

PERIGEE = 2462240.0 + 0.5 - 134 / 1440
"""2029-04-13T21:46:00 TDB, to the minute (Horizons)."""
OBLIQUITY = math.radians(84381.448 / 3600)
SOURCES = ("sun", "moon", *blocks.PLANETS)


class Sky:
    """Places of a kernel's bodies, km in axes of the ICRF, and their gravitational parameters, km^3/day^2."""

    def __init__(self, package: str = "de421") -> None:
        self.kernel = blocks.Kernel(package)
        names = ("moon", "earthmoon", "sun", *blocks.PLANETS)
        self._stored = {
            name: np.load(self.kernel.folder / f"jpl-{name}.npy", mmap_mode="r") for name in names
        }

    def _at(self, name: str, date: float) -> np.ndarray:
        stored = self._stored[name]
        since = (date - self.kernel.first) * len(stored) / (self.kernel.last - self.kernel.first)
        row = int(since)
        return np.asarray(chebyshev.chebval(2 * (since - row) - 1, stored[row].T))

    def from_earth(self, date: float) -> dict[str, np.ndarray]:
        """Of every source, from the Earth's centre."""
        moon = self._at("moon", date)
        earth = self._at("earthmoon", date) - moon / (1 + self.kernel.constants["EMRAT"])
        return {"moon": moon} | {name: self._at(name, date) - earth for name in SOURCES if name != "moon"}


def flight(place: np.ndarray, speed: np.ndarray, start: float, days: float) -> np.ndarray:
    """Place (km) and velocity (km/day) from the Earth, so many days after a date (before, if negative)."""
    sky = Sky()
    pull = sky.kernel.parameters

    def rates(day: float, state: np.ndarray) -> np.ndarray:
        x = state[:3]
        found = -pull["earth"] * x / np.linalg.norm(x) ** 3
        for name, there in sky.from_earth(start + day).items():
            apart = there - x
            found = found + pull[name] * (
                apart / np.linalg.norm(apart) ** 3 - there / np.linalg.norm(there) ** 3
            )
        return np.concatenate([state[3:], found])

    begin = np.concatenate([place, speed])
    done = solve_ivp(rates, (0, days), begin, "DOP853", rtol=1e-12, atol=1e-7)
    return np.asarray(done.y[:, -1])


def equatorial(vector: np.ndarray) -> np.ndarray:
    """From the ecliptic of J2000 to its equator (the ICRF's, to 0.02 arcsec)."""
    c, s = math.cos(OBLIQUITY), math.sin(OBLIQUITY)
    return np.asarray(np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ vector)
