"""Does a rigid Mars precess and nutate as published, and what does a fluid core make of its nutations?

The ready scene `mars_nutation` over 50 years around J2000, with H = (C - A)/C fitted to the precession; six
harmonics of the mean anomaly, a parabola and the free nutation are fitted to the figure axis; and again
with a core of A_c/A_m = 0.07, free in -240 days. The published series (Konopliv, Park & Folkner 2016,
Icarus 274, 253, from Reasenberg & King 1979) goes with another precession, so that one factor is common to
all amplitudes. The core's amplifications are those of the linearised equations of mantle and core; 1 + F
s/(s - s0) is their limit for slow nutations.
"""

import math

import numpy as np

from experiments.common import CONFIGS, Answer, Check, Curve, Panel, Picture, Result, Study, simulate
from experiments.real_bodies import mars

SCENE = CONFIGS / "kernels" / "mars_nutation.toml"
START = 2442412.5 - 2451545.0
H, POLAR = 0.00537997, 0.36368397603343121822
SIDES = 0.99427298999751357497, 0.99496707000248642503
"""A/C, B/C of the preset."""
CORE = mars.Core(1 - H, 0.07 / 1.07, 0.00398)
SPIN = math.radians(mars.RATE)
FREE = SPIN * (1 + math.sqrt((1 - SIDES[0]) * (1 - SIDES[1]) / (SIDES[0] * SIDES[1])))
"""Of the rigid body's free nutation in space, rad/day."""
ANNUAL = math.radians(0.52402068)
LARGE = (-1, 1, 2, 3)  # circles above 100 mas


def run(*settings: str) -> tuple[np.ndarray, Result]:
    """Days after J2000, and the scene with nothing but its figure axis."""
    result = simulate(SCENE, "output.record=['figure_axis']", "output.estimate=false", *settings)
    return START + result.values("time") / 86400, result


def factor(rigid: mars.Nutation) -> float:
    """All amplitudes over the published ones, by least squares."""
    harmonics = range(1, mars.HARMONICS + 1)
    ours = np.array([rigid.amplitudes(k) for k in harmonics]).ravel()
    theirs = np.array([mars.published(k) for k in harmonics]).ravel()
    return float(ours @ theirs / (theirs @ theirs))


def nutations(rigid: mars.Nutation, scale: float) -> list[Check]:
    """Amplitudes by harmonic, over the common factor."""
    names = ("longitude", "obliquity")
    return [
        Check(f"{what}, harmonic {k} of the year, over {scale:.4f}", ours / scale, theirs, 0.5, "mas",
              "Konopliv et al. 2016; asked for", "absolute")
        for k in range(1, mars.HARMONICS + 1)
        for what, ours, theirs in zip(names, rigid.amplitudes(k), mars.published(k), strict=True)
    ]  # fmt: skip


def amplifications(rigid: mars.Nutation, core: mars.Nutation) -> list[Check]:
    """Circles with a core over those without."""
    checks = []
    for k in (*LARGE, -2, -3):
        found = abs(core.circles[k] / rigid.circles[k])
        rate, name = k * ANNUAL, f"{'pro' if k > 0 else 'retro'}grade harmonic {abs(k)}"
        allowed = 1e-4 if k in LARGE else 1e-3 if k == -2 else 0.01
        checks.append(
            Check(f"core: {name} amplified by", found, CORE.response(rate, SPIN), allowed, "1",
                  "linearised equations; lines that 50 years can't tell apart", "absolute")
        )  # fmt: skip
    rows = [k for k in range(-mars.HARMONICS, mars.HARMONICS + 1) if k not in (0, -3)]
    apart = max(
        abs(CORE.transfer(k * ANNUAL, SPIN) - CORE.response(k * ANNUAL, SPIN)) / CORE.factor for k in rows
    )
    checks.append(
        Check("core: the usual formula from the linearised equations, over F", apart, 0.0, 0.03, "1",
              "1 + F s/(s - s0) is of first order in s over the spin and in the flattening", "absolute")
    )  # fmt: skip
    return checks


def picture(
    days: np.ndarray, result: Result, rigid: mars.Nutation, core: mars.Nutation, scale: float
) -> Picture:
    """The pole's path, amplitudes beside the published ones, and the core's resonance."""
    psi, tilt = mars.angles(result.values("figure_axis"))
    later = (days > 0) & (days < 687)
    along = np.radians(rigid.start[0]) + rigid.rates[0] * mars.MAS * days / 365.25
    size = math.sin(math.radians(rigid.start[1]))
    path = Curve(
        size * (psi - along)[later] / mars.MAS, (tilt - math.radians(rigid.start[1]))[later] / mars.MAS
    )
    harmonics = np.arange(1, mars.HARMONICS + 1)
    bars = [
        Curve(harmonics, [rigid.amplitudes(k)[which] / over - mars.published(k)[which] for k in harmonics],
              f"{what}, {label}", color, "o", more={"markerfacecolor": "white"} if over == 1 else {})
        for which, (what, color) in enumerate((("longitude", "blue"), ("obliquity", "orange")))
        for over, label in ((1, "as it is"), (scale, f"all over {scale:.4f}"))
    ]  # fmt: skip
    period = np.concatenate([np.linspace(-900, -90, 4000), [np.nan], np.linspace(90, 900, 1000)])
    curve = np.array([CORE.response(2 * math.pi / p, SPIN) for p in period])
    curve[np.abs(curve) > 4] = np.nan
    shown = [k for k in (-3, -2, -1, 1, 2, 3, 4) if abs(rigid.circles[k]) > 1]
    runs = [abs(core.circles[k] / rigid.circles[k]) for k in shown]
    title = "A rigid Mars nutates as published, and a core amplifies it as foretold"
    return Picture(title, "abc", [
        Panel("Nutation in the first Martian year after J2000", "longitude × sin(obliquity), mas",
              "obliquity, mas", [path], equal=True),
        Panel("Amplitudes less the published ones (grey: 0.5 mas)", "harmonic of the year", "mas",
              [*bars, *(Curve(None, y, "", "grey", ":") for y in (-0.5, 0.5))], legend="upper right"),
        Panel("Amplified by a core of F = 0.07, free in −240 days", "period, days (negative: back)", "", [
            Curve(period, curve, "linearised equations", "grey", width=1),
            Curve([2 * math.pi / (k * ANNUAL) for k in shown], runs, "runs", "red", "o"),
        ], limits={"ylim": (-1, 4)}, legend="upper right"),
    ], (14, 5.2))  # fmt: skip


@Study
def study(full: bool) -> Answer:
    """Precession, amplitudes, amplifications."""
    days, result = run()
    rigid = mars.fit(days, result.values("figure_axis"), (FREE,))
    _, fluid = run(f"body.core={{moment={CORE.moment!r}, flattening={CORE.flattening!r}}}")
    core = mars.fit(days, fluid.values("figure_axis"), (FREE, CORE.free_nutation(SPIN)))
    scale = factor(rigid)
    return [
        Check("precession, with the geodetic one", rigid.rates[0] + mars.GEODETIC, mars.PRECESSION, 0.02,
              "mas/yr", "Konopliv et al. 2016; H is fitted to it, in six digits", "absolute"),
        Check("C/(M R^2) = J2/H", POLAR, 0.36367, 1e-4, "1", "Baland et al. 2020; its error", "absolute"),
        *nutations(rigid, scale),
        Check("precession that the published series goes with", -rigid.rates[0] / scale, 7576.0, 35.0,
              "mas/yr", "Folkner et al. 1997; its error", "absolute"),
        *amplifications(rigid, core),
    ], picture(days, result, rigid, core, scale)  # fmt: skip
