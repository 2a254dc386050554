"""The Earth over a million years: what does the motion of its orbit do to the obliquity?

The Earth under Sun and Moon, averaged over rotation and orbits, on a fixed orbit and on one that moves by
configs/tables/earth_secular.csv (our own integration of the planets), where the Moon acts with 1 - 3/2
sin^2 i of its strength. Published: IAU 2006 (Capitaine et al. 2003) over the next two thousand years, 1 %
and 0.2 %; 23.3 +- 1.3 deg (Laskar, Joutel & Robutel 1993); a mean period of 41,000 years (Berger 1976), 2
%, by which one million years differ from another. The full motion is beside it for a thousand years
(--full; 50 otherwise).
"""

import sys

import numpy as np

from experiments.common import CONFIGS, Answer, Check, Curve, Panel, Picture, Result, Study, covered, simulate

TABLE = CONFIGS / "tables" / "earth_secular.csv"
YEAR, ARCSEC = 31557600.0, np.pi / 648000
SUN, MOON = "1.32712440018e20", "4.902800e12"
INCLINATION = np.radians(5.145)
START = """
name = "earth"
body.preset = "earth"
[initial]
angular_velocity = [0, 0, "7.292115e-5 rad/s"]
euler_angles = ["180 deg", "84381.406 arcsec", 0]
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = {sun}
orbit = {{ {orbit} }}
{moon}
[model]
level = "{level}"
short_period = {short}
[time]
{times}
[output]
record = ["momentum_axis"]
estimate = {estimate}
"""
KEPLER = 'semi_major_axis = "1.495978707e11", eccentricity = 0.016709'
LOAD = """[[loads]]
kind = "gravity_gradient"
gravitational_parameter = {strength}
orbit = {{ semi_major_axis = "3.84399e8", eccentricity = 0.0549, period = "27.321661 day", {more} }}
"""
NODE = 'inclination = "5.145 deg", node_rate = "-0.05295383 deg/day"'


def columns() -> np.ndarray:
    """(rows, 5): time (yr), eccentricity, inclination, node, longitude of the pericentre (deg)."""
    return np.loadtxt(TABLE, delimiter=",", comments=("#", "time"))


def run(
    level: str,
    years: float,
    every: float | None,
    *,
    moving: bool = False,
    moon: bool = True,
    estimate: bool = False,
) -> Result:
    """The Earth from J2000 on, sampled every so many years, or at the rows of the table."""
    more, tables, orbit, strength = NODE, "", KEPLER, float(MOON)
    if moving:
        rows = columns()
        text = "\n".join(TABLE.read_text(encoding="utf-8").splitlines()[3:])
        plane = ["time [yr], inclination [deg], ascending_node [deg], longitude_of_periapsis [deg]"]
        plane += [f"{row[0]!r}, {row[2]!r}, {row[3]!r}, 0" for row in rows.tolist()]
        tables = "".join(
            f"[tables.\"{name}.csv\"]\ntext = '''\n{body}\n'''\n"
            for name, body in (("earth", text), ("plane", "\n".join(plane)))
        )
        orbit, more = 'table = "earth.csv", semi_major_axis = "1.495978707e11"', 'table = "plane.csv"'
        strength *= 1 - 1.5 * float(np.sin(INCLINATION)) ** 2
    load = LOAD.format(strength=repr(strength), more=more) if moon else ""
    averaged = str(level != "full").lower()
    times = f'end = "{years} yr"\nevery = "{every} yr"'
    if every is None:
        times = f"times = [{', '.join(repr(f'{row:.10g} yr') for row in columns()[:, 0])}]"
    text = START.format(
        sun=SUN, orbit=orbit, moon=load, level=level, short=averaged, times=times,
        estimate=str(estimate).lower(),
    )  # fmt: skip
    return simulate(text + tables)


def normals() -> np.ndarray:
    """(rows, 3): of the moving orbit."""
    i, node = np.radians(columns()[:, 2:4]).T
    return np.array([np.sin(i) * np.sin(node), -np.sin(i) * np.cos(node), np.cos(i)]).T


def obliquity(axes: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Angle between axis and plane's normal, rad."""
    return np.asarray(np.arccos(np.clip((axes * planes).sum(axis=1), -1.0, 1.0)))


def longitude(axes: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Of the equinox in the moving plane, counted from the departure point that doesn't turn with it, rad."""
    equinox = np.cross(axes, planes)
    equinox /= np.linalg.norm(equinox, axis=1)[:, None]
    # a direction carried along with the plane, by the shortest turn from each row's normal to the next one's
    carried, found = np.array([1.0, 0.0, 0.0]), []
    for number, normal in enumerate(planes):
        if number:
            before = planes[number - 1]
            carried = carried - (carried @ normal) / (1 + before @ normal) * (before + normal)
        across = np.cross(normal, carried)
        found.append(np.arctan2(equinox[number] @ across, equinox[number] @ carried))
    return np.unwrap(found)


def period(times: np.ndarray, values: np.ndarray) -> float:
    """Mean time from one maximum to the next."""
    inner = (values[1:-1] > values[:-2]) & (values[1:-1] >= values[2:])
    peaks = times[1:-1][inner]
    return float((peaks[-1] - peaks[0]) / (len(peaks) - 1))


def obliquity_rate(years: float) -> float:
    """Mean rate of obliquity over so many years from J2000, IAU 2006, arcsec a century."""
    t = years / 100
    return -46.836769 - 0.0001831 * t + 0.00200340 * t**2


def precession_rate(years: float) -> float:
    """Mean rate of the general precession over so many years from J2000, IAU 2006, arcsec a year."""
    return (5028.796195 + 1.1054348 * years / 100) / 100


def beside(span: int) -> list[Check]:
    """The average by the table beside every rotation, over so many years."""
    levels = ("orbit_averaged", "full")
    averaged, full = (
        run(level, span, span / 100, moving=True, estimate=level != "full").told(f"{span} years, {level}")
        for level in levels
    )
    return [covered("moving orbit: the average", averaged.apart(full), averaged.announced())]


def sun_alone() -> Check:
    """What averaging over the rotation saves where the year sets the steps."""
    levels = ("full", "spin_averaged")
    full, averaged = (run(x, 1000, 100, moon=False).told(f"Sun alone, 1000 years, {x}") for x in levels)
    share = averaged.steps / full.steps
    saved = f"{1 / share:.0f} times fewer steps, {full.seconds / averaged.seconds:.0f} times less CPU"
    print(f"Sun alone: spin_averaged takes {saved}", file=sys.stderr)
    name = "Sun alone: steps of spin_averaged over the full model's"
    return Check(name, share, 0.0, 0.01, "1", "a hundredth, as asked", "absolute")


def picture(fixed: Result, years: np.ndarray, tilt: np.ndarray) -> Picture:
    """Obliquity along time, and the orbit's plane."""
    still = obliquity(fixed.values("momentum_axis"), np.array([[0.0, 0.0, 1.0]]))
    title = "The Earth over a million years: obliquity on a fixed and on its moving orbit"
    return Picture(title, "a;b", [
        Panel("", "", "obliquity (deg)", [
            Curve(years / 1000, tilt, "moving orbit"),
            Curve(fixed.values("time") / YEAR / 1000, np.degrees(still), "fixed orbit", "orange"),
        ], legend="upper center"),
        Panel("", "time from J2000 (kyr)", "orbit's inclination (deg)",
              [Curve(years / 1000, columns()[: len(years), 2], "", "grey")]),
    ], (11.5, 5.6))  # fmt: skip


@Study
def study(full: bool) -> Answer:
    """Both orbits, and the Sun alone; see the module's text."""
    planes, years = normals(), columns()[:, 0]
    end = float(years[-1])
    fixed = run("orbit_averaged", end, 500, estimate=True).told("fixed orbit, orbit_averaged")
    moving = run("orbit_averaged", end, None, moving=True, estimate=True)
    moving.told("moving orbit, orbit_averaged")
    still = obliquity(fixed.values("momentum_axis"), np.array([[0.0, 0.0, 1.0]]))
    tenth = len(still) // 10
    tilt = np.degrees(obliquity(moving.values("momentum_axis"), planes))
    turn = longitude(moving.values("momentum_axis"), planes)
    first = float(years[1])
    slope = np.radians(tilt[1] - tilt[0]) / first / ARCSEC * 100
    general = -(turn[1] - turn[0]) / first / ARCSEC
    middle = (tilt.max() + tilt.min()) / 2
    swing = (tilt.max() - tilt.min()) / 2
    print(f"moving orbit: {tilt.min():.3f} to {tilt.max():.3f} deg", file=sys.stderr)
    change = float(still[-tenth:].mean() - still[:tenth].mean())
    iau, laskar = "IAU 2006; mean over the first row", "Laskar et al. 1993"
    checks = [
        Check("fixed orbit: change of the mean obliquity", change, 0.0, fixed.announced(), "rad",
              "none; announced error", "absolute"),
        Check("moving orbit: obliquity's rate", slope, obliquity_rate(first), 0.01, "arcsec/cy", iau),
        Check("moving orbit: middle of its range", middle, 23.3, 0.1, "deg", laskar, "absolute"),
        Check("moving orbit: half its range", swing, 0.65, 0.65, "deg", f"{laskar}: at most 1.3", "absolute"),
        Check("moving orbit: period of obliquity", period(years, tilt), 41000.0, 0.02, "yr", "Berger 1976"),
        Check("moving orbit: general precession", general, precession_rate(first), 0.002, "arcsec/yr", iau),
        *beside(1000 if full else 50),
        sun_alone(),
    ]  # fmt: skip
    return checks, picture(fixed, years, tilt)
