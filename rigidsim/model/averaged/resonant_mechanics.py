"""Equations of a body in spin-orbit resonance (see ``rigidsim.model.averaged.resonance``).

With m the momentum along a, b, c, w = I^-1 m, s = m / L, and W the rate of these axes, all along themselves,

    q' = q (0, W) / 2,    W = w - p n s + (s x Q - s x (s x dU/ds)) / L + G,
    m' = m x w + N + (Q . s) s,    N = P x dU/dP + T x dU/dT + s x dU/ds.

N is the torque's mean in the body; Q is that of second order, which acts on the momentum in space, and so is
L_0 G x s, the average over rotation and orbits of all other sources.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import heyoka as hy

from rigidsim.model.averaged.mechanics import AveragedMechanics, total
from rigidsim.model.averaged.orbit_terms import Ellipse
from rigidsim.model.averaged.resonance import Resonance
from rigidsim.model.rotations import Symbolic, apply, quaternion_kinematics, quaternion_matrix
from rigidsim.model.two_part import as_factor
from rigidsim.scene.arithmetic import cross, dot, transpose

SLOW = ["rw", "rx", "ry", "rz", "la", "lb", "excess"]
"""States: the quaternion of the axes a, b, c, and the momentum along them less p n C along c."""


@dataclass(frozen=True)
class ResonantMechanics(AveragedMechanics):
    """Mechanics of an average that keeps the resonant angle."""

    @property
    def resonance(self) -> Resonance:
        """The resonance that is kept."""
        return self.carried(self.of.resonance)

    @cached_property
    def slow_matrix(self) -> list[list[Symbolic]]:
        """Rotation matrix whose columns are a, b, c in space axes."""
        return quaternion_matrix(list(hy.make_vars(*SLOW[:4])))

    @cached_property
    def slow_momentum(self) -> list[Symbolic]:
        """Angular momentum along a, b, c, internal units."""
        context, motion = self.scene.context, self.of.motion
        whole = context.ldexp(self.resonance.pace * motion.moments[2], -self.scaling.momentum)
        first, second, excess = hy.make_vars(*SLOW[4:])
        return [first, second, excess + self.number(whole)]

    @cached_property
    def momentum_size(self) -> Symbolic:
        return hy.sqrt(hy.sum([x * x for x in self.slow_momentum]))

    @cached_property
    def about(self) -> list[Symbolic]:
        """Direction s of the momentum along a, b, c."""
        return [x / self.momentum_size for x in self.slow_momentum]

    @cached_property
    def direction(self) -> list[Symbolic]:
        return apply(self.slow_matrix, self.about)

    @cached_property
    def orbit_seen(self) -> tuple[list[Symbolic], list[Symbolic]]:
        """Unit vectors P and T of the source's orbit, components along a, b, c."""
        turned = transpose(self.slow_matrix)
        along, across = (apply(turned, v) for v in self.plane_vectors(self.resonance.orbit))
        return along, across

    @property
    def commensurable_angle(self) -> tuple[Symbolic, Symbolic] | None:
        """See ``Mechanics``: from the pericentre's direction to the axis of least moment, about s."""
        along, _ = self.orbit_seen
        return -along[1], along[0]

    def _times(self, factor: Any, expression: Symbolic) -> Symbolic:
        return as_factor(self.number(factor)) * expression

    @cached_property
    def _mean_torque(self) -> tuple[list[Symbolic], list[Symbolic]]:
        """N, and s x dU/ds, along a, b, c."""
        p, t = self.orbit_seen
        by_p, by_t, by_s = self._gradient(p, t, self.about)
        bent = cross(self.about, by_s)
        parts = zip(cross(p, by_p), cross(t, by_t), bent, strict=True)
        return [x + y + z for x, y, z in parts], bent

    def _gradient(
        self, p: list[Symbolic], t: list[Symbolic], s: list[Symbolic]
    ) -> tuple[list[Symbolic], list[Symbolic], list[Symbolic]]:
        """Gradients of U by P, T and s, internal units of energy.

        The sum over the axes leaves out b, with the middle moment taken off all of them: a sphere's part is
        constant.
        """
        context, (least, middle, most) = self.scene.context, self.of.motion.moments
        ps, ts, gp, gt = dot(p, s), dot(t, s), cross(p, s), cross(t, s)
        nothing = [hy.expression(0.0)] * 3
        of_p, of_t, of_s, of_gp, of_gt = (list(nothing) for _ in range(5))
        of_ps, of_ts = [], []
        for i, excess in ((0, least - middle), (2, most - middle)):
            strength = context.ldexp(self.resonance.source.strength * excess / 2, -self.scaling.energy)
            weight = as_factor(self.number(strength))
            m, ep, et = s[i], p[i] - s[i] * ps, t[i] - s[i] * ts
            squares = (ep + gt[i], et - gp[i], ep - gt[i], et + gp[i])
            direct, by_ps, by_ts, slopes = self._mean_square(m, ps, ts, squares)
            s1, d1, s2, d2 = (weight * x for x in slopes)
            by_ep, by_et = s1 + s2, d1 + d2
            of_gt[i], of_gp[i] = s1 - s2, d2 - d1
            of_p[i], of_t[i] = by_ep, by_et
            of_s[i] = weight * direct - (by_ep * ps + by_et * ts)
            of_ps.append(weight * by_ps - m * by_ep)
            of_ts.append(weight * by_ts - m * by_et)
        along, beside = hy.sum(of_ps), hy.sum(of_ts)
        # v . (P x s) has the gradients s x v and v x P
        parts = zip(of_p, cross(s, of_gp), s, strict=True)
        by_p = [x + y + along * z for x, y, z in parts]
        parts = zip(of_t, cross(s, of_gt), s, strict=True)
        by_t = [x + y + beside * z for x, y, z in parts]
        turned = zip(cross(of_gp, p), cross(of_gt, t), strict=True)
        bent = zip(of_s, turned, p, t, strict=True)
        by_s = [x + y + z + along * u + beside * v for x, (y, z), u, v in bent]
        return by_p, by_t, by_s

    def _mean_square(
        self, m: Symbolic, ps: Symbolic, ts: Symbolic, squares: tuple[Symbolic, ...]
    ) -> tuple[Symbolic, Symbolic, Symbolic, list[Symbolic]]:
        """Slopes of <(a/r)^3 (i . r)^2> by m, P_s, T_s and by each of S, D, S', D', taken as independent."""
        x0 = 2 * Ellipse.of(self.scene.context, self.resonance.orbit).secular_factor  # <(a/r)^3>
        once, plus, minus = self.resonance.coefficients
        y0, y2, ym = self.resonance.of_wobble
        s1, d1, s2, d2 = squares
        (a1, a2), (b1, b2) = ((y0 + y2) / 2, (y0 + ym) / 2), ((y0 - y2) / 2, (y0 - ym) / 2)
        slopes = [
            self._times((x0 + plus) / 4, s1) + self._times(once / 4, s2),
            self._times((x0 - plus) / 4, d1) + self._times(once / 4, d2),
            self._times((x0 + minus) / 4, s2) + self._times(once / 4, s1),
            self._times((x0 - minus) / 4, d2) + self._times(once / 4, d1),
        ]
        flat = self._times(x0, m)
        if self.resonance.multiple % 2:
            return flat * (ps * ps + ts * ts), flat * m * ps, flat * m * ts, slopes
        along = self._times(a1, s1) + self._times(a2, s2)
        beside = self._times(b1, d1) + self._times(b2, d2)
        mp, mt = m * ps, m * ts
        wobble = (self._times(a1, mp), self._times(b1, mt), self._times(a2, mp), self._times(b2, mt))
        slopes = [x + y for x, y in zip(slopes, wobble, strict=True)]
        direct = flat * (ps * ps + ts * ts) + (ps * along + ts * beside)
        return direct, flat * mp + m * along, flat * mt + m * beside, slopes

    @cached_property
    def _second_torque(self) -> list[Symbolic]:
        """Q along a, b, c: P x dK/dP + T x dK/dT with the axes brought to the momentum, and back."""
        context = self.scene.context
        k1, k2, k3, k4, k5, k6, k7, k8 = (
            self.number(context.ldexp(k, -self.scaling.energy)) for k in self.resonance.second_order
        )
        (pa, pb, pc), (ta, tb, tc) = (self._brought(v, 1.0) for v in self.orbit_seen)
        x, c, s = pa * tb - pb * ta, 0.5 * (pa + tb), 0.5 * (pb - ta)
        once, skew = c * c - s * s, 2.0 * (c * s)
        by_x = k1 + x * (2.0 * k2 + x * (3.0 * k3 + x * (4.0 * k4))) + once * (k6 + x * (2.0 * k7))
        by_once = k5 + x * (k6 + x * k7) + k8 * (2.0 * once)
        by_skew = k8 * (-2.0 * skew)
        by_c = by_once * c + by_skew * s  # half of the slopes
        by_s = by_skew * c - by_once * s
        nothing = hy.expression(0.0)
        by_p = [by_x * tb + by_c, by_s - by_x * ta, nothing]
        by_t = [-(by_x * pb) - by_s, by_x * pa + by_c, nothing]
        parts = zip(cross([pa, pb, pc], by_p), cross([ta, tb, tc], by_t), strict=True)
        return self._brought([x + y for x, y in parts], -1.0)

    def _brought(self, vector: list[Symbolic], sign: float) -> list[Symbolic]:
        """A vector turned as the shortest turn from s to c does, or back."""
        axis = [sign * self.about[1], -sign * self.about[0], hy.expression(0.0)]
        once = cross(axis, vector)
        twice = cross(axis, once)
        return [x + y + z / (1.0 + self.about[2]) for x, y, z in zip(vector, once, twice, strict=True)]

    @cached_property
    def slow_rates(self) -> list[Symbolic]:
        """Angular velocity W of the axes a, b, c, along themselves, per internal unit of time."""
        context, motion = self.scene.context, self.of.motion
        size, about, m = self.momentum_size, self.about, self.slow_momentum
        inverse = self._inverse_moments
        pace = self.number(context.ldexp(self.resonance.pace, self.scaling.time))
        across = m[0] * m[0] + m[1] * m[1]
        free = [inverse[0] * m[0] - pace * about[0], inverse[1] * m[1] - pace * about[1]]
        # w_c - p n s_c without their common part
        free.append(inverse[2] * hy.make_vars(SLOW[6]) + pace * (across / (size * (size + m[2]))))
        whole = self.number(context.ldexp(motion.momentum, -self.scaling.momentum))
        parts = [self._secular(x) for x in self.of.sources if x is not self.resonance.source]
        _, bent = self._mean_torque
        driven = cross(about, [q - b for q, b in zip(self._second_torque, bent, strict=True)])
        if parts:
            pull = apply(transpose(self.slow_matrix), total(parts))
            level = dot(pull, about)
            driven = [d + whole * (g - level * x) for d, g, x in zip(driven, pull, about, strict=True)]
        return [x + d / size for x, d in zip(free, driven, strict=True)]

    @cached_property
    def _inverse_moments(self) -> list[Symbolic]:
        context = self.scene.context
        return [
            as_factor(self.number(1 / context.ldexp(x, -self.scaling.inertia)))
            for x in self.of.motion.moments
        ]

    @cached_property
    def _momentum_rates(self) -> list[Symbolic]:
        """Derivative of the momentum along a, b, c, internal units."""
        a, b, c = self.of.motion.moments
        context, unit, m = self.scene.context, self.scaling.inertia, self.slow_momentum
        torque, _ = self._mean_torque
        level = dot(self._second_torque, self.about)
        found = []
        for i, (first, second) in enumerate(((b, c), (c, a), (a, b))):
            factor = 1 / context.ldexp(second, -unit) - 1 / context.ldexp(first, -unit)
            free = self._times(factor, m[(i + 1) % 3] * m[(i + 2) % 3])
            found.append(free + torque[i] + level * self.about[i])
        return found

    @cached_property
    def slow_derivatives(self) -> list[Symbolic]:
        """Derivatives of the slow states."""
        turning = quaternion_kinematics(list(hy.make_vars(*SLOW[:4])), self.slow_rates)
        return [*turning, *self._momentum_rates]

    @cached_property
    def derivatives(self) -> list[Symbolic]:
        s, change = self.about, self._momentum_rates
        level = dot(change, s)
        own = [(x - level * y) / self.momentum_size for x, y in zip(change, s, strict=True)]
        turned = cross(self.slow_rates, s)
        return apply(self.slow_matrix, [x + y for x, y in zip(own, turned, strict=True)])

    @cached_property
    def rotational_energy(self) -> Symbolic:
        pairs = zip(self._inverse_moments, self.slow_momentum, strict=True)
        return 0.5 * hy.sum([inverse * (x * x) for inverse, x in pairs])
