"""Do the Sun and the Moon turn a rigid Earth's axis at the published rates, with every rotation resolved?

The preset "earth" under the Sun, the Moon and both on Kepler orbits (the Moon's node regresses). Both stand
on the equinox at the start, where they exert no torque, so that the free nutation stays small. Longitude
and obliquity of the figure axis are fitted with a line and the forced terms. P1 and the first-order
nutation are of first order in the torque, which leaves 0.3 and 0.5 %. --full goes once round the cycle of
25,772 years.
"""

from __future__ import annotations

import resource
import sys
import time
from typing import Any

import mpmath
import numpy as np

from experiments.common import Answer, Check, Curve, Panel, Picture, Result, Study, simulate
from experiments.measure import matrices

DAY, YEAR = 86400, 365.25 * 86400  # s; Julian year
ARCSEC = np.pi / 648000
H, OBLIQUITY, SPIN = "0.00327379492", "84381.406", "1.00273790935"  # (C-A)/C, arcsec, turns a day
SUN = {"period": "365.256363", "axis": "1.495978707e11", "e": "0.016709"}  # days, m (the axis drops out)
MOON = {"period": "27.321661", "axis": "3.84399e8", "e": "0.0549", "i": "5.145"}
NODE = "6798.38"  # days, once round backwards
SHARE = "81.30057"  # Earth / Moon: the torque has Kepler's n^2 times 1 / (1 + this)
PUBLISHED = {"Sun": (15.949, 1e-3), "Moon": (34.36, 3e-3), "both": (50.307, 3e-3)}  # arcsec/yr
NUTATION = {"obliquity": 9.2022, "longitude": 17.235}  # arcsec, first order
CYCLE = (25772.0, 25762.0)  # years: the run, and 360 degrees at 50.307 arcsec/yr
CONFIG = """
name = "luni_solar_precession"
body.preset = "earth"
[initial]
angular_velocity = [0, 0, "{spin} rad/day"]
euler_angles = ["180 deg", "84381.406 arcsec", 0]  # the x axis is the vernal equinox
{loads}
[time]
end = "{days} day"
samples = {samples}
[output]
record = ["quaternion"]
"""
LOAD = """
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = "{strength}"
[loads.orbit]
semi_major_axis = {axis}
eccentricity = {e}
period = "{period} day"
"""


def config(bodies: str, days: float, samples: int) -> str:
    """The TOML of the Earth with the Sun, the Moon or both."""
    with mpmath.workdps(30):
        loads = ""
        for body, factor in ((SUN, mpmath.mpf(1)), (MOON, 1 / (1 + mpmath.mpf(SHARE)))):
            if bodies != "both" and body is not (SUN if bodies == "Sun" else MOON):
                continue
            motion = 2 * mpmath.pi / (mpmath.mpf(body["period"]) * DAY)
            strength = mpmath.nstr(factor * motion**2 * mpmath.mpf(body["axis"]) ** 3, 25)
            loads += LOAD.format(strength=strength, **{k: body[k] for k in ("axis", "e", "period")})
            if body is MOON:
                loads += f'inclination = "{MOON["i"]} deg"\nnode_rate = "{-360 / mpmath.mpf(NODE)} deg/day"\n'
        spin = mpmath.nstr(2 * mpmath.pi * mpmath.mpf(SPIN), 25)
    return CONFIG.format(spin=spin, loads=loads, days=days, samples=samples)


def averaged(body: dict[str, str]) -> tuple[float, float]:
    """P1: the averaged precession in arcsec/yr, and Kp (P1 without its cosine and inclination), in rad/s."""
    motion, spin = 2 * np.pi / (float(body["period"]) * DAY), 2 * np.pi * float(SPIN) / DAY
    share = 1 / (1 + float(SHARE)) if body is MOON else 1.0
    kp = 1.5 * motion**2 / spin * float(H) * (1 - float(body["e"]) ** 2) ** -1.5 * share
    tilted = 1 - 1.5 * np.sin(np.radians(float(body.get("i", 0)))) ** 2
    return kp * tilted * np.cos(float(OBLIQUITY) * ARCSEC) * YEAR / ARCSEC, kp


def node_terms() -> dict[str, float]:
    """First-order nutation of the node's period, arcsec."""
    _, kp = averaged(MOON)
    i, eps, rate = np.radians(float(MOON["i"])), float(OBLIQUITY) * ARCSEC, 2 * np.pi / (float(NODE) * DAY)
    strength = kp * np.sin(i) * np.cos(i) / rate / ARCSEC
    return {"obliquity": strength * np.cos(eps), "longitude": strength * np.cos(2 * eps) / np.sin(eps)}


def figure_axis(result: Result) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time (s), precession in longitude since the start and obliquity (arcsec)."""
    axis = matrices(result.values("quaternion"))[:, :, 2]
    azimuth = np.unwrap(np.arctan2(axis[:, 0], -axis[:, 1]))
    obliquity = np.arctan2(np.hypot(axis[:, 0], axis[:, 1]), axis[:, 2])
    return result.values("time"), -(azimuth - azimuth[0]) / ARCSEC, obliquity / ARCSEC


def fit(bodies: str, t: np.ndarray, values: np.ndarray, slow: bool) -> tuple[float, np.ndarray, np.ndarray]:
    """Rate (per year), cosine and sine of the node's argument, and the residual of line and forced terms.

    Args:
        slow: samples too sparse for months: only the node's terms.
    """
    year, month, node = (2 * np.pi / (float(p) * DAY) for p in (SUN["period"], MOON["period"], NODE))
    node -= PUBLISHED[bodies][0] * ARCSEC / YEAR  # from the equinox, which goes back as well
    rates = [node, 2 * node] if bodies != "Sun" else []
    if not slow:
        rates += [k * year for k in (1, 2, 3)] if bodies != "Moon" else []
        rates += [k * month - j * node for k in (1, 2, 3) for j in (0, 1, 2)] if bodies != "Sun" else []
    x = (t - t.mean()) / YEAR
    columns = [np.ones_like(t), x]
    for rate in rates:
        columns += [np.cos(rate * t), -np.sin(rate * t)]  # of the node's longitude, which decreases
    basis = np.stack(columns, axis=1)
    found = np.linalg.lstsq(basis, values, rcond=None)[0]
    return float(found[1]), found[2:4], values - basis[:, :2] @ found[:2]


def run(bodies: str, days: float, samples: int) -> dict[str, Any]:
    """Integrate and measure; ``drift`` is the largest over its bound."""
    started = time.perf_counter()
    result = simulate(config(bodies, days, samples))
    wall = time.perf_counter() - started
    t, longitude, obliquity = figure_axis(result)
    slow = (t[1] - t[0]) > 5 * DAY
    rate, along, residual = fit(bodies, t, longitude, slow)
    tilt, across, tilt_residual = fit(bodies, t, obliquity, slow)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    held = result.summary["invariants"]
    print(
        f"{bodies}: {days / 365.25:.2f} yr, {result.steps:,} steps, {len(t)} samples, {wall:.1f} s wall "
        f"({result.summary['cost']['seconds']['build']:.1f} s compiling), peak memory {memory:.0f} MiB; "
        "drifts " + ", ".join(f"{name} {v['largest_drift']:.1e}" for name, v in held.items()),
        file=sys.stderr, flush=True,
    )  # fmt: skip
    return {
        "rate": rate, "longitude": -float(along[1]) if len(along) else 0.0,
        "obliquity": float(across[0]) if len(across) else 0.0, "tilt": tilt,
        "residuals": (residual, tilt_residual), "t": t / YEAR, "path": longitude,
        "drift": max(v["largest_drift"] / v["bound"] for v in held.values()),
    }  # fmt: skip


@Study
def study(full: bool) -> Answer:
    """Each body alone and both; see the module's text."""
    days = float(NODE)
    found = {"Sun": run("Sun", 2 * float(SUN["period"]), 732)}
    found["Moon"] = run("Moon", days, 6799)
    found["both"] = run("both", days, 6799)
    expected = {"Sun": averaged(SUN)[0], "Moon": averaged(MOON)[0]}
    expected["both"] = expected["Sun"] + expected["Moon"]
    first_order = node_terms()
    checks = []
    for name, (number, tolerance) in PUBLISHED.items():
        checks += [
            Check(f"precession, {name}", found[name]["rate"], number, tolerance, "arcsec/yr",
                  "P1 as printed; the order of what P1 leaves out"),
            Check(f"precession, {name}, all digits of P1", found[name]["rate"], expected[name], tolerance,
                  "arcsec/yr", "P1 evaluated; as above"),
        ]  # fmt: skip
    for name in ("Moon", "both"):
        for part, number in NUTATION.items():
            checks.append(
                Check(f"18.6-yr nutation in {part}, {name}", found[name][part], number, 5e-3, "arcsec",
                      f"first order ({first_order[part]:.4f} evaluated); the order of what it leaves out")
            )  # fmt: skip
    if full:
        cycle = run("both", CYCLE[0] * 365.25, round(CYCLE[0] / 10) + 1)
        checks += [
            Check("whole cycle: period", 1296000 / cycle["rate"], CYCLE[1], 3e-3, "yr",
                  "360 degrees at 50.307 arcsec/yr; as above"),
            Check("whole cycle: longitude at the end", cycle["path"][-1] / 3600, 360 * CYCLE[0] / CYCLE[1],
                  3e-3, "deg", "the same"),
            Check("whole cycle: 18.6-yr nutation in obliquity", cycle["obliquity"], NUTATION["obliquity"],
                  5e-3, "arcsec", "first order; as above"),
        ]  # fmt: skip
        found["cycle"] = cycle
    for name, one in found.items():
        checks.append(
            Check(f"largest drift over its bound, {name}", one["drift"], 0.0, 1.0, "1",
                  "invariants; the bound of the run's own summary", "absolute")
        )  # fmt: skip
    figure = picture(found)
    return checks, figure


def picture(found: dict[str, Any]) -> Picture:
    """The equinox going back, and the ellipse of the nutation."""
    both, first, turn = found["both"], node_terms(), np.linspace(0, 2 * np.pi, 400)
    across, up = both["residuals"]
    tilt = np.sin(float(OBLIQUITY) * ARCSEC)
    a, b = first["longitude"] * tilt, first["obliquity"]
    title = f"Sun and Moon turn the Earth's axis by {both['rate']:.2f} arcsec a year, nodding in 18.6 years"
    return Picture(title, "ab", [
        Panel("Longitude: a line and the nutation", "time (Julian years)", "precession (arcsec)", [
            Curve(one["t"], one["path"], f"{name}: {one['rate']:.3f} arcsec/yr", color)
            for name, one, color in (("both", both, "blue"), ("Moon", found["Moon"], "orange"),
                                     ("Sun", found["Sun"], "green"))
        ]),
        Panel("Nutation over one turn of the node", "longitude times sin(obliquity) (arcsec)",
              "obliquity (arcsec)", [
                  Curve(across * tilt, up, "figure axis, daily, the line removed", width=0.6),
                  Curve(a * np.sin(turn), b * np.cos(turn), f"first order: {b:.2f} by {a:.2f} arcsec",
                        "orange", "--", 1.6),
              ], equal=True, legend="upper center", limits={"ylim": (-11, 15.5)}),
    ], (11.5, 5.4), {"width_ratios": [1.55, 1]})  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(study.main())
