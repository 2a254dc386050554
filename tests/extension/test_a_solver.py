"""A solver from outside the package: fixed steps of the classical Runge-Kutta method, on numpy.

Everything above the tests is what its author writes. It is registered by one line, and gets samples, effects,
checkpoints and the summary from rigidsim.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import angle_between, config, loaded, run_text

import rigidsim
from rigidsim.model.system import System
from rigidsim.scene.choices import Method
from rigidsim.scene.scene import Scene
from rigidsim.solve.compiled import compiled_function
from rigidsim.solve.events import EventLog
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.solvers.algorithm import Algorithm, Unsuitable, solves
from rigidsim.solve.stepper import Mark, OwnErrors, Stepper

ORDER = 4


@solves(Method("runge_kutta", "Runge-Kutta", "the classical method of fourth order, in fixed steps"))
class RungeKutta(Algorithm):
    title = "classical Runge-Kutta, fixed steps, quintic dense output"

    @classmethod
    def of(cls, scene: Scene, system: System, *, driven: bool) -> RungeKutta:
        if scene.config.integrator.precision != "double":
            raise Unsuitable('which computes in double precision; set precision = "double"')
        if system.formulation.name != "quaternion":
            raise Unsuitable('which tells its errors for quaternions; set formulation = "quaternion"')
        return cls()

    def stepper(
        self, system: System, precision: Precision, tolerance: Scalar | None, start: Scalar, log: EventLog
    ) -> Stepper:
        return FixedSteps(system, precision, float(tolerance or precision.epsilon), float(start))


class FixedSteps(Stepper):
    """Pairs of half steps; a whole step beside each pair tells its error (Richardson)."""

    def __init__(self, system: System, precision: Precision, tolerance: float, start: float) -> None:
        super().__init__(system, precision)
        right = [side for _, side in system.equations]
        self._rates = compiled_function(right, system.variables, **precision.options)
        self._size = 2.0 ** math.floor(math.log2(tolerance) / ORDER)
        self._time, self._state = start, precision.array(system.initial)
        self._units = np.ldexp(1.0, np.array(system.state_exponents))
        self._seconds = 2.0**system.scaling.time
        self._turning = [system.states.index(name) for name in ("wx", "wy", "wz")]
        self._attitude = [system.states.index(name) for name in ("qw", "qx", "qy", "qz")]
        self._sums = np.zeros(3)  # errors of the attitude, of the rates, and those times their moments

    @property
    def time(self) -> float:
        return self._time

    @property
    def state(self) -> np.ndarray:
        return self._state

    def step(self) -> bool:
        time, begin, size = self._time, self._state.copy(), self._size
        if self.until is not None:
            size = min(size, float(self.until) - time)
        half = size / 2
        whole = self._stepped(time, begin, size)
        middle = self._stepped(time, begin, half)
        end = self._stepped(time + half, middle, half)
        if not np.isfinite(end).all():
            return False
        values = np.array([begin, middle, end])
        slopes = np.array([self._rates(y, time=time + n * half) for n, y in enumerate(values)])
        self._piece = time, size, values, slopes
        self._time, self._state = time + size, end
        self.steps += 1
        self.smallest = self.largest = size
        self._count((end - whole) * self._units / (2**ORDER - 1))
        return True

    def _stepped(self, time: float, state: np.ndarray, size: float) -> np.ndarray:
        a = self._rates(state, time=time)
        b = self._rates(state + size / 2 * a, time=time + size / 2)
        c = self._rates(state + size / 2 * b, time=time + size / 2)
        d = self._rates(state + size * c, time=time + size)
        return np.asarray(state + size / 6 * (a + 2 * b + 2 * c + d))

    def dense(self, time: Scalar) -> np.ndarray:
        """The quintic with the values and slopes of both half steps."""
        begin, size, values, slopes = self._piece
        s = (float(time) - begin) / size
        nodes = np.array([0.0, 0.5, 1.0])
        squares = np.array([2 * (s - 0.5) * (s - 1), -4 * s * (s - 1), 2 * s * (s - 0.5)]) ** 2
        inclined = np.array([-3.0, 0.0, 3.0])  # of the square roots of these at their own nodes
        weights = (1 - 2 * inclined * (s - nodes)) * squares
        return np.asarray(weights @ values + size * ((s - nodes) * squares) @ slopes)

    def _count(self, error: np.ndarray) -> None:
        rates = float(np.linalg.norm(error[self._turning]))
        attitude = 2 * float(np.linalg.norm(error[self._attitude]))
        self._sums = self._sums + np.array([attitude, rates, rates * self._time * self._seconds])

    def errors(self) -> OwnErrors:
        """Sums of the errors of all steps; one of the rates moves the attitude as long as it lasts, and where
        the motion is stable by no more than that.
        """
        attitude, rates, moments = self._sums
        attitude += rates * self._time * self._seconds - moments
        spin = float(np.linalg.norm((self._state * self._units)[self._turning]))
        how = "errors of all steps, by steps of half the size, as they add up in a stable motion"
        return OwnErrors(attitude, rates / spin, how)

    def mark(self) -> Mark:
        return replace(super().mark(), memory=self._sums)

    def back_to(self, mark: Mark) -> None:
        self._time, self._state, self._sums = float(mark.time[0]), mark.state.copy(), mark.memory
        self.steps = mark.steps

    def pack(self, memory: Any) -> dict[str, np.ndarray]:
        return {"runge_kutta_errors": memory}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> Any:
        return arrays["runge_kutta_errors"]


# --- the tests ----------------------------------------------------------------------------------------------


def text(tolerance: float = 1e-8, method: str = "runge_kutta", **tables: str) -> str:
    tables = {"time": "end = 40\nsamples = 161"} | tables
    integrator = f'method = "{method}"\nformulation = "quaternion"\ntolerance = {tolerance}'
    return config(**tables, integrator=integrator, estimate=True)


def exact_attitudes() -> np.ndarray:
    return loaded(run_text(text(1e-16, "taylor")))["quaternion"].values


@pytest.mark.slow
def test_it_records_a_dataset_with_true_errors_of_its_own(tmp_path: Path) -> None:
    run = rigidsim.run(rigidsim.parse(text()), out=tmp_path)
    assert run.status == "finished"
    data = loaded(run)
    assert (data.attrs["method"], data.attrs["integrator"]) == ("runge_kutta", RungeKutta.title)
    assert "taylor_order" not in data.attrs
    true = angle_between(data["quaternion"].values, exact_attitudes()).max()
    accuracy = run.summary["accuracy"]
    assert true <= accuracy["estimated_attitude_error"] <= 100 * true
    assert "steps of half the size" in accuracy["estimated_how"]
    assert rigidsim.verify(run.folder.path).identical
