"""The mechanical quantities of a scene as expressions of its states, in internal units.

One object that observables and invariants are written against: what a scene doesn't carry is None.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import heyoka as hy

from rigidsim.model.dynamics import Number, ScaledNumbers
from rigidsim.model.formulations import AttitudeStates
from rigidsim.model.loads import GravityGradientModel, LoadModel, Term
from rigidsim.model.rotations import Expression, ExpressionMatrix, apply
from rigidsim.model.scaling import Scaling
from rigidsim.model.split import as_factor
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
        loads: all that act.
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
    loads: list[LoadModel] = field(default_factory=list)

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
    def torque(self) -> list[Term]:
        """Of all loads, body axes, internal units of energy."""
        return [term for load in self.loads for term in load.torque(self)]

    @cached_property
    def force(self) -> list[Term]:
        """Acceleration of the centre of mass by all loads, space axes."""
        return [term for load in self.loads for term in load.force(self)]

    @cached_property
    def potential_energy(self) -> Expression | None:
        """Of the loads that are conservative; None where none is."""
        parts = [load.potential(self) for load in self.loads if load.conservative]
        found = [part for part in parts if part is not None]
        return hy.sum(found) if found else None

    @cached_property
    def power(self) -> Expression | None:
        """Of the loads without a potential, internal units of energy over time; None without such loads."""
        context, terms = self.scene.context, []
        for load in self.loads:
            if load.conservative:
                continue
            for vector, expression in load.torque(self):
                pairs = zip(vector, self.rates, strict=True)
                terms.append(expression * hy.sum([self.number(x) * w for x, w in pairs if x != 0]))
            if self.velocity is not None and self.scene.body.mass is not None:
                # force per mass times mass times speed
                scale = context.ldexp(self.scene.body.mass, 2 * self.scaling.speed - self.scaling.energy)
                for vector, expression in load.force(self):
                    pairs = zip(vector, self.velocity, strict=True)
                    along = hy.sum([self.number(scale * x) * v for x, v in pairs if x != 0])
                    terms.append(expression * along)
        return hy.sum(terms) if terms else None

    @property
    def conserves_energy(self) -> bool:
        """Whether every load that acts has a potential that doesn't depend on time."""
        return all(load.conservative or not (load.torque(self) or load.force(self)) for load in self.loads)

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
        """Unit axis about which the tensor is symmetric, body axes (mpf).

        None for an asymmetric body, and for a sphere without a weight to mark an axis.
        """
        context, body = self.scene.context, self.scene.body
        moments, axes = body.principal_moments, body.principal_axes
        tiny = max(moments) * context.mpf(2) ** (24 - context.prec)
        if all(abs(moments[i] - moments[0]) <= tiny for i in (1, 2)):  # a sphere: gravity marks its axis
            if self.numbers.arm is None:
                return None
            length = context.sqrt(dot(self.numbers.arm, self.numbers.arm))
            return [a / length for a in self.numbers.arm]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            if abs(moments[j] - moments[k]) <= tiny:
                return axes[i]
        return None

    @property
    def keeps_axial(self) -> bool:
        """Whether the angular momentum along the symmetry axis is conserved."""
        axis = self.symmetry_direction
        if axis is None:
            return False
        return all(load.keeps_axial(self, axis) or not load.torque(self) for load in self.loads)

    @cached_property
    def jacobi(self) -> Expression | None:
        """Jacobi's constant H = w . I w / 2 - n o . I w + (3 G M / 2 R^3) c . I c of the only load, a gravity
        gradient on a circular orbit in a fixed plane (o its normal, c the direction of the source).
        """
        if len(self.loads) != 1 or not isinstance(self.loads[0], GravityGradientModel):
            return None
        load = self.loads[0]
        orbit = load.spec.orbit
        if orbit is None or not orbit.circular or not orbit.fixed_plane:
            return None
        context = self.scene.context
        motion = context.ldexp(orbit.mean_motion, self.scaling.time)
        if self.attitude is not None and self.attitude.orbital is not None:
            factor = as_factor(self.number(motion))
            normal_body = self.attitude.orbital.normal
            carried = [factor * (o * x) for o, x in zip(normal_body, self.momentum_body, strict=True)]
        else:
            sin_i, cos_i = context.sin(orbit.inclination), context.cos(orbit.inclination)
            normal = [
                sin_i * context.sin(orbit.ascending_node),
                -sin_i * context.cos(orbit.ascending_node),
                cos_i,
            ]
            pairs = zip(normal, self.momentum_space, strict=True)
            carried = [self.number(motion * o) * x for o, x in pairs if o != 0]
        return self.rotational_energy - hy.sum(carried) + load.potential(self)


def in_common_unit(states: list[Expression], units: list[Any], number: Number) -> list[Expression]:
    """States times their own units; a unit of one costs nothing."""
    return [s if u == 1 else number(u) * s for s, u in zip(states, units, strict=True)]
