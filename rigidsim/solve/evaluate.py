"""Evaluation of recorded variables from states at sample times, compiled and in the run's own precision."""

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import ClassVar

import heyoka as hy
import mpmath
import numpy as np

from rigidsim.model.system import Recorded, System
from rigidsim.solve.checkpoint import Arrays
from rigidsim.solve.compiled import CompiledFunction, compiled_function, evaluate_rows, interruptible
from rigidsim.solve.effects.angle_wrapping import AngleWrapping
from rigidsim.solve.effects.charts import AngleContinuation
from rigidsim.solve.precision import Precision
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.turns import Continuity, JoinedAngles

RecordedParts = dict[str, list[np.ndarray]]
"""Float64 parts (n, components) by variable, whose sum is the value in SI (``Precision.parts``)."""


class _PartnerChart:
    """Recorded variables of samples whose states are in the partner sequence."""

    def __init__(
        self,
        system: System,
        compiled: Callable[[list[hy.expression]], CompiledFunction],
        precision: Precision,
    ) -> None:
        partner = system.partner
        assert partner is not None
        self._precision = precision
        self._lift = AngleContinuation(system.sequence, precision)
        self._positions = list(system.angle_states)
        found = [r.first for r in partner.recorded if r.continuity == "wrapped"]
        self._angles = slice(found[0], found[0] + 3) if found else None
        self._outputs = compiled(partner.outputs)
        self.singular = compiled([partner.singular_factor])

    def values(
        self, block: SampleBlock, initial: np.ndarray, wrapping: AngleWrapping
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """All outputs (outputs, n), and the recorded angles of the requested sequence (n, 3), if any."""
        states, times = block.states, block.times
        if self._angles is None:
            return evaluate_rows(self._outputs, states, initial if len(initial) else None, times), None
        plain = states[:, self._positions].astype(np.float64)
        lifted = [
            self._lift(before, tuple(angles))
            for before, angles in zip(block.reference.tolist(), plain.tolist(), strict=True)
        ]
        near = np.array([angles for angles, *_ in lifted])
        either = {x: self._precision.number(mpmath.mpf(x)) for x in (1.0, -1.0)}
        branches = np.array(
            [either[self._lift.branch(angles[1])] for angles, *_ in lifted], dtype=self._precision.scalar
        )
        constants = np.concatenate([np.repeat(initial[:, None], len(states), axis=1), [branches]])
        values = evaluate_rows(self._outputs, states, constants, times)
        angles = values[self._angles].T
        full = np.rint((near - angles.astype(np.float64)) / (2 * np.pi))
        angles = wrapping.unwrapped(angles, full)
        for row, (_, side, _) in enumerate(lifted):
            if side:  # in the singularity the first angle is kept, and the sum (difference) is the state's
                moved = self._precision.number(mpmath.mpf(near[row, 0])) - angles[row, 0]
                angles[row, 0] = angles[row, 0] + moved
                angles[row, 2] = angles[row, 2] - side * moved
        return values, angles


class Evaluator:
    """Evaluates a system's outputs on blocks of states.

    Attributes:
        angles: follows the angles that are joined from sample to sample, before they are evaluated here.
        last_quaternion: what the next sample's is joined to; None before the first.
    """

    version: ClassVar[int] = 2

    def __init__(
        self, system: System, precision: Precision, wrapping: AngleWrapping, *, has_steps: bool = True
    ) -> None:
        self._system = system
        self._precision = precision
        self._wrapping = wrapping
        components = [x for invariant in system.invariants for x in invariant.expressions]
        self._parameters = len(components)
        self.code = self._compile([*system.outputs, *components] or system.variables[:1])
        initial, start = precision.array(system.initial), precision.array([system.start])
        none = precision.of_doubles(np.zeros(len(components))) if components else None
        begun = evaluate_rows(self.code, initial[None, :], none, start)
        self.initial = begun[len(system.outputs) :, 0] if components else initial[:0]
        self.angles = JoinedAngles(system, self._compile, precision, has_steps=has_steps)
        self.last_quaternion: np.ndarray | None = None
        self._recorded = [
            (one, np.array(one.exponents, dtype=np.int32) if any(one.exponents) else None)
            for one in system.recorded
        ]
        self._first_quaternion = [float(x) for x in system.scene.quaternion]
        factor = system.singular_factor
        self._singular = None if factor is None else self._compile([factor])

    def singular_factors(self, states: np.ndarray, chart: np.ndarray) -> np.ndarray | None:
        """Factors that vanish in the singularity of the chart in use, (n,); None without one."""
        if self._singular is None:
            return None
        values, there = evaluate_rows(self._singular, states), chart != 0
        if there.any():
            values[:, there] = evaluate_rows(self._partner.singular, states[there])
        return values[0]

    @cached_property
    def _partner(self) -> _PartnerChart:
        """The partner chart's evaluation, compiled once samples in that chart occur."""
        return interruptible(lambda: _PartnerChart(self._system, self._compile, self._precision))

    def _compile(self, expressions: list[hy.expression]) -> CompiledFunction:
        return compiled_function(
            expressions,
            self._system.variables,
            compact_mode=self._precision.compact or self._system.wide,
            **self._precision.options,
        )

    def evaluate(self, block: SampleBlock) -> RecordedParts:
        """All variables of a block with its joined angles, which must follow the one before, and each
        invariant's drift, (n, 1).
        """
        initial = self.initial if self._parameters else None
        values = evaluate_rows(self.code, block.states, initial, block.times)[: len(self._system.outputs)]
        in_partner = block.chart != 0
        angles: np.ndarray | None = None
        if self._system.partner is not None and in_partner.any():
            there, angles = self._partner.values(block.only(in_partner, 0), self.initial, self._wrapping)
            values[:, in_partner] = there
        result: RecordedParts = {}
        turned = self._turned(values, block) if self.angles else None
        for variable, exponents in self._recorded:
            columns = values[variable.first : variable.first + variable.count].T
            if turned is not None and (part := self.angles.part(variable)) is not None:
                columns = turned[:, part]
            columns = self._joined(variable, columns, block)
            if angles is not None and variable.continuity == "wrapped":
                columns[in_partner] = angles
            parts = self._precision.parts(columns)
            if exponents is not None:
                parts = [np.ldexp(part, exponents) for part in parts]
            result[variable.name] = parts
        first = len(self._system.outputs) - len(self._system.invariants)
        for n, invariant in enumerate(self._system.invariants):
            drift = values[first + n].astype(np.float64)
            result[f"{invariant.name}_drift"] = [drift[:, None]]
        return result

    def evaluate_apart(self, block: SampleBlock) -> RecordedParts:
        """All variables at states that aren't among the samples.

        Nothing is joined to them later, and angles that aren't states are within one turn, since the motion
        between two of them isn't known.
        """
        before = self.last_quaternion
        try:
            return self.evaluate(self.angles.apart(block))
        finally:
            self.last_quaternion = before

    def _joined(self, variable: Recorded, block: np.ndarray, samples: SampleBlock) -> np.ndarray:
        turns = samples.turns
        if variable.continuity == "wrapped":
            return self._wrapping.unwrapped(block, turns)
        if variable.continuity == "parity":
            odd = turns.sum(axis=1) % 2 == 1
            block = block.copy()
            block[odd] = -block[odd]
            return block
        if variable.continuity == "nearest":
            return self._nearest(block)
        return block

    def _turned(self, values: np.ndarray, block: SampleBlock) -> np.ndarray:
        """The joined angles with their turns, (n, angles)."""
        return self._wrapping.unwrapped(*self.angles.recorded(values[self.angles.columns].T, block))

    def _nearest(self, block: np.ndarray) -> np.ndarray:
        """Give each quaternion the sign nearest to the one before."""
        plain = block.astype(np.float64)
        before = self.last_quaternion
        shifted = np.empty_like(plain)
        shifted[0] = self._first_quaternion if before is None else before
        shifted[1:] = plain[:-1]
        products = np.einsum("ij,ij->i", plain, shifted)
        if not (products < 0).any():
            self.last_quaternion = plain[-1].copy()
            return block
        signs = np.cumprod(np.where(products < 0, -1, 1))
        block = block.copy()
        block[signs < 0] = -block[signs < 0]
        self.last_quaternion = plain[-1] * signs[-1]
        return block

    def pack(self) -> Arrays:
        last = {} if self.last_quaternion is None else {"joined_quaternion": self.last_quaternion}
        return last | self.angles.known.pack()

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        self.last_quaternion = arrays.get("joined_quaternion")
        self.angles.known = Continuity.unpacked(arrays)

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
