"""What the loads of a scene do: torque, force, energy and power as expressions of its states."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.rotations import Symbolic
from rigidsim.model.two_part import as_factor


@dataclass(frozen=True)
class Mechanics(Kinematics):
    """Kinematics with all loads that act: what observables and invariants are written against."""

    loads: list[Load] = field(default_factory=list)

    @cached_property
    def torque(self) -> list[Term]:
        """Of all loads, body axes, internal units of energy."""
        return [term for load in self.loads for term in load.torque(self)]

    @cached_property
    def force(self) -> list[Term]:
        """Acceleration of the centre of mass by all loads, space axes."""
        return [term for load in self.loads for term in load.force(self)]

    @cached_property
    def potential_energy(self) -> Symbolic | None:
        """Of the loads that are conservative; None where none is."""
        parts = [load.potential(self) for load in self.loads if load.conservative]
        found = [part for part in parts if part is not None]
        return hy.sum(found) if found else None

    @cached_property
    def power(self) -> Symbolic | None:
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
    def energy(self) -> Symbolic:
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

    @property
    def keeps_axial(self) -> bool:
        """Whether the angular momentum along the symmetry axis is conserved."""
        axis = self.symmetry_direction
        if axis is None:
            return False
        return all(load.keeps_axial(self, axis) or not load.torque(self) for load in self.loads)

    @cached_property
    def jacobi(self) -> Symbolic | None:
        """Jacobi's constant H = w . I w / 2 - n o . I w + U of the only load, whose potential U rests in a
        frame that turns with a circular orbit in a fixed plane (o its normal, n the mean motion).
        """
        orbit = self.loads[0].corotating_orbit if len(self.loads) == 1 else None
        if orbit is None:
            return None
        load = self.loads[0]
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
