"""The Earth's mean equator and equinox of date by IAU 1976, Lieske et al. 1977, Astron. Astrophys. 58, 1."""

import math

import numpy as np

ARCSEC = math.radians(1 / 3600)


def turned(axis: int, angle: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Components (n, 3) after the axes have turned by an angle about one of them."""
    c, s = np.cos(angle), np.sin(angle)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    found = np.array(vectors, dtype=float)
    found[:, a], found[:, b] = (c * vectors[:, a] + s * vectors[:, b], -s * vectors[:, a] + c * vectors[:, b])
    return found


def centuries(julian_dates: np.ndarray) -> np.ndarray:
    """Since J2000."""
    return (np.asarray(julian_dates) - 2451545.0) / 36525


def _angles(julian_dates: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """zeta, z, theta, rad."""
    t = centuries(julian_dates)
    return (
        (2306.2181 * t + 0.30188 * t**2 + 0.017998 * t**3) * ARCSEC,
        (2306.2181 * t + 1.09468 * t**2 + 0.018203 * t**3) * ARCSEC,
        (2004.3109 * t - 0.42665 * t**2 - 0.041833 * t**3) * ARCSEC,
    )


def to_date(julian_dates: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """From axes of J2000 to those of date."""
    zeta, z, theta = _angles(julian_dates)
    return turned(2, -z, turned(1, theta, turned(2, -zeta, vectors)))


def from_date(julian_dates: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """From axes of date to those of J2000."""
    zeta, z, theta = _angles(julian_dates)
    return turned(2, zeta, turned(1, -theta, turned(2, z, vectors)))


def true_pole(julian_dates: np.ndarray) -> np.ndarray:
    """The pole in axes of J2000, with the 18.6-year term of nutation, (n, 3)."""
    t = centuries(julian_dates)
    node = np.radians(125.04452 - 1934.136261 * t)
    obliquity = (84381.448 - 46.8150 * t) * ARCSEC
    longitude, tilt = -17.1996 * ARCSEC * np.sin(node), 9.2025 * ARCSEC * np.cos(node)
    # N = R1(-eps - deps) R3(-dpsi) R1(eps), inverted
    pole = np.tile([0.0, 0.0, 1.0], (len(t), 1))
    pole = turned(0, -obliquity, turned(2, longitude, turned(0, obliquity + tilt, pole)))
    return from_date(julian_dates, pole)
