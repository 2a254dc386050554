"""How do errors grow over long runs, and what does holding the invariants change?

Brouwer (1937, Astron. J. 46, 149) found that rounding alone makes the energy of an orbit wander like t^(1/2)
and its phase like t^(3/2). A free asymmetric body and a heavy symmetric top, 12 nearby starts for each
precision, are compared with the closed form in quadruple precision, which is exact at any time. Times are in
radians of the fastest rate. Lines are fitted to the logarithms of the root mean squares over the starts; the
exponents' uncertainty is from resampling the starts (bootstrap).

Tolerances are "auto". At epsilon itself truncation leaves a bias wherever rounding the series' order up gains
little: in single precision (order 9 for 8.97) the mean energy error of 24 starts was 9 standard errors from
zero at 1.3e5 rad, in 80 bits (23 for 22.83) that of 16 starts 3.2 at 3e4 rad. With an eighth of epsilon
(orders 11 and 24) they are 1.7 and 0.2. Double precision (20 for 19.02) shows none.
(tests/solve/test_auto_tolerance.py)

Reduced: single to 1e4, double to 1e5 rad, extended to 1e4; --full: 1e5, 1e7 and 1e6 (an hour and a half).
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import mpmath
import numpy as np
import xarray

import rigidsim
from experiments.common import EPSILON, Answer, Check, Curve, Panel, Picture, Study
from rigidsim.accuracy.comparison import angles_between, try_setting
from rigidsim.accuracy.setting import Setting

STARTS = 12
PER_DECADE = 4
REDUCED = {"single": 1e4, "double": 1e5, "extended": 1e4}
FULL = {"single": 1e5, "double": 1e7, "extended": 1e6}
FIRST = 1e2
FIT_FROM = 1e3  # before that the rounding of the evaluation itself is seen
LOST = 0.03  # rad: beyond it an attitude error no longer grows freely
QUANTITIES = ("energy", "angular momentum", "attitude")
LAW = {"energy": 0.5, "angular momentum": 0.5, "attitude": 1.5}
HELD_LAW = 1.0  # of the attitude where the frequencies are held

BODIES = {
    "free asymmetric body": """
name = "free"
body.principal_moments = [1, 2, 3]
[initial]
angular_velocity = [{a}, {b}, {c}]
euler_angles = [0, 1, 0]
[time]
end = {end}
""",
    "heavy symmetric top": """
name = "top"
[body]
principal_moments = [1, 1, "1/2"]
mass = 1
center_of_mass = [0, 0, "1/4"]
[initial]
angular_velocity = [{a}, {b}, {c}]
euler_angles = [0, 1, 0]
[[loads]]
kind = "uniform_gravity"
acceleration = [0, 0, -1]
[time]
end = {end}
""",
}
RATES = {"free asymmetric body": (0.5, 0.25, 1.0), "heavy symmetric top": (0.3, 0.2, 1.0)}
MOMENTUM = {"free asymmetric body": "angular_momentum", "heavy symmetric top": "angular_momentum_vertical"}


def times(horizon: float) -> list[float]:
    """Radians: the start, and evenly spaced logarithms from 1e2 on; single precision means them exactly."""
    count = round(PER_DECADE * math.log10(horizon / FIRST)) + 1
    return [0.0, *(float(np.float32(round(t))) for t in np.geomspace(FIRST, horizon, count))]


def experiment(body: str, start: int, end: float) -> rigidsim.Experiment:
    """The scene of one start: rates a few thousandths off, in decimals that every precision reads exactly.

    The fastest rate is the largest component of 1 (within the same thousandths), so that seconds are radians.
    """
    offsets = np.random.default_rng([start, len(body)]).integers(-64, 65, size=3) / 16384
    a, b, c = (repr(rate + float(offset)) for rate, offset in zip(RATES[body], offsets, strict=True))
    return rigidsim.parse(BODIES[body].format(a=a, b=b, c=c, end=repr(end)))


def measure(body: str, precision: str, held: bool, horizon: float, starts: int = STARTS) -> xarray.Dataset:
    """Absolute errors of every start at every time: dimensions ``start``, ``time``."""
    moments = times(horizon)
    grown = slice(1, None)  # nothing has grown at the start
    exact = [mpmath.mpf(t) for t in moments]
    errors = np.full((len(QUANTITIES), starts, len(moments) - 1), np.nan)
    cpu = np.zeros(starts)
    for start in range(starts):
        scene = experiment(body, start, moments[-1])
        reference = try_setting(scene, Setting("quadruple", method="closed_form"), exact)
        trial = try_setting(scene, Setting(precision, hold_invariants=held), exact)
        errors[0, start] = np.abs(trial.histories["energy"])[grown]
        errors[1, start] = np.abs(trial.histories[MOMENTUM[body]])[grown]
        errors[2, start] = angles_between(trial.attitudes, reference.attitudes)[grown]
        cpu[start] = trial.cpu_seconds
    return xarray.Dataset(
        {"error": (("quantity", "start", "time"), errors), "cpu_seconds": (("start",), cpu)},
        coords={"quantity": list(QUANTITIES), "time": moments[grown]},
        attrs={"body": body, "precision": precision, "held": int(held)},
    )


@dataclass(frozen=True)
class Fit:
    """error = factor * t^exponent; sigma: of the exponent; start, end: of the times that it was fitted to."""

    exponent: float
    sigma: float
    factor: float
    start: float
    end: float


def fit(measured: xarray.Dataset, quantity: str) -> Fit | None:
    """Growth of one quantity; None where fewer than five times can be used."""
    values = measured["error"].sel(quantity=quantity).values
    moments = measured["time"].values
    with np.errstate(invalid="ignore"):
        usable = (moments >= FIT_FROM) & (np.median(values, axis=0) > 0)
    if quantity == "attitude":
        usable &= np.median(values, axis=0) < LOST
    if usable.sum() < 5:
        return None
    x, chosen = np.log(moments[usable]), values[:, usable]
    exponent, offset = _line(x, chosen)
    generator = np.random.default_rng(0)
    again = [_line(x, chosen[generator.integers(0, len(chosen), len(chosen))])[0] for _ in range(400)]
    return Fit(exponent, float(np.std(again)), math.exp(offset), moments[usable][0], moments[usable][-1])


def _line(x: np.ndarray, values: np.ndarray) -> tuple[float, float]:
    typical = np.sqrt(np.mean(values**2, axis=0))
    exponent, offset = np.polyfit(x, np.log(np.maximum(typical, 1e-300)), 1)
    return float(exponent), float(offset)


def checks(measured: Sequence[xarray.Dataset]) -> list[Check]:
    """Exponents against the laws: faster growth than the law by more than three sigma fails."""
    found = []
    for data in measured:
        body, precision, held = data.attrs["body"], data.attrs["precision"], bool(data.attrs["held"])
        for quantity in QUANTITIES:
            fitted = fit(data, quantity)
            if fitted is None:
                continue
            law = LAW[quantity] if not held else (HELD_LAW if quantity == "attitude" else 0.5)
            title = f"{body}, {precision}{', held' if held else ''}: exponent of {quantity}"
            origin = f"Brouwer 1937: t^{LAW[quantity]}" if not held else f"frequencies held: at most t^{law}"
            source = (
                f"{origin}; fitted {fitted.exponent:.2f} +- {fitted.sigma:.2f}; three of these may be over"
            )
            over = max(fitted.exponent, law)
            found.append(Check(title, over, law, max(3 * fitted.sigma, 0.02), "1", source, "absolute"))
    return found


def picture(measured: Sequence[xarray.Dataset]) -> Picture:
    """Medians, quartiles and lines: a row for each body, a column for each quantity."""
    panels = []
    for body in BODIES:
        for quantity in QUANTITIES:
            curves = []
            for data in measured:
                if data.attrs["body"] == body:
                    curves += _curves(data, quantity)
            unit = "rad" if quantity == "attitude" else "relative"
            labels = "time, radians of the fastest rate", f"{quantity} error, {unit}"
            panels.append(Panel(body, *labels, curves, "xy", legend="upper left"))
    title = "Errors over long runs: random walks, t^1/2 and t^3/2, unless the invariants are held"
    return Picture(title, "abc;def", panels, (14, 8.6))


def _curves(data: xarray.Dataset, quantity: str) -> list[Curve]:
    precision, held, moments = data.attrs["precision"], bool(data.attrs["held"]), data["time"].values
    color = {"single": "grey", "double": "blue", "extended": "orange"}[precision]
    least = EPSILON[precision] / 16  # zeros are below what the evaluation resolves
    values = np.maximum(data["error"].sel(quantity=quantity).values, least)
    fitted, label = fit(data, quantity), f"{precision}{', held' if held else ''}"
    curves = []
    if fitted is not None:
        label += f": t^({fitted.exponent:.2f} ± {fitted.sigma:.2f})"
        span = np.array([fitted.start, fitted.end])
        curves.append(Curve(span, fitted.factor * span**fitted.exponent, "", color))
    low, middle, high = np.percentile(values, (25, 50, 75), axis=0)
    marker = {"markerfacecolor": "white" if held else color}
    curves.append(Curve(moments, middle, label, color, "s" if held else "o", 1, marker))
    return curves + [Curve(moments, edge, "", color, ":", 0.6) for edge in (low, high)]


@Study
def long_horizon(full: bool) -> Answer:
    """Measure, fit, draw."""
    measured = []
    for body in BODIES:
        for precision, horizon in (FULL if full else REDUCED).items():
            for held in (False, True):
                print(f"{body}, {precision}, {'held' if held else 'plain'}", file=sys.stderr, flush=True)
                measured.append(measure(body, precision, held, horizon))
    return checks(measured), picture(measured)
