"""Which lines has the nutation of a rigid Earth, and does the frequency analysis find the published ones?

The preset "earth" under Sun and Moon on Kepler orbits for 200 years, a sample each 4 days.
``rigidsim.analyse`` names the lines of obliquity and longitude by the mean longitudes, the node and the
perigee. Thinned to 20 days the same samples show 13.66 days beyond Nyquist's frequency; sampled each half
synodic month, these fall onto the half year and must not be told apart. Periods agree to half of the last
digit of 6798.38 d. The real Earth (IAU 2000B) must differ where its fluid core counts, and not in the slow
lines.
"""

from typing import Any

import mpmath
import numpy as np

import rigidsim
from experiments.common import COLORS, Answer, Check, Curve, Panel, Picture, Study, simulate

DAY, YEAR = 86400, 365.25 * 86400
ARCSEC = np.pi / 648000
SIDEREAL_YEAR, SIDEREAL_MONTH = "365.256363", "27.321661"  # days
DRACONIC, ANOMALISTIC, NODE = "27.212221", "27.554550", "6798.38"  # days; the node from the moving equinox
SHARE = "81.30057"  # Earth / Moon
PRECESSION = "50.307"  # arcsec/yr
REAL = {  # IAU 2000B (McCarthy & Luzum 2003), arcsec: longitude, obliquity
    "18.6 yr": (17.2064161, 9.2052331), "182.6 d": (1.3170906, 0.5730336),
    "13.66 d": (0.2276413, 0.0978459), "9.3 yr": (0.2074554, 0.0897492),
}  # fmt: skip
RIGID = {"18.6 yr": 17.28, "182.6 d": 1.277, "13.66 d": 0.221}  # longitude
LABELS = {  # without the sign, which differs between sine and cosine of a decreasing angle
    "18.6 yr": {"node2": -1, "precession": 1}, "182.6 d": {"orbit1": 2, "precession": -2},
    "13.66 d": {"orbit2": 2, "precession": -2}, "9.3 yr": {"node2": -2, "precession": 2},
}  # fmt: skip
CONFIG = """
name = "precession_and_nutation"
body.preset = "earth"
[initial]
angular_velocity = [0, 0, "{spin} rad/day"]
euler_angles = ["180 deg", "84381.406 arcsec", 0]  # the x axis is the vernal equinox

[[loads]]                                          # the Sun
kind = "gravity_gradient"
gravitational_parameter = "{sun}"
orbit = {{semi_major_axis = "1.495978707e11", eccentricity = 0.016709, period = "{year} day"}}

[[loads]]                                          # the Moon
kind = "gravity_gradient"
gravitational_parameter = "{moon}"
[loads.orbit]
semi_major_axis = "3.84399e8"
eccentricity = 0.0549
inclination = "5.145 deg"
period = "{anomalistic} day"
periapsis_rate = "{apsis} rad/day"
node_rate = "{node} rad/day"

[time]
end = "{end} day"
every = "{every} day"

[output]
record = ["obliquity", "node_longitude"]
estimate = false
"""


def config(years: float, every: str) -> str:
    """The TOML, samples so many days apart."""
    with mpmath.workdps(30):
        pi2 = 2 * mpmath.pi
        tropical = -pi2 / mpmath.mpf(NODE)  # from the equinox, which goes back as well
        node = tropical - mpmath.mpf(PRECESSION) * mpmath.pi / 648000 / mpmath.mpf("365.25")
        apsis = pi2 / mpmath.mpf(DRACONIC) - pi2 / mpmath.mpf(ANOMALISTIC)
        sun = (pi2 / (mpmath.mpf(SIDEREAL_YEAR) * DAY)) ** 2 * mpmath.mpf("1.495978707e11") ** 3
        moon = (pi2 / (mpmath.mpf(SIDEREAL_MONTH) * DAY)) ** 2 * mpmath.mpf("3.84399e8") ** 3
        numbers = {
            "spin": pi2 * mpmath.mpf("1.00273790935"), "sun": sun, "moon": moon / (1 + mpmath.mpf(SHARE)),
            "apsis": apsis, "node": node,
        }  # fmt: skip
        texts = {name: mpmath.nstr(value, 25) for name, value in numbers.items()}
    count = int(years * 365.25 / float(every))
    end = mpmath.nstr(count * mpmath.mpf(every), 25)
    return CONFIG.format(**texts, year=SIDEREAL_YEAR, anomalistic=ANOMALISTIC, end=end, every=every)


def line_of(analysis: Any, signal: str, name: str) -> Any:
    """The line of one of the four terms, by its label."""
    wanted = LABELS[name]
    names = [known.name for known in analysis.known]
    for line in analysis[signal].lines:
        found = {n: m for n, m in zip(names, line.label.multipliers, strict=False) if m}
        if found in (wanted, {n: -m for n, m in wanted.items()}):
            return line
    raise LookupError(f"{signal}: no line is called {wanted}")


def period(name: str) -> float:
    """Of a term, in days, from the rates of its argument."""
    equinox = -float(PRECESSION) / 1296000 / 365.25  # turns a day
    node = -1 / float(NODE)
    moon = 1 / float(DRACONIC) + node  # from the equinox
    return {
        "18.6 yr": -1 / node, "9.3 yr": -0.5 / node,
        "182.6 d": 0.5 / (1 / float(SIDEREAL_YEAR) - equinox), "13.66 d": 0.5 / moon,
    }[name]  # fmt: skip


def precession(found: Any) -> list[Check]:
    """The secular rate, and what its error claims."""
    signal = found["node_longitude.figure"]
    rate = -float(signal.rate) * YEAR / ARCSEC
    return [
        Check("precession", rate, float(PRECESSION), 3e-3, "arcsec/yr", "P1; what it leaves out"),
        Check("error of the rate that is claimed", signal.rate_error * YEAR / ARCSEC, 0, 1e-6, "arcsec/yr",
              "no slow line is left: 200 years are 10 turns of the node", "absolute"),
    ]  # fmt: skip


def nutation(found: Any) -> list[Check]:
    """The four largest terms in longitude and obliquity."""
    checks = []
    rigid = "REN-2000 as quoted; perturbations of the orbits are left out"
    for name, real in REAL.items():
        along, across = (line_of(found, s, name) for s in ("node_longitude.figure", "obliquity.figure"))
        sizes = [float(x.amplitude) / ARCSEC for x in (along, across)]
        source, allowed = "the term's argument; lines within a bin", 1e-6 if name != "182.6 d" else 1e-5
        checks.append(Check(f"{name}: period", along.period / DAY, period(name), allowed, "d", source))
        if name in RIGID:
            checks.append(Check(f"{name}: longitude, rigid", sizes[0], RIGID[name], 1e-2, "arcsec", rigid))
        for what, size, published in zip(("longitude", "obliquity"), sizes, real, strict=True):
            if name in ("182.6 d", "13.66 d"):
                title, source = f"{name}: {what}, real Earth", "IAU 2000B; core and mantle yield"
                checks.append(Check(title, size, published, 0.015 * published, "arcsec", source, "apart"))
            if name == "9.3 yr":
                source = "IAU 2000B; slow: all alike"
                checks.append(Check(f"{name}: {what}", size, published, 1e-2, "arcsec", source))
        if name == "18.6 yr":
            source = "first order; what it leaves out"
            checks.append(Check("18.6 yr: obliquity, rigid", sizes[1], 9.2022, 5e-3, "arcsec", source))
    return checks


def unfolding(found: Any, thin: Any, blind: Any) -> list[Check]:
    """13.66 days from samples 20 days apart, and where it can't be known."""
    checks = []
    for signal in ("node_longitude.figure", "obliquity.figure"):
        known, seen = line_of(found, signal, "13.66 d"), line_of(thin, signal, "13.66 d")
        checks += [
            Check(f"20-day samples, {signal}: beyond Nyquist", float(seen.unfolded), 1.0, 0.0, "1", "marked"),
            Check(f"20-day samples, {signal}: period", seen.period / DAY, known.period / DAY, 1e-6, "d",
                  "the line of dense samples; blends within a bin"),
            Check(f"20-day samples, {signal}: amplitude", float(seen.amplitude) / ARCSEC,
                  float(known.amplitude) / ARCSEC, 1e-4, "arcsec", "the same"),
        ]  # fmt: skip
    half_year = min(blind.signals[0].lines, key=lambda line: abs(line.period / DAY - 182.6))
    checks.append(
        Check("sampled each half synodic month, 182.6 and 13.66 d in one: refused",
              float(half_year.ambiguous and not half_year.unfolded), 1.0, 0.0, "1",
              "they fold onto each other")
    )  # fmt: skip
    return checks


def picture(found: Any, thin: Any) -> Picture:
    """The spectrum of the longitude with its lines, from dense samples and from 20-day ones."""

    def panel(analysis: Any, title: str, xlabel: str) -> Panel:
        signal = analysis["node_longitude.figure"]
        frequency, size = signal.spectrum
        turns = YEAR / (2 * np.pi)

        def lines(axes: Any) -> None:
            taken: list[tuple[float, float]] = []
            for line in signal.lines:
                x, y = float(line.frequency) * turns, float(line.amplitude) / ARCSEC
                color = COLORS["red"] if line.unfolded else "blue"
                if line.ambiguous or not line.label.text:
                    color = "grey"
                axes.vlines(x, 1e-6, y, color=color, linewidth=1.4)
                room = all(abs(np.log10(x / a)) > 0.14 or abs(np.log10(y / b)) > 0.9 for a, b in taken)
                if y > 3e-2 and room:
                    taken.append((x, y))
                    days = line.period / DAY
                    said = f"{days:.2f} d" if days < 1000 else f"{days / 365.25:.2f} yr"
                    axes.annotate(f"{line.label.text}\n{said}", (x, y), (0, 5), textcoords="offset points",
                                  ha="center", fontsize=7.5)  # fmt: skip

        return Panel(title, xlabel, "amplitude (arcsec)", [
            Curve(frequency[1:] * turns, size[1:] / ARCSEC, "", "#9fb6cd", width=0.7),
            Curve(analysis.nyquist * turns, None, "Nyquist", "orange", "--", 1),
        ], "xy", limits={"ylim": (1e-6, 3e3), "xlim": (0.02, 220)}, legend="lower left",
            more=lines)  # fmt: skip

    rate = -float(found["node_longitude.figure"].rate) * YEAR / ARCSEC
    title = f"A rigid Earth under Sun and Moon: {rate:.3f} arcsec/yr, and its lines of nutation in longitude"
    folded = "a sample every 20 days: shorter periods are folded, unfolded where one name fits"
    panels = [panel(found, "all samples", ""), panel(thin, folded, "turns per year")]
    return Picture(title, "a;b", panels, (12, 7.4))


@Study
def study(full: bool) -> Answer:
    """Daily, every 20 days, and each half synodic month."""
    daily = simulate(config(200, "1" if full else "4")).dataset
    found = rigidsim.analyse(daily, lines=30)
    thin = rigidsim.analyse(daily.isel(time=slice(None, None, 20 if full else 5)), lines=30)
    synodic = 1 / (1 / mpmath.mpf(SIDEREAL_MONTH) - 1 / mpmath.mpf(SIDEREAL_YEAR))
    folded = simulate(config(60, mpmath.nstr(synodic / 2, 20))).dataset
    blind = rigidsim.analyse(folded, ["node_longitude.figure"], lines=12)
    checks = precession(found) + nutation(found) + unfolding(found, thin, blind)
    return checks, picture(found, thin)
