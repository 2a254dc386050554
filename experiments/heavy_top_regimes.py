"""Does a heavy symmetric top nutate, precess, sleep and swing as its elliptic integrals say?

The top of configs/heavy_top_*.toml in double precision (Landau & Lifshitz, Mechanics, section 35;
Whittaker, section 71). Turning points of the tilt are zeros of d(cos theta)/dt, between samples by
polynomials through the 12 nearest: good to (6!)^2/12! (2 pi/50)^12 = 2e-14 of the amplitude.

Tolerances are three times the round-off law of attitudes (Brouwer 1937), but for: the fast top at 90
degrees, whose plain formulas lack 2 e^2 (precession) and 3 e^2 (nutation), e = A mu/(C w3)^2 = 7.8e-4; the
sleeping top 0.1 % above its threshold w3^2 = 4 A mu/C^2, whose linear theory lacks (tilt/0.045)^2 = 1.3e-9;
and the growth rate, fitted after 12 e-folds (exp(-24) = 4e-11 of the decaying solution) and below 1e-6 rad.
"""

import math
from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np

from experiments.closed_forms import HeavyTop, heavy_top
from experiments.common import (
    CONFIGS,
    Answer,
    Check,
    Curve,
    Panel,
    Picture,
    Result,
    Study,
    round_off,
    simulate,
)
from experiments.measure import crossings, matrices, phase_rate, tilt, value_at

A, C, MASS, GRAVITY, ARM = ("2e-4", "1e-4", "0.1", "9.80665", "0.04")
RECORD = 'output.record=["angular_velocity", "quaternion"]'
READY = CONFIGS / "heavy_top_nutating.toml"


def constants() -> tuple[Any, Any, Any]:
    """A, C and mu = M g l, as mpf."""
    return mpmath.mpf(A), mpmath.mpf(C), mpmath.mpf(MASS) * mpmath.mpf(GRAVITY) * mpmath.mpf(ARM)


def spin(theta: str, rates: tuple[str, str, str], end: str, samples: int) -> Result:
    """The top, started at a tilt in degrees (phi = psi = 0) with body rates in rad/s."""
    return simulate(
        READY,
        RECORD,
        f'initial.euler_angles=[0, "{theta} deg", 0]',
        "initial.angular_velocity=[" + ", ".join(f'"{w}"' for w in rates) + "]",
        f"time.end={end}",
        f"time.samples={samples}",
    )


def closed(theta: str, rates: tuple[str, str, str]) -> HeavyTop:
    """The closed form of the same start."""
    a, c, mu = constants()
    return heavy_top(a, c, mu, mpmath.mpf(theta) * mpmath.pi / 180, [mpmath.mpf(w) for w in rates])


def axis(result: Result) -> np.ndarray:
    """The top's axis in space, (n, 3)."""
    return matrices(result.values("quaternion"))[:, :, 2]


def climb(result: Result) -> np.ndarray:
    """d(cos theta)/dt at the samples, from attitude and rates: Z . R (w x z)."""
    up = matrices(result.values("quaternion"))[:, 2, :]
    w = result.values("angular_velocity")
    return up[:, 0] * w[:, 1] - up[:, 1] * w[:, 0]


@dataclass(frozen=True)
class Nutation:
    """What the turning points of a run say; angles in rad."""

    period: float
    lowest: float
    highest: float
    count: int
    precession: float
    bound: float


def nutation(result: Result) -> Nutation:
    """Measure the nutation; ``bound`` is three times the round-off law, rad."""
    time, theta = result.values("time"), tilt(result.values("quaternion"))
    turning = {way: crossings(time, climb(result), direction=way) for way in (1, -1)}
    lows, highs = turning[1], turning[-1]
    low = np.mean([float(value_at(time, theta, t)) for t in lows])
    high = np.mean([float(value_at(time, theta, t)) for t in highs])
    phi = np.unwrap(np.arctan2(axis(result)[:, 0], -axis(result)[:, 1]))
    turned = value_at(time, phi, lows[-1]) - value_at(time, phi, lows[0])  # over whole nutations
    speed = float(np.linalg.norm(result.values("angular_velocity"), axis=1).max())
    period = float((lows[-1] - lows[0]) / (len(lows) - 1))
    precession = float(turned / (lows[-1] - lows[0]))
    return Nutation(period, float(low), float(high), len(lows) - 1, precession, round_off(result, speed))


REGIMES = {  # the axis' path: body rates that start at its upper turning point, 30 degrees
    "cusps": ("0", "0", "100"),
    "loops": ("0", "-3", "100"),
    "waves": ("0", "3", "100"),
}


def nutation_checks(full: bool) -> tuple[list[Check], dict[str, Result]]:
    """Cusps, loops and waves."""
    checks, results = [], {}
    for name, rates in REGIMES.items():
        result = results[name] = spin("30", rates, "50" if full else "5", 50001 if full else 5001)
        top, found = closed("30", rates), nutation(result)
        low, high = mpmath.acos(top.u1), mpmath.acos(top.u2)
        relative = found.bound / float(low - high) / (2 * math.pi * found.count)
        turned = abs(found.precession) * float(result.values("time")[-1])
        law = "3 x round-off law"
        checks += [
            Check(f"{name}: nutation period", found.period, top.nutation, relative, "s",
                  f"2K/p; {law} / amplitude / phase of {found.count} nutations"),
            Check(f"{name}: lower turning angle", found.lowest, low, found.bound, "rad",
                  f"root u1; {law}", "absolute"),
            Check(f"{name}: upper turning angle", found.highest, high, found.bound, "rad",
                  f"root u2; {law}", "absolute"),
            Check(f"{name}: mean precession", found.precession, top.precession, found.bound / turned, "rad/s",
                  f"Pi(n, k); {law} / angle turned"),
        ]  # fmt: skip
    return checks, results


def precession_checks(full: bool) -> list[Check]:
    """The fast top at 90 degrees, and regular precession."""
    a, c, mu = constants()
    slow = mu / (c * 1000)
    small = float(a * mu / (c * 1000) ** 2)
    released = spin("90", ("0", "0", "1000"), "4" if full else "2", 16001 if full else 8001)
    top, found = closed("90", ("0", "0", "1000")), nutation(released)
    turned = found.precession * float(released.values("time")[-1])
    regular = spin("90", ("0", mpmath.nstr(slow, 30), "1000"), "2", 2001)
    phi = np.arctan2(axis(regular)[:, 0], -axis(regular)[:, 1])
    rate = phase_rate(regular.values("time"), phi)
    sixty = simulate(CONFIGS / "heavy_top_regular_precession.toml", RECORD)
    wander = np.abs(tilt(sixty.values("quaternion")) - math.pi / 3).max()
    return [
        Check("fast top, 90 deg, from rest: mean precession", found.precession, slow, 3 * small**2, "rad/s",
              "mu/(C w3); 3 e^2, of which the theory's second order takes 2"),
        Check("the same", found.precession, top.precession, found.bound / turned, "rad/s",
              "Pi(n, k); 3 x round-off law / angle turned"),
        Check("its nutation rate", 2 * math.pi / found.period, c / a * 1000, 4 * small**2, "rad/s",
              "(C/A) w3; 4 e^2, of which the theory's second order takes 3"),
        Check("regular precession at 90 deg", rate, slow,
              round_off(regular, 1000) / (rate * float(regular.values("time")[-1])), "rad/s",
              "mu/(C w3), exact; 3 x round-off law / angle turned"),
        Check("regular precession at 60 deg: change of tilt", wander, 0.0, round_off(sixty, 198.2), "rad",
              "A p^2 cos - C w3 p + mu = 0; 3 x round-off law", "absolute"),
    ]  # fmt: skip


def sleeping(ratio: str, push: str, end: str) -> tuple[Result, Any]:
    """An upright top at ``ratio`` times the threshold with a push (rad/s); and its spin."""
    a, c, mu = constants()
    w3 = mpmath.mpf(ratio) * 2 * mpmath.sqrt(a * mu) / c
    return spin("0", (push, "0", mpmath.nstr(w3, 40)), end, 12001), w3


def largest_tilt(result: Result) -> float:
    """Between samples: a parabola through the largest and its neighbours (samples are dense)."""
    theta = tilt(result.values("quaternion"))
    i = int(theta[1:-1].argmax()) + 1
    before, at, after = theta[i - 1 : i + 2]
    return float(at + (after - before) ** 2 / (8 * (2 * at - before - after)))


def sleeping_checks() -> tuple[list[Check], dict[str, Result]]:
    """Both sides of the threshold, and the growth rate."""
    a, c, mu = constants()
    above, fast = sleeping("1.001", "1e-6", "30")
    spread = mpmath.sqrt((c * fast / a) ** 2 - 4 * mu / a)
    below, slow = sleeping("0.999", "1e-6", "30")
    lowest = mpmath.acos(heavy_top(a, c, mu, mpmath.mpf(0), (mpmath.mpf("1e-6"), 0, slow)).u1)
    growing, spun = sleeping("0.98", "1e-14", "7.5")
    growth = mpmath.sqrt(mu / a - (c * spun / (2 * a)) ** 2)
    time, theta = growing.values("time"), tilt(growing.values("quaternion"))
    part = (time * float(growth) > 12) & (theta < 1e-6)
    fitted = phase_rate(time[part], np.log(theta[part]))
    rounding = round_off(below, float(slow))
    checks = [
        Check("sleeping, 0.1 % above the threshold: largest tilt", largest_tilt(above), 2e-6 / spread, 1e-8,
              "rad", "2 e/spread, it stays up; 1e-8: the linear theory's next order is 1.3e-9"),
        Check("0.1 % below: largest tilt", largest_tilt(below), lowest, rounding, "rad",
              "root u1 of the cubic, it leans over; 3 x round-off law", "absolute"),
        Check("2 % below: growth rate", fitted, growth, 1e-9, "1/s",
              "sqrt(mu/A - (C w3/2A)^2); 1e-9: exp(-24) of the decaying solution, over the fit's stretch"),
    ]  # fmt: skip
    return checks, {"0.1 % above": above, "0.1 % below": below}


def pendulum_checks(full: bool) -> list[Check]:
    """No spin: periods of swings of several amplitudes (degrees from the lowest point)."""
    a, _, mu = constants()
    checks = []
    for degrees in (10, 45, 90, 135, 170, 179) if full else (45, 135, 179):
        amplitude = mpmath.mpf(degrees) * mpmath.pi / 180
        exact = 4 * mpmath.ellipk(mpmath.sin(amplitude / 2) ** 2) * mpmath.sqrt(a / mu)
        result = spin(str(180 - degrees), ("0", "0", "0"), mpmath.nstr(5 * exact, 20), 3001)
        q = result.values("quaternion")
        angle = np.unwrap(2 * np.arctan2(q[:, 1], q[:, 0])) - math.pi  # from the lowest point
        passes = crossings(result.values("time"), angle, direction=1)
        period = (passes[-1] - passes[0]) / (len(passes) - 1)
        speed = 2 * math.sqrt(float(mu / a)) * math.sin(float(amplitude) / 2)
        # an error d of the energy's angle moves K(k) as d/(1 - k^2), 1 - k^2 = cos^2(a/2)
        sensitivity = 1 / math.cos(float(amplitude) / 2) ** 2
        bound = round_off(result, speed) * sensitivity / (speed * float(exact))
        checks.append(
            Check(f"pendulum, {degrees} deg: period", period, exact, bound, "s",
                  "4 K(sin(a/2)) sqrt(A/mu); 3 x round-off law x dK/dk, over one swing")
        )  # fmt: skip
    return checks


def picture(paths: dict[str, Result], tilts: dict[str, Result]) -> Picture:
    """Tilts against time: with the closed form's turning angles, and near the sleeping threshold."""
    curves = []
    for (name, result), color in zip(paths.items(), ("blue", "orange", "green"), strict=True):
        part, top = result.values("time") <= 0.5, closed("30", REGIMES[name])
        curves.append(Curve(result.values("time")[part], np.degrees(tilt(result.values("quaternion")))[part],
                            name, color))  # fmt: skip
        curves += [Curve(None, math.degrees(mpmath.acos(u)), "", color, ":", 1) for u in (top.u1, top.u2)]
    sleeping = [
        Curve(result.values("time")[1:], np.degrees(tilt(result.values("quaternion")))[1:],
              f"{name} the threshold", color)
        for (name, result), color in zip(tilts.items(), ("blue", "red"), strict=True)
    ]  # fmt: skip
    title = "The heavy top keeps to its elliptic integrals: cusps, loops, waves, and sleep"
    return Picture(title, "ab", [
        Panel("Tilt; dotted: turning angles of the closed form", "time (s)", "tilt (deg)", curves),
        Panel("Sleeping top, pushed by 1e-6 rad/s", "time (s)", "tilt (deg)", sleeping, "y"),
    ], (12, 5))  # fmt: skip


@Study
def study(full: bool) -> Answer:
    """Every regime; see the module's text."""
    with mpmath.workdps(40):
        nutations, paths = nutation_checks(full)
        precessions = precession_checks(full)
        sleepers, tilts = sleeping_checks()
        pendulums = pendulum_checks(full)
        figure = picture(paths, tilts)
        return nutations + precessions + sleepers + pendulums, figure
