"""How far are averaged motions from the full one, and do they say so?

Seeded random bodies run averaged, with their modelling error measured in windows, and with every rotation
resolved to the end: 40 that rotate freely under one or two sources (seed 16; the windows were chosen on seed
15), and 56 triaxial ones that librate in a spin-orbit resonance (seed 7).

Expected: the announced error covers the true one in every rotating body, and is at most ten times the true
one in half of them; of librating ones the true error is at most three times the announced one in 99 %, and at
most ten times in all that don't warn.
"""

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import rigidsim
from experiments.common import Answer, Check, Curve, Panel, Picture, Study
from rigidsim.errors import ConfigError
from rigidsim.scene.cautions import WarningCode
from rigidsim.store.summary import Summary

AXES = ["momentum_axis", "figure_axis"]
TIMES, MOST, PART = 3.0, 10.0, 0.99
"""True errors over announced ones: of this part of all, and of each that doesn't warn."""


@dataclass(frozen=True)
class Axis:
    """How far a recorded axis is from the full model's.

    Attributes:
        announced, true: errors until the end, rad; nan if none is announced.
        warned: whether the run warns of it.
    """

    name: str
    announced: float
    true: float
    warned: bool

    @property
    def ratio(self) -> float:
        """True error over the announced one."""
        return self.true / self.announced


def axes_of(experiment: rigidsim.Experiment) -> list[Axis]:
    """The axes of an averaged run, held against the full model.

    Raises:
        ConfigError: no average applies.
    """
    averaged = experiment.replace({"output.record": AXES, "output.timeline": False})
    run = rigidsim.run(averaged, out=None)
    summary = run.outcome
    assert isinstance(summary, Summary)
    assert summary.modelling is not None
    assert run.status == "finished"
    full = averaged.replace({"model": {"level": "full"}, "output.estimate": False})
    every = rigidsim.run(full, out=None)
    codes = {WarningCode.MODEL_UNCERTAIN.value, WarningCode.MODEL_UNMEASURED.value}
    warned = bool(codes.intersection(summary.warning_codes))
    found = []
    for name in AXES:
        announced = getattr(summary.modelling, name)
        apart = np.linalg.norm(run.dataset[name].values - every.dataset[name].values, axis=1)
        found.append(Axis(name, math.nan if announced is None else announced, float(apart.max()), warned))
    return found


def rotating(number: int, seed: int) -> dict[str, Any]:
    """Tables of a random body under one or two sources: slow and fast, principal and tumbling rotations,
    eccentricities up to 0.8, some with moving nodes, over 4,000 to 30,000 rotations.
    """
    random = np.random.default_rng([seed, number])
    a, b = random.uniform(0.2, 1.0, 2)
    third = random.uniform(max(abs(a - b), 0.3) * 1.001, a + b)
    moments = [a, a, min(third, 2 * a)] if random.uniform() < 0.3 else [a, b, third]
    tumbles = bool(random.uniform() < 0.5)
    direction = random.normal(size=3)
    if not tumbles:
        direction = np.eye(3)[int(np.argmax(moments))] + 10.0 ** random.uniform(-6, -2) * direction
    # in units of the slow orbit's mean motion
    ratio = 10.0 ** random.uniform(1.3, 3.2)
    rates = ratio * direction / np.linalg.norm(direction)
    loads, motions = [], [1.0]
    if random.uniform() < 0.4:
        motions.append(float(random.uniform(1.7, 5.0)))
    for motion in motions:
        strength = motion**2 * (1.0 if motion == 1.0 else random.uniform(0.05, 0.5))
        orbit = {
            "semi_major_axis": 1,
            "period": 2 * math.pi / motion,
            "eccentricity": float(random.choice([0.0, random.uniform(0, 0.3), random.uniform(0.3, 0.8)])),
            "inclination": f"{random.uniform(0, 40)} deg",
            "ascending_node": float(random.uniform(0, 6)),
            "periapsis": float(random.uniform(0, 6)),
            "mean_anomaly": float(random.uniform(0, 6)),
        }
        if random.uniform() < 0.3:
            orbit["node_rate"] = float(-motion * 10.0 ** random.uniform(-4, -2.2))
        loads.append({"kind": "gravity_gradient", "gravitational_parameter": strength, "orbit": orbit})
    rotations = 10.0 ** random.uniform(3.6, 4.5)
    quaternion = random.normal(size=4)
    return {
        "name": f"averaged_{number}",
        "body": {"principal_moments": [float(x) for x in moments]},
        "initial": {
            "angular_velocity": [float(x) for x in rates],
            "quaternion": [float(x) for x in quaternion],
        },
        "loads": loads,
        "time": {"end": float(rotations * 2 * math.pi / ratio), "samples": 401},
        "model": {
            "level": str(random.choice(["spin_averaged", "orbit_averaged"])),
            "short_period": bool(random.uniform() < 0.7),
        },
        "output": {"record": AXES, "timeline": False},
    }


def librating(number: int, seed: int) -> dict[str, Any]:
    """Tables of a random triaxial body in a spin-orbit resonance: librating, on an eccentric and inclined
    orbit, some with moving nodes and pericentres.
    """
    random = np.random.default_rng([seed, number])
    pace, widest = ((1.0, 0.15), (1.5, 0.3), (0.5, 0.3), (2.0, 0.3))[number % 4]
    flattening, share = 10 ** random.uniform(-3.3, -1.6), random.uniform(0.2, 0.8)
    e = random.uniform(0.2, 1) * widest
    strength = {1.0: 1 - 2.5 * e * e, 1.5: 3.5 * e, 0.5: -0.5 * e, 2.0: 8.5 * e * e}[pace]
    rate = math.sqrt(3 * abs(strength) * flattening * (1 - share))
    swing, phase = random.uniform(0, 0.6), random.uniform(0, 2 * math.pi)
    node, periapsis, anomaly, first = random.uniform(-math.pi, math.pi, 4)
    around = node + periapsis + pace * anomaly + (0.0 if strength > 0 else math.pi / 2)
    orbit = {
        "semi_major_axis": 1,
        "eccentricity": e,
        "inclination": float(random.uniform(0, 0.3)),
        "ascending_node": node,
        "periapsis": periapsis,
        "mean_anomaly": anomaly,
        "node_rate": float(-random.integers(2) * 10 ** random.uniform(-3.5, -2)),
        "periapsis_rate": float(random.integers(2) * 10 ** random.uniform(-3.5, -2)),
        "period": 2 * math.pi,
    }
    tilt = float(random.uniform(0, 0.25))
    return {
        "name": f"librating_{number}",
        "body": {"principal_moments": [1 - flattening, 1 - share * flattening, 1.0]},
        "initial": {
            "angular_velocity": [*random.normal(0, 0.003, 2).tolist(), pace + swing * rate * math.cos(phase)],
            "euler_angles": [first, tilt, around - first + swing * math.sin(phase)],
        },
        "loads": [{"kind": "gravity_gradient", "gravitational_parameter": 1.0, "orbit": orbit}],
        "model": {"level": "orbit_averaged"},
        "time": {"end": 2 * math.pi * float(random.uniform(150, 500)), "samples": 401},
        "output": {"timeline": False, "record": AXES},
    }


def members(
    count: int, seed: int, tables: Callable[[int, int], dict[str, Any]] = librating
) -> Iterator[tuple[int, list[Axis]]]:
    """Members that have an average, with their axes; the others are left out."""
    for number in range(count):
        try:
            axes = axes_of(rigidsim.Experiment.from_dict(tables(number, seed)))
        except ConfigError as refused:
            print(f"{number:3d} refused: {refused}", file=sys.stderr, flush=True)
            continue
        told = ", ".join(f"{x.name} {x.announced:.1e} announced, {x.true:.1e} true" for x in axes)
        print(f"{number:3d} {told}", file=sys.stderr, flush=True)
        yield number, axes


def sound(axes: list[Axis]) -> bool:
    """Whether these announced errors hold what is asked of them."""
    ratios = np.array([axis.ratio for axis in axes])
    silent = np.array([axis.ratio for axis in axes if not axis.warned])
    return bool((ratios <= TIMES).mean() >= PART and (silent <= MOST).all() and np.isfinite(ratios).all())


def picture(turning: list[Axis], resting: list[Axis]) -> Picture:
    """Announced errors against true ones."""
    ran = [*turning, *resting]
    ends = np.array([min(one.true for one in ran) / 3, max(one.announced for one in ran) * 3])
    curves = [Curve(ends, factor * ends, label, "grey", style, 1) for factor, label, style in (
        (1, "announced = true", "-"), (10, "ten times the true one", "--"))]  # fmt: skip
    for some, color, label in ((turning, "blue", "rotating bodies"), (resting, "orange", "librating bodies")):
        points = np.array([(one.true, one.announced) for one in some])
        curves.append(Curve(*points.T, label, color, "o", 1.5))
    panel = Panel("Axes of momentum and figure", "true error, from the full motion (rad)", "announced (rad)",
                  curves, "xy")  # fmt: skip
    title = "Averages of random bodies announce errors that cover the true ones"
    return Picture(title, "a", [panel], (8.4, 6.2))


@Study
def study(full: bool, seed: int = 16) -> Answer:
    """Rotating and librating bodies."""
    rotating_ones = [axes[0] for _, axes in members(40 if full else 12, seed, rotating)]
    resting = [axis for _, axes in members(56 if full else 4, 7) for axis in axes]
    # both integrations round as well, by no more than 1e-9 rad here
    ratios = np.array([one.announced / max(one.true - 1e-9, 1e-12) for one in rotating_ones])
    return [
        Check("true error over the announced one, largest", float((1 / ratios).max()), 0.0, 1.0, "1",
              "the summary's own bound", "absolute"),
        Check("announced error over the true one, median", float(np.median(ratios)), 0.0, 10.0, "1",
              "ten times in half of the runs", "absolute"),
        Check("librating bodies: errors beyond what is allowed", float(not sound(resting)), 0.0, 0.0, "1",
              "3 times the announced one in 99 %, 10 times in all without a warning", "absolute"),
    ], picture(rotating_ones, resting)  # fmt: skip
