"""Is the model that `plan --physics` names the least one within the error?

Method: random scenes of three to six effects (sources with degree 3 of the body's field and a figure of their
own, a fluid core with friction, torques, two of them nearly opposite, damping, a rotor), from microradians to
tumbling. The error that `plan --physics` is asked for is that of a random model, times 0.3 to 10. Every
model without some of the effects is then written anew, as a config that never had them, and run. Costs are
the steps that it took times the operations of its equations.

Checked for each scene: the named model is within the error. Counted: scenes in which a model within it has
only a part of its effects, and scenes in which a model within it costs less by more than 5 %.

Run: python -m experiments.least_models [--count N] [--seed N]      exit code 1 if a model is beyond the error
"""

from __future__ import annotations

import math
import random
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

import rigidsim
from experiments.common import Command
from rigidsim.solve.problem import prepare
from rigidsim.workflows.physics import size_of

PARENTS = {
    "planet-degree-3": "planet",
    "planet-figure": "planet",
    "core-friction": "core",
    "core-flattening": "core",
}
KINDS = ["planet", "sun", "core", "push", "pull", "brake", "rotor-wheel", *PARENTS]
_MOST = 6e5  # arcsec, less than half a turn
_CHEAPER = 0.95  # of a cost, from which on it is counted
ARCSEC = math.degrees(1) * 3600


@dataclass(frozen=True)
class Scene:
    """A random scene: its effects, and the numbers that it has whichever of them are there."""

    effects: tuple[str, ...]
    numbers: dict[str, Any]
    shift: float  # of the error that is asked for, from that of one of the models

    @classmethod
    def drawn(cls, chance: random.Random) -> Scene:
        """One of three to six effects."""
        count = chance.randint(3, 6)
        effects: list[str] = []
        while len(effects) < count:
            kind = chance.choice(KINDS)
            if kind not in effects and PARENTS.get(kind, kind) in [*effects, kind]:
                effects.append(kind)

        def size(low: float, high: float) -> float:
            return float(f"{10 ** chance.uniform(low, high):.6g}")

        push = size(-6, -3)
        numbers = {
            "moments": [1.0, round(chance.uniform(1.01, 1.4), 4), round(chance.uniform(1.45, 1.9), 4)],
            "rates": [round(chance.uniform(-0.2, 0.2), 4), round(chance.uniform(-0.2, 0.2), 4), 1.0],
            "planet": size(-5, -2),
            "sun": size(-5, -2),
            "field": size(-3, 0),
            "figure": size(-2, 0.5),
            "core": size(-3, -1),
            "friction": size(-4, -1),
            "flattening": size(-3, -1),
            "push": push,
            "pull": -push * round(chance.uniform(0.7, 1.3), 3),
            "brake": size(-7, -3),
            "wheel": size(-5, -2),
            "end": chance.choice([20, 60, 200]),
        }
        return cls(tuple(k for k in KINDS if k in effects), numbers, size(-0.5, 1))

    def config(self, effects: Sequence[str]) -> dict[str, Any]:
        """The config that has some of the effects alone."""
        n = self.numbers
        body: dict[str, Any] = {"principal_moments": n["moments"], "mass": 1}
        tables: dict[str, Any] = {
            "name": "scene",
            "body": body,
            "initial": {"angular_velocity": n["rates"], "euler_angles": [0.1, 0.7, 0.3]},
            "time": {"end": n["end"], "samples": 41},
        }
        loads: list[dict[str, Any]] = []
        if "planet" in effects:
            orbit = {"semi_major_axis": 1, "eccentricity": 0.1, "period": 40, "inclination": 0.3}
            planet = {"kind": "gravity_gradient", "name": "planet"}
            planet |= {"gravitational_parameter": n["planet"], "orbit": orbit}
            if "planet-degree-3" in effects:
                planet["degree"] = 3
            if "planet-figure" in effects:
                planet["figure"] = {"J2": n["figure"], "radius": 0.3, "pole": [0, 0.6, 0.8]}
            loads.append(planet)
        if "planet-degree-3" in self.effects:
            body["gravity_field"] = {"radius": 0.5, "C": {"3,0": n["field"]}, "S": {"3,1": n["field"] / 3}}
        if "sun" in effects:
            sun = {"kind": "gravity_gradient", "name": "sun", "position": [0.3, -0.8, 0.6]}
            loads.append(sun | {"gravitational_parameter": n["sun"]})
        for name in ("push", "pull"):
            if name in effects:
                components = [f"{n[name]} * cos(0.3*t)", "0", f"{n[name]} / 2"]
                loads.append({"kind": "torque", "name": name, "components": components, "frame": "space"})
        if "brake" in effects:
            loads.append({"kind": "viscous_torque", "name": "brake", "coefficients": [n["brake"]] * 3})
        if "core" in effects:
            core = {key: n[key] if f"core-{key}" in effects else 0 for key in ("friction", "flattening")}
            body["core"] = {"moment": n["core"], **core, "angular_velocity": [0.05, 0, 0.98]}
        if "rotor-wheel" in effects:
            tables["rotors"] = [{"name": "wheel", "axis": [0, 1, 2], "moment": n["wheel"], "rate": 3}]
        return tables | ({"loads": loads} if loads else {})

    def models(self) -> Iterator[frozenset[str]]:
        """The effects of every model."""
        for count in range(len(self.effects) + 1):
            for kept in combinations(self.effects, count):
                if all(PARENTS.get(kind, kind) in kept for kind in kept):
                    yield frozenset(kept)


@dataclass(frozen=True)
class Model:
    """A model that was run by itself."""

    error: float  # arcsec, from the full model
    cost: int


def attitudes(tables: dict[str, Any]) -> tuple[np.ndarray, int]:
    """Quaternions at the samples, and steps times operations."""
    experiment = rigidsim.Experiment.from_dict(
        tables | {"output": {"record": ["quaternion"], "estimate": False, "timeline": False}}
    )
    run = rigidsim.run(experiment, out=None)
    steps = max(int(run.summary["cost"]["steps"]), 1)
    return run.dataset["quaternion"].values, steps * size_of(prepare(experiment))


def all_models(scene: Scene) -> dict[frozenset[str], Model]:
    """Every model of a scene, run."""
    full, _ = attitudes(scene.config(scene.effects))
    found = {}
    for kept in scene.models():
        other, cost = attitudes(scene.config([kind for kind in scene.effects if kind in kept]))
        half = np.minimum(np.linalg.norm(other - full, axis=1), np.linalg.norm(other + full, axis=1)) / 2
        found[kept] = Model(float(4 * np.arcsin(np.minimum(half, 1)).max()) * ARCSEC, cost)
    return found


@Command
def campaign(count: int = 30, seed: int = 1) -> int:
    """Count scenes whose named model is beyond the error, isn't the smallest, or isn't the cheapest."""
    wrong = smaller = cheaper = 0
    for number in range(count):
        chance = random.Random(f"{seed} {number}")
        scene = Scene.drawn(chance)
        models = all_models(scene)
        picked = chance.choice([m.error for m in models.values() if m.error > 0])
        error = min(float(f"{picked * scene.shift:.4g}"), _MOST)
        with tempfile.TemporaryDirectory() as folder:
            given = rigidsim.Experiment.from_dict(scene.config(scene.effects))
            plan = rigidsim.required_physics(given, f"{error} arcsec", out=folder)
        named = frozenset(row.code for row in plan.effects if row.required)
        within = {kept: model for kept, model in models.items() if model.error <= error}
        parts = [kept for kept in within if kept < named]
        share = max(1 - model.cost / models[named].cost for model in within.values())
        wrong, smaller = wrong + (named not in within), smaller + bool(parts)
        cheaper += share > 1 - _CHEAPER
        print(
            f"{number:3} {len(models):3} models; within {error:9.4g} arcsec {len(named)} of "
            f"{len(scene.effects)} effects, {models[named].error:.4g} arcsec"
            + (f"; {sorted(min(parts, key=len))} would do" if parts else "")
            + (f"; another costs {share:.1%} less" if share > 1 - _CHEAPER else ""),
            flush=True,
        )
    print(f"of {count} named models {wrong} are beyond the error, {smaller} aren't the smallest, ", end="")
    print(f"{cheaper} aren't the cheapest")
    return int(wrong > 0)
