"""Equations of a body in spin-orbit resonance (see ``rigidsim.model.averaged.resonance``).

With N the torque of the averaged potential, in the frame of a, b, s, and l the momentum beyond p turns to a
revolution, so that L = l + p n C,

    q' = q (0, W) / 2,    W = (-N_b / L, N_a / L, l / C),    l' = N_s,

N = -(3 G M / 2 a^3) ((B - A) / 2) (P x dh/dP + T x dh/dT) for the commensurable part. Of all else the average
over rotation and orbits is left, a pull G in L_0 G x s, which adds G L_0 / L to the first two parts of W.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import heyoka as hy

from rigidsim.model.averaged.average import TOLD
from rigidsim.model.averaged.mechanics import AveragedMechanics
from rigidsim.model.averaged.orbit_terms import plane_vectors
from rigidsim.model.averaged.resonance import Resonance
from rigidsim.model.averaged.sources import Source
from rigidsim.model.formulations import quaternion_kinematics
from rigidsim.model.rotations import Symbolic, apply, quaternion_matrix
from rigidsim.model.two_part import as_factor
from rigidsim.scene.arithmetic import cross, dot, transpose
from rigidsim.scene.records import dataclass

SLOW = ["rw", "rx", "ry", "rz", "excess"]
"""States: the quaternion of the axes a, b, s, and l."""
RESONANT_ANGLE = "resonant_angle"


@dataclass(frozen=True)
class ResonantMechanics(AveragedMechanics):
    """Mechanics of an average that keeps the resonant angle."""

    def tells(self, name: str) -> bool:
        """See ``Mechanics``."""
        return name in TOLD or name == RESONANT_ANGLE

    @property
    def kept_by_average(self) -> str | None:
        """See ``Mechanics``."""
        return None

    @property
    def resonance(self) -> Resonance:
        """The resonance that is kept."""
        return self.carried(self.of.resonance)

    @cached_property
    def slow_matrix(self) -> list[list[Symbolic]]:
        """Rotation matrix whose columns are a, b, s in space axes."""
        return quaternion_matrix(list(hy.make_vars(*SLOW[:4])))

    @property
    def direction(self) -> list[Symbolic]:
        """Direction s of the momentum, space axes."""
        return [row[2] for row in self.slow_matrix]

    @cached_property
    def momentum_size(self) -> Symbolic:
        """Size L of the angular momentum, internal units."""
        context, motion = self.scene.context, self.of.motion
        whole = context.ldexp(self.resonance.pace * motion.moments[2], -self.scaling.momentum)
        return hy.make_vars(SLOW[4]) + self.number(whole)

    @cached_property
    def orbit_seen(self) -> tuple[list[Symbolic], list[Symbolic]]:
        """Unit vectors P and T of the source's orbit, components along a, b, s."""
        orbit = self.resonance.orbit
        vectors = plane_vectors(
            self._turned(orbit.inclination, 0),
            self._turned(orbit.ascending_node, orbit.node_rate),
            self._turned(orbit.periapsis, orbit.periapsis_rate),
        )
        turned = transpose(self.slow_matrix)
        along, across = (apply(turned, vector) for vector in vectors)
        return along, across

    @property
    def commensurable_angle(self) -> tuple[Symbolic, Symbolic] | None:
        """See ``Mechanics``: from the pericentre's direction to the axis of least moment, about s."""
        along, _ = self.orbit_seen
        return -along[1], along[0]

    @cached_property
    def resonant_torque(self) -> list[Symbolic]:
        """Torque of the commensurable harmonic along a, b, s, internal units of energy."""
        (pa, pb, ps), (ta, tb, ts) = self.orbit_seen
        context = self.scene.context
        zero, plus, minus = (as_factor(self.number(x)) for x in self.resonance.coefficients)
        half_plus, half_minus = 0.5 * plus, 0.5 * minus
        sum_plus, sum_minus = half_plus * (pa + tb), half_minus * (pa - tb)
        skew_plus, skew_minus = half_plus * (pb - ta), half_minus * (pb + ta)
        nothing = hy.expression(0.0)
        by_p = [zero * pa + sum_plus + sum_minus, -(zero * pb) - skew_plus - skew_minus, nothing]
        by_t = [zero * ta + skew_plus - skew_minus, sum_plus - sum_minus - zero * tb, nothing]
        size = as_factor(self.number(context.ldexp(-self.resonance.strength, -self.scaling.energy)))
        both = zip(cross([pa, pb, ps], by_p), cross([ta, tb, ts], by_t), strict=True)
        return [size * (x + y) for x, y in both]

    @cached_property
    def slow_rates(self) -> list[Symbolic]:
        """Angular velocity W of the axes a, b, s, along themselves, per internal unit of time."""
        context, motion = self.scene.context, self.of.motion
        torque, size = self.resonant_torque, self.momentum_size
        parts = [self._other(source) for source in self.of.sources]
        pull = apply(transpose(self.slow_matrix), [hy.sum([part[i] for part in parts]) for i in range(3)])
        whole = self.number(context.ldexp(motion.momentum, -self.scaling.momentum))
        inverse = as_factor(self.number(1 / context.ldexp(motion.moments[2], -self.scaling.inertia)))
        return [
            (whole * pull[0] - torque[1]) / size,
            (whole * pull[1] + torque[0]) / size,
            inverse * hy.make_vars(SLOW[4]),
        ]

    def _other(self, source: Source) -> list[Symbolic]:
        """Pull without the commensurable harmonic; to first order only for the resonant source."""
        if source is not self.resonance.source:
            return self._secular(source)
        context, normal = self.scene.context, self.orbit(self.resonance.orbit).normal
        unit = context.ldexp(context.one, self.scaling.time)
        size = source.secular_strength(context) * self.of.motion.excess / self.of.motion.momentum
        factor = as_factor(self.number(-size * unit)) * dot(normal, self.direction)
        return [factor * x for x in normal]

    @cached_property
    def slow_derivatives(self) -> list[Symbolic]:
        """Derivatives of the slow states."""
        turning = quaternion_kinematics(list(hy.make_vars(*SLOW[:4])), self.slow_rates)
        return [*turning, self.resonant_torque[2]]

    @cached_property
    def derivatives(self) -> list[Symbolic]:
        """Derivative of the momentum's direction, per internal unit of time."""
        p, q, _ = self.slow_rates
        return apply(self.slow_matrix, [q, -p, hy.expression(0.0)])

    @cached_property
    def momentum_space(self) -> list[Symbolic]:
        """Angular momentum, space axes."""
        return [self.momentum_size * x for x in self.direction]

    @cached_property
    def momentum_body(self) -> list[Symbolic]:
        """The same as ``momentum_space``; only its size is recorded."""
        return self.momentum_space

    @cached_property
    def rotational_energy(self) -> Symbolic:
        """Rotational energy L^2 / (2 C)."""
        context = self.scene.context
        twice: Any = 2 * context.ldexp(self.of.motion.moments[2], -self.scaling.inertia)
        return as_factor(self.number(1 / twice)) * (self.momentum_size * self.momentum_size)
