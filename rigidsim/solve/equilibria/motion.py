"""A scene's motion from any attitude and rates, in arithmetic of any width: what equilibria are found with.

The equations are those of a run, with the attitude in space axes. They are compiled once for each width and
evaluated or integrated from where the caller says; what surrounds the rotation (orbits) begins where the
scene has it. Numbers go in and out as mpf.
"""

from __future__ import annotations

from collections.abc import Iterable
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

_SPARE_BITS = 48
"""Bits beyond the run's own: what a nearly singular Jacobian loses, and some to round once."""
_STEPS = 200_000


class Lost(Exception):
    """The motion ends before the time that was asked for."""


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
        """The pose so many seconds (mpf) after the start. Raises ``Lost``."""
        engine, context = self._engine, self.context
        engine.time = self._start
        engine.state[:] = self._state(pose)
        until = self._exact_start + context.ldexp(seconds, -self._system.scaling.time)
        outcome, *_ = engine.propagate_until(self.precision.number(until), max_steps=_STEPS)
        if outcome != hy.taylor_outcome.time_limit:
            raise Lost
        state = self._exact([engine.state[place] for place in self._places])
        rates = [context.ldexp(w, e) for w, e in zip(state[4:], self._exponents, strict=True)]
        quaternion = attitude.unit_quaternion(context, state[:4])
        return Pose(attitude.rotation_matrix(quaternion), rates)
