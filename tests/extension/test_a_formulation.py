"""A formulation from outside the package: modified Rodrigues parameters, with their shadow set.

    sigma = q_v / (1 + q_w),    4 sigma' = (1 - |sigma|^2) w + 2 sigma x w + 2 sigma (sigma . w)

(Schaub & Junkins 1996, J. Astronaut. Sci. 44, 1), three states that are singular after a whole turn. Beyond
half a turn, |sigma| = 1, the run goes on in the shadow set -sigma / |sigma|^2, which is the same attitude.

Everything above the tests is what its author writes. The formulation and the effect that changes the set are
registered by one line each; choice, invariants, checkpoints and estimated errors come from rigidsim.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np
from support import angle_between, config, loaded, run_text, wide

import rigidsim
from rigidsim.model.formulations.formulation import Formulation, ModelPlan, formulates
from rigidsim.model.rotations import Symbolic, quaternion_matrix
from rigidsim.model.scaling import Rounder
from rigidsim.model.state_blocks import AttitudeStates
from rigidsim.model.system import System
from rigidsim.scene.choices import Variables
from rigidsim.solve.effects.effect import Effect, register_effect
from rigidsim.solve.precision import Precision
from rigidsim.solve.stepper import Stepper

SIGMA = ["s1", "s2", "s3"]


@formulates(Variables("rodrigues", "modified Rodrigues parameters, with their shadow set", regular=False))
class Rodrigues(Formulation):
    why = "three states without a singularity within half a turn"

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> AttitudeStates:
        sigma = list(hy.make_vars(*SIGMA))
        square, along = _dot(sigma, sigma), _dot(sigma, rates)
        (a, b, c), (p, q, r) = sigma, rates
        crossed = [b * r - c * q, c * p - a * r, a * q - b * p]
        derivatives = [
            0.25 * (1.0 - square) * w + 0.5 * (x + s * along)
            for s, w, x in zip(sigma, rates, crossed, strict=True)
        ]
        w, *v = plan.scene.quaternion
        start = [x / (1 + w) for x in v] if w >= 0 else [x / (w - 1) for x in v]
        inverse = 1.0 / (1.0 + square)
        quaternion = [(1.0 - square) * inverse, *(2.0 * s * inverse for s in sigma)]
        return AttitudeStates(SIGMA, derivatives, start, quaternion_matrix(quaternion), quaternion, "nearest")


def _dot(a: list[Symbolic], b: list[Symbolic]) -> Symbolic:
    return hy.sum([x * y for x, y in zip(a, b, strict=True)])


@register_effect("shadow set")
class ShadowSet(Effect):
    """Changes the set after each step that ends beyond half a turn."""

    rewrites = True
    limit = 1

    def __init__(self, system: System) -> None:
        self._places = [system.states.index(name) for name in SIGMA]
        self.changes = 0

    @classmethod
    def of(cls, system: System, precision: Precision) -> ShadowSet | None:
        return cls(system) if isinstance(system.formulation, Rodrigues) else None

    def due(self, stepper: Stepper, stride: int) -> bool:
        return bool(self._square(stepper.state) > 1)

    def apply(self, stepper: Stepper, stride: int) -> bool:
        square = self._square(stepper.state)
        for place in self._places:
            stepper.state[place] = -stepper.state[place] / square
        self.changes += 1
        return True

    def _square(self, state: np.ndarray) -> Any:
        a, b, c = (state[place] for place in self._places)
        return a * a + b * b + c * c

    @property
    def memory(self) -> int:
        return self.changes

    def back_to(self, memory: int, stepper: Stepper) -> None:
        self.changes = memory

    def pack(self, memory: int) -> dict[str, np.ndarray]:
        return {"shadow_changes": np.array([memory])}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> Any:
        return int(arrays["shadow_changes"][0])


# --- the tests ----------------------------------------------------------------------------------------------

TOP = {  # a heavy asymmetric body, which turns over again and again
    "body": "principal_moments = [1, 1.6, 2]\nmass = 1\ncenter_of_mass = [0.1, 0, 0.4]",
    "initial": "angular_velocity = [0.3, 1.0, 0.5]\neuler_angles = [0.2, 1.1, 0.7]",
    "loads": 'kind = "uniform_gravity"\nacceleration = [0, 0, -1]',
}


def text(
    formulation: str = "rodrigues", precision: str = "double", end: float = 30, samples: int = 121
) -> str:
    integrator = f'formulation = "{formulation}"\nprecision = "{precision}"'
    return config(**TOP, time=f"end = {end}\nsamples = {samples}", integrator=integrator)


def attitudes(*given: Any) -> np.ndarray:
    return wide(loaded(run_text(text(*given))), "quaternion")


def test_its_errors_are_announced_and_true(tmp_path: Path) -> None:
    """Held against more digits, and in variables of the package itself; past many changes of the set."""
    run = rigidsim.run(rigidsim.parse(text(), overrides=["output.estimate=true"]), out=tmp_path)
    assert (run.status, run.summary["formulation"]) == ("finished", "rodrigues")
    assert run.summary["states"] == ["wx", "wy", "wz", *SIGMA]
    data, accuracy = loaded(run), run.summary["accuracy"]
    exact = attitudes("quaternion", "extended")
    true = angle_between(data["quaternion"].values, exact).max()
    assert true <= accuracy["estimated_attitude_error"] <= 100 * true
    assert "a solution in quaternions" in accuracy["estimated_how"]
    assert "lacks the effects" not in accuracy["estimated_how"]
    w = data["quaternion"].values[:, 0]
    assert (np.diff(np.sign(w)) != 0).sum() >= 5  # half turns, where the set is changed
    assert {"energy", "angular_momentum_vertical"} <= set(run.summary["invariants"])
    for invariant in run.summary["invariants"].values():
        assert invariant["largest_drift"] < invariant["bound"]
    assert rigidsim.verify(run.folder.path).identical
