"""From states at sample times to the recorded variables, compiled and in the run's own precision."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from typing import Any

import heyoka as hy
import mpmath
import numpy as np

from rigidsim.model.recording import Recorded
from rigidsim.model.system import System
from rigidsim.solve.charts import Lift, angles_before
from rigidsim.solve.precision import Precision
from rigidsim.solve.winding import CHART, TURNS, Winding

_GROUP = 64  # rows; a multiple of every SIMD width


class _Away:
    """Recorded variables of samples in the partner chart."""

    def __init__(self, system: System, compiled: Any, rowwise: Any, precision: Precision) -> None:
        partner = system.partner
        assert partner is not None
        self._precision, self._rowwise = precision, rowwise
        self._lift = Lift(system.sequence, precision)
        self._positions = list(system.angle_states)
        found = [r.first for r in partner.recorded if r.continuity == "winding"]
        self._angles = slice(found[0], found[0] + 3) if found else None
        self._outputs = compiled(partner.outputs)
        self._singular = compiled([partner.singular_factor])

    def factors(self, states: np.ndarray) -> np.ndarray:
        """Singular factors of the partner chart."""
        return np.asarray(self._rowwise(self._singular, states)[0])

    def values(
        self, states: np.ndarray, turns: np.ndarray, initial: np.ndarray, winding: Winding
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """All outputs (outputs, n), and the recorded Euler angles of the asked sequence (n, 3), if any.

        Args:
            initial: invariants' components.
        """
        if self._angles is None:
            return self._rowwise(self._outputs, states, initial if len(initial) else None), None
        plain = states[:, self._positions].astype(np.float64)
        lifted = [self._lift(angles_before(t), tuple(a)) for t, a in zip(turns, plain.tolist(), strict=True)]
        near = np.array([angles for angles, *_ in lifted])
        either = {x: self._precision.number(mpmath.mpf(x)) for x in (1.0, -1.0)}
        branches = np.array(
            [either[self._lift.branch(angles[1])] for angles, *_ in lifted], dtype=self._precision.scalar
        )
        constants = np.concatenate([np.repeat(initial[:, None], len(states), axis=1), [branches]])
        values = np.asarray(self._rowwise(self._outputs, states, constants))
        angles = values[self._angles].T
        full = np.rint((near - angles.astype(np.float64)) / (2 * np.pi))
        angles = winding.unwrapped(angles, full)
        for row, (_, side, _) in enumerate(lifted):
            if side:  # in the singularity the first angle is kept, and the sum (difference) is the state's
                moved = self._precision.number(mpmath.mpf(near[row, 0])) - angles[row, 0]
                angles[row, 0] = angles[row, 0] + moved
                angles[row, 2] = angles[row, 2] - side * moved
        return values, angles


@dataclass
class Memory:
    """What joins a block of samples to the one before (part of a checkpoint).

    Attributes:
        turns: of derived Euler angles, shape (3,), and the last raw angles.
        last_angles, last_quaternion: float64 copies; None before the first block.
    """

    turns: np.ndarray = field(default_factory=lambda: np.zeros(3, dtype=np.int64))
    last_angles: np.ndarray | None = None
    last_quaternion: np.ndarray | None = None


class Evaluator:
    """Evaluates a system's outputs on blocks of states.

    Attributes:
        initial: initial values of the invariants' components, in internal units.
        memory: see ``Memory``.
    """

    def __init__(self, system: System, precision: Precision, winding: Winding) -> None:
        self._system = system
        self._precision = precision
        self._winding = winding
        self.memory = Memory()
        self._outputs = self._compile(system.outputs) if system.outputs else None
        components = [x for invariant in system.invariants for x in invariant.expressions]
        self._invariants = self._compile(components)
        initial = precision.array(system.initial)
        self.initial = self._rowwise(self._invariants, initial[None, :])[:, 0] if components else initial[:0]
        self._parameters = len(components)
        self._away: _Away | None = None
        factor = system.singular_factor
        self._singular = None if factor is None else self._compile([factor])

    def singular_factors(self, states: np.ndarray, turns: np.ndarray) -> np.ndarray | None:
        """What vanishes in the singularity of the chart in use; None without one.

        Args:
            states, turns: as of ``evaluate``.
        """
        if self._singular is None:
            return None
        factors = self._rowwise(self._singular, states)[0]
        partner = self._in_partner(turns)
        if partner.any():
            factors[partner] = self._partner.factors(states[partner])
        return factors

    @property
    def _partner(self) -> _Away:
        """For samples in the partner chart; compiled when there are any."""
        if self._away is None:
            self._away = _Away(self._system, self._compile, self._rowwise, self._precision)
        return self._away

    @staticmethod
    def _in_partner(turns: np.ndarray) -> np.ndarray:
        if turns.shape[1] <= CHART:
            return np.zeros(len(turns), dtype=bool)
        return np.asarray(turns[:, CHART] != 0, dtype=bool)

    @staticmethod
    def _rowwise(function: Any, states: np.ndarray, constants: np.ndarray | None = None) -> np.ndarray:
        """Evaluate at each row of states (n, states), with constants for all (k,) or for each (k, n); returns
        (outputs, n).

        heyoka takes rows several at a time and the rest one by one, which differs in the last bit. Rows
        are padded to whole groups, so that a row's bits don't depend on the block that it came in.
        """
        count = len(states)
        padded = -(-count // _GROUP) * _GROUP
        if padded > count:
            states = np.concatenate([states, np.repeat(states[-1:], padded - count, axis=0)])
        # compiled code for expressions without parameters refuses an array of them
        arguments = {}
        if constants is not None:
            table = np.repeat(constants[:, None], padded, axis=1) if constants.ndim == 1 else constants
            if table.shape[1] < padded:
                table = np.concatenate([table, np.repeat(table[:, -1:], padded - count, axis=1)], axis=1)
            arguments = {"pars": np.ascontiguousarray(table)}
        return np.asarray(function(np.ascontiguousarray(states.T), **arguments))[:, :count]

    def _compile(self, expressions: list[Any]) -> Any:
        return hy.cfunc(
            expressions,
            self._system.variables,
            compact_mode=self._precision.compact or self._system.wide,
            **self._precision.options,
        )

    def evaluate(self, states: np.ndarray, turns: np.ndarray) -> dict[str, list[np.ndarray]]:
        """All variables of a block.

        Args:
            states: (n, states), internal units, angles wrapped.
            turns: (n, ...) full turns of the angle states, and their chart (see ``Winding``).

        Returns:
            For each recorded variable float64 parts of shape (n, components) in SI (see
            ``Precision.parts``), and for each invariant its drift, (n, 1), one part.
        """
        assert self._outputs is not None
        values = self._rowwise(self._outputs, states, self.initial if self._parameters else None)
        partner = self._in_partner(turns)
        angles: np.ndarray | None = None
        if partner.any():
            there, angles = self._partner.values(states[partner], turns[partner], self.initial, self._winding)
            values[:, partner] = there
        turns = turns[:, TURNS]
        result: dict[str, list[np.ndarray]] = {}
        for variable in self._system.recorded:
            block = values[variable.first : variable.first + variable.count].T
            block = self._joined(variable, block, turns)
            if angles is not None and variable.continuity == "winding":
                block[partner] = angles
            parts = self._precision.parts(block)
            exponents = np.array(variable.exponents, dtype=np.int32)
            if exponents.any():
                parts = [np.ldexp(part, exponents) for part in parts]
            result[variable.name] = parts
        first = len(self._system.outputs) - len(self._system.invariants)
        for n, invariant in enumerate(self._system.invariants):
            drift = values[first + n].astype(np.float64)
            result[f"{invariant.name}_drift"] = [drift[:, None]]
        return result

    def evaluate_apart(self, states: np.ndarray, turns: np.ndarray) -> dict[str, list[np.ndarray]]:
        """As ``evaluate``, for states that aren't among the samples: nothing is joined to them later."""
        memory = copy.deepcopy(self.memory)
        try:
            return self.evaluate(states, turns)
        finally:
            self.memory = memory

    def _joined(self, variable: Recorded, block: np.ndarray, turns: np.ndarray) -> np.ndarray:
        if variable.continuity == "winding":
            return self._winding.unwrapped(block, turns)
        if variable.continuity == "parity":
            odd = turns.sum(axis=1) % 2 == 1
            block = block.copy()
            block[odd] = -block[odd]
            return block
        if variable.continuity == "nearest":
            return self._nearest(block)
        if variable.continuity == "unwrap":
            return self._unwrapped(block)
        return block

    def _nearest(self, block: np.ndarray) -> np.ndarray:
        """Give each quaternion the sign nearest to the one before."""
        plain = block.astype(np.float64)
        before = self.memory.last_quaternion
        if before is None:
            before = np.array([float(x) for x in self._system.scene.quaternion])
        products = np.einsum("ij,ij->i", plain, np.vstack([before, plain[:-1]]))
        signs = np.cumprod(np.where(products < 0, -1, 1))
        block = block.copy()
        block[signs < 0] = -block[signs < 0]
        self.memory.last_quaternion = plain[-1] * signs[-1]
        return block

    def _unwrapped(self, block: np.ndarray) -> np.ndarray:
        """Add the full turns that make each angle nearest to the sample before."""
        plain = block.astype(np.float64)
        before = plain[0] if self.memory.last_angles is None else self.memory.last_angles
        jumps = np.diff(np.vstack([before, plain]), axis=0)
        turns = self.memory.turns - np.cumsum(np.rint(jumps / (2 * np.pi)), axis=0).astype(np.int64)
        self.memory.turns, self.memory.last_angles = turns[-1], plain[-1]
        return self._winding.unwrapped(block, turns)

    def initial_invariants(self) -> dict[str, list[float]]:
        """Initial values of the invariants' components in SI, nearest doubles, by name."""
        values = {}
        first = 0
        for invariant in self._system.invariants:
            block = self.initial[first : first + len(invariant.expressions)]
            first += len(invariant.expressions)
            lead = self._precision.parts(block)[0]
            values[invariant.name] = [float(x) for x in np.ldexp(lead, invariant.exponents)]
        return values
