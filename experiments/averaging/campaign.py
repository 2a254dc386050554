"""Random bodies under random sources: does the announced modelling error cover the true one?

Seeded: member N of a seed is the same scene whenever it is run. Slow and fast, principal and tumbling
rotations, symmetric and triaxial bodies, one or two sources on orbits with eccentricities up to 0.8, some
with moving nodes, over 4,000 to 30,000 rotations; both averaged levels, with and without short-period terms.
The full model runs to the end.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

import rigidsim
from rigidsim.errors import ConfigError

SAMPLES = 401


@dataclass(frozen=True)
class Member:
    """One of them.

    Attributes:
        refused: why no average applies; empty where one does.
        announced, true: modelling error of the momentum's direction, and the largest distance at the
            samples, rad.
        numerical: error of the averaged run's integration as announced, rad.
        whole: whether the full model was followed to the end anyway.
        cpu: of the averaged run with its windows, and of the full one, s.
    """

    number: int
    level: str
    tumbles: bool
    refused: str
    announced: float = math.nan
    true: float = math.nan
    numerical: float = math.nan
    whole: bool = False
    cpu: tuple[float, float] = (math.nan, math.nan)


def scene(number: int, seed: int) -> dict[str, Any]:
    """The tables of a member."""
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
        "time": {"end": float(rotations * 2 * math.pi / ratio), "samples": SAMPLES},
        "model": {
            "level": str(random.choice(["spin_averaged", "orbit_averaged"])),
            "short_period": bool(random.uniform() < 0.7),
        },
        "output": {"record": ["momentum_axis"], "timeline": False},
    }


def member(number: int, seed: int) -> Member:
    """Run both models of a member."""
    tables = scene(number, seed)
    level = tables["model"]["level"]
    rates = np.array(tables["initial"]["angular_velocity"])
    tumbles = bool(np.max(np.abs(rates)) < 0.95 * np.linalg.norm(rates))
    started = time.process_time()
    try:
        averaged = rigidsim.run(rigidsim.Experiment.from_dict(tables), out=None)
    except ConfigError as error:
        return Member(number, level, tumbles, "; ".join(p.what for p in error.problems))
    between = time.process_time()
    tables["model"] = {"level": "full"}
    tables["output"]["estimate"] = False
    full = rigidsim.run(rigidsim.Experiment.from_dict(tables), out=None)
    spent = between - started, time.process_time() - between
    apart = averaged.dataset.momentum_axis.values - full.dataset.momentum_axis.values
    found = averaged.summary["modelling"]
    return Member(
        number,
        level,
        tumbles,
        "",
        found.get("momentum_axis", math.nan),
        float(np.linalg.norm(apart, axis=1).max()),
        averaged.summary["accuracy"]["estimated_attitude_error"] or 0.0,
        found["whole"],
        spent,
    )
