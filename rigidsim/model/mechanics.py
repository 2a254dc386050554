"""The mechanical quantities of a scene as expressions of its states, in internal units.

One object that observables and invariants are written against: what a scene doesn't carry is None.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import heyoka as hy

from rigidsim.model.dynamics import Number, ScaledNumbers
from rigidsim.model.formulations import AttitudeStates
from rigidsim.model.rotations import Expression, ExpressionMatrix, apply
from rigidsim.model.scaling import Scaling
from rigidsim.scene.context import dot
from rigidsim.scene.scene import Scene

T = TypeVar("T")


@dataclass(frozen=True)
class Mechanics:
    """Expressions of the state.

    Attributes:
        rate_states: the three states of the rates, each in its own unit.
        attitude: None where no attitude is carried.
        vertical: unit vector against gravity, body axes; None where no torque needs it.
        position, velocity: states in their own units; None unless carried.
        number: mpf to the working precision.
    """

    scene: Scene
    scaling: Scaling
    numbers: ScaledNumbers
    rate_states: list[Expression]
    attitude: AttitudeStates | None
    vertical: list[Expression] | None
    position: list[Expression] | None
    velocity: list[Expression] | None
    number: Number

    @cached_property
    def rates(self) -> list[Expression]:
        """Angular velocity in units of 1/time, body axes."""
        return in_common_unit(self.rate_states, self.numbers.rate_units, self.number)

    @cached_property
    def momentum_body(self) -> list[Expression]:
        """Angular momentum I w, body axes."""
        context = self.scene.context
        largest = max(abs(x) for row in self.numbers.inertia for x in row)
        rows = []
        for row in self.numbers.inertia:
            terms = [
                self.number(x) * w
                for x, w in zip(row, self.rates, strict=True)
                if abs(x) > largest * context.mpf(2) ** (24 - context.prec)
            ]
            rows.append(hy.sum(terms) if terms else hy.expression(0.0))
        return rows

    @cached_property
    def momentum_space(self) -> list[Expression]:
        """Angular momentum R I w, space axes."""
        return apply(self.matrix, self.momentum_body)

    @staticmethod
    def carried(part: T | None) -> T:
        """A part that the caller knows to be carried (``Observable.needs`` says so)."""
        assert part is not None
        return part

    @property
    def matrix(self) -> ExpressionMatrix:
        """R, body to space."""
        assert self.attitude is not None
        return self.attitude.matrix

    @cached_property
    def rotational_energy(self) -> Expression:
        """w . I w / 2."""
        return 0.5 * hy.sum([w * m for w, m in zip(self.rates, self.momentum_body, strict=True)])

    @cached_property
    def potential_energy(self) -> Expression | None:
        """M g l above the fixed point, or -M g . x in free flight; None without gravity."""
        context, scene, scaling = self.scene.context, self.scene, self.scaling
        if self.vertical is not None and self.numbers.arm is not None:
            return hy.sum(
                [self.number(a) * v for a, v in zip(self.numbers.arm, self.vertical, strict=True) if a]
            )
        mass = scene.body.mass
        if self.position is None or scene.gravity is None or mass is None:
            return None
        weights = [context.ldexp(-mass * g, scaling.length - scaling.energy) for g in scene.gravity]
        terms = [self.number(k) * x for k, x in zip(weights, self.position, strict=True) if k]
        return hy.sum(terms) if terms else None

    @cached_property
    def energy(self) -> Expression:
        """Kinetic (of rotation and of the centre of mass, where it moves) plus potential."""
        terms = [self.rotational_energy]
        mass = self.scene.body.mass
        if self.velocity is not None and mass is not None:
            context, scaling = self.scene.context, self.scaling
            half_mass = context.ldexp(mass / 2, 2 * scaling.speed - scaling.energy)
            terms.append(self.number(half_mass) * hy.sum([v * v for v in self.velocity]))
        if self.potential_energy is not None:
            terms.append(self.potential_energy)
        return hy.sum(terms)

    @cached_property
    def symmetry_direction(self) -> list[Any] | None:
        """Unit axis of a symmetric top, body axes (mpf): the tensor is symmetric about it and, where
        gravity acts, the centre of mass lies on it. None for other bodies, and for spheres without gravity.
        """
        context, body = self.scene.context, self.scene.body
        moments, axes = body.principal_moments, body.principal_axes
        tiny = max(moments) * context.mpf(2) ** (24 - context.prec)
        if all(abs(moments[i] - moments[0]) <= tiny for i in (1, 2)):  # a sphere
            if self.numbers.arm is None:
                return None
            length = context.sqrt(dot(self.numbers.arm, self.numbers.arm))
            return [a / length for a in self.numbers.arm]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            if abs(moments[j] - moments[k]) > tiny:
                continue
            if self.numbers.arm is not None:
                largest = max(abs(a) for a in self.numbers.arm)
                across = [abs(dot(axes[n], self.numbers.arm)) for n in (j, k)]
                if max(across) > largest * context.mpf(2) ** (24 - context.prec):
                    continue
            return axes[i]
        return None


def in_common_unit(states: list[Expression], units: list[Any], number: Number) -> list[Expression]:
    """States times their own units; a unit of one costs nothing."""
    return [s if u == 1 else number(u) * s for s, u in zip(states, units, strict=True)]
