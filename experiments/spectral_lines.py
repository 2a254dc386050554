"""How many digits do the lines of a spectrum have, and are they called what they are?

Closed forms in double precision over ten thousand periods (--full: in quadruple precision too), and a
satellite on a circular orbit that librates by 1e-5 rad, integrated; ``rigidsim.analyse`` finds and names the
lines of rates in body axes and of the figure axis in space. Lines above 1e-3 of the largest have 1e-14 of the
scene's fastest known frequency (1e-28 in 128 bits); fainter ones, the error as a phase over the run times
their share of the largest line, 1e-13. Toutatis has its published periods, too (Hudson & Ostro 1995). The
satellite's frequencies are n sqrt(3 (B - A) / C), and s^4 + n^2 (1 + 3 sx + sx sz) s^2 + 4 n^4 sx sz = 0, to
the order of the amplitude squared.
"""

from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np

import rigidsim
from experiments.closed_forms import free_top, heavy_top
from experiments.common import COLORS, Answer, Check, Curve, Panel, Picture, Study, simulate

PERIODS = 10000
FEW = 2.618  # samples a period in quadruple precision, where each takes milliseconds: harmonics are folded
CONFIG = """
name = "{name}"
[body]
{body}
[initial]
{initial}
{loads}
[time]
end = {end}
every = {every}
[integrator]
precision = "{precision}"
method = "closed_form"
[output]
record = {record}
estimate = false
"""
MOMENTS, RATES = ["3.09", "3.22", "1"], ["20.7", "31.3", "98.0"]
"""Toutatis' ratios, the long axis last, and deg/day (Hudson & Ostro 1995)."""
PUBLISHED, RECOMPUTED = {"wobble": 5.41, "precession": 7.35}, {"wobble": 5.396, "precession": 7.350}
"""Its periods, days."""
GRAVITY = '[[loads]]\nkind = "uniform_gravity"\nacceleration = [0, 0, "-9.80665"]\n'
SATELLITE = """
name = "satellite"
body.principal_moments = [9, 10, 4]                 # x along the orbit, y against its normal, z to the Earth
[initial]
euler_angles = ["90 deg", "90 deg", "180 deg"]
angular_velocity = [1e-5, "-1.00001", 2e-5]
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {semi_major_axis = 1}
[time]
end = 2000
every = 0.5
[output]
record = ["roll_pitch_yaw"]
estimate = false
"""


@dataclass(frozen=True)
class Case:
    """A scene with its exact frequencies (mpf, rad/s), and how it is sampled."""

    name: str
    body: str
    initial: str
    loads: str
    exact: dict[str, Any]
    period: Any
    samples: float  # a period, no ratio of small numbers: harmonics would fold onto each other

    def analysis(self, precision: str, record: list[str]) -> Any:
        """Of its closed form, over all periods."""
        samples = self.samples if precision == "double" else FEW
        every = mpmath.nstr(self.period / samples, 6)
        count = int(PERIODS * samples)
        text = CONFIG.format(
            name=self.name.replace(" ", "_"), body=self.body,
            initial=self.initial, loads=self.loads, precision=precision,
            end=mpmath.nstr(mpmath.mpf(every) * count, 20), every=every, record=str(record).replace("'", '"'),
        )  # fmt: skip
        return rigidsim.analyse(simulate(text).dataset, record, lines=12)


def free(name: str, moments: list[str], rates: list[str], unit: str, samples: float) -> Case:
    """Of texts; rates in the unit, if there is one."""
    scale = mpmath.pi / 180 / 86400 if unit else mpmath.mpf(1)
    form = free_top(moments, [scale * mpmath.mpf(w) for w in rates])
    exact = {"wobble": 2 * mpmath.pi / form.period, "precession": form.precession}
    words = ", ".join(f'"{w} {unit}"' if unit else w for w in rates)
    body = f"principal_moments = [{', '.join(moments)}]"
    return Case(name, body, f"angular_velocity = [{words}]", "", exact, form.period, samples)


def top() -> Case:
    """configs/heavy_top_nutating.toml: A = 2e-4, C = 1e-4, mu = 0.1 g 0.04, tilt 30 deg, spin 100 rad/s."""
    mu = mpmath.mpf("0.1") * mpmath.mpf("9.80665") * mpmath.mpf("0.04")
    form = heavy_top(mpmath.mpf("2e-4"), mpmath.mpf("1e-4"), mu, mpmath.pi / 6, [0, 0, 100])
    exact = {
        "nutation": 2 * mpmath.pi / form.nutation, "precession": form.precession, "spin": 100 - form.turning,
    }  # fmt: skip
    body = "principal_moments = [2e-4, 2e-4, 1e-4]\nmass = 0.1\ncenter_of_mass = [0, 0, 0.04]"
    initial = 'euler_angles = [0, "30 deg", 0]\nangular_velocity = [0, 0, 100]'
    return Case("heavy top", body, initial, GRAVITY, exact, form.nutation, 8.382)


def checks_of(case: Case, analysis: Any, digits: float, kind: str) -> list[Check]:
    """All lines have names; their frequencies are the combinations that these say."""
    leading, others, nameless = [mpmath.mpf(0)], [mpmath.mpf(0)], 0
    for signal in analysis.signals:
        largest = signal.lines[0].amplitude if signal.lines else 0  # the top's axial rate has none
        for line in signal.lines:
            if not line.label.text or line.ambiguous:
                nameless += 1
                continue
            terms = zip(line.label.multipliers, analysis.known, strict=True)
            exact = sum(n * case.exact[known.name] for n, known in terms)
            error = abs(line.frequency - exact)
            if line.amplitude > 1e-3 * largest:
                leading.append(error / max(case.exact.values()))
            else:
                others.append(error * analysis.length * line.amplitude / largest)
    count = sum(len(signal.lines) for signal in analysis.signals)
    title = f"{case.name}, {kind}"
    return [
        Check(f"{title}: lines without a name, of {count}", nameless, 0, 0.0, "1",
              "all are known", "absolute"),
        Check(f"{title}: leading frequencies", max(leading), 0, digits, "1",
              "elliptic integrals by mpmath; the issue's digits", "absolute"),
        Check(f"{title}: fainter ones, as phases", max(others), 0, 1e-13, "rad",
              "rounding of samples, in phase all along", "absolute"),
    ]  # fmt: skip


def periods(analysis: Any) -> list[Check]:
    """Of Toutatis: its rotation about the long axis, and the precession of that axis."""
    lines = [x for signal in analysis.signals for x in signal.lines if x.label.text and not x.ambiguous]
    weights = np.array([float(x.amplitude) for x in lines])
    combined = np.array([x.label.multipliers for x in lines]) * weights[:, None]
    rates = np.linalg.lstsq(combined, np.array([float(x.frequency) for x in lines]) * weights, rcond=None)[0]
    checks = []
    for known, rate in zip(analysis.known, rates, strict=True):
        days = 2 * np.pi / abs(float(rate)) / 86400
        for values, allowed, source in (
            (PUBLISHED, 0.01, "Hudson & Ostro 1995; three digits of the published state"),
            (RECOMPUTED, 1e-3, "re-computed from the same state; three digits of the inputs"),
        ):
            title = f"Toutatis: period of the {known.name}"
            checks.append(Check(title, days, values[known.name], allowed, "d", source))
    return checks


def librations() -> list[Check]:
    """Pitch, roll and yaw of the satellite."""
    analysis = rigidsim.analyse(simulate(SATELLITE).dataset, lines=6)
    ix, iy, iz = 9, 10, 4
    sx, sz = (iy - iz) / ix, (iy - ix) / iz
    half, product = (1 + 3 * sx + sx * sz) / 2, 4 * sx * sz
    exact = {
        "pitch": np.sqrt(3 * (ix - iz) / iy), "rollyaw1": np.sqrt(half + np.sqrt(half**2 - product)),
        "rollyaw2": np.sqrt(half - np.sqrt(half**2 - product)),
    }  # fmt: skip
    found: dict[str, list[float]] = {name: [] for name in exact}
    for angle in ("roll", "pitch", "yaw"):
        for line in analysis[f"roll_pitch_yaw.{angle}"].lines:
            name = line.label.text
            if name in exact and (name == "pitch") == (angle == "pitch"):
                found[name].append(float(line.frequency))
    quartic = "quartic; amplitude^2"
    sources = {"pitch": "n sqrt(3 (B - A) / C); amplitude^2", "rollyaw1": quartic, "rollyaw2": quartic}
    return [
        Check(f"satellite: {name}, line {n + 1}", rate, exact[name], 1e-8, "n", sources[name])
        for name, rates in found.items()
        for n, rate in enumerate(rates or [float("nan")])
    ]


def picture(drawn: list[tuple[Case, Any]]) -> Picture:
    """The lines of the rates across the figure axis, down to 1e-12 of the largest."""

    def panel(case: Case, analysis: Any) -> Panel:
        signal = analysis["angular_velocity.x+iy"]
        unit, largest = float(max(case.exact.values())), float(signal.lines[0].amplitude)
        frequency, size = signal.spectrum
        reach = max(abs(float(line.frequency)) for line in signal.lines) / unit * 1.15

        def lines(axes: Any) -> None:
            for line in signal.lines:
                x, y = float(line.frequency) / unit, float(line.amplitude) / largest
                axes.vlines(x, 1e-15, y, color=COLORS["blue"] if line.label.text else "grey", linewidth=1.5)
                axes.annotate(line.label.text, (x, y), (0, 4), textcoords="offset points", ha="center",
                              fontsize=7.5)  # fmt: skip

        fastest = max(case.exact, key=lambda name: case.exact[name])
        return Panel(case.name, f"frequency / {fastest}", "amplitude / largest",
                     [Curve(frequency / unit, size / largest, "", "#9fb6cd", width=0.7)], "y", more=lines,
                     limits={"ylim": (1e-15, 1e3), "xlim": (-reach, reach)})  # fmt: skip

    title = "Ten thousand periods in double precision: lines of wx + i wy, by name"
    return Picture(title, "a;b;c", [panel(*one) for one in drawn], (12, 8.4))


@Study
def study(full: bool) -> Answer:
    """All scenes."""
    checks = []
    with mpmath.workdps(50):
        cases = [
            free("free body", ["3", "2", "1"], ["0.3", "0.2", "1"], "", 7.382),
            free("Toutatis", MOMENTS, RATES, "deg/day", 9.472),
            top(),
        ]
        drawn = []
        for case in cases:
            analysis = case.analysis("double", ["angular_velocity", "figure_axis"])
            checks += checks_of(case, analysis, 1e-14, "double")
            drawn.append((case, analysis))
        checks += periods(drawn[1][1])
        if full:
            for case in cases:
                analysis = case.analysis("quadruple", ["angular_velocity"])
                checks += checks_of(case, analysis, 1e-28, "quadruple")
    checks += librations()
    return checks, picture(drawn)
