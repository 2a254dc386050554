"""Evaluation of what is recorded for many members at once, by functions compiled once."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.tangents import GROWTH
from rigidsim.solve.batch.family import Numbers
from rigidsim.solve.batch.tracing import TracedSystem
from rigidsim.solve.compiled import compiled_function, evaluate_rows

Values = dict[str, np.ndarray]


class BatchOutputs:
    """Recorded variables and drifts of a traced system.

    The growth of tangent vectors has a function of its own, of states that the motion alone lacks; together
    with it the code of the others would be compiled differently.
    """

    def __init__(self, traced: TracedSystem) -> None:
        self._traced = traced
        self._system = traced.system
        self._growth = {r.first for r in self._system.recorded if r.name == GROWTH}

    def _compiled(self, expressions: list[Any], states: int) -> tuple[Any, list[int]]:
        """A compiled function of states, and the indices of the states and parameters that it takes."""
        variables = [*self._system.variables[:states], *self._traced.parameters.variables]
        names = set(hy.get_variables([hy.expression(x) for x in expressions]))
        read = [n for n, variable in enumerate(variables) if str(variable) in names] or [0]
        taken = [variables[n] for n in read]
        wide = self._system.wide
        return compiled_function(expressions, taken, compact_mode=wide, fp_type=float), read

    @cached_property
    def _parts(self) -> tuple[list[int], list[Any], list[Any]]:
        """Rows and expressions of the outputs of the motion alone, and the growth's expressions."""
        outputs = list(enumerate(self._system.outputs))
        of_motion = [(row, x) for row, x in outputs if row not in self._growth]
        growth = [x for row, x in outputs if row in self._growth]
        return [row for row, _ in of_motion], [x for _, x in of_motion], growth

    @cached_property
    def _components(self) -> list[Any]:
        return [x for invariant in self._system.invariants for x in invariant.expressions]

    def compile(self) -> None:
        """Compile the functions that ``begun`` and ``at`` call."""
        _, of_motion, growth = self._parts
        for expressions in filter(None, (self._components, of_motion)):
            self._compiled(expressions, self._traced.moving)
        if growth:
            self._compiled(growth, len(self._system.states))

    def begun(self, initial: np.ndarray, swept: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Invariants' components at the start (components, m), for the motion's states (states, m)."""
        return self._evaluated(self._components, initial[None], swept, start[None])[:, 0]

    def at(
        self,
        states: np.ndarray,
        swept: np.ndarray,
        times: np.ndarray,
        begun: np.ndarray,
        along: np.ndarray | None = None,
    ) -> list[np.ndarray]:
        """All outputs, each (samples, m), of states (samples, states, m) and times (samples, m), internal
        units; ``along`` has tangent vectors, without which their growth is unknown.
        """
        rows, of_motion, growth = self._parts
        found = self._evaluated(of_motion, states, swept, times, begun)
        table = dict(zip(rows, found, strict=True))
        if growth:
            lost = np.full(times.shape, np.nan)
            grown = [lost] if along is None else self._evaluated(growth, along, swept, times)
            table |= dict(zip(sorted(self._growth), grown, strict=True))
        return [table[row] for row in range(len(table))]

    def named(self, found: Sequence[np.ndarray], numbers: Numbers, part: np.ndarray) -> tuple[Values, Values]:
        """Outputs, each (samples, m), as recorded variables (samples, m, components), SI, and drifts."""
        values = self._in_si(found, numbers, part)
        first = len(self._system.outputs) - len(self._system.invariants)
        drifts = {
            f"{invariant.name}_drift": found[first + n] for n, invariant in enumerate(self._system.invariants)
        }
        self._join(values, numbers, part)
        return values, drifts

    def named_at_events(self, found: Sequence[np.ndarray], numbers: Numbers, members: np.ndarray) -> Values:
        """Outputs at members' crossings, (1, n) each, as recorded variables (n, components), SI."""
        return {name: values[0] for name, values in self._in_si(found, numbers, members).items()}

    def _in_si(self, found: Sequence[np.ndarray], numbers: Numbers, members: np.ndarray) -> Values:
        values: Values = {}
        for variable in self._system.recorded:
            columns = [
                np.ldexp(found[variable.first + k], numbers.whole_numbers(exponent)[members])
                for k, exponent in enumerate(variable.exponents)
            ]
            values[variable.name] = np.stack(columns, axis=2)
        return values

    def _join(self, values: Values, numbers: Numbers, part: np.ndarray) -> None:
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
        """Values (expressions, samples, m) for states (samples, states, m) and times (samples, m)."""
        samples, count, m = states.shape
        if not expressions:
            return np.empty((0, samples, m))
        function, read = self._compiled(expressions, count)
        # parameters of members are inputs like their states
        every = (samples, m)
        rows = [states[:, n] if n < count else np.broadcast_to(swept[n - count], every) for n in read]
        inputs = np.stack(rows).reshape(len(rows), -1)
        constants = None
        if function.nparams and begun is not None:
            constants = np.repeat(begun[:, None], samples, axis=1).reshape(len(begun), -1)
        found = evaluate_rows(function, inputs.T, constants, times.ravel())
        return found.reshape(len(expressions), samples, m)
