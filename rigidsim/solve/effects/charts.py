"""Changes of chart: a run in Euler angles continues in a partner sequence near its own singularity.

The chart is changed at the first natural step boundary where its singular factor is below ``NEAR``: a
function of the state alone, so that bits don't depend on how a run is driven. The other chart's factor is at
least sqrt(1 - NEAR^2) there (see ``rigidsim.model.formulations.formulation``), far from a change back.

What is recorded stays in the asked sequence: in the partner chart the asked angles are followed from natural
step to natural step (where they swing fast: in parts of steps), and each sample is joined to what was found
before it. Their middle angle keeps to its branch, as an integration in the asked sequence would, so that the
outer angles swing by half a turn where the motion passes the singularity. A pass nearer than some 1e-7 rad,
whose swing no sampling shows, is taken straight through: the outer angles go on and the middle one past its
end. In the singularity itself, where the outer angles' sum or difference is all that is defined, the first
keeps the value it had.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import heyoka as hy
import mpmath
import numpy as np

from rigidsim.model.formulations.formulation import (
    across,
    partner_sequence,
    pole_of_partner,
    singular_factor,
)
from rigidsim.model.system import System
from rigidsim.scene.attitude import quaternion_from_euler
from rigidsim.scene.rotations import is_proper
from rigidsim.solve.compiled import CompiledFunction, TaylorEngine, compiled_function
from rigidsim.solve.effects.angle_wrapping import AngleWrapping
from rigidsim.solve.effects.effect import Effect
from rigidsim.solve.effects.whole_time import WholeTime
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.sample_block import Angles, AngleState
from rigidsim.solve.stepper import Stepper

NEAR = 0.5
"""Singular factor below which a chart is left."""

_SWING = math.pi / 2  # of the outer angles within a step, from which the step is examined in parts
_HALVINGS = 10  # of a step at most; the remainder is a straight line to 1e-4 of its length
_STRAIGHT = math.pi - 2.0**-7  # swing in such a part from which it passed straight through
_NEAR_POLE = 2.0**-20  # singular factor below which a reference doesn't fix its branch
_TURN = 2 * math.pi


class AngleContinuation:
    """Joins the requested sequence's angles, in the partner chart, to the ones before."""

    def __init__(self, sequence: str, precision: Precision) -> None:
        self._sequence, self._partner = sequence, partner_sequence(sequence)
        self._proper = is_proper(sequence)
        self._pole = 4 * float(precision.epsilon)

    def branch(self, middle: float) -> float:
        """Branch (+1 or -1) of the two triples of angles to which a middle angle belongs."""
        return math.copysign(1.0, singular_factor(self._sequence, middle, math))

    def __call__(self, before: Sequence[float], angles: Angles) -> tuple[Angles, int, float]:
        """The requested angles nearest to some shortly before; +1 or -1 within rounding of their singularity
        (else 0): whether the sum or the difference of the outer ones is all that is known; and how far the
        first one swung if the middle one stayed on its branch.
        """
        first, middle, last = across(self._partner, list(angles), math)
        side = pole_of_partner(self._partner, list(angles), math)
        sign = 1 if side >= 0 else -1
        factor = abs(singular_factor(self._sequence, middle, math))
        branch = self.branch(before[1])
        swing = math.remainder(first + (0.0 if branch > 0 else math.pi) - before[0], _TURN)
        seen = abs(swing)
        if factor < self._pole:
            swing = seen = 0.0
        else:
            lost = abs(singular_factor(self._sequence, before[1], math)) < _NEAR_POLE
            if seen > (math.pi / 2 if lost else _STRAIGHT):
                branch = -branch
                swing -= math.copysign(math.pi, swing)
        if branch < 0:
            middle = -middle if self._proper else math.pi - middle
        # the sum (difference) is regular near this pole, and half a turn of both changes it by full turns
        common = math.remainder(first + sign * last - before[0] - sign * before[2], _TURN)
        joined = (
            before[0] + swing,
            before[1] + math.remainder(middle - before[1], _TURN),
            before[2] + sign * (common - swing),
        )
        return joined, sign if factor < self._pole else 0, seen


class Charts(Effect):
    """The chart that a run is in, and the changes between charts.

    Called by the engine after each natural step. Which chart it is, and the requested angles, are in the
    memory of the wrapping, which comes before it. Before a change ``whole`` puts time on a single number.
    """

    def __init__(
        self,
        asked: System,
        partner: System,
        precision: Precision,
        wrapping: AngleWrapping,
        whole: WholeTime | None = None,
    ) -> None:
        self._sequences = asked.sequence, partner.sequence
        self._positions = list(asked.angle_states)
        self._middle = self._positions[1]
        self._precision = precision
        self._half = precision.number(mpmath.mpf(0.5))
        self._lift = AngleContinuation(asked.sequence, precision)
        self._wrapping, self._whole = wrapping, whole
        self.changes = 0
        self._passed: list[tuple[Scalar, tuple[float, ...]]] = []  # times and asked angles since ``begin``
        self._conversions = [self._compile(sequence) for sequence in self._sequences]

    def _compile(self, sequence: str) -> CompiledFunction:
        angles, branch = list(hy.make_vars("phi", "theta", "psi")), hy.make_vars("branch")
        precision = self._precision
        return compiled_function(
            across(sequence, angles, hy, branch),
            [*angles, branch],
            compact_mode=precision.compact,
            **precision.options,
        )

    @property
    def chart(self) -> int:
        """0 in the requested sequence, 1 in its partner."""
        return self._wrapping.angles.chart

    def near(self, state: np.ndarray) -> bool:
        """Whether the chart in use must be left in this state."""
        return abs(singular_factor(self._sequences[self.chart], float(state[self._middle]), math)) < NEAR

    # --- following the requested angles ------------------------------------------------------------------

    def begin(self, time: Scalar) -> None:
        """Prepare for steps; the boundaries of earlier ones are forgotten."""
        self._passed = [(time, self._wrapping.angles.reference)]

    def __call__(self, integrator: TaylorEngine) -> bool:
        """Follow a natural step; False if the chart must be left."""
        state = integrator.state
        if self.chart:
            self._follow(integrator, integrator.time, state, _HALVINGS)
        return not self.near(state)

    def _follow(self, integrator: TaylorEngine, time: Scalar, state: np.ndarray, halvings: int) -> None:
        """Follow the requested angles from the latest known ones to a state within the latest step."""
        known = self._wrapping.angles
        joined, _, swing = self._lift(known.reference, self._angles(state))
        if swing > _SWING and halvings:
            before = self._passed[-1][0]
            middle = before + self._half * (time - before)
            between = np.array(integrator.update_d_output(middle))
            self._follow(integrator, middle, between, halvings - 1)
            self._follow(integrator, time, state, halvings - 1)
            return
        self._wrapping.angles = known._replace(reference=joined)
        self._passed.append((time, joined))

    def _angles(self, state: np.ndarray) -> Angles:
        a, b, c = (float(state[p]) for p in self._positions)
        return a, b, c

    def references(self, times: np.ndarray) -> np.ndarray | None:
        """Requested angles (n, 3), rad, before each time since ``begin``; None in the requested chart."""
        if not self.chart:
            return None
        passed = np.zeros(len(times), dtype=np.int64)
        for time, _ in self._passed[1:]:
            passed += np.asarray(times > time, dtype=bool)
        return np.array([angles for _, angles in self._passed])[passed]

    # --- as an effect -----------------------------------------------------------------------------------

    def watch(self, stepper: Stepper) -> None:
        """Follow a stepper from its start on, where the other chart may be needed already."""
        stepper.watcher = self
        if self.near(stepper.state):  # no change on the way: it begins there
            self._enter_other(stepper)
            self.changes = 0
            stepper.bound_steps()

    anywhere = True

    def due(self, stepper: Stepper, stride: int) -> bool:
        """See ``Effect``: at any boundary whose state asks for it."""
        return self.near(stepper.state)

    def apply(self, stepper: Stepper, stride: int) -> bool:
        if self._whole is not None and not self._whole.apply(stepper, stride):
            return False
        self._enter_other(stepper)
        return True

    def _enter_other(self, stepper: Stepper) -> None:
        state = self.change(stepper.state)
        stepper.enter(self.chart, state)

    @property
    def memory(self) -> int:
        return self.changes

    def back_to(self, memory: int, stepper: Stepper) -> None:
        self.changes = memory
        stepper.use(self.chart)

    def pack(self, memory: int) -> dict[str, np.ndarray]:
        return {"rhythm_chart_changes": np.array([memory], dtype=np.int64)}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> int:
        return int(arrays.get("rhythm_chart_changes", np.zeros(1))[0])

    def of_samples(self, times: np.ndarray) -> dict[str, Any]:
        return {"reference": self.references(times)}

    # --- changing ---------------------------------------------------------------------------------------

    def change(self, state: np.ndarray) -> np.ndarray:
        """Change to the other chart and count the change; returns the same state in it."""
        known, angles = self._wrapping.angles, self._angles(state)
        sign = self._quaternion(angles, known)
        if self.chart:
            continuous = known.reference
            branch = self._lift.branch(continuous[1])
        else:
            continuous = tuple(a + _TURN * n for a, n in zip(angles, known.turns, strict=True))
            branch = 1.0
        scalars = self._precision.zeros((4,))
        scalars[:3] = state[self._positions]
        scalars[3] = self._precision.number(mpmath.mpf(branch))
        result = np.array(state)
        result[self._positions] = self._conversions[self.chart](scalars)
        angles = self._angles(result)
        if self.chart:
            turns = [round((b - a) / _TURN) for a, b in zip(angles, continuous, strict=True)]
            entered = AngleState(tuple(turns), 0, (0.0, 0.0, 0.0))
        else:
            entered = AngleState((0, 0, 0), 1, continuous)
        if float(np.dot(sign, self._quaternion(angles, entered))) < 0:  # a full turn changes its sign
            a, b, c = entered.turns
            entered = entered._replace(turns=(a, b, c + 1))
        self._wrapping.angles = entered
        self.changes += 1
        return result

    def _quaternion(self, angles: Angles, of: AngleState) -> np.ndarray:
        sign = -1.0 if sum(of.turns) % 2 else 1.0
        return sign * np.array(quaternion_from_euler(mpmath.fp, list(angles), self._sequences[of.chart]))
