"""What do fits show of real bodies: Toutatis, a book with a telephone on it, a satellite, the Moon?

Toutatis by attitudes and rates of December 1992 (Takahashi, Busch & Scheeres 2013; two misprints are in the
table); a tossed book by 1.2 s of a simulated gyroscope with noise and biases; a satellite with a wheel by
attitudes good to 0.1 deg over up to two orbits (without the wheel only ratios of moments show); with --full
DE421's Moon by a year of its librations, from a perturbed start. Tolerances are three sigmas of the fits.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import rigidsim
from experiments.common import CONFIGS, Answer, Check, Curve, Panel, Picture, Study
from rigidsim.scene.scene import build_scene

BOOK = """
name = "book"
body.principal_moments = [13, 20, 25]
initial.angular_velocity = [0.6, 9, 0.4]
[parameters]
bx = "0 rad/s"
by = "0 rad/s"
bz = "0 rad/s"
[time]
end = 1.2
samples = 2
"""
BIAS = np.array([0.05, -0.08, 0.03])  # rad/s
GYROSCOPE = 0.02  # rad/s, of each sample
SATELLITE = """
name = "satellite"
body.principal_moments = ["900 kg m^2", "1000 kg m^2", "400 kg m^2"]
[initial]
quaternion = [0.5, -0.5, 0.5, -0.5]
angular_velocity = ["4e-4 rad/s", "-1.3e-3 rad/s", "-3e-4 rad/s"]
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = "3.986004418e14 m^3/s^2"
orbit = {semi_major_axis = "6.9e6 m"}
[time]
end = "11410 s"
samples = 400
"""
WHEEL = """
[[rotors]]
name = "wheel"
axis = [0, 1, 0]
moment = "0.05 kg m^2"
rate = "-100 rad/s"
fixed = true
"""
ORBIT = 5704.0  # s
ATTITUDES = float(np.deg2rad(0.1))  # rad, of each component
SPANS = (0.1, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0)  # orbits
START = 2440400.5  # JD of the Moon's start
MAS = float(np.deg2rad(1 / 3.6e6))
MOMENTS = [f"body.principal_moments[{i}]" for i in range(3)]


def observations(
    path: Path,
    times: np.ndarray,
    values: np.ndarray,
    observable: str,
    sigma: str,
    names: str = "xyz",
    more: str = "",
) -> str:
    """Write a table of observations; the ``[[fit.data]]`` of it.

    Args:
        sigma: as TOML.
        names: of the columns, a letter each.
        more: further keys.
    """
    header, columns = ",".join(["time", *names]), '", "'.join(names)
    np.savetxt(path, np.column_stack([times, values]), "%.17g", ",", header=header, comments="")
    return (
        f'[[fit.data]]\nfile = "{path}"\nobservable = "{observable}"\n'
        f'columns = ["{columns}"]\nsigma = {sigma}\n{more}\n'
    )


def motion(text: str, times: np.ndarray) -> Any:
    """Attitude and rates of a config at some times."""
    listed = rigidsim.parse(text).replace(
        {"time.end": None, "time.samples": None, "time.times": times.tolist(),
         "output.record": ["quaternion", "angular_velocity"]}
    )  # fmt: skip
    return rigidsim.run(listed, out=None, progress=False).dataset


def within(name: str, measured: float, expected: float, error: float, source: str, unit: str = "1") -> Check:
    """A number within an absolute error, which is three sigmas for fitted values."""
    return Check(name, measured, expected, error, unit, source, "absolute")


def toutatis() -> tuple[list[Check], Panel]:
    """The fit of 1992."""
    found = rigidsim.fit(CONFIGS / "fits" / "toutatis_1992.toml")
    residuals = np.rad2deg(np.linalg.norm(found.dataset["residual_1"].values, axis=1))
    used = found.dataset["used_2"].values.astype(bool)
    rates = np.rad2deg(np.abs(found.dataset["residual_2"].values).max(axis=1)) * 86400
    times = found.dataset["time_2"].values / 86400
    panel = Panel("Toutatis 1992: residuals", "days since 9 November 1992", "deg", [
        Curve(found.dataset["time_1"] / 86400, residuals, "attitudes", "blue", "o-"),
        Curve(times[used], rates[used], "rates, deg/day", "orange", "s"),
        Curve(times[~used], rates[~used], "left out", "red", "x", 2),
    ], "y")  # fmt: skip
    source = "Takahashi et al. 2013; three scaled sigmas"
    checks = [
        within(f"Toutatis: moment {name}", found.value(key), value, 3 * _scaled(found, key), source)
        for name, key, value in (("I2", MOMENTS[0], 3.0836), ("I3", MOMENTS[1], 3.235))
    ]
    rms = float(np.rad2deg(found.data[0].rms))
    checks.append(within("Toutatis: attitudes, rms", rms, 0.0, 7.7, "their solution leaves 7.7", "deg"))
    misprints = [float(one.row.removeprefix("line ")) for one in found.outliers]
    source = "rates that no solution fits, of 7 and 14 December"
    checks += [
        within(f"Toutatis: misprint {n}", line, expected, 0.0, source, "line")
        for n, (line, expected) in enumerate(zip(misprints, (8.0, 15.0), strict=True), start=1)
    ]
    return checks, panel


def _scaled(found: Any, key: str) -> float:
    return float(next(one.scaled_sigma for one in found.parameters if one.key == key))


def book(folder: Path) -> tuple[list[Check], Panel]:
    """A gyroscope on a book."""
    times = np.arange(1, 121) / 100
    true = motion(BOOK, times)["angular_velocity"].values
    noise = np.random.default_rng(11).standard_normal(true.shape)
    seen = true + BIAS + GYROSCOPE * noise
    sets = "".join(
        observations(
            folder / f"{a}.csv", times, seen[:, n], f"w{a} + b{a}", repr(GYROSCOPE), a, 'unit = "rad/s"'
        )
        for n, a in enumerate("xyz")
    )
    keys = ["initial.angular_velocity", *MOMENTS[:2], *(f"parameters.b{a}" for a in "xyz")]
    start = BOOK.replace("[13, 20, 25]", "[12.8, 20.3, 25]").replace("[0.6, 9, 0.4]", "[0.65, 8.9, 0.35]")
    fit = f"[fit]\nparameters = {keys}\n".replace("'", '"')
    fit += "".join(f'prior."parameters.b{a}" = {{sigma = "0.1 rad/s"}}\n' for a in "xyz")
    found = rigidsim.fit(rigidsim.parse(start + fit + sets))
    curves = []
    for n, (name, color) in enumerate(zip("xyz", ("red", "green", "blue"), strict=True)):
        left = found.dataset[f"residual_{n + 1}"].values[:, 0]
        curves += [Curve(times, seen[:, n], "", color, ".", 0.5),
                   Curve(times, seen[:, n] - left, name, color, width=1)]  # fmt: skip
    truth = dict(zip(MOMENTS[:2], (13.0, 20.0), strict=True))
    truth |= {f"parameters.b{a}": float(b) for a, b in zip("xyz", BIAS, strict=True)}
    source = "the simulated truth; three sigmas"
    checks = [
        within(f"book: {key}", found.value(key), value, 3 * float(found.sigma(key) or 0), source)
        for key, value in truth.items()
    ]
    return checks, Panel("a telephone on a tossed book: its gyroscope", "time, s", "rad/s", curves)


def satellite(folder: Path) -> tuple[list[Check], Panel]:
    """What attitudes along up to two orbits tell of a satellite's moments."""
    times = np.linspace(0, 2 * ORBIT, 401)[1:]
    checks: list[Check] = []
    keys = ["initial.attitude", "initial.angular_velocity", *MOMENTS]
    fit = f"[fit]\nparameters = {keys}\n".replace("'", '"')
    told = {}
    for name, text in (("with a wheel", SATELLITE + WHEEL), ("without", SATELLITE)):
        true = motion(text, times)["quaternion"].values
        noise = ATTITUDES * np.random.default_rng(4).standard_normal((len(times), 3))
        seen = np.array([_turned(q, v) for q, v in zip(true, noise, strict=True)])
        sigmas = []
        spans = SPANS if name == "with a wheel" else SPANS[-1:]
        for span in spans:
            part = times <= span * ORBIT * (1 + 1e-9)
            file = folder / "attitudes.csv"
            data = observations(file, times[part], seen[part], "quaternion", repr(ATTITUDES), "wxyz")
            found = rigidsim.fit(rigidsim.parse(text + fit + data))
            sigmas.append([found.sigma(key) or np.nan for key in MOMENTS])
        told[name] = found
        if name == "with a wheel":
            relative = 100 * np.array(sigmas) / [900, 1000, 400]
            colors = ("red", "green", "blue")
            curves = [Curve(spans, relative[:, n], f"moment {'xyz'[n]}", colors[n], "o-") for n in range(3)]
    for key, value in zip(MOMENTS, (900.0, 1000.0, 400.0), strict=True):
        found = told["with a wheel"]
        source = "the simulated truth; three sigmas"
        tolerance = 3 * float(found.sigma(key) or 0)
        checks.append(within(f"satellite: {key}", found.value(key), value, tolerance, source, "kg m^2"))
    names = {name for one in told["without"].undetermined for name in one.keys} & {*MOMENTS}
    source = "torques of a gravity gradient are as large as the moments"
    checks.append(within("satellite without its wheel: undetermined", len(names), 3, 0, source, "keys"))
    title, below = (
        "a satellite's moments by attitudes to 0.1 deg",
        "orbits observed (only ratios without its wheel)",
    )
    curves.append(Curve(None, 100, "", "grey", width=0.8))
    return checks, Panel(title, below, "sigma, % of the moment", curves, "y")


def _turned(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """A quaternion turned by a small rotation vector in space axes."""
    made = Rotation.from_rotvec(vector) * Rotation.from_quat(quaternion[[1, 2, 3, 0]])
    return np.asarray(made.as_quat()[[3, 0, 1, 2]])


def moon(folder: Path) -> tuple[list[Check], Panel]:
    """DE421's Moon by its own librations, from a perturbed start, and perturbed beta and gamma."""
    from experiments.bare import moon as bare

    days = np.arange(4.0, 366.0, 4.0)
    matrices = bare.librations("de421", START + days)
    seen = Rotation.from_matrix(matrices).as_quat()[:, [3, 0, 1, 2]]
    file = folder / "librations.csv"
    observations(file, days * 86400, seen, "quaternion", "1", "wxyz")
    scene = rigidsim.load(CONFIGS / "kernels" / "moon_since_1969.toml").replace(
        {"time.end": f"{days[-1]:g} day", "output.record": ["quaternion"]}
    )
    table = scene.to_dict()
    moments = [float(x) for x in build_scene(scene).body.principal_moments]
    rates = [float(x.split()[0]) / 86400 for x in table["initial"]["angular_velocity"]]
    perturbed = [moments[0] * (1 + 3e-8), moments[1] * (1 - 2e-8), moments[2]]
    keys = ["initial.attitude", "initial.angular_velocity", *MOMENTS[:2]]
    begun = scene.replace(
        {
            "name": "moon",
            "body.principal_moments": perturbed,
            "initial.euler_angles": [x + 2e-7 for x in map(float, table["initial"]["euler_angles"])],
            "initial.angular_velocity": [w * (1 + 1e-7) for w in rates],
            "fit": {
                "parameters": keys,
                "data": [
                    {"file": str(file), "observable": "quaternion", "columns": ["w", "x", "y", "z"],
                     "sigma": f"{MAS!r} rad"}
                ],
            },
        }
    )  # fmt: skip
    found = rigidsim.fit(begun)
    left = found.dataset["residual_1"].values / MAS
    years = days / 365.25
    colors = ("red", "green", "blue")
    curves = [Curve(years, left[:, n], "XYZ"[n], colors[n], width=1) for n in range(3)]
    largest = float(np.linalg.norm(left, axis=1).max())
    checks = [Check("Moon: residual at most", largest, 0.0, 1.0, "mas", "DE421's librations", "absolute")]
    fitted = [found.value(key) for key in MOMENTS[:2]] + [moments[2]]
    spread = [float(found.sigma(key) or np.nan) for key in MOMENTS[:2]]
    source = "DE421's constants; three sigmas"
    for name, (i, j, k) in {"beta": (2, 0, 1), "gamma": (1, 0, 2)}.items():
        true, seen = ((x[i] - x[j]) / x[k] for x in (moments, fitted))
        allowed = 3 * float(np.hypot(*spread)) / moments[k]
        checks.append(Check(f"Moon: {name}", seen, true, allowed, "1", source, "absolute"))
    return checks, Panel("DE421's Moon, fitted: residuals", "years since 1969", "mas", curves)


@Study
def study(full: bool) -> Answer:
    """All four, and their figure."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        found = [toutatis(), book(folder), satellite(folder), *([moon(folder)] if full else [])]
    checks = [check for some, _ in found for check in some]
    panels = [panel for _, panel in found]
    places, size = ("ab;cd", (12, 8.5)) if full else ("abc", (15, 4.6))
    return checks, Picture("What observations show of real bodies", places, panels, size)
