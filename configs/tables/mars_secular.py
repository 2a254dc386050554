"""Writes the orbit of Mars over the next 10 million years, or of the Earth with its Moon over a million. The
mars_secular.csv of mars_obliquity.toml is older: it lacks the quadrupole below.

    python configs/tables/mars_secular.py                       # some fifteen minutes; takes numba
    python configs/tables/mars_secular.py earth                 # some four
    python configs/tables/mars_secular.py earth -1000000 FILE   # the past, to compare with published orbits

The eight planets are points under each other's gravity, with the relativistic advance of the perihelia as a
potential (Nobili & Roxburgh 1986) and the quadrupole of the Earth with its Moon (Quinn, Tremaine & Duncan
1991, AJ 101, 2287, with the factor 0.8525 of Varadi, Runnegar & Ghil 2003, ApJ 592, 620). They start from
their places at J2000 (VSOP2013, Simon et al. 2013, as heyoka has the series). The method is the symplectic
map of Wisdom & Holman (1991) in heliocentric places and barycentric velocities (Duncan, Levison & Lee 1998),
with steps of 5 days. Rows are elements against the ecliptic and equinox of J2000, averaged over a thousand
years with a Hann window: less than 4e-4 of a term with a period of 46,000 years is lost.

Measured: with steps of 8 days the eccentricity of the past million years is within 2.0e-4 (6e-5 rms) of the
solution ZB18a(1,1) of Zeebe & Lourens (2019), where a table without the quadrupole was 2.5e-3 off.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import heyoka as hy
import numba
import numpy as np

GAUSS = 0.01720209895  # sqrt(G M) of the Sun, au^(3/2) / day
LIGHT = 173.1446326847  # au / day
INVERSE_MASSES = [6023600, 408523.71, 328900.56, 3098708, 1047.3486, 3497.898, 22902.98, 19412.24]
"""Of the Sun over Mercury ... Neptune with their moons (IAU 2009)."""
PLANETS = {"mars": (3, 10_000_000, 4000), "earth": (2, 1_000_000, 2000)}
"""Number, years of the table, and years from one row to the next."""
EARTH = 2  # number of the Earth with its Moon
MOON_SHARE = 1 / (81.3007 + 2 + 1 / 81.3007)  # product of both masses over the square of their sum
MOON_DISTANCE = 0.0025696  # au
MOON_FACTOR = 0.8525  # for the Moon's eccentricity, inclination and perturbed orbit (Varadi et al. 2003)
STEP = 5.0  # days
YEAR = 365.25
WINDOW = 1000  # years
SEEN = 59  # steps between two looks within a window


def start() -> tuple[np.ndarray, np.ndarray]:
    """Heliocentric places (au) and velocities (au / day) at J2000."""
    time = hy.make_vars("millennia")
    places, velocities = [], []
    for planet in range(1, 9):
        series = hy.model.vsop2013_cartesian(planet, time_expr=time, thresh=1e-8)
        found = hy.cfunc(series, [time], compact_mode=True)(np.array([0.0]))
        places.append(found[:3])
        velocities.append(found[3:])
    return np.array(places), np.array(velocities)


@numba.njit(cache=True)
def drift(x, v, mu, step):
    """Along the Kepler orbit, in place, by differences of the eccentric anomaly (Danby 1988, ch. 6)."""
    r0 = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    u = x[0] * v[0] + x[1] * v[1] + x[2] * v[2]
    a = 1 / (2 / r0 - (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) / mu)
    n = math.sqrt(mu / (a * a * a))
    ec, es = 1 - r0 / a, u / (n * a * a)
    m = n * step
    change = m / (1 - ec)
    change = m - es * (1 - math.cos(change)) + ec * math.sin(change)
    for _ in range(20):
        s, c = math.sin(change), math.cos(change)
        f = change - ec * s + es * (1 - c) - m
        f1 = 1 - ec * c + es * s
        f2 = ec * s + es * c
        d = -f / f1
        d = -f / (f1 + d * f2 / 2)
        change += d
        if abs(d) < 1e-7:  # the next would be of its third power
            break
    s, c = math.sin(change), math.cos(change)
    r = a * (1 - ec * c + es * s)
    f, g = 1 - a / r0 * (1 - c), step - (change - s) / n
    df, dg = -a * a * n / (r * r0) * s, 1 - a / r * (1 - c)
    for i in range(3):
        x[i], v[i] = f * x[i] + g * v[i], df * x[i] + dg * v[i]


@numba.njit(cache=True)
def kick(x, v, gm, sun, step):
    """By the planets' gravity on each other, the relativistic potential -3 (G M / c r)^2, and the Sun's pull
    on the quadrupole of Earth and Moon, whose mean potential is -f G M m R^2 / (4 r^3).
    """
    count = len(gm)
    relativity = 6 * sun * sun / (LIGHT * LIGHT)
    moon = 0.75 * sun * MOON_FACTOR * MOON_SHARE * MOON_DISTANCE * MOON_DISTANCE
    for i in range(count):
        r2 = x[i, 0] ** 2 + x[i, 1] ** 2 + x[i, 2] ** 2
        pull = relativity / (r2 * r2) * step
        if i == EARTH:
            pull += moon / (r2 * r2 * math.sqrt(r2)) * step
        for a in range(3):
            v[i, a] -= pull * x[i, a]
        for j in range(i + 1, count):
            d0, d1, d2 = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
            r2 = d0 * d0 + d1 * d1 + d2 * d2
            w = step / (r2 * math.sqrt(r2))
            own, other = gm[j] * w, gm[i] * w
            v[i, 0] += own * d0
            v[i, 1] += own * d1
            v[i, 2] += own * d2
            v[j, 0] -= other * d0
            v[j, 1] -= other * d1
            v[j, 2] -= other * d2


@numba.njit(cache=True)
def jump(x, v, gm, sun, step):
    """By the Sun's motion about the barycentre."""
    for a in range(3):
        total = 0.0
        for i in range(len(gm)):
            total += gm[i] * v[i, a]
        total *= step / sun
        for i in range(len(gm)):
            x[i, a] += total


@numba.njit(cache=True)
def advance(x, v, gm, sun, step, count):
    """So many steps: half a kick, half a jump, a drift, and the halves again; kicks in a row are one."""
    kick(x, v, gm, sun, step / 2)
    for n in range(count):
        jump(x, v, gm, sun, step / 2)
        for i in range(len(gm)):
            drift(x[i], v[i], sun, step)
        jump(x, v, gm, sun, step / 2)
        kick(x, v, gm, sun, step if n < count - 1 else step / 2)


def elements(planet: int, x: np.ndarray, v: np.ndarray, gm: np.ndarray, sun: float) -> np.ndarray:
    """k, h, q, p and the semi-major axis of a planet, heliocentric and osculating."""
    moving = v + (gm @ v) / sun  # the Sun's own velocity taken off
    place, speed, mu = x[planet], moving[planet], sun + gm[planet]
    momentum = np.cross(place, speed)
    normal = momentum / np.linalg.norm(momentum)
    r = np.linalg.norm(place)
    e = np.cross(speed, momentum) / mu - place / r
    half = math.sqrt((1 + normal[2]) / 2)
    q, p = -normal[1] / (2 * half), normal[0] / (2 * half)
    f = np.array([1 - 2 * p * p, 2 * p * q, -2 * p * half])
    g = np.array([2 * p * q, 1 - 2 * q * q, 2 * q * half])
    return np.array([e @ f, e @ g, q, p, 1 / (2 / r - speed @ speed / mu)])


def rows(planet: int, last: float, every: int) -> list[tuple[float, np.ndarray]]:
    """Years and averaged elements; of the past if the last year is negative."""
    x, v = start()
    step = math.copysign(STEP, last)
    sun = GAUSS**2
    gm = sun / np.array(INVERSE_MASSES)
    v -= (gm @ v) / (sun + gm.sum())  # barycentric
    half = round(WINDOW / 2 * YEAR / STEP / SEEN)  # looks before the middle of a window
    advance(x, v, gm, sun, -step, half * SEEN)
    weights = np.cos(np.pi * np.arange(-half, half + 1) / (2 * half + 2)) ** 2
    weights /= weights.sum()
    between = round(every * YEAR / STEP)
    found, year = [], 0.0
    while abs(year) <= abs(last):
        mean = np.zeros(5)
        for weight in weights:
            mean += weight * elements(planet, x, v, gm, sun)
            advance(x, v, gm, sun, step, SEEN)
        found.append((year, mean))
        advance(x, v, gm, sun, step, between - len(weights) * SEEN)
        year += between * step / YEAR
    return found


def main() -> None:
    """Write a planet's table, of Mars unless another is named; into this folder unless a file is named."""
    name, last, path, *_ = [*sys.argv[1:], *("mars", None, None)[len(sys.argv) - 1 :]]
    planet, years, every = PLANETS[name]
    found = rows(planet, float(last or years), every)
    axis = np.mean([row[4] for _, row in found])
    lines = [
        f"# {name.title()}, secular: the eight planets integrated with the relativistic advance of perihelia"
        " and the quadrupole of",
        "# Earth and Moon, averaged over 1000 years; ecliptic and equinox of J2000, time from J2000.",
        "# Written by mars_secular.py.",
        f"# The mean of the semi-major axis is {axis:.7f} au.",
        "time [yr], eccentricity, inclination [deg], ascending_node [deg], longitude_of_periapsis [deg]",
    ]
    for year, (k, h, q, p, _) in found:
        angles = (2 * math.asin(math.hypot(q, p)), math.atan2(p, q), math.atan2(h, k))
        degrees = ", ".join(f"{math.degrees(x):.6f}" for x in angles)
        lines.append(f"{year:.0f}, {math.hypot(k, h):.8f}, {degrees}")
    target = Path(path) if path else Path(__file__).with_name(f"{name}_secular.csv")
    target.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
