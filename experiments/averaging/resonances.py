"""Random bodies that librate in a spin-orbit resonance: does the announced error cover the true one?

Seeded: member N of a seed is the same scene whenever it is run. Triaxial bodies at 1:1, 3:2, 1:2 and 2:1 on
eccentric, inclined orbits, some with moving nodes and pericentres, over 150 to 500 orbits; the full model
runs to the end.

Held against: an announced error in each, the true one at most three times that in 99 % of them, and at most
ten times in all that don't warn.

Run: python -m experiments.averaging.resonances [56] [--seed 7]
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import rigidsim
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
            "angular_velocity": [
                *random.normal(0, 0.003, 2).tolist(),
                pace + swing * rate * math.cos(phase),
            ],
            "euler_angles": [first, tilt, around - first + swing * math.sin(phase)],
        },
        "loads": [{"kind": "gravity_gradient", "gravitational_parameter": 1.0, "orbit": orbit}],
        "model": {"level": "orbit_averaged"},
        "time": {"end": 2 * math.pi * float(random.uniform(150, 500)), "samples": 401},
        "output": {"timeline": False, "record": AXES},
    }


def members(count: int, seed: int) -> Iterator[tuple[int, list[Axis]]]:
    """Members that have an average, with their axes; the others are left out."""
    for number in range(count):
        try:
            yield number, axes_of(rigidsim.Experiment.from_dict(librating(number, seed)))
        except ConfigError as refused:
            print(f"{number:3d} refused: {refused}", file=sys.stderr, flush=True)


def sound(axes: list[Axis]) -> bool:
    """Whether these announced errors hold what is asked of them."""
    ratios = np.array([axis.ratio for axis in axes])
    silent = np.array([axis.ratio for axis in axes if not axis.warned])
    return bool((ratios <= TIMES).mean() >= PART and (silent <= MOST).all() and np.isfinite(ratios).all())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m experiments.averaging.resonances")
    parser.add_argument("members", type=int, nargs="?", default=56)
    parser.add_argument("--seed", type=int, default=7)
    asked = parser.parse_args()
    all_axes: list[Axis] = []
    for number, axes in members(asked.members, asked.seed):
        all_axes += axes
        told = ", ".join(f"{x.name} {x.announced:.1e} announced, {x.true:.1e} true" for x in axes)
        print(f"{number:3d} {told}", flush=True)
    ratios = np.array([axis.ratio for axis in all_axes])
    print(
        f"{len(ratios)} axes, {np.isnan(ratios).sum()} without an announced error, "
        f"{(ratios > TIMES).sum()} beyond {TIMES:g} times, worst {np.nanmax(ratios):.2g}, "
        f"median {np.nanmedian(ratios):.2g}"
    )
    sys.exit(int(not sound(all_axes)))
