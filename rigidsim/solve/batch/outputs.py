"""What is recorded of members' states: for many of them at once, by functions that are compiled once."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from rigidsim.model.outputs import Recorded
from rigidsim.model.tangents import GROWTH
from rigidsim.solve.batch.family import Numbers
from rigidsim.solve.batch.tracing import TracedSystem
from rigidsim.solve.compiled import compiled_function
from rigidsim.solve.engine import CompiledFunction

_GROUP = 64  # a multiple of every SIMD width: padded to it, a column's bits don't depend on its place

Values = dict[str, np.ndarray]


class BatchOutputs:
    """Recorded variables and drifts of a traced system.

    How a tangent vector grew has a function of its own, of states that the motion is without: beside it,
    code of the others would be compiled in another way.
    """

    def __init__(self, traced: TracedSystem) -> None:
        self._traced = traced
        self._system = traced.system
        self._growth = {r.first for r in self._system.recorded if r.name == GROWTH}

    def _compiled(self, expressions: list[Any], states: int) -> CompiledFunction:
        variables = [*self._system.variables[:states], *self._traced.parameters.variables]
        return compiled_function(expressions, variables, compact_mode=self._system.wide, fp_type=float)

    @cached_property
    def _parts(self) -> tuple[list[int], list[Any], list[Any]]:
        """Which of the outputs are of the motion, these, and the growth."""
        outputs = list(enumerate(self._system.outputs))
        of_motion = [(row, x) for row, x in outputs if row not in self._growth]
        growth = [x for row, x in outputs if row in self._growth]
        return [row for row, _ in of_motion], [x for _, x in of_motion], growth

    def begun(self, initial: np.ndarray, swept: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Initial values of the invariants' components, (components, m).

        Args:
            initial: (states of the motion, m).
        """
        components = [x for invariant in self._system.invariants for x in invariant.expressions]
        return self._evaluated(components, initial[None], swept, start[None])[:, 0]

    def at(
        self,
        states: np.ndarray,
        swept: np.ndarray,
        times: np.ndarray,
        begun: np.ndarray,
        along: np.ndarray | None = None,
    ) -> np.ndarray:
        """All outputs, (outputs, samples, m).

        Args:
            states: of the motion, (samples, states, m); times: (samples, m), internal units.
            along: the same with tangent vectors; where there are none, their growth isn't known.
        """
        rows, of_motion, growth = self._parts
        found = self._evaluated(of_motion, states, swept, times, begun)
        if not growth:
            return found
        table = np.full((len(self._system.outputs), *found.shape[1:]), np.nan)
        table[rows] = found
        if along is not None:
            table[sorted(self._growth)] = self._evaluated(growth, along, swept, times)
        return table

    def named(self, found: np.ndarray, numbers: Numbers, part: slice) -> tuple[Values, Values]:
        """Outputs at samples as recorded variables (samples, m, components), SI; drifts by invariants."""
        values: Values = {}
        for variable in self._system.recorded:
            columns = [
                _to_si(found[variable.first + k], numbers, variable.exponents[k], part)
                for k in range(variable.count)
            ]
            values[variable.name] = np.stack(columns, axis=2)
        first = len(self._system.outputs) - len(self._system.invariants)
        drifts = {
            f"{invariant.name}_drift": found[first + n] for n, invariant in enumerate(self._system.invariants)
        }
        self._join(values, numbers, part)
        return values, drifts

    def named_at_events(self, found: np.ndarray, numbers: Numbers, members: np.ndarray) -> Values:
        """Outputs at crossings, (outputs, 1, n), as recorded variables, (n, components), SI.

        Args:
            members: places of those that cross.
        """
        return {
            variable.name: _at_events(variable, found, numbers, members) for variable in self._system.recorded
        }

    def _join(self, values: Values, numbers: Numbers, part: slice) -> None:
        """Give each quaternion the sign nearest to the one before, as in a single run."""
        for variable in self._system.recorded:
            if variable.continuity != "nearest":
                continue
            block = values[variable.name]
            begin = [numbers.doubles(x)[part] for x in self._traced.system.scene.quaternion]
            before = np.concatenate([np.stack(begin, axis=1)[None], block[:-1]])
            products = np.einsum("smc,smc->sm", block, before)
            signs = np.cumprod(np.where(products < 0, -1.0, 1.0), axis=0)
            block *= signs[:, :, None]

    def _evaluated(
        self,
        expressions: list[Any],
        states: np.ndarray,
        swept: np.ndarray,
        times: np.ndarray,
        begun: np.ndarray | None = None,
    ) -> np.ndarray:
        """Values (expressions, samples, m).

        Args:
            states: (samples, states, m); times: (samples, m), internal units.
            begun: initial values of the invariants' components, (components, m).
        """
        samples, _, m = states.shape
        if not expressions:
            return np.empty((0, samples, m))
        function: Any = self._compiled(expressions, states.shape[1])
        columns = samples * m
        padded = -(-columns // _GROUP) * _GROUP

        def spread(table: np.ndarray) -> np.ndarray:
            """From (k, m) to (k, padded), the same for all samples."""
            return _padded(np.broadcast_to(table[:, None], (len(table), samples, m)), padded)

        inputs = np.concatenate([_padded(states.transpose(1, 0, 2), padded), spread(swept)])
        arguments = {}
        if function.is_time_dependent:
            arguments["time"] = _padded(times[None], padded)[0]
        if function.nparams and begun is not None:
            arguments["pars"] = spread(begun)
        found = np.asarray(function(np.ascontiguousarray(inputs), **arguments))
        return found[:, :columns].reshape(len(expressions), samples, m)


def _padded(table: np.ndarray, columns: int) -> np.ndarray:
    """From (k, samples, m) to (k, columns), the last column repeated."""
    if not len(table):
        return np.empty((0, columns))
    flat = table.reshape(len(table), -1)
    if flat.shape[1] == columns:
        return flat
    return np.concatenate([flat, np.repeat(flat[:, -1:], columns - flat.shape[1], axis=1)], axis=1)


def _to_si(values: np.ndarray, numbers: Numbers, exponent: Any, part: slice) -> np.ndarray:
    if isinstance(exponent, int):
        return np.ldexp(values, exponent) if exponent else values
    return np.ldexp(values, numbers.whole_numbers(exponent)[part])


def _at_events(variable: Recorded, at: np.ndarray, numbers: Numbers, chosen: np.ndarray) -> np.ndarray:
    columns = [
        np.ldexp(at[variable.first + k, 0], numbers.whole_numbers(variable.exponents[k])[chosen])
        for k in range(variable.count)
    ]
    return np.stack(columns, axis=1)
