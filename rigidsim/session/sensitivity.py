"""Sensitivities at a run's samples: derivatives of attitude, rates and position by keys of its config.

The run's own integrator knows nothing of them. A second one carries the motion with its tangents from sample
to sample, and is set on the run's own state every few steps, so that the derivatives belong to the motion
that is recorded however long that is. All depends on the samples' numbers and states alone: a resumed run
has the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np

from rigidsim.model.rotations import Symbolic
from rigidsim.model.state_blocks import BODY
from rigidsim.model.system import System
from rigidsim.solve.by_keys import KeyTangents, Rows, turned
from rigidsim.solve.checkpoint import Arrays, pack, unpack
from rigidsim.solve.compiled import CompiledFunction, compiled_function, evaluate_rows, interruptible
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.tangents import LostTangents, Place
from rigidsim.store.variables import Variable


class SettledStates:
    """Evaluates the states of one system at samples of another."""

    def __init__(self, functions: list[CompiledFunction], signs: list[int]) -> None:
        self._functions, self._signs = functions, signs

    @classmethod
    def of(cls, system: System, wanted: System, precision: Precision) -> SettledStates | None:
        """From a run's system to another of the same scene; None if it has states that don't follow."""
        functions = []
        for chart in (system, system.partner):
            if chart is None:
                continue
            expressions = _expressions(chart, wanted, precision)
            if expressions is None:
                return None
            options: dict[str, Any] = dict(precision.options, compact_mode=precision.compact or system.wide)
            functions.append(compiled_function(expressions, chart.variables, **options))
        return cls(functions, [wanted.states.index(name) for name in BODY.quaternion])

    def from_state(self, state: np.ndarray, time: Scalar, chart: int) -> np.ndarray:
        """States (states,) of a state in a chart, with the quaternion of either sign."""
        times = np.array([time], dtype=state.dtype)
        return np.array(evaluate_rows(self._functions[chart], state[None], times=times)[:, 0])

    def at(self, block: SampleBlock, row: int, near: np.ndarray) -> np.ndarray:
        """States of a sample (states,), with the quaternion's sign as in a state near it."""
        found = self.from_state(block.states[row], block.times[row], int(block.chart[row]))
        if (found[self._signs] * near[self._signs]).sum() < 0:
            found[self._signs] = -found[self._signs]
        return found


def _expressions(system: System, wanted: System, precision: Precision) -> list[Symbolic] | None:
    m, context = system.mechanics, system.scene.context
    exponents = dict(zip(wanted.states, wanted.state_exponents, strict=True))
    own = dict(zip(system.states, zip(system.variables, system.state_exponents, strict=True), strict=True))
    same = system.formulation.name == wanted.formulation.name
    if m.attitude is None or (m.rate_correction is not None and not same):
        return None
    given: dict[str, tuple[Symbolic, int]] = {}
    if not same:
        given |= {n: (x, -system.scaling.time) for n, x in zip(BODY.rates, m.rates, strict=True)}
        given |= {n: (x, 0) for n, x in zip(BODY.quaternion, m.attitude.quaternion, strict=True)}
    found = []
    for name in wanted.states:
        expression, exponent = given.get(name) or own.get(name, (None, 0))
        if expression is None:
            return None
        shift = exponent - exponents[name]
        factor = precision.number(context.ldexp(context.one, shift))
        found.append(expression * factor if shift else expression)
    return found


# --- derivatives --------------------------------------------------------------------------------------------


_SET_AFTER = 8  # steps of the second integrator, after which it is set on the run's state at a sample

NAMES = {
    "attitude_sensitivity": ("space_axis", "rad", "attitude, as a rotation vector", "space axes"),
    "angular_velocity_sensitivity": ("body_axis", "rad s-1", "angular velocity", "body axes"),
    "position_sensitivity": ("space_axis", "m", "position", "space axes"),
    "rigid_body_attitude_sensitivity": (
        "space_axis",
        "rad",
        "second body's attitude, likewise",
        "space axes",
    ),
}
"""Dimension besides the parameter's, unit for one SI unit of a key, what is differentiated, and its frame."""

Columns = dict[str, list[np.ndarray]]


def sensitivity_variables(prepared: InitialValueProblem) -> list[Variable]:
    """What is recorded of sensitivities; empty if none are asked for."""
    if not prepared.sensitivity_keys:
        return []
    keys, parts = prepared.parametrised.keys, prepared.precision.part_count
    labels = {"parameter": [key.name for key in keys]}
    found = []
    for name, (axes, unit, what, frame) in NAMES.items():
        if name not in _names(prepared):
            continue
        attributes = {
            "units": unit,
            "long_name": f"partial derivative of the {what}",
            "frame": frame,
            "convention": "per SI unit of each parameter, a key of the config; parameter_units names these",
            "parameter_units": ", ".join(key.unit for key in keys),
        }
        found.append(Variable(name, ("parameter", axes), attributes, parts, labels))
    return found


def _names(prepared: InitialValueProblem) -> list[str]:
    """Which of ``NAMES`` a motion has; the position is the second body's where the first has none."""
    without = set() if prepared.system.flown else {"position_sensitivity"}
    without |= set() if prepared.scene.config.rigid_bodies else {"rigid_body_attitude_sensitivity"}
    return [name for name in NAMES if name not in without]


class Sensitivity:
    """The second integrator of a run, as a part of its checkpoints."""

    version: ClassVar[int] = 1

    def __init__(self, prepared: InitialValueProblem) -> None:
        self._precision = prepared.precision
        self._engine = interruptible(lambda: KeyTangents(prepared.parametrised, prepared.precision))
        self._tangents = self._engine.tangents
        self._names = _names(prepared)
        self._settled = SettledStates.of(prepared.system, self._engine.system, prepared.precision)
        shift = prepared.system.scaling.time - self._engine.system.scaling.time
        self._unit = prepared.precision.of_double(2.0**shift)
        self._lost = False
        self.go_on: Callable[[], bool] = lambda: True

    @property
    def place(self) -> tuple[Place, bool]:
        """Where it is, to go back to."""
        return self._tangents.place, self._lost

    def back_to(self, place: tuple[Place, bool]) -> None:
        """Return to where it was."""
        self._lost = place[1]
        self._tangents.begin(place[0])

    def take(self, block: SampleBlock) -> Columns:
        """Columns of the variables for samples that follow those before; NaN once the tangents are lost.

        Raises:
            KeyboardInterrupt: ``go_on`` says no; it is then where it was before.
        """
        before = self.place
        samples: list[Any] = []
        times = block.times.astype(self._precision.scalar) * self._unit
        try:
            for row in range(len(block) if not self._lost else 0):
                samples.append(self._engine.sample(times[row], self.go_on))
                if self._tangents.steps >= _SET_AFTER and self._settled is not None:
                    self._tangents.set(times[row], self._settled.at(block, row, samples[-1][0]))
        except LostTangents:
            self._lost = True
        except KeyboardInterrupt:
            self.back_to(before)
            raise
        rows = self._engine.of(times[: len(samples)], samples) if samples else None
        return self._columns(rows, len(block))

    def _columns(self, rows: Rows | None, count: int) -> Columns:
        found = {}
        if rows is not None:
            found["angular_velocity_sensitivity"] = rows.slopes["angular_velocity"]
            for prefix in ("", "rigid_body_"):
                if (place := rows.slopes.get(f"{prefix}position")) is not None:
                    found["position_sensitivity"] = place
                if (q := rows.values.get(f"{prefix}quaternion")) is not None:
                    found[f"{prefix}attitude_sensitivity"] = turned(q, rows.slopes[f"{prefix}quaternion"])
        columns: Columns = {}
        for name in self._names:
            shape, more = (count, 3 * self._engine.keys), self._precision.part_count - 1
            columns[name] = [np.full(shape, np.nan), *(np.zeros(shape) for _ in range(more))]
            parts = self._precision.parts(found[name].reshape(-1)) if found else []
            for whole, part in zip(columns[name], parts, strict=False):
                whole.reshape(-1)[: len(part)] = part
        return columns

    def pack(self) -> Arrays:
        """See ``rigidsim.solve.checkpoint.SavedPart``."""
        place, precision = self._tangents.place, self._precision
        arrays = pack(np.array(place.time, dtype=precision.scalar), precision, "tangent_time")
        arrays |= pack(place.state, precision, "tangent_state")
        arrays["tangent_exponents"] = place.exponents
        arrays["tangent_counts"] = np.array([place.steps, self._lost], dtype=np.int64)
        return arrays

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See ``rigidsim.solve.checkpoint.SavedPart``."""
        time, state = (unpack(arrays, self._precision, name) for name in ("tangent_time", "tangent_state"))
        here = self._tangents.place
        exponents = np.asarray(arrays["tangent_exponents"])
        if time.shape != (2,) or state.shape != here.state.shape or exponents.shape != here.exponents.shape:
            raise ValueError("its tangents belong to other equations")
        steps, lost = (int(n) for n in arrays["tangent_counts"])
        self.back_to((Place((time[0], time[1]), state, exponents.astype(np.int64), steps), bool(lost)))
