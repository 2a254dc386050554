"""What equilibria are found with: a scene's motion from any attitude and rates, in arithmetic of any width,
Newton's method with central differences, for few unknowns that may be degenerate, and exponents by which
motions near a zero go on.

The equations are a run's, with the attitude in space axes. They are compiled once for each width and
evaluated or integrated from where the caller says; what surrounds the rotation (orbits) begins where the
scene has it. Numbers go in and out as mpf.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Matrix, Vector, multiply, norm, working_bits
from rigidsim.scene.scene import Scene
from rigidsim.scene.starts import InitialRotation
from rigidsim.solve.from_states import AnyStart
from rigidsim.solve.precision import Precision, precision_of
from rigidsim.store.summary import FoundStart

Function = Callable[[Vector], Vector]
_SPARE_BITS = 48
"""Bits beyond the run's own: what a nearly singular Jacobian loses, and some to round once."""
_STEPS = 200_000
_ROUNDS = 40
_PATIENCE = (
    4  # rounds without gain: where some directions count far less than others, they lead on all the same
)
_POOR = 0.1  # part of a residual that a step with a good Jacobian doesn't leave
_STILL = 1e-9


class NoEquilibrium(Exception):
    """Why a scene has none, or none is found; goes on from ``given "name", but``."""


@dataclass(frozen=True)
class Pose:
    """Rotation matrix, body to space axes, and angular velocity (body axes, rad/s); mpf."""

    matrix: Matrix
    rates: Vector

    def moved(self, context: Any, turn: Vector, change: Vector) -> Pose:
        """The pose turned by a rotation vector (body axes) and with other rates."""
        rates = [w + x for w, x in zip(self.rates, change, strict=True)]
        return Pose(multiply(self.matrix, turned(context, turn)), rates)

    def start(self, context: Any, bits: int, found: FoundStart) -> InitialRotation:
        """The start that it is, found in so many bits: what is smaller is the rounding of a zero."""
        quaternion = attitude.quaternion_from_matrix(context, self.matrix)
        size, least = norm(context, self.rates), context.ldexp(1, 8 - bits)
        plain = [x if abs(x) > least else context.zero for x in quaternion]
        rates = [w if abs(w) > least * size else context.zero for w in self.rates]
        return InitialRotation(attitude.unit_quaternion(context, plain), rates, found=found)


def turned(context: Any, vector: Vector) -> Matrix:
    """Rotation matrix (mpf) of a rotation vector."""
    angle = context.sqrt(sum(x * x for x in vector))
    half = context.sin(angle / 2) / angle if angle else context.mpf(0.5)
    return attitude.rotation_matrix([context.cos(angle / 2), *(half * x for x in vector)])


def widths(scene: Scene) -> list[Precision]:
    """Arithmetics in which an equilibrium is found one after the other, the last beyond the run's own."""
    bits = working_bits(scene.config.integrator.precision) + _SPARE_BITS
    found = [precision_of("double"), precision_of("quadruple")]
    if bits > found[-1].bits:
        found.append(Precision(f"{bits} bits", bits, hy.real, cheap=False, compact=True))
    return found


class PoseMotion(AnyStart):
    """The motion of a scene in one arithmetic; what else is in it, such as rotors, begins beside a pose."""

    def __init__(self, scene: Scene, precision: Precision, pose: Pose | None = None) -> None:
        model = scene.config.model.model_copy(update={"level": "full", "short_period": False})
        scene = replace(scene, config=scene.config.model_copy(update={"model": model}))
        if pose is not None:
            quaternion = attitude.quaternion_from_matrix(scene.context, pose.matrix)
            scene = replace(scene, quaternion=quaternion, angular_velocity=pose.rates)
        super().__init__(scene, precision, compact=True)
        self.context = scene.context

    @cached_property
    def _exponents(self) -> list[int]:
        return [self._system.state_exponents[place] for place in self._places[4:]]

    def _state(self, pose: Pose) -> np.ndarray:
        context, values = self.context, list(self._system.initial)
        quaternion = attitude.quaternion_from_matrix(context, pose.matrix)
        scaled = [context.ldexp(w, -e) for w, e in zip(pose.rates, self._exponents, strict=True)]
        for place, value in zip(self._places, [*quaternion, *scaled], strict=True):
            values[place] = value
        return self.precision.array(values)

    def _exact(self, values: Iterable[Any]) -> Vector:
        return [self.context.make_mpf(self.precision.exact(x)._mpf_) for x in values]

    def acceleration(self, pose: Pose) -> tuple[Vector, dict[str, Any]]:
        """Derivatives at the start: of the rates (body axes, rad/s^2), and by name of other states, in
        internal units.
        """
        time, names = self._system.scaling.time, self._system.states
        options = {"time": self._start} if self._derivatives.is_time_dependent else {}
        slopes = self._exact(np.asarray(self._derivatives(self._state(pose), **options)))
        rates = [
            self.context.ldexp(slopes[place], e - time)
            for place, e in zip(self._places[4:], self._exponents, strict=True)
        ]
        return rates, {name: slopes[names.index(name)] for name in self.others}

    def after(self, pose: Pose, seconds: Any) -> Pose:
        """The pose so many seconds (mpf) after the start. Raises ``NoEquilibrium``."""
        engine, context = self._engine, self.context
        engine.time = self._start
        engine.state[:] = self._state(pose)
        until = self._exact_start + context.ldexp(seconds, -self._system.scaling.time)
        outcome, *_ = engine.propagate_until(self.precision.number(until), max_steps=_STEPS)
        if outcome != hy.taylor_outcome.time_limit:
            raise NoEquilibrium("the motion near it ends")
        state = self._exact([engine.state[place] for place in self._places])
        rates = [context.ldexp(w, e) for w, e in zip(state[4:], self._exponents, strict=True)]
        quaternion = attitude.unit_quaternion(context, state[:4])
        return Pose(attitude.rotation_matrix(quaternion), rates)


# --- Newton's method ---------------------------------------------------------------------------------------


def jacobian(context: Any, function: Function, count: int, bits: int) -> Matrix:
    """Jacobian (rows of outputs) at zero of a function known to so many bits, to two thirds of them."""
    step = context.ldexp(1, -(bits // 3))
    columns = []
    for i in range(count):
        ahead, behind = (
            function([sign * step if j == i else context.zero for j in range(count)]) for sign in (1, -1)
        )
        columns.append([(a - b) / (2 * step) for a, b in zip(ahead, behind, strict=True)])
    return [list(row) for row in zip(*columns, strict=True)]


def shortest(context: Any, matrix: Matrix, values: Vector, bits: int) -> Vector:
    """The shortest x with matrix x = -values, as far as there is one (Moore and Penrose).

    Directions whose singular value, relative to the largest, is below half of so many bits are left alone:
    they lead from one of many equilibria to the next.
    """
    count = len(matrix[0])
    a = context.matrix(matrix)
    sizes, vectors = context.eigsy(a.T * a)
    right = a.T * context.matrix(values)
    least = max(sizes[k] for k in range(count)) * context.ldexp(1, -bits)
    found = [context.zero] * count
    for k in range(count):
        if sizes[k] > least:
            part = sum(vectors[i, k] * right[i] for i in range(count)) / sizes[k]
            found = [x - part * vectors[i, k] for i, x in enumerate(found)]
    return found


@dataclass(frozen=True)
class Newton:
    """Newton's method for a residual of so many bits, which keeps its Jacobian while steps gain by it.

    Attributes:
        residual: of a point.
        moved: the point that a step leads to.
        unknowns: their number.
    """

    context: Any
    bits: int
    residual: Callable[[Any], Vector]
    moved: Callable[[Any, Vector], Any]
    unknowns: int

    @property
    def uncertainty(self) -> Any:
        """Of eigenvalues of a Jacobian whose elements are about 1, at a point that is nearly the zero."""
        return max(self.context.ldexp(16, -(2 * self.bits // 3)), self.context.mpf(_STILL))

    def slope(self, at: Any) -> Matrix:
        """Jacobian at a point."""
        return jacobian(
            self.context, lambda step: self.residual(self.moved(at, step)), self.unknowns, self.bits
        )

    def settled(self, at: Any, slope: Matrix | None = None) -> Any:
        """Follow steps from a point until they gain no more: a zero, as far as the residual's bits show.

        Args:
            slope: the Jacobian near the point, if it is known.

        Raises:
            NoEquilibrium: steps make the residual no smaller while it is still large.
        """
        context = self.context
        best, least, size, worse = at, context.inf, context.inf, 0
        for _ in range(_ROUNDS):
            here, before = self.residual(at), size
            size = norm(context, here)
            if size < least:
                best, least, worse = at, size, 0
            elif (worse := worse + 1) >= _PATIENCE:
                break
            if size <= context.ldexp(1, 16 - self.bits):
                break
            if slope is None or (before < context.inf and size > _POOR * before):
                slope = self.slope(at)
            at = self.moved(at, shortest(context, slope, here, self.bits))
        if least > context.ldexp(1, -self.bits // 2):
            raise NoEquilibrium("near it nothing is at rest")
        return best


# --- what becomes of small displacements ------------------------------------------------------------------


def exponents_of(
    context: Any, matrix: Matrix, still: Any, period: Any | None = None, nutation: Any | None = None
) -> tuple[tuple[tuple[float, float], ...], bool]:
    """Exponents (1/s) of a linear system's matrix, or of its map over a period (s), as of ``FoundStart``, and
    whether none grows.

    Args:
        still: uncertainty of the exponents, 1/s, below which a part of one is zero.
        nutation: angle (rad) of a fast nutation over the period, many turns of it, which is left out.
    """
    values, _ = context.eig(context.matrix(matrix))
    values = list(values)
    for angle in () if nutation is None else (nutation, -nutation):
        turned = context.expj(angle)
        values.remove(min(values, key=lambda value: abs(value - turned)))
    if period is not None:
        values = [context.log(value) / period for value in values]
    found = []
    for value in values:
        real, imaginary = (context.zero if abs(x) <= still else x for x in (value.real, value.imag))
        if imaginary >= 0:
            found.append((float(real), float(imaginary)))
    found.sort(key=lambda pair: (pair[1], pair[0]))
    return tuple(found), all(real <= 0 for real, _ in found)
