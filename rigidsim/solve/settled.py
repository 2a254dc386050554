"""A run's states, whatever they are, as rates and quaternion of the same motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from rigidsim.model.rotations import Symbolic
from rigidsim.model.state_blocks import BODY
from rigidsim.model.system import System
from rigidsim.solve.compiled import CompiledFunction, compiled_function, evaluate_rows
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.sample_block import SampleBlock


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
