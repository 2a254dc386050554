"""In how many days does the pole of a rigid Earth go round its figure axis, and is that Chandler's period?

Rates alone, ten years: the azimuth of the pole grows linearly, and its rate is a least-squares fit; with
the measured moments (preset "earth"), and with a homogeneous ellipsoid of the Earth's diameters. Euler's
closed form is A/(C-A) rotations, (a^2+c^2)/(a^2-c^2) for the ellipsoid; ten years are 12 turns, so that
rounding leaves 1e-12 at worst. The real, elastic Earth's 427 to 435 days must NOT come out.
"""

from typing import Any

import mpmath
import numpy as np

from experiments.common import COLORS, CONFIGS, Answer, Check, Curve, Panel, Picture, Result, Study, simulate
from experiments.measure import phase_rate

FLATTENING = "0.00327379492"  # (C-A)/C, Mathews, Herring & Buffett 2002
SPIN = "7.292115e-5"  # rad/s, nominal (Groten 2004)
DIAMETERS = (12756, 12714)  # km, equatorial and polar
CHANDLER = (427.0, 435.0)  # days: Chandler 1891; Gross 2007
DAY = 86400


def pole_rate(result: Result) -> float:
    """Rate of the pole's azimuth in the body, rad/s."""
    w = result.values("angular_velocity")
    return phase_rate(result.values("time"), np.arctan2(w[:, 1], w[:, 0]))


def picture(result: Result, days: dict[str, float]) -> Picture:
    """The pole's path over one turn, and the three periods."""
    period = days["measured moments"]
    w, time = result.values("angular_velocity"), result.values("time") / DAY
    arcsec = np.degrees(w[:, :2] / w[:, 2:3]) * 3600
    turn, span, marks = time <= period, time <= 900, arcsec[0:304:50]

    def named(axes: Any) -> None:
        for number, mark in enumerate(marks):
            axes.annotate(f"day {50 * number}", 0.8 * mark, ha="center", va="center", fontsize=8.5)

    periods = [Curve(n * period, None, label, "orange", "--")
               for n, label in ((1, f"{period:.2f} d and twice that"), (2, ""))]  # fmt: skip

    def band(axes: Any) -> None:
        axes.axvspan(*CHANDLER, color=COLORS["red"], alpha=0.25, label="Chandler's period (elastic)")

    return Picture(f"A rigid Earth nutates in {period:.2f} days, not in Chandler's 427 to 435", "ab", [
        Panel("One turn of the pole, in the body", "pole along x (arcsec)", "pole along y (arcsec)",
              [Curve(*arcsec[turn].T, width=2), Curve(*marks.T, style="o"), Curve(0, 0, "", "grey", "+", 3)],
              equal=True, more=named),
        Panel("Measured moments, (C - A)/C = 0.00327379492", "time (mean solar days)",
              "pole along x (arcsec)",
              [Curve(time[span], arcsec[span, 0], "rigid Earth: pole along x"), *periods],
              limits={"ylim": (-0.23, 0.33)}, legend="upper right", more=band),
    ], (11, 5.2), {"width_ratios": [1, 1.5]})  # fmt: skip


@Study
def study(full: bool, flattening: str = FLATTENING) -> Answer:
    """Both Earths against Euler; see the module's text.

    Args:
        flattening: that the measured moments are held against.
    """
    years = 40 if full else 10
    length = f'time.end="{365 * years} day"'
    every = 'time.every="1 day"'
    measured = simulate(CONFIGS / "earth_free_nutation.toml", length, every)
    axes = simulate(CONFIGS / "earth_free_nutation_axes.toml", length, every,
                    'output.record=["angular_velocity"]')  # fmt: skip
    with mpmath.workdps(30):
        h, spin = mpmath.mpf(flattening), mpmath.mpf(SPIN)
        rotation = 2 * mpmath.pi / spin / DAY
        turns = {"measured moments": (1 - h) / h}
        a, c = (mpmath.mpf(d) / 2 for d in DIAMETERS)
        turns["axes"] = (a**2 + c**2) / (a**2 - c**2)
        expected = {name: float(n * rotation) for name, n in turns.items()}
    rates = {"measured moments": pole_rate(measured), "axes": pole_rate(axes)}
    days = {name: 2 * np.pi / rate / DAY for name, rate in rates.items()}
    rotations = float(spin) / rates["measured moments"]
    closed = "Euler 1765, closed form; 1e-9: nine digits of the inputs, rounding is below 1e-12"
    checks = [
        Check("nutation, measured moments", rotations, float(turns["measured moments"]), 1e-9, "rotations",
              closed),
        Check("nutation, measured moments", days["measured moments"], expected["measured moments"], 1e-9,
              "days", closed),
        Check("as printed, in rotations", rotations, 304.456, 5e-4, "rotations",
              "Mathews et al. 2002; half of the last printed digit", "absolute"),
        Check("as printed, in mean solar days", days["measured moments"], 303.62, 5e-3, "days",
              "Mathews et al. 2002; half of the last printed digit", "absolute"),
        Check("nutation, from the axes", days["axes"], expected["axes"], 1e-9, "days", closed),
        Check("NOT Chandler's period (measured moments)", days["measured moments"], sum(CHANDLER) / 2,
              (CHANDLER[1] - CHANDLER[0]) / 2, "days",
              "Chandler 1891, Gross 2007: 427 to 435 d, elastic; half the width of the band", "apart"),
        Check("NOT Chandler's period (axes)", days["axes"], sum(CHANDLER) / 2,
              (CHANDLER[1] - CHANDLER[0]) / 2, "days", "as above", "apart"),
    ]  # fmt: skip
    return checks, picture(measured, days)
