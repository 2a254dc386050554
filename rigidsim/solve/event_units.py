"""Units in which events' expressions are of order one, as the states are.

heyoka's control of the step is relative to the largest of the states and of the expressions of events. An
event such as ``t - 7e7``, or a height of thousands of kilometres, would loosen it by as much: the motion
would lose those digits. So the engine is given such an expression times a power of two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.compiled import compiled_function

STATES = 64
TIMES = (0.0, 0.25, 0.5, 0.75, 1.0)  # as fractions of the run
_WORTH_A_UNIT = 1  # bits above one; a smaller excess loosens nothing


def of_order_one(
    system: System, expressions: Sequence[hy.expression], meant: Sequence[hy.expression]
) -> list[hy.expression]:
    """Expressions scaled for the engine by powers of two; their zeros are unchanged.

    Args:
        expressions: expressions of the states, the time and parameters.
        meant: the same without the small offsets that keep them off a zero.
    """
    if not expressions:
        return []
    return [
        expression if not bits else expression * 2.0**-bits
        for expression, bits in zip(expressions, _bits(system, meant), strict=True)
    ]


def _bits(system: System, expressions: Sequence[hy.expression]) -> list[int]:
    """Binary exponents, at least 0, of the largest values over the run's time and states of order one."""
    scene, scaling = system.scene, system.scaling
    start, end = (math.ldexp(float(t), -scaling.time) for t in (scene.start, scene.samples.last))
    random = np.random.default_rng(0)
    states = random.uniform(-1.0, 1.0, (STATES, len(system.states)))
    states[0] = [float(x) for x in system.initial]
    compiled: Any = compiled_function(expressions, system.variables, compact_mode=True)
    parameters = random.uniform(-1.0, 1.0, (STATES, compiled.nparams))
    sides = len(system.surfaces)
    parameters[:, sides : sides + len(system.turning)] *= end - start  # full turns, for rates of order one
    if system.clocked:
        parameters[:, system.parameters - 1 :] = 0.0  # a part of the time far below its last digit
    largest = np.zeros(len(expressions))
    for part in TIMES:
        values = _evaluated(compiled, states, parameters, start + part * (end - start))
        largest = np.fmax(largest, np.where(np.isfinite(values), np.abs(values), 0.0).max(axis=1))
    return [int(bits) for bits in exponents_of(largest)]


def exponents_of(largest: np.ndarray) -> np.ndarray:
    """Binary exponents of the units for given largest values."""
    exponents = np.frexp(largest)[1]
    return np.where(exponents > _WORTH_A_UNIT, exponents, 0)


def _evaluated(compiled: Any, states: np.ndarray, parameters: np.ndarray, time: float) -> np.ndarray:
    """Values of shape (expressions, states)."""
    inputs = np.ascontiguousarray(states.T)
    options = {"pars": np.ascontiguousarray(parameters.T)} if compiled.nparams else {}
    if compiled.is_time_dependent:
        options["time"] = np.full(len(states), time)
    with np.errstate(all="ignore"):
        return np.asarray(compiled(inputs, **options))
