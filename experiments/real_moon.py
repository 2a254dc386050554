"""Does the Moon turn as DE421 says, and what is each effect worth?

The ready scene `moon_since_1969` for 50 years, nothing fitted, and with one effect left out at a time: the
rotation vector to the package's own librations every 8 days. Another program of these equations was within
2.0 mas and lost so much with each effect left out, to 20 %. `experiments/bare/moon.py`, with heyoka alone,
has the delay to third order, a hundredth of the 80 mas that the second adds: 2e-9 rad; again with de423,
number by number. With --full its CPU is compared, seven times in turn.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.bare import blocks
from experiments.bare import moon as bare
from experiments.common import CONFIGS, Answer, Check, Curve, Panel, Picture, Result, Study, simulate

SCENE = CONFIGS / "kernels" / "moon_since_1969.toml"
START = 2440400.5
DAY = 86400.0
ALLOWED = 1.5  # mas
EFFECTS: dict[str, tuple[str, tuple[str, ...], float]] = {
    "core": ("fluid core", ("body.core.moment=0",), 7.75),
    "degree4": ("degree 4", ("loads[0].degree=3",), 1.08),
    "core_flattening": ("core's flattening", ("body.core.flattening=0",), 0.70),
    "distortion": ("tide and spin distortion", ("body.elasticity.love_number=0",), 0.355),
    "delay": ("delay", ("body.elasticity.delay=0",), 0.29),
    "core_friction": ("core's friction", ("body.core.friction=0",), 0.25),
    "figure": ("Earth's figure", ("loads[0].figure=",), 0.107),
}
"""Of the bare program's names: title, overrides, arcsec rms without it."""
SPIN = 0.041
_TURNS = 7
SPARSE = ("time.every=8 day", "output.record=['quaternion']", "output.estimate=false")


def left_over(result: Result, package: str = "de421") -> np.ndarray:
    """Rotation vectors from the package's librations, mas, body axes."""
    days = result.values("time") / DAY
    return bare.left_over(package, START, days, result.values("quaternion"))


def rms(vectors: np.ndarray) -> float:
    """Of the whole vectors."""
    return float(np.sqrt((vectors**2).sum(axis=1).mean()))


def apart(one: Result, other: np.ndarray) -> float:
    """Largest rotation angle between a run's attitudes and other quaternions, rad."""
    vectors = bare.between(bare.matrices(one.values("quaternion")), bare.matrices(other))
    return float(np.linalg.norm(vectors, axis=1).max())


def by_numbers(constants: Mapping[str, float]) -> list[str]:
    """Overrides that give a package's constants and start instead of the preset."""
    c = constants
    beta, gamma, j2 = c["LBET"], c["LGAM"], c["J2M"]
    cube = c["AU"] ** 3 * 1e9 / DAY**2
    mass = c["GMB"] * cube / (1 + c["EMRAT"]) / 6.67430e-11
    polar = 2 * (1 + beta) * j2 / (2 * beta - gamma + beta * gamma) * mass * (c["AM"] * 1e3) ** 2
    moments = [polar * (1 - beta * gamma) / (1 + beta), polar * (1 + gamma) / (1 + beta), polar]
    cosines = {f"{n},{m}": c[f"C{n}{m}M"] for n in (3, 4) for m in range(1, n + 1)}
    cosines |= {f"{n},0": -c[f"J{n}M"] for n in (3, 4)}
    sines = {f"{n},{m}": c[f"S{n}{m}M"] for n in (3, 4) for m in range(1, n + 1)}
    field = "{radius = '" + f"{c['AM']!r} km', C = {_inline(cosines)}, S = {_inline(sines)}" + "}"
    day = {key: f"'{c[key]!r} rad/day'" for key in c if key.startswith(("OMEGA", "OMGC"))}
    return [
        "body.preset=",
        f"body.principal_moments={moments!r}",
        f"body.mass={mass!r}",
        f"body.gravity_field={field}",
        "body.elasticity={"
        f"love_number = {c['K2M']!r}, delay = '{c['TAUM']!r} day', radius = '{c['AM']!r} km', "
        f"mean_rate = '{bare.MEAN_RATE!r} rad/day', raised_by = ['earth']" + "}",
        "body.core={"
        f"moment = {c['IFAC']!r}, flattening = {c['COBLAT']!r}, friction = '{c['KVC']!r} day^-1', "
        f"angular_velocity = [{day['OMGCX']}, {day['OMGCY']}, {day['OMGCZ']}]" + "}",
        f"initial.euler_angles={[c['PHI'], c['THT'], c['PSI']]!r}",
        f"initial.angular_velocity=[{day['OMEGAX']}, {day['OMEGAY']}, {day['OMEGAZ']}]",
        "loads[0].figure={" + f"J2 = {c['J2E']!r}, radius = '{c['RE']!r} km', pole = 'iau1976'" + "}",
    ]


def _inline(values: Mapping[str, float]) -> str:
    return "{" + ", ".join(f'"{key}" = {value!r}' for key, value in sorted(values.items())) + "}"


def _same(name: str, result: Result, other: Mapping[str, Any]) -> Check:
    """Beside a bare run, which has every other sample too."""
    source = "the same equations in another formulation; third order in the delay"
    angle = apart(result, other["quaternion"][::2])
    return Check(f"apart from {name}", angle, 0.0, 2e-9, "rad", source, "absolute")


def _cost(days: float) -> list[Check]:
    """CPU of integrating and recording, beside the bare program's."""
    moon, ours, theirs = bare.Moon("de421"), [], []
    for _ in range(_TURNS):
        cost = simulate(SCENE, "output.estimate=false").summary["cost"]
        ours.append(cost["cpu_by_phase"]["integrate_and_record"])
        theirs.append(moon.integrate(days)["seconds"])
    ratios = sorted(a / b for a, b in zip(ours, theirs, strict=True))
    source = "a loop over the blocks with heyoka alone; asked for"
    return [
        Check(f"CPU of 50 years, least of {_TURNS}", min(ours), 0.0, 2.0, "s", "none; asked for", "absolute"),
        Check("the same over the bare program's", min(ours) / min(theirs), 0.0, 1.1, "1", source, "absolute"),
        Check("median of the ratios", ratios[_TURNS // 2], 0.0, 1.1, "1", source, "absolute"),
    ]


def _announced(full: bool, whole: Result) -> list[Check]:
    """The announced error of 50 years, and one against 80 bits."""
    span = () if full else ("time.end=1824 day",)
    short = whole if full else simulate(SCENE, *SPARSE[:2], *span)
    precise = simulate(SCENE, *SPARSE, *span, "integrator.precision=extended")
    ratio = apart(short, precise.values("quaternion")) / announced(short)
    return [
        Check(
            "announced error of 50 years", announced(whole), 0.0, 1e-9, "rad", "none; asked for", "absolute"
        ),
        Check("true error over the announced one", ratio, 0.0, 3.0, "1", "80 bits; asked for", "absolute"),
    ]


def announced(result: Result) -> float:
    """The attitude's error at the end, rad."""
    return float(result.summary["accuracy"]["estimated_attitude_error"])


def seen_from_earth(result: Result) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Years, and the Earth's longitude and latitude on the Moon, deg: librations as observers see them."""
    days = result.values("time") / DAY
    kernel = blocks.Kernel("de421")
    series = kernel.places("moon", ("earth",), START, round(days[-1] / blocks.DAYS))["earth"]
    block = np.minimum((days / blocks.DAYS).astype(int), len(series) - 1)
    inside = 2 * (days / blocks.DAYS - block) - 1
    values = np.polynomial.chebyshev.chebvander(inside, series.shape[-1] - 1)
    place = np.einsum("nk,nak->na", values, series[block])
    seen = np.einsum("nji,nj->ni", bare.matrices(result.values("quaternion")), place)
    seen /= np.linalg.norm(seen, axis=1, keepdims=True)
    longitude, latitude = np.arctan2(seen[:, 1], seen[:, 0]), np.arcsin(seen[:, 2])
    return 1969.486 + days / 365.25, np.degrees(longitude), np.degrees(latitude)


def picture(whole: Result, rest: np.ndarray, found: Mapping[str, np.ndarray]) -> Picture:
    """Librations in longitude and latitude, and residuals by effect."""
    days, longitude, latitude = seen_from_earth(
        simulate(SCENE, *SPARSE, "time.every=1 day", "time.end=1200 day")
    )
    years = 1969.486 + whole.values("time") / DAY / 365.25
    colors = ["#67001f", "red", "orange", "#bf812d", "green", "blue", "#762a83", "black"]
    lines = [(f"without {EFFECTS[name][0]}", vectors)
             for name, vectors in sorted(found.items(), key=lambda item: -rms(item[1]))]  # fmt: skip
    curves = [
        Curve(years, np.linalg.norm(vectors, axis=1), f"{label}: {_size(rms(vectors))}", color, width=0.8)
        for (label, vectors), color in zip([*lines, ("everything", rest)], colors, strict=True)
    ]
    title = "The Moon since 1969: nothing fitted, within a milliarcsecond of DE421"
    return Picture(title, "a;b", [
        Panel("The Earth in the Moon's sky: librations in longitude and latitude", "", "deg",
              [Curve(days, longitude, "longitude"), Curve(days, latitude, "latitude", "orange")]),
        Panel("Rotation from DE421's librations with one effect left out (rms in the legend)", "year", "mas",
              [*curves, Curve(None, ALLOWED, "", "grey", "--", 0.8)], "y", limits={"ylim": (1e-2, 4e6)},
              legend="upper left"),
    ], (11, 8.5), {"height_ratios": [1, 1.7]})  # fmt: skip


def _size(mas: float) -> str:
    return f"{mas:.2f} mas" if mas < 1 else f"{mas / 1000:.3g} arcsec"


@Study
def study(full: bool) -> Answer:
    """Librations, effects, the bare program, another package, and the announced error."""
    whole = simulate(SCENE, *SPARSE[:2])
    rest = left_over(whole)
    found = {name: left_over(simulate(SCENE, *SPARSE, *effect[1])) for name, effect in EFFECTS.items()}
    spin = left_over(simulate(SCENE, *SPARSE, "body.elasticity.raised_by=[]")) - found["distortion"]
    source = "another program of these equations, rounded; its handling of the delay differs"
    largest = np.abs(rest).max(axis=0).tolist()
    checks = [
        Check(f"largest of the rotation vector's {axis}", largest[k], 0.0, ALLOWED, "mas",
              "DE421's librations; asked for", "absolute")
        for k, axis in enumerate("xyz")
    ]  # fmt: skip
    checks += [
        Check(
            f"left without {EFFECTS[name][0]}", rms(vectors) / 1000, EFFECTS[name][2], 0.2, "arcsec", source
        )
        for name, vectors in found.items()
    ]
    checks.append(Check("added by the spin's distortion", rms(spin) / 1000, SPIN, 0.2, "arcsec", source))
    days = float(whole.values("time")[-1]) / DAY
    checks.append(_same("the bare program", whole, bare.Moon("de421").integrate(days)))
    constants = blocks.Kernel("de423").constants
    second = simulate(SCENE, *SPARSE, "ephemeris.kernel=de423", *by_numbers(constants))
    checks.append(_same("it with de423", second, bare.Moon("de423").integrate(days)))
    if full:  # what a machine with other work on it would not show
        checks += _cost(days)
    checks += _announced(full, whole)
    return checks, picture(whole, rest, found)
