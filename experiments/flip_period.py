"""How long does a body dwell before it flips about its intermediate axis, ever nearer to the separatrix?

Moments 1, 2, 3; w = (0, 1, d). The rate about the middle axis reverses every 2K/p ~ 2 ln(4 / k') / p with
k' ~ d. Reversals are found between samples by polynomials through 24 of them, good to 1e-28. The period
hangs on k'^2 ~ d^2, the small difference L^2 - 2 E I_2, of which double precision leaves nothing at d =
1e-8: so d <= 1e-4 is run in 80 bits, d <= 1e-6 in quadruple precision, and double must NOT find the period
at 1e-12.

Tolerance: L^2 and 2E each walk (eps/2) sqrt(steps) (Brouwer 1937), doubled as squares; three times sqrt(2)
eps sqrt(steps) L^2 over L^2 - 2 E I_2 is the relative error of k'^2, and over p that of the period.
"""

import math
from typing import Any

import mpmath
import numpy as np

from experiments.closed_forms import FreeTop, free_top
from experiments.common import EPSILON, Answer, Check, Curve, Panel, Picture, Result, Study, simulate
from experiments.measure import crossings

MOMENTS = (1, 2, 3)
FLIPS = 3
PER_UNIT = 50  # samples per 1/p
CONFIG = """
name = "flips"
body.principal_moments = [1, 2, 3]
initial.angular_velocity = [0, 1, "1e-{exponent}"]
[time]
end = "{end}"
samples = {samples}
[integrator]
precision = "{precision}"
[output]
record = ["angular_velocity"]
"""


def closed(exponent: int) -> FreeTop:
    """The closed form at offset 10^-exponent."""
    return free_top([mpmath.mpf(m) for m in MOMENTS], [mpmath.mpf(0), 1, mpmath.mpf(10) ** -exponent])


def bound(top: FreeTop, result: Result, precision: str) -> float:
    """Allowed error of one flip's duration, seconds; see the module's text."""
    beyond = abs(top.complement * top.p**2 * top.i1 * top.i2 * top.i3 / (top.i3 - top.i1))  # L^2 - 2 E I_2
    walk = 3 * math.sqrt(2) * EPSILON[precision] * math.sqrt(result.steps)
    return float(walk * top.momentum**2 / beyond / top.p)


def run(exponent: int, precision: str) -> tuple[Result, list[Any]]:
    """One run over some flips, and its reversals of w_y (mpf seconds)."""
    top = closed(exponent)
    end = (FLIPS + 0.8) * top.flip
    samples = int(end * top.p * PER_UNIT) + 1
    text = CONFIG.format(exponent=exponent, end=mpmath.nstr(end, 8), samples=samples, precision=precision)
    result = simulate(text)
    reversals = crossings(result.exact("time"), result.exact("angular_velocity", "y"), points=24)
    return result, reversals


def worst(top: FreeTop, reversals: list[Any]) -> Any:
    """The interval between reversals that is farthest from the closed form."""
    intervals = np.diff(np.array(reversals, dtype=object))
    return max(intervals, key=lambda interval: abs(interval - top.flip))


def picture(found: dict[str, list[tuple[int, float, float, float]]]) -> Picture:
    """Period against offset, and its error."""
    offsets = np.logspace(-1, -12, 100)
    curve = [float(free_top([mpmath.mpf(m) for m in MOMENTS], [mpmath.mpf(0), 1, mpmath.mpf(d)]).flip)
             for d in offsets]  # fmt: skip
    periods, errors = [Curve(offsets, curve, "2K(k)/p", "grey")], []
    for (precision, rows), color, marker in zip(
        found.items(), ("orange", "green", "blue"), "s^o", strict=True
    ):
        exponents, values, error, allowed = np.array(rows, dtype=float).T
        periods.append(Curve(10**-exponents, values, precision, color, marker, 1.7))
        errors += [Curve(10**-exponents, np.maximum(error, 1e-36), precision, color, marker, 1.7),
                   Curve(10**-exponents, allowed, "", color, "--", 1)]  # fmt: skip
    title = "Ten times nearer the separatrix, 2 ln(10)/p longer until the flip: to 1e-12, in enough digits"
    xlabel, limits = "offset d from the separatrix (rad/s)", {"xlim": (0.3, 3e-13)}
    return Picture(title, "ab", [
        Panel("Double precision loses it where d^2 < eps", xlabel, "time between flips (s)", periods, "x",
              limits=limits),
        Panel("Error; dashed: what rounding explains, ~ eps / d^2", xlabel, "error (s)", errors, "xy",
              limits=limits),
    ], (12, 5.2))  # fmt: skip


@Study
def study(full: bool) -> Answer:
    """Offsets from 1e-1 to 1e-12."""
    cases = {
        "double": range(1, 13) if full else (1, 2, 3, 6, 12),
        "extended": range(1, 13) if full else (4, 6),
        "quadruple": range(1, 13) if full else (6, 9, 12),
    }
    trusted = {"double": range(1, 4), "extended": range(4, 6), "quadruple": range(6, 13)}
    checks: list[Check] = []
    found: dict[str, list[tuple[int, float, float, float]]] = {}
    kept: dict[int, Result] = {}
    with mpmath.workdps(50):
        for precision, exponents in cases.items():
            for exponent in exponents:
                top = closed(exponent)
                result, reversals = run(exponent, precision)
                interval, allowed = worst(top, reversals), bound(top, result, precision)
                error = float(abs(interval - top.flip))
                found.setdefault(precision, []).append((exponent, float(interval), error, allowed))
                if exponent in trusted[precision]:
                    kept[exponent] = result
                    checks.append(
                        Check(f"flip at offset 1e-{exponent}, {precision}", interval, top.flip, allowed, "s",
                              "2K(k)/p; 3 x round-off of L^2 - 2 E I_2 over its value, over p", "absolute")
                    )  # fmt: skip
                if exponent == 12 and precision == "double":
                    checks.append(
                        Check("NOT in double at offset 1e-12", interval, top.flip, 1.0, "s",
                              "d^2 = 1e-24 < eps: the flip comes early by about ln(d^2/eps)/p", "apart")
                    )  # fmt: skip
        figure = picture(found)
    return checks, figure
