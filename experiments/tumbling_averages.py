"""A tumbling body under the Sun: what does its average keep, over 10,000 orbits and over 100,000 years?

A triaxial body tumbles 230 times a revolution on an eccentric orbit, 10,000 revolutions (--full; 200
otherwise), in full and by both averages; then Toutatis for 100,000 years, with 2,000 of them in full (--full;
100 otherwise). Energy and size of the momentum don't change on average. The momentum precesses about the
orbit's normal at -3/2 (G M / a^3) (1 - e^2)^(-3/2) (D / L) cos(obliquity), with D from the mean of l . I l
along the free motion, taken from Euler's equations step by step (DOP853), without the elliptic integrals of
the model; within the part of a turn that it makes in one orbit, which is the size of what the average adds in
second order.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from experiments.common import Answer, Check, Curve, Panel, Picture, Result, Study, covered, simulate

DAY, YEAR, UNIT = 86400.0, 31557600.0, 149597870700.0
SUN = 1.32712440018e20
CONFIG = """
name = "tumbler"
[body]
{body}
[initial]
angular_velocity = {spin}
euler_angles = ["30 deg", "40 deg", "10 deg"]
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = {sun}
orbit = {{semi_major_axis = {axis}, eccentricity = {e}}}
[model]
level = "{level}"
short_period = {short}
[time]
end = {end}
samples = {samples}
[output]
record = {record}
estimate = {estimate}
"""
AVERAGES = {"spin_averaged": "blue", "orbit_averaged": "orange"}


@dataclass(frozen=True)
class Body:
    """A body and its orbit about the Sun.

    Attributes:
        text: of ``[body]``.
        spin: rates about the body axes, deg/day.
        au, e: of the orbit.
    """

    text: str
    spin: tuple[float, float, float]
    au: float
    e: float

    @property
    def axis(self) -> float:
        """Semi-major axis, m."""
        return self.au * UNIT

    @property
    def period(self) -> float:
        """Of the orbit, s."""
        return float(2 * np.pi * np.sqrt(self.axis**3 / SUN))

    @property
    def rates(self) -> np.ndarray:
        """rad/s."""
        return np.radians(self.spin) / DAY

    def run(self, level: str, end: float, samples: int) -> Result:
        """One model until a time (s); what an averaged one announces is measured after its run."""
        record = ["momentum_axis", "angular_momentum_norm", "energy"]
        return simulate(
            CONFIG.format(
                body=self.text, spin=[float(x) for x in self.rates], sun=SUN, axis=self.axis, e=self.e,
                level=level, short=str(level != "full").lower(), end=end, samples=samples,
                record=record + (["figure_axis"] if level == "full" else []),
                estimate=str(level != "full").lower(),
            ).replace("'", '"')
        )  # fmt: skip


# 230 turns a revolution; no resonance of turn, wobble and orbit is near
TUMBLER = Body("principal_moments = [1.0, 1.7, 2.0]", (91.2, 127.2, 175.2), 1.0, 0.3)
# its rates in 1992 (Hudson & Ostro 1995), its orbit's a and e
TOUTATIS = Body('preset = "toutatis"', (20.7, 31.3, 98.0), 2.53, 0.63)


def extremes(moments: np.ndarray, energy: float, momentum: float) -> tuple[float, float]:
    """Least and largest angle between the axis of the largest moment and the momentum in free motion, rad."""
    a, b, c = moments
    along = [(2 * energy - momentum**2 / x) / (1 / c - 1 / x) / momentum**2 for x in (a, b)]
    low, high = sorted(np.arccos(np.sqrt(np.clip(along, 0.0, 1.0))))
    return float(low), float(high)


def wobble(result: Result) -> np.ndarray:
    """Angle from the figure axis to the momentum at each sample, rad, at most a right one."""
    axes = result.values("figure_axis"), result.values("momentum_axis")
    return np.asarray(np.arccos(np.clip(np.abs((axes[0] * axes[1]).sum(axis=1)), 0.0, 1.0)))


def wobbles(
    when: str,
    moments: np.ndarray,
    given: Sequence[float],
    shares: Sequence[float],
    seen: np.ndarray,
    source: str,
    more: Sequence[float] = (0.0, 0.0),
) -> list[Check]:
    """Least and largest wobble seen, against those of the free motion.

    Args:
        given: energy and size of the momentum.
        shares: relative, by which both may be wrong.
        more: allowed besides, rad.
    """
    energy, momentum = given
    signs = [(x, y) for x in (-1, 1) for y in (-1, 1)]
    moved = [
        extremes(moments, energy * (1 + x * shares[0]), momentum * (1 + y * shares[1])) for x, y in signs
    ]
    checks = []
    for n, (word, value) in enumerate((("least", seen.min()), ("largest", seen.max()))):
        theory = extremes(moments, energy, momentum)[n]
        allowed = max(abs(pair[n] - theory) for pair in moved) + more[n]
        degrees = (float(np.degrees(x)) for x in (value, theory, allowed))
        checks.append(
            Check(f"tumbler: {word} wobble in the last {when}", *degrees, "deg", source, "absolute")
        )
    return checks


def beside(body: Body, title: str, end: float, samples: int, found: dict[str, Result]) -> list[Check]:
    """Each average's distance from the full motion, over what it announces; runs are put into ``found``."""
    for level in ("full", *AVERAGES):
        found[level] = body.run(level, end, samples).told(f"{title}, {level}")
    title += ", {}: momentum's direction"
    return [
        covered(title.format(level), found[level].apart(found["full"]), found[level].announced())
        for level in AVERAGES
    ]


def kept(full: Result, moments: np.ndarray) -> list[Check]:
    """What the averages take for constant, in the full motion."""
    checks, tenth = [], len(full.values("time")) // 10
    swings = {}
    for name, words in (("energy", "energy"), ("angular_momentum_norm", "size of the momentum")):
        values = full.values(name) / full.values(name).mean()
        swing = swings[name] = float(np.ptp(values))
        change = float(values[-tenth:].mean() - values[:tenth].mean())
        checks.append(Check(f"tumbler: change of the mean {words}", change, 0.0, swing / 10, "1",
                            "none; a tenth of its swing", "absolute"))  # fmt: skip
    names = ("energy", "angular_momentum_norm")
    given, shares = ([float(full.values(name).mean()) for name in names], [swings[name] for name in names])
    source = "free motion; swing of energy and momentum"
    return checks + wobbles("tenth", moments, given, shares, wobble(full)[-tenth:], source)


def mean_moment(moments: np.ndarray, energy: float, momentum: float) -> float:
    """Mean of l . I l along the free motion, by Euler's equations over some 400 turns (Hann)."""
    a, b, c = np.sort(moments)
    # where the part along the middle axis vanishes
    along = (2 * energy - momentum**2 / a) / (1 / c - 1 / a)
    start = np.sqrt([momentum**2 - along, 0.0, along]) / (a, b, c)
    scale = float(np.linalg.norm(start))

    def change(_: float, w: np.ndarray) -> list[float]:
        return [(b - c) / a * w[1] * w[2], (c - a) / b * w[2] * w[0], (a - b) / c * w[0] * w[1]]

    times = np.linspace(0.0, 2500.0, 50001)
    w = solve_ivp(change, (0.0, times[-1]), start / scale, "DOP853", times, rtol=1e-12, atol=1e-14).y
    parts = np.array([a, b, c])[:, None] * w
    values = (np.array([a, b, c])[:, None] * parts**2).sum(axis=0) / (parts**2).sum(axis=0)
    weights = np.hanning(len(times))
    return float(weights @ values / weights.sum())


def precession(body: Body, full: Result, averaged: Result) -> float:
    """Of the momentum about the orbit's normal, rad/s, for the energy and momentum of the start."""
    moments = moments_of(full)
    energy, momentum = (full.values(name)[0] for name in ("energy", "angular_momentum_norm"))
    d = (3 * mean_moment(moments, energy, momentum) - moments.sum()) / 2
    mean = SUN / body.axis**3 * (1 - body.e**2) ** -1.5
    return float(-1.5 * mean * d / momentum * averaged.values("momentum_axis")[:, 2].mean())


def moments_of(result: Result) -> np.ndarray:
    """Principal moments, as the dataset has them."""
    return np.array(json.loads(result.dataset.attrs["principal_moments"]))


def asteroid(full: bool, found: dict[str, Result]) -> list[Check]:
    """Toutatis beside its full motion, and over 100,000 years."""
    checks = beside(TOUTATIS, "Toutatis", (2000 if full else 100) * YEAR, 1001, found)
    long = found["long"] = TOUTATIS.run("orbit_averaged", 1e5 * YEAR, 50001).told("Toutatis, 100,000 years")
    axis, time = long.values("momentum_axis"), long.values("time")
    angle = np.unwrap(np.arctan2(axis[:, 1], axis[:, 0]))
    rate = precession(TOUTATIS, found["full"], long)
    measured = float(angle[-1] - angle[0]) / float(time[-1])
    allowed = abs(rate) * TOUTATIS.period / (2 * np.pi)
    name, yearly = "Toutatis: precession over 100,000 years", float(np.degrees(YEAR))
    source = "closed average, D by Euler's equations; second order in the precession of one orbit"
    checks.append(Check(name, measured * yearly, rate * yearly, allowed, "deg/yr", source))
    return checks


def picture(tumbler: dict[str, Result], toutatis: dict[str, Result]) -> Picture:
    """Distances from the full motion, and the wobble in it."""
    ways = (("tumbler", tumbler, TUMBLER), ("Toutatis", toutatis, TOUTATIS))
    panels = []
    for title, found, unit in ways:
        curves = []
        for level, color in AVERAGES.items():
            orbits = found[level].values("time")[1:] / unit.period
            curves += [Curve(orbits, found[level].apart(found["full"])[1:], level, color, ".", 0.6),
                       Curve(None, found[level].announced(), "", color, "--", 0.8)]  # fmt: skip
        panels.append(
            Panel(f"{title}; dashed: announced at the end", "revolutions",
                  "momentum's direction, distance (rad)", curves, "y", legend="lower right")
        )  # fmt: skip
    whole = tumbler["full"]
    energy, momentum = (float(whole.values(name).mean()) for name in ("energy", "angular_momentum_norm"))
    swings = [Curve(whole.values("time") / TUMBLER.period, np.degrees(wobble(whole)), "", "grey", ".", 0.5)]
    swings += [Curve(None, np.degrees(bound), "", "green")
               for bound in extremes(moments_of(whole), energy, momentum)]  # fmt: skip
    path = Curve(*toutatis["long"].values("momentum_axis")[:, :2].T, width=0.6)
    panels += [
        Panel("tumbler, full; green: extremes of the free motion", "revolutions",
              "figure axis from the momentum (deg)", swings),
        Panel("Toutatis: momentum's direction over 100,000 years", "X", "Y", [path], equal=True),
    ]  # fmt: skip
    return Picture(
        "Tumbling bodies under the Sun: averages beside every rotation", "ab;cd", panels, (11.5, 8.2)
    )


@Study
def study(full: bool) -> Answer:
    """Both bodies; see the module's text."""
    tumbler: dict[str, Result] = {}
    toutatis: dict[str, Result] = {}
    orbits = 10000 if full else 200
    checks = beside(TUMBLER, "tumbler", orbits * TUMBLER.period, 5001, tumbler)
    checks += kept(tumbler["full"], moments_of(tumbler["full"]))
    checks += asteroid(full, toutatis)
    return checks, picture(tumbler, toutatis)
