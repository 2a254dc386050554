"""Does Mercury librate as observed and as published, with the Sun where it is?

The ready scene `mercury_libration` over 150 years: harmonics of the mean anomaly, six long periods, the
free libration and a parabola are fitted to the angle about the mean pole. Again with a core that brings the
largest libration to 41 arcsec, and, rigid and set librating freely, with the moments of Rambaux & Bois 2004
(Astron. Astrophys. 413, 381), whose free period is n sqrt(3 (B - A)/C_m (7 e/2 - 123 e^3/16 + 489
e^5/128)).

Published: Margot et al. 2012 (J. Geophys. Res. 117, E00L09); Archinal et al. 2018; Stark, Oberst & Hussmann
2015 (Celest. Mech. Dyn. Astr. 123, 263), 6.138506839(28) deg/day; Dufey et al. 2009 (Celest. Mech. Dyn.
Astr. 101, 141); Peale, Margot & Yseboodt 2009 (Icarus 199, 1).
"""

import math
from dataclasses import dataclass

import numpy as np

from experiments.common import CONFIGS, Answer, Check, Curve, Panel, Picture, Study, simulate
from experiments.measure import matrices

ARCSEC = math.radians(1 / 3600)
YEAR = 365.25
FORCED = (11.862, 5.931, 5.663, 14.73, 6.58, 3.954)
"""Periods of forced librations, yr: Jupiter and its harmonics, Venus (the third), Saturn, the Earth."""
HARMONICS = 6
SCENE = CONFIGS / "kernels" / "mercury_libration.toml"
START = 2415083.0 - 2451545.0
IAU = (38.421252, -4.043124, -0.39744, -0.091404, -0.020556)
"""Of sin kM in the IAU's W, arcsec."""
STARK, SLIDE = 6.138506839, -0.0328 * math.sin(math.radians(61.45)) / 36525
"""deg/day: the published rate of W, and how the node of the equator on the Earth's slides along it."""
DUFEY = ("body.core.moment=0.599", 'initial.prime_meridian="247.5241476066 deg"',
         'initial.angular_velocity=[0, 0, "6.139108854766 deg/day"]')  # fmt: skip
"""A core with which the libration of 88 days is of 41 arcsec, and a start without free libration."""
MOMENTS = [1 - (6e-5 + 2e-5) / 0.34, 1 - (6e-5 - 2e-5) / 0.34, 1]
RIGID = ("body.preset=", "body.core=", f"body.principal_moments={MOMENTS!r}")


def anomaly(days: np.ndarray) -> np.ndarray:
    """Mean anomaly of Mercury, rad, so many days after J2000 (Archinal et al. 2018)."""
    return np.asarray(np.radians(174.7910857 + 4.092335 * days))


def angle(quaternion: np.ndarray) -> np.ndarray:
    """Angle of the x axis about the mean z axis, rad, continuous, from where that plane cuts the XY plane."""
    axes = matrices(quaternion)
    first, pole = axes[:, :, 0], axes[:, :, 2].mean(axis=0)
    pole /= np.linalg.norm(pole)
    node = np.array([-pole[1], pole[0], 0.0]) / math.hypot(pole[0], pole[1])
    return np.unwrap(np.arctan2(first @ np.cross(pole, node), first @ node))


@dataclass(frozen=True)
class Libration:
    """Lines of a libration in longitude.

    Attributes:
        rate: mean rate at J2000, deg/day.
        annual: amplitudes of sin kM, arcsec, from k = 1.
        quadrature: the largest of cos kM, arcsec.
        forced: amplitudes by period (yr), arcsec.
        free: complex amplitude of the free libration, as C exp(i s t) with t from the first sample, arcsec.
        period: the free libration's, yr.
        rest: what is left over, arcsec, rms.
    """

    rate: float
    annual: list[float]
    quadrature: float
    forced: dict[float, float]
    free: complex
    period: float
    rest: float


def fit(days: np.ndarray, turned: np.ndarray, near: float) -> Libration:
    """All lines, a parabola, and a free libration that is well seen, of a period (yr) near a given one."""
    width = 0.05
    for _ in range(4):  # the rest is quadratic in the period, near its least value
        tried = [lines(days, turned, near + step) for step in (-width, 0.0, width)]
        a, b, c = (one.rest**2 for one in tried)
        if a - 2 * b + c > 0:
            near += max(min(width * (a - c) / (2 * (a - 2 * b + c)), 5 * width), -5 * width)
        width /= 4
    return lines(days, turned, near)


def lines(days: np.ndarray, turned: np.ndarray, free: float) -> Libration:
    """All lines, a parabola, and a free libration of a given period (yr), by least squares."""
    centuries, m = days / 36525, anomaly(days)
    columns = [centuries**k for k in range(3)]
    for k in range(1, HARMONICS + 1):
        columns += [np.sin(k * m), np.cos(k * m)]
    for period in (*FORCED, free):
        phase = 2 * math.pi * (days - days[0]) / (YEAR * period)
        columns += [np.cos(phase), np.sin(phase)]
    matrix = np.stack(columns, axis=1)
    found, *_ = np.linalg.lstsq(matrix, turned / ARCSEC, rcond=None)
    annual, late = found[3 : 3 + 2 * HARMONICS], found[3 + 2 * HARMONICS :]
    return Libration(
        float(found[1]) / 3600 / 36525,
        annual[::2].tolist(),
        float(np.abs(annual[1::2]).max()),
        {period: float(np.hypot(*late[2 * i : 2 * i + 2])) for i, period in enumerate(FORCED)},
        complex(late[-2], -late[-1]),
        free,
        float(np.std(turned / ARCSEC - matrix @ found)),
    )


def run(*settings: str) -> tuple[np.ndarray, np.ndarray]:
    """Days after J2000, and the angle turned, rad."""
    result = simulate(SCENE, "output.record=['quaternion']", "output.estimate=false", *settings)
    return START + result.values("time") / 86400, angle(result.values("quaternion"))


def free_period(ratio: float) -> float:
    """Of the libration, yr, for (B - A) over the moment that librates."""
    e = 0.2056336
    return 87.9691 / math.sqrt(3 * ratio * (7 * e / 2 - 123 * e**3 / 16 + 489 * e**5 / 128)) / YEAR


def picture(days: np.ndarray, turned: np.ndarray, real: Libration) -> Picture:
    """A few orbits, 150 years, and amplitudes by the period of the free libration."""
    rest = turned / ARCSEC - np.polyval(np.polyfit(days, turned / ARCSEC, 1), days)
    m, few = anomaly(days), slice(0, 132)
    annual, observed = (
        sum(a * np.sin((k + 1) * m) for k, a in enumerate(lines)) for lines in (real.annual, IAU)
    )
    slow, span, years = rest - annual, days[few] - days[0], 2000 + days / YEAR
    period = np.linspace(10, 20, 2001)
    resonance = [Curve(period, real.annual[0] * (real.period / period) ** 2, "88 days", "grey", width=1),
                 Curve(real.period, real.annual[0], "", "grey", "o")]  # fmt: skip
    for line, color, name in ((11.862, "red", "Jupiter, 11.86 y"), (5.663, "blue", "Venus, 5.66 y"),
                              (14.73, "orange", "Saturn, 14.73 y")):  # fmt: skip
        push = abs(real.forced[line] * ((real.period / line) ** 2 - 1))
        amplitude = push / np.maximum(np.abs((period / line) ** 2 - 1), 1e-6)
        resonance += [Curve(period, amplitude, name, color, width=1),
                      Curve(real.period, real.forced[line], "", color, "o")]  # fmt: skip
    title = "Mercury's librations: 38 arcsec each year, and as much again with Jupiter"
    return Picture(title, "abc", [
        Panel("Libration in longitude, three years of Mercury", "days", "arcsec", [
            Curve(span, annual[few] + slow[few] - slow[few].mean(), "run"),
            Curve(span, observed[few], "the IAU's lines", "orange", "--", 1),
        ], limits={"ylim": (-48, 62)}, legend="upper right"),
        Panel("150 years: Jupiter's line of 11.86 years", "", "arcsec", [
            Curve(years, rest, "all", "grey", width=0.2),
            Curve(years, slow, "without that of 88 days", "red"),
        ], limits={"ylim": (-100, 135)}, legend="upper right"),
        Panel("Near resonance (dots: the run)", "period of the free libration, yr", "amplitude, arcsec",
              resonance, "y", limits={"ylim": (0.3, 1000)}, legend="upper right"),
    ], (14, 5.0))  # fmt: skip


@Study
def study(full: bool) -> Answer:
    """Lines of three runs."""
    ratio = 4 * 0.8067e-5 / 0.346
    days, turned = run()
    real = lines(days, turned, free_period(ratio / 0.431))
    other = lines(*run(*DUFEY), free_period(ratio / 0.401))
    loose = fit(*run(*RIGID), 15.85)
    first = real.annual[0]
    checks = [
        Check("libration of 88 days", first, 38.5, 1.6, "arcsec", "Margot et al. 2012; its error",
              "absolute"),
        *(Check(f"harmonic {k} of it, scaled to the IAU's first", real.annual[k - 1] * IAU[0] / first,
                IAU[k - 1], 0.02, "arcsec", "Archinal et al. 2018; the others' 0.02", "absolute")
          for k in range(2, 6)),
        Check("mean rate of the prime meridian", real.rate - SLIDE, STARK, 2.8e-8, "deg/day",
              "Stark et al. 2015; its error", "absolute"),
        Check("Jupiter's line of 11.86 years over that of 88 days", real.forced[11.862] / first, 1.0, 0.1,
              "1", "Peale et al. 2009, abstract: may exceed it; a tenth", "apart"),
    ]  # fmt: skip
    source = "Dufey et al. 2009, abstract; one digit"
    largest = other.annual[0]
    for name, period, share, allowed in (
        ("Jupiter, 11.86 years", 11.862, 0.33, 0.05),
        ("Venus, 5.66 years", 5.663, 0.10, 0.01),
        ("Saturn, 14.73 years", 14.73, 0.03, 0.005),
        ("the Earth, 6.58 years", 6.58, 0.02, 0.005),
    ):
        found = other.forced[period] / largest
        checks.append(Check(f"{name}, over 41 arcsec", found, share, allowed, "1", source, "absolute"))
    checks += [
        Check("largest libration of the second run", largest, 41.0, 0.5, "arcsec", source, "absolute"),
        Check("free libration, moments of 2004", loose.period, 15.847, 0.01, "yr",
              "Rambaux & Bois 2004; the moments' digits, and a finite amplitude", "absolute"),
        Check("the same by the formula", loose.period, free_period(4e-5 / 0.34), 1e-3, "yr",
              "first order; the eccentricity changes"),
    ]  # fmt: skip
    return checks, picture(days, turned, real)
