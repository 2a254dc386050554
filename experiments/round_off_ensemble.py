"""How do rounding errors grow with time, and are they what the project's law says, in every precision?

Method: an ensemble of free motions of one body (``configs/sweeps/round_off.toml``: random starts, moments
for which Euler's equations have exact coefficients) in single, double and 80-bit arithmetic. A second sweep
runs the closed form from the very numbers that each of them starts with, in a precision that has 2^11
(single: 2^29) times finer numbers; it takes no steps, so that nothing adds up in it. Attitudes are
subtracted before they are multiplied, so that an error of 1e-16 keeps its digits. Energies are
worked out in fractions from the rates recorded.

Held against: Brouwer's law (1937) as this project announces it. Each step rounds the rates by eps/2 of
their size, in random directions: after N steps energy is off by (eps/2) sqrt(N), and attitudes, which
integrate rates that are off so, by (eps/2) sqrt(N) |w| t / sqrt 3. So the exponents of time are 1/2 and
3/2. Root mean squares over the members; their error bars are standard deviations over 400 ensembles drawn
from this one with replacement (Efron 1979), and so are those of exponents (least squares from 8 s on, each
ensemble fitted by itself: neighbouring times share their walk, so that scatter about a line tells too
little) and of constants.

- Exponents: within three of their error bars of 1/2 and 3/2, and further than that from 1 and 2, which a
  bias would give.
- Constants: at most 1 (the law is announced as a bound of what is typical), at least 1/20: a law twenty
  times too wide would announce nothing.

Run: python -m experiments.round_off_ensemble [--full] [--out DIR]
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import xarray

import rigidsim
from experiments.common import (
    BLUE,
    CONFIGS,
    EPSILON,
    GREEN,
    GREY,
    ORANGE,
    Answer,
    Check,
    Curve,
    Panel,
    Picture,
    Study,
)
from rigidsim.scene.parts_of_values import parts_in

CONFIG = CONFIGS / "sweeps" / "round_off.toml"
FINER = {"single": "double", "double": "extended", "extended": "quadruple"}
COLORS = {"single": ORANGE, "double": BLUE, "extended": GREEN}
ENSEMBLES = 400
MOMENTS = (3, 1, 4)
BEGIN = 8.0
"""Seconds (some twenty steps) from which on a walk can be told."""
AXES = [f"initial.angular_velocity[{i}]" for i in range(3)]


@dataclass(frozen=True)
class Ensemble:
    """Errors of all members of one precision.

    Attributes:
        time: samples from 1 s on, (samples,), s.
        attitude, energy: (members, samples), rad and relative, with their sign where they have one.
        law: of attitudes over t^1.5 and of energies over t^0.5: the root mean square over the members.
    """

    precision: str
    time: np.ndarray
    attitude: np.ndarray
    energy: np.ndarray
    law: tuple[float, float]


@dataclass(frozen=True)
class Growth:
    """How the root mean square of an error grows.

    Attributes:
        rms, bar: at each sample, and its error bar.
        exponent, constant: each with its error bar; the constant at the last sample, over the law.
    """

    rms: np.ndarray
    bar: np.ndarray
    exponent: tuple[float, float]
    constant: tuple[float, float]


def run(config: str, settings: list[str]) -> xarray.Dataset:
    """A sweep of the config in a folder that goes away."""
    with tempfile.TemporaryDirectory() as folder:
        swept = rigidsim.sweep(rigidsim.parse(config, overrides=settings), out=folder)
        with swept.dataset as dataset:
            return dataset.load()


def measured(precision: str, members: int, end: int) -> Ensemble:
    """Errors of so many members up to a time, against their closed form."""
    text = CONFIG.read_text(encoding="utf-8")
    listed = rigidsim.load(CONFIG).config.time.times or ()
    times = [float(t.rational) for t in listed if t.rational <= end]
    settings = [
        f'integrator.precision="{precision}"',
        f"time.times=[{', '.join(map(str, times))}]",
        *(f'sweep.axes."{key}".count={members}' for key in AXES),
    ]
    found = run(text, settings)
    parts = [found[name].values[:, 0] for name in parts_in(found, "angular_velocity")]
    starts = parts[0]
    exact = [
        f'integrator.precision="{FINER[precision]}"',
        'integrator.method="closed_form"',
        f"time.times=[{', '.join(map(str, times))}]",
        *(
            f'sweep.axes."{key}"={{values=[{_listed(*(part[:, i] for part in parts))}]}}'
            for i, key in enumerate(AXES)
        ),
    ]
    reference = run(text, exact)
    time = found["time"].values
    rate = np.linalg.norm(starts, axis=1)
    steps = found.steps.values / time[-1]
    half = EPSILON[precision] / 2
    law = half * np.sqrt(steps) * rate / np.sqrt(3), half * np.sqrt(steps)
    return Ensemble(
        precision,
        time[1:],
        attitude_errors(found, reference)[:, 1:],
        energy_errors(found)[:, 1:],
        (float(np.sqrt((law[0] ** 2).mean())), float(np.sqrt((law[1] ** 2).mean()))),
    )


def _listed(*parts: np.ndarray) -> str:
    """Sums of doubles as the exact fractions that they are."""
    return ", ".join(f'"{sum(map(Fraction, map(float, row)))}"' for row in zip(*parts, strict=True))


def energy_errors(found: xarray.Dataset) -> np.ndarray:
    """Relative errors of the energy (members, samples), from the very rates recorded, in exact arithmetic."""
    parts = [found[name].values for name in parts_in(found, "angular_velocity")]
    energies = [
        [
            sum(
                moment * sum(map(Fraction, map(float, w))) ** 2
                for moment, w in zip(MOMENTS, rates, strict=True)
            )
            for rates in member
        ]
        for member in np.stack(parts, axis=-1)
    ]
    return np.array([[float(energy / member[0] - 1) for energy in member] for member in energies])


def attitude_errors(found: xarray.Dataset, reference: xarray.Dataset) -> np.ndarray:
    """Angles (rad) between attitudes of two sweeps, (members, samples), from residuals, too."""
    true = reference.quaternion.values
    apart = found.quaternion.values - true
    other = found.quaternion.values + true  # the same attitude has two quaternions
    turned = (apart**2).sum(axis=-1) > (other**2).sum(axis=-1)
    apart = np.where(turned[..., None], other, apart)
    sign = np.where(turned[..., None], -1.0, 1.0)
    for residual in parts_in(found, "quaternion")[1:]:
        apart = apart + found[residual].values
    for residual in parts_in(reference, "quaternion")[1:]:
        apart = apart - sign * reference[residual].values
    true = sign * true
    w, v = true[..., :1], true[..., 1:]
    across = w * apart[..., 1:] - apart[..., :1] * v - np.cross(v, apart[..., 1:])
    return np.asarray(2 * np.linalg.norm(across, axis=-1))


def growth(ensemble: Ensemble, errors: np.ndarray, power: float, law: float) -> Growth:
    """Root mean square, exponent and constant, with error bars over ensembles drawn with replacement."""
    draw = np.random.default_rng(7)
    members = len(errors)
    late = ensemble.time >= BEGIN
    logs = np.log(ensemble.time[late])
    logs = logs - logs.mean()
    chosen = [np.arange(members), *draw.integers(members, size=(ENSEMBLES, members))]
    rms = np.array([np.sqrt((errors[rows] ** 2).mean(axis=0)) for rows in chosen])
    exponents = np.log(rms[:, late]) @ logs / (logs @ logs)
    constants = rms[:, -1] / (law * ensemble.time[-1] ** power)
    return Growth(
        rms[0],
        rms[1:].std(axis=0),
        (float(exponents[0]), float(exponents[1:].std())),
        (float(constants[0]), float(constants[1:].std())),
    )


@Study
def study(full: bool) -> Answer:
    """Three ensembles, the figure, the checks."""
    sizes = {"single": (96, 8192), "double": (192, 32768), "extended": (48, 8192)}
    few = {"single": (24, 1024), "double": (64, 8192), "extended": (16, 512)}
    checks: list[Check] = []
    shown = []
    for precision, (members, end) in (sizes if full else few).items():
        ensemble = measured(precision, members, end)
        attitude = growth(ensemble, ensemble.attitude, 1.5, ensemble.law[0])
        energy = growth(ensemble, ensemble.energy, 0.5, ensemble.law[1])
        shown.append((ensemble, attitude, energy))
        for what, found, expected, wrong in (("energy", energy, 0.5, 1.0), ("attitude", attitude, 1.5, 2.0)):
            exponent, bar = found.exponent
            constant, spread = found.constant
            print(f"{precision:9s} {what:8s} {members} members to t = {end}: exponent {exponent:.3f} "
                  f"+- {bar:.3f}, {constant:.3f} +- {spread:.3f} of the law")  # fmt: skip
            name = f"{what}, {precision}"
            checks += [
                Check(f"exponent of time: {name}", exponent, expected, 3 * bar, "1",
                      "Brouwer 1937; three error bars", "absolute"),
                Check(f"NOT that of a bias: {name}", exponent, wrong, 3 * bar, "1",
                      "errors of one sign in every step", "apart"),
                Check(f"constant over the law: {name}", constant, 0.525, 0.475, "1",
                      "announced as a bound; between 1/20 and 1", "absolute"),
            ]  # fmt: skip
    figure = picture(shown)
    return checks, figure


def picture(shown: list[tuple[Ensemble, Growth, Growth]]) -> Picture:
    """Errors against time with their bars, the law, and both as ratios."""
    panels: dict[int, tuple[Panel, Panel]] = {}
    for column, (what, power) in enumerate((("energy (relative)", 0.5), ("attitude (rad)", 1.5))):
        above, below = [], [Curve(None, 1, "", GREY, "--", 1)]
        for (ensemble, *pair), color in zip(shown, (ORANGE, BLUE, GREEN), strict=True):
            found, law = pair[1 - column], ensemble.law[1 - column] * ensemble.time**power
            label = f"{ensemble.precision}: exponent {found.exponent[0]:.2f} ± {found.exponent[1]:.2f}"
            above += [Curve(ensemble.time, found.rms, label, color, "o"),
                      Curve(ensemble.time, law, "", color, "--", 1)]  # fmt: skip
            below += [Curve(ensemble.time, found.rms / law, "", color, "o"),
                      *(Curve(ensemble.time, (found.rms + k * found.bar) / law, "", color, ":", 0.8)
                        for k in (-2, 2))]  # fmt: skip
        panels[column] = (
            Panel("root mean square; dashed: the law", "", f"error of the {what}", above, "xy"),
            Panel("dotted: ± 2 error bars", "time (s), 1 rad/s", "over the law", below, "x",
                  limits={"ylim": (0, None)}),
        )  # fmt: skip
    title = "Rounding walks: energy errs like t^0.5, attitude like t^1.5, in every precision"
    order = [panels[0][0], panels[1][0], panels[0][1], panels[1][1]]
    return Picture(title, "ab;cd", order, (12.5, 6.4), {"height_ratios": [2, 1]})


if __name__ == "__main__":
    raise SystemExit(study.main())
