"""A rotation that is damped: how far is its average from the full motion, in momentum, energy and wobble?

A body with moments 1 : 1.7 : 2 tumbles under a viscous torque that takes nine tenths of its energy over
10,000 turns (--full; 1,000 with ten times the torque otherwise), alone and under a gravity gradient; again at
eight sizes of the torque, to which errors are proportional if the same share is lost. An axisymmetric body's
rates decay exponentially. Random bodies with random torques (40 with --full, 10 otherwise) announce their
errors.
"""

import sys
from dataclasses import dataclass

import numpy as np

from experiments.common import Answer, Check, Curve, Panel, Picture, Result, Study, covered, simulate
from experiments.tumbling_averages import extremes, wobble, wobbles
from rigidsim.errors import ConfigError

CONFIG = """
name = "damped"
body.principal_moments = {moments}
[initial]
angular_velocity = {rates}
euler_angles = ["30 deg", "40 deg", "10 deg"]
[[loads]]
kind = "viscous_torque"
coefficients = {damping}
{gradient}
[time]
end = {end}
samples = {samples}
[model]
level = "{level}"
[output]
record = {record}
estimate = {estimate}
"""
GRADIENT = """[[loads]]
kind = "gravity_gradient"
gravitational_parameter = {square}
orbit = {{semi_major_axis = 1, eccentricity = {e}, inclination = "{tilt} deg"}}
"""
ANNOUNCED = {
    "momentum_axis": "momentum's direction",
    "angular_momentum_norm": "size of the momentum",
    "energy": "energy",
}
SAMPLES = 2001
PARTS = 50


@dataclass(frozen=True)
class Scene:
    """A damped body; SI.

    Attributes:
        moments, rates, damping: about the principal axes.
        gradient: tables of a gravity gradient, or nothing.
        end: s.
    """

    moments: list[float]
    rates: list[float]
    damping: list[float]
    end: float
    gradient: str = ""

    def run(self, level: str, samples: int = SAMPLES, *, estimate: bool = True) -> Result:
        """One model; an averaged one measures its errors if asked to."""
        reduced = level != "full"
        energy = ["energy"] if reduced else ["rotational_energy", "figure_axis"]
        record = ["momentum_axis", "angular_momentum_norm", *energy]
        told = {"level": level, "record": record, "estimate": str(reduced and estimate).lower()}
        return simulate(CONFIG.format(**vars(self), **told, samples=samples).replace("'", '"'))


def tumbler(size: float, end: float, gradient: str = "") -> Scene:
    """Moments 1 : 1.7 : 2, in short-axis mode, with a wobble of 30 deg."""
    return Scene([1.0, 1.7, 2.0], [0.4, 0.5, 1.2], [size, 2 * size, 1.5 * size], end, gradient)


def distances(averaged: Result, full: Result) -> dict[str, np.ndarray]:
    """Of the averaged motion from the full one at the samples: rad, and relative."""
    sizes = {"angular_momentum_norm": "angular_momentum_norm", "energy": "rotational_energy"}
    found = {name: np.abs(averaged.values(name) / full.values(there) - 1) for name, there in sizes.items()}
    return {"momentum_axis": averaged.apart(full), **found}


def wobble_checks(scene: Scene, averaged: Result, full: Result) -> list[Check]:
    """The wobble in the last part of the full motion, and that of the averaged momentum and energy."""
    moments, last = np.array(scene.moments), slice(-(SAMPLES // PARTS), None)
    both = [averaged.values(name)[last] for name in ("energy", "angular_momentum_norm")]
    bounds = np.array([extremes(moments, e, s) for e, s in zip(*both, strict=True)])
    announced = [averaged.announced(name) for name in ("energy", "angular_momentum_norm")]
    given, source = [x.mean() for x in both], "free motion; announced errors and change meanwhile"
    return wobbles("fiftieth", moments, given, announced, wobble(full)[last], source, np.ptp(bounds, axis=0))


def axisymmetric() -> Check:
    """Energy of a body whose rates decay exponentially."""
    scene = Scene([1.0, 1.0, 2.0], [0.4, 0.5, 1.2], [1e-4, 1e-4, 1.5e-4], 1e5)
    found = scene.run("spin_averaged", estimate=False)
    moments, damping = np.array(scene.moments), np.array(scene.damping)
    rates = np.array(scene.rates)[:, None] * np.exp(-(damping / moments)[:, None] * found.values("time"))
    energy = (moments[:, None] * rates**2).sum(axis=0) / 2
    worst = float(np.abs(found.values("energy") - energy).max() / energy[0])
    source = "w1, w2 = e^(-c t / A), w3 = e^(-d t / C); 1024 epsilon, the tolerance, relative to the start"
    return Check(
        "axisymmetric body: energy from the exact one", worst, 0.0, 1024 * 2.0**-52, "1", source, "absolute"
    )


def orders(sizes: np.ndarray) -> tuple[list[Check], dict[str, np.ndarray]]:
    """Exponents of the errors' growth with the torque, if the same share is lost."""
    found: dict[str, list[float]] = {name: [] for name in ANNOUNCED}
    for size in sizes:
        scene = tumbler(float(size), 0.4 / float(size))
        apart = distances(scene.run("spin_averaged", estimate=False), scene.run("full"))
        for name, error in apart.items():
            found[name].append(float(error.max()))
    checks, errors = [], {name: np.array(values) for name, values in found.items()}
    for name, values in errors.items():
        slope = float(np.polyfit(np.log(sizes), np.log(values), 1)[0])
        source = "first-order averaging; phases at which samples meet the oscillation"
        checks.append(
            Check(f"order of the error in the torque: {ANNOUNCED[name]}", slope, 1.0, 0.05, "1", source)
        )
    return checks, errors


def random_scene(number: int) -> Scene:
    """A triaxial body in any rotation, any viscous torque, in 0.4 of them with a gravity gradient."""
    random = np.random.default_rng([15, number])
    a, b = random.uniform(0.3, 1.0, 2).tolist()
    third = random.uniform(max(abs(a - b), 0.3) * 1.01, a + b)
    direction = random.normal(size=3)
    torque = 10.0 ** random.uniform(-5, -2.5)
    gradient = ""
    if random.uniform() < 0.4:
        motion = 10.0 ** random.uniform(-3, -2)
        gradient = GRADIENT.format(square=motion**2, e=random.uniform(0, 0.3), tilt=random.uniform(0, 60))
    rates, damping = direction / np.linalg.norm(direction), torque * random.uniform(0, 1, 3)
    end = min(random.uniform(0.3, 1.5) / torque, 4e4)
    return Scene([a, b, third], rates.tolist(), damping.tolist(), end, gradient)


def campaign(count: int) -> tuple[list[Check], np.ndarray, int]:
    """Random bodies: true errors over announced ones, (bodies, 3), and how many were refused."""
    ratios, refused, number = [], 0, 0
    while len(ratios) < count:
        scene = random_scene(number)
        number += 1
        try:
            averaged = scene.run("spin_averaged")
        except ConfigError as error:
            refused += 1
            print(f"random {number - 1}: {error.problems[0].what[:200]}", file=sys.stderr)
            continue
        apart = distances(averaged, scene.run("full"))
        ratios.append([float(apart[name].max()) / averaged.announced(name) for name in ANNOUNCED])
        print(f"random {number - 1}: {ratios[-1]} of what is announced", file=sys.stderr)
    found = np.array(ratios)
    checks = [
        Check(
            f"random bodies: {words}: largest error over what is announced",
            float(found[:, i].max()), 0.5, 0.5, "1", f"summary.json of {count} runs: not above 1", "absolute",
        )
        for i, words in enumerate(ANNOUNCED.values())
    ]  # fmt: skip
    return checks, found, refused


def picture(
    scene: Scene,
    both: dict[str, Result],
    ordered: tuple[np.ndarray, dict[str, np.ndarray]],
    ratios: np.ndarray,
) -> Picture:
    """The wobble, the distances, their order, and the random bodies."""
    averaged, full = both["spin_averaged"], both["full"]
    time, energy, colors = averaged.values("time"), averaged.values("energy"), ("blue", "orange", "green")
    pairs = zip(energy, averaged.values("angular_momentum_norm"), strict=True)
    bounds = np.degrees([extremes(np.array(scene.moments), e, s) for e, s in pairs])
    away, (sizes, errors) = distances(averaged, full), ordered
    along, order, beside = [], [], [Curve(None, 1.0, "", "red", width=1)]
    for i, (color, (name, label)) in enumerate(zip(colors, ANNOUNCED.items(), strict=True)):
        along += [Curve(time, np.maximum(away[name], 1e-12), label, color, ".", 0.5),
                  Curve(None, averaged.announced(name), "", color, "--", 0.9)]  # fmt: skip
        order.append(Curve(sizes, errors[name], label, color, "o-"))
        beside.append(Curve(np.arange(len(ratios)), ratios[:, i], label, color, "o"))
    line = errors["angular_momentum_norm"][0] / 2 * sizes / sizes[0]
    order.append(Curve(sizes, line, "first order", "grey", ":", 0.8))
    least = float(min(np.median(x) for x in away.values())) / 30
    return Picture("A damped rotation: its average beside every rotation", "ab;cd", [
        Panel(f"{100 * energy[-1] / energy[0]:.0f} % of the energy left at the end", "time (s)",
              "wobble (deg)", [Curve(time, np.degrees(wobble(full)), "full", "grey", ".", 0.5),
               *(Curve(time, bounds[:, i], label, "red")
                 for i, label in enumerate(("averaged: extremes", "")))], legend="upper right"),
        Panel("average from full; dashed: announced", "time (s)", "distance (rad, relative)", along, "y",
              limits={"ylim": (least, None)}, legend="lower right"),
        Panel("the same share lost", "coefficient of the torque (N m s)", "largest distance", order, "xy"),
        Panel("below the line: covered", "random body", "true error over announced", beside,
              limits={"ylim": (0, 1.2 * max(1.0, float(ratios.max())))}, legend="lower left"),
    ], (11.5, 8.2))  # fmt: skip


@Study
def study(full: bool) -> Answer:
    """All of it; see the module's text."""
    size, end = (2.5e-5, 5e4) if full else (2.5e-4, 5e3)
    scenes = {
        "tumbler": tumbler(size, end),
        "with a gradient": tumbler(size, end, GRADIENT.format(square=4e-5, e=0.1, tilt=20)),
    }
    checks: list[Check] = []
    runs: dict[str, dict[str, Result]] = {}
    for title, scene in scenes.items():
        levels = ("full", "spin_averaged")
        runs[title] = {level: scene.run(level).told(f"{title}, {level}") for level in levels}
        full_one, averaged = runs[title].values()
        checks += [
            covered(f"{title}: {ANNOUNCED[name]}", error, averaged.announced(name))
            for name, error in distances(averaged, full_one).items()
        ]
    checks += wobble_checks(scenes["tumbler"], runs["tumbler"]["spin_averaged"], runs["tumbler"]["full"])
    checks.append(axisymmetric())
    sizes = 2e-3 / 2.0 ** np.arange(8 if full else 5)
    slopes, errors = orders(sizes)
    rows, ratios, refused = campaign(40 if full else 10)
    print(f"random bodies: {refused} refused", file=sys.stderr)
    return checks + slopes + rows, picture(scenes["tumbler"], runs["tumbler"], (sizes, errors), ratios)
