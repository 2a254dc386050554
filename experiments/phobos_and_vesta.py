"""Do Phobos and Vesta librate and nutate as published?

The ready scenes `phobos_libration`, 40 days, and `vesta_nutation`, 22 years, whose polar moment isn't
known: 0.4 M R^2, and again 0.38 and 0.42. Harmonics of the mean anomaly are fitted to Phobos' angle and to
Vesta's obliquity and node. Published: Rambaux et al. 2012 (Astron. Astrophys. 548, A14), Archinal et al.
2018 (Celest. Mech. Dyn. Astr. 130, 22), Rambaux 2013 (Astron. Astrophys. 556, A151). Formulas: 2 e/(1 -
n^2/s^2) with s = sqrt(3 G M (B - A)/(C a^3)); (3/2) n^2/w (C - A)/C cos(obliquity) (1 - e^2)^(-3/2), and
the half-yearly (3/4) n/w (C - A)/C sin(obliquity), less 5 e^2/2.
"""

import math

import numpy as np

from experiments.common import CONFIGS, Answer, Check, Curve, Panel, Picture, Result, Study, simulate

PHOBOS, VESTA = (CONFIGS / "bodies" / f"{name}.toml" for name in ("phobos_libration", "vesta_nutation"))
DAY, YEAR = 86400.0, 365.25
MAS = math.radians(1 / 3.6e6)
MARS, AXIS, ECCENTRICITY = 42828.3758157561e9, 9375e3, 0.0151
ANOMALISTIC = math.radians(1128.84475928 - 0.435227)  # rad/day
GAMMA = (0.4265 - 0.3615) / 0.5024
J2, SPIN = 0.0317799 * math.sqrt(5), math.radians(1617.3331237)
ORBIT = math.sqrt(1.32712440018e20 / (2.3615 * 149597870700.0) ** 3) * DAY  # rad/day
FLAT = 0.0887


def phobos() -> tuple[Result, float, float]:
    """A run, the amplitude once in an orbit (deg, of the sine of the anomaly), that of the free libration."""
    result = simulate(PHOBOS, "output.record=['quaternion', 'libration']")
    days, q = result.values("time") / DAY, result.values("quaternion")
    turned = np.unwrap(2 * np.arctan2(q[:, 3], q[:, 0]))
    columns = [np.ones_like(days), days]
    for k in (1, 2, 3):
        columns += [np.sin(k * ANOMALISTIC * days), np.cos(k * ANOMALISTIC * days)]
    columns += [f(free() * days) for f in (np.cos, np.sin)]
    found, *_ = np.linalg.lstsq(np.stack(columns, axis=1), turned, rcond=None)
    return result, math.degrees(found[2]), math.degrees(math.hypot(*found[-2:]))


def free() -> float:
    """Frequency of Phobos' small free libration, rad/day."""
    return math.sqrt(3 * GAMMA * MARS / AXIS**3) * DAY


def vesta(polar: float = 0.4) -> tuple[Result, float, float, float]:
    """A run, its precession (arcsec/yr), mean obliquity (rad) and the half-yearly amplitude of that (mas)."""
    moments = [polar - J2, polar - J2, polar]
    settings = ("body.preset=", f"body.principal_moments={moments!r}") if polar != 0.4 else ()
    result = simulate(
        VESTA, "output.record=['obliquity', 'node_longitude']", "output.estimate=false", *settings
    )
    days = result.values("time") / DAY
    columns = [np.ones_like(days), days, days**2]
    for k in range(1, 7):
        columns += [np.sin(k * ORBIT * days), np.cos(k * ORBIT * days)]
    matrix = np.stack(columns, axis=1)
    tilt, node = (
        np.linalg.lstsq(matrix, result.dataset[name].sel(axis="figure").values, rcond=None)[0]
        for name in ("obliquity", "node_longitude")
    )
    return result, float(node[1]) * YEAR / MAS / 1000, float(tilt[0]), math.hypot(*tilt[5:7]) / MAS


def picture(moon: Result, rock: Result, swing: float, nutation: float) -> Picture:
    """Phobos towards Mars and about its mean rotation; Vesta's obliquity and node."""
    days = moon.values("time")[:401] / DAY
    facing = -np.degrees(moon.values("libration")[:401, 0])  # counted as the rotation, like the other one
    years = rock.values("time") / DAY / YEAR
    nodding = []
    for name, color, label in (("obliquity", "blue", "obliquity"),
                               ("node_longitude", "orange", "node less its precession")):  # fmt: skip
        values = rock.dataset[name].sel(axis="figure").values
        rest = values - np.polyval(np.polyfit(years, values, 1), years)
        nodding.append(Curve(years, rest / MAS / 1000, label, color))
    title = "Phobos rocks by 1.1 degrees in each orbit, Vesta nods by 2 arcsec twice a year"
    return Picture(title, "ab", [
        Panel(f"Phobos: {abs(swing):.2f}° of its own, the rest is optical", "hours", "deg", [
            Curve(days * 24, facing, "long axis from the direction of Mars"),
            Curve(days * 24, swing * np.sin(ANOMALISTIC * days), "from uniform rotation", "red"),
        ], limits={"ylim": (-3.4, 4.6)}, legend="upper right"),
        Panel(f"Vesta: {nutation / 1000:.2f} arcsec in obliquity, twice in 3.6 years", "years", "arcsec",
              nodding, limits={"ylim": (-6.5, 9)}, legend="upper right"),
    ], (13, 5.0))  # fmt: skip


@Study
def study(full: bool) -> Answer:
    """Both bodies."""
    moon, swing, loose = phobos()
    rock, rate, tilt, nutation = vesta()
    lighter, heavier = vesta(0.38)[3], vesta(0.42)[3]
    formula = 2 * ECCENTRICITY / (1 - (ANOMALISTIC / free()) ** 2)
    h = J2 / 0.4
    secular = -1.5 * ORBIT**2 / SPIN * h * math.cos(tilt) * (1 - FLAT**2) ** -1.5 * YEAR / MAS / 1000
    half = 0.75 * ORBIT / SPIN * h * math.sin(tilt) * (1 - 2.5 * FLAT**2) / MAS
    abstract = "Rambaux 2013, abstract"
    return [
        Check("Phobos, once in an orbit", -swing, 1.1, 0.05, "deg", "Rambaux et al. 2012; one digit",
              "absolute"),
        Check("Phobos, beside what is observed", -swing, 1.143, 0.06, "deg",
              "Archinal et al. 2018; the body is taken as homogeneous", "absolute"),
        Check("Phobos, by the formula", swing, math.degrees(formula), 0.01, "deg",
              "first order in e and in the libration", "absolute"),
        Check("Phobos' free libration left by its start", loose, 0.0, 0.05, "deg", "none was meant",
              "absolute"),
        Check("Vesta, half-yearly nutation in obliquity", nutation, 2000.0, 150.0, "mas",
              f"{abstract}: about; the polar moment is open by 5 %", "absolute"),
        Check("Vesta, more of it with 0.38 than with 0.42", lighter - heavier, 200.0, 20.0, "mas",
              f"{abstract}: of the order of", "absolute"),
        Check("Vesta, the nutation by the formula", nutation, half, 0.005, "mas", "first order; e^4, n/w"),
        Check("Vesta's precession by the formula", rate, secular, 0.001, "arcsec/yr",
              "average; the nutations' squares, and that 22 years are no whole number of cycles"),
    ], picture(moon, rock, swing, nutation)  # fmt: skip
