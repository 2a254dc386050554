"""Motions averaged over the body's rotation, as [model] level asks for: directions of the body's axes in
space, but no rotation about them.

Under torques of the body alone, the amplitudes P and Q of ``free_motion`` are states besides the momentum's
direction. Gradients turn it as before, with the mean tensor of the present polhode.

In spin-orbit resonance (see ``rigidsim.model.averaged.sources``) with m the momentum along a, b, c,
w = I^-1 m, s = m / L, and W the rate of these axes, all along themselves,

    q' = q (0, W) / 2,    W = w - p n s + (s x Q - s x (s x dU/ds)) / L + G,
    m' = m x w + N + (Q . s) s,    N = P x dU/dP + T x dU/dT + s x dU/ds.

N is the torque's mean in the body; Q is the second-order mean, which acts on the momentum in space, and so is
L_0 G x s, the average over rotation and orbits of all other sources.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem, required
from rigidsim.model.averaged.average import DIRECTION, Average, Driven, average_of
from rigidsim.model.averaged.sources import Ellipse, OrbitPlace, OrbitTerms, Resonance, Source
from rigidsim.model.formulations.formulation import Formulation, ModelPlan, Requirements
from rigidsim.model.frames import refuse_without_plane
from rigidsim.model.load import Load, Term
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.orbits import ElementStates, OrbitStates, element_states
from rigidsim.model.rotations import Symbolic, apply, quaternion_kinematics, quaternion_matrix
from rigidsim.model.scaling import Rounder, choose_scaling
from rigidsim.model.state_blocks import AttitudeStates, StateBlock
from rigidsim.model.two_part import as_factor, rounded
from rigidsim.scene.arithmetic import cosine_and_sine, cross, dot, transpose
from rigidsim.scene.choices import Variables
from rigidsim.scene.kepler import plane_vectors
from rigidsim.scene.orbit_tables import AXIS, TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene

_LIGHT = 299792458  # m/s


@dataclass(frozen=True)
class AveragedMechanics(Mechanics):
    """Mechanics of an averaged motion; ``rates`` is the rate at which the momentum turns, in space axes."""

    @property
    def unit(self) -> Any:
        """Internal unit of time, s (mpf)."""
        return self.scene.context.ldexp(self.scene.context.one, self.scaling.time)

    # --- where the sources are ------------------------------------------------------------------------------

    def orbit(self, orbit: KeplerOrbit) -> OrbitStates:
        """See ``Kinematics``; here a function of time, without states.

        The digits that the phase loses as time goes on shift the direction only in proportion to the
        nutation, and a torque without states allows steps twice as long.
        """
        e = orbit.eccentricity
        shape = () if orbit.circular else (e, self.scene.context.sqrt(1 - e * e))
        direction, inverse = self._place(orbit).seen(*map(self.number, shape))
        turn = self._turned(orbit.ascending_node + orbit.periapsis, orbit.node_rate + orbit.periapsis_rate)
        eccentric = self.number(e) * turn[0], self.number(e) * turn[1]
        normal = self._normal(orbit)
        return OrbitStates(StateBlock([], [], []), direction, normal, inverse, eccentric=eccentric)

    def _place(self, orbit: KeplerOrbit) -> OrbitPlace:
        """Position of a source on its orbit."""
        mean = self.moving(orbit.mean_anomaly, orbit.mean_motion)
        e = hy.expression(self.number(orbit.eccentricity))
        anomaly = mean if orbit.circular else hy.kepE(e, mean)
        return OrbitPlace(hy.cos(anomaly), hy.sin(anomaly), *self.plane_vectors(orbit))

    def plane_vectors(self, orbit: KeplerOrbit) -> tuple[list[Symbolic], list[Symbolic]]:
        """P and T of an orbit."""
        return plane_vectors(
            self._turned(orbit.inclination, 0),
            self._turned(orbit.ascending_node, orbit.node_rate),
            self._turned(orbit.periapsis, orbit.periapsis_rate),
        )

    def _normal(self, orbit: KeplerOrbit) -> list[Symbolic]:
        c, s = self._turned(orbit.inclination, 0)
        node_c, node_s = self._turned(orbit.ascending_node, orbit.node_rate)
        return [node_s * s, -(node_c * s), c]

    def _turned(self, angle: Any, rate: Any) -> tuple[Symbolic, Symbolic]:
        """Cosine and sine of an angle that advances uniformly."""
        if rate == 0:
            c, s = cosine_and_sine(self.scene.context, angle)
            return as_factor(self.number(c)), as_factor(self.number(s))
        moving = self.moving(angle, rate)
        return hy.cos(moving), hy.sin(moving)

    def moving(self, angle: Any, rate: Any) -> Symbolic:
        """An angle that advances uniformly."""
        start = hy.expression(self.number(angle))
        if rate == 0:
            return start
        return start + self.number(rate * self.unit) * hy.time

    @cached_property
    def _elements(self) -> dict[TabulatedOrbit, ElementStates]:
        given = self.scaling.time, self.scene.start, self.number
        return {orbit: element_states(orbit, at, *given) for orbit, at in self.tables.items()}

    def table(self, orbit: TabulatedOrbit) -> OrbitStates:
        """Averaged over the orbit it has no direction unless the mean longitude is carried."""
        if not self.average.over_orbits:
            return super().table(orbit)
        states = self._elements[orbit]
        terms = OrbitTerms.of_elements(states, self.number)
        direction: list[Symbolic] = []
        inverse = hy.expression(1.0)
        if terms.place is not None:
            direction, inverse = terms.place.seen(terms.ellipse.eccentricity, terms.ellipse.root)
            inverse = inverse / rounded(states.values[AXIS])
        return OrbitStates(states.block, direction, states.normal, inverse, eccentric=states.eccentric)

    def _terms(self, source: Source) -> OrbitTerms:
        """What an average over the source's orbit is made of."""
        if source.of.table is not None:
            return OrbitTerms.of_elements(self._elements[source.of.table], self.number)
        context, placed = self.scene.context, source.of.placement
        if placed.node_averaged is not None:
            e, motion = placed.node_averaged
            ellipse = Ellipse(e, e * e, context.sqrt(1 - e * e), motion * self.unit, bool(e == 0))
            return OrbitTerms(ellipse, self.normal(source), None, context.one, self.number)
        orbit = self.carried(source.of.orbit)
        ellipse = Ellipse.of(context, orbit)
        ellipse = replace(ellipse, motion=ellipse.motion * self.unit)
        fixed = orbit.fixed_plane and not orbit.circular
        return OrbitTerms(
            ellipse, self._normal(orbit), self._place(orbit), context.one, self.number,
            self.plane_vectors(orbit) if fixed else None,
        )  # fmt: skip

    # --- equations ------------------------------------------------------------------------------------------

    @property
    def direction(self) -> list[Symbolic]:
        """Direction of the momentum: the states themselves, space axes."""
        return list(hy.make_vars(*DIRECTION))

    @cached_property
    def derivatives(self) -> list[Symbolic]:
        """Derivatives of the states, per internal unit of time."""
        s = self.direction
        geodetic = self._geodetic()
        if self.average.over_orbits:
            found = cross(total([self._secular(source) for source in self.average.sources] + geodetic), s)
            return (
                found if self.average.tides is None else total([found, *self.average.tides.turned(self, s)])
            )
        pull = self._pull(s)
        if self.average.figure == 0 or not self._second:
            return cross(total([pull, *geodetic]), s)
        # the torque acts on the circled axis, which is offset from the momentum by d = -a s x s'; to second
        # order this gives (G - a G^2 + 2 a (s . G s) G) s x s for a pull G s
        moment = self.average.motion.transverse / self.average.motion.momentum
        a = as_factor(self.scaled(moment, -self.scaling.time))
        factor = 1.0 + 2.0 * (a * dot(s, pull))
        bent = [factor * g - a * again for g, again in zip(pull, self._pull(pull), strict=True)]
        return cross(total([bent, *geodetic]), s)

    @property
    def _second(self) -> bool:
        """Whether terms of second order belong to the equations."""
        return self.scene.config.model.order == 2

    def _geodetic(self) -> list[list[Symbolic]]:
        """Rates at which space turns along the body's orbits, if asked for, per internal unit of time:
        3/2 G M n / (c^2 a (1 - e^2)) about the orbit's normal (de Sitter 1916; Misner, Thorne & Wheeler 1973,
        eq. 40.33), with the mean n and a of a table and the e of the moment.
        """
        found = []
        for source in self.average.sources if self.scene.config.model.geodetic_precession else ():
            if not source.has_elements:
                continue
            orbit, table, context = source.of.orbit, source.of.table, self.scene.context
            motion, axis = required(table or orbit).mean_motion, source.of.placement.distance(context)
            size = 3 * source.of.gravitational_parameter * motion / (2 * _LIGHT**2 * axis) * self.unit
            if orbit is not None:
                factor = as_factor(self.number(size / (1 - orbit.eccentricity**2)))
            else:
                k, h = required(self.table(required(table)).eccentric)
                factor = as_factor(self.number(size)) / (1.0 - (k * k + h * h))
            found.append([factor * x for x in self.normal(source)])
        return found

    def _secular(self, source: Source) -> list[Symbolic]:
        """Secular pull -(k/2) (1 - e^2)^(-3/2) (n . s) n to second order; the pull of a source at rest."""
        placed = source.of.placement
        if not source.has_elements and placed.node_averaged is None:
            return self._pull_of(source, self.direction)
        rate, growth = self.average.rate(source) * self.unit * placed.node_factor(self.scene.context), None
        if self.average.tides is not None:
            growth = self.average.tides.growth(self, source)
        return self._terms(source).secular(rate, self.direction, second=self._second, growth=growth)

    def normal(self, source: Source) -> list[Symbolic]:
        """Normal of the plane of a source's orbit, space axes."""
        orbit, table = source.of.placement.elements()
        return self._normal(required(orbit)) if table is None else self.table(table).normal

    def _pull(self, s: list[Symbolic]) -> list[Symbolic]:
        """G s, the sum of k (a/r)^3 (s . r) r, per internal unit of time; s' is its cross product with s."""
        return total([self._pull_of(source, s) for source in self.average.sources])

    def _pull_of(self, source: Source, s: list[Symbolic]) -> list[Symbolic]:
        place, distance = source.of.placement.seen(self), source.of.placement.distance(self.scene.context)
        factor = self._strength(source) * dot(place.line, s) * place.inverse**3
        if place.unit != distance:
            factor = self.number((distance / place.unit) ** 3) * factor
        return [factor * x for x in place.line]

    def _strength(self, source: Source) -> Symbolic:
        return as_factor(self.number(self.average.rate(source) * self.unit))

    # --- what is recorded -----------------------------------------------------------------------------------

    @cached_property
    def _axes(self) -> tuple[list[Symbolic], list[Symbolic], list[Symbolic]]:
        """Directions of momentum, figure and spin axis, of unit length to first order, space axes."""
        mean = self.direction
        lost = [hy.expression(float("nan"))] * 3
        momentum, sign = mean, self.average.figure
        if not self.average.short_period:
            figure = [float(sign) * x for x in mean] if sign else lost
            return mean, figure, mean
        if self.average.over_orbits:
            for source in self.average.sources:
                if source.has_elements:
                    more = self._terms(source).nutation(self.average.rate(source) * self.unit, mean)
                    momentum = [x + y for x, y in zip(momentum, more, strict=True)]
        if not sign:
            return momentum, lost, momentum
        # the circled axis is offset from the momentum by -a s x s', as above
        context, motion = self.scene.context, self.average.motion
        offset = context.ldexp(-(motion.transverse / motion.momentum), -self.scaling.time)
        factor = as_factor(self.number(offset))
        away = [factor * x for x in cross(momentum, cross(self._pull(momentum), momentum))]
        ratio = self.number(1 - motion.moments[2] / motion.transverse)
        figure = [float(sign) * (x + d) for x, d in zip(momentum, away, strict=True)]
        spin = [x + ratio * d for x, d in zip(momentum, away, strict=True)]
        return momentum, figure, spin

    @cached_property
    def momentum_size(self) -> Any:
        size = self.scaled(self.average.motion.momentum, -self.scaling.momentum)
        return size if self.average.tides is None else size * self.average.tides.spin_ratio(self)

    @cached_property
    def momentum_space(self) -> list[Symbolic]:
        return [self.momentum_size * x for x in self._axes[0]]

    @cached_property
    def momentum_body(self) -> list[Symbolic]:
        """Angular momentum without the terms added back; only its size is recorded."""
        return [self.momentum_size * x for x in self.direction]

    @property
    def figure_space(self) -> list[Symbolic]:
        """See ``Mechanics``; NaN if the figure axis has no mean direction."""
        return self._axes[1]

    @property
    def spin_space(self) -> list[Symbolic]:
        return self._axes[2]

    @cached_property
    def rates(self) -> list[Symbolic]:
        return self.derivatives

    @cached_property
    def rotational_energy(self) -> Symbolic:
        """Energy of the free rotation."""
        energy = hy.expression(self.scaled(self.average.energy, -self.scaling.energy))
        if self.average.tides is None:
            return energy
        spin = self.average.tides.spin_ratio(self)
        return energy * (spin * spin)

    # --- loads ----------------------------------------------------------------------------------------------

    @cached_property
    def torque(self) -> list[Term]:
        """None along body axes."""
        return []

    @cached_property
    def turning(self) -> list[Load]:
        """All loads."""
        return list(self.loads)

    @cached_property
    def potential_energy(self) -> Symbolic | None:
        """None is recorded."""
        return None

    @cached_property
    def power(self) -> Symbolic | None:
        """None: the mean power is zero."""
        return None


def total(vectors: list[list[Symbolic]]) -> list[Symbolic]:
    """Sum of vectors."""
    return [hy.sum([vector[i] for vector in vectors]) for i in range(3)]


# --- torques of the body alone ------------------------------------------------------------------------------

AMPLITUDES = ["axial", "transverse"]
"""States: the largest components P and Q of the momentum along the circled axis and the intermediate one."""


@dataclass(frozen=True)
class DrivenMechanics(AveragedMechanics):
    """Mechanics of an average under torques that do work."""

    @property
    def driven(self) -> Driven:
        """What drives the motion."""
        return self.carried(self.average.driven)

    @cached_property
    def amplitudes(self) -> tuple[Symbolic, Symbolic]:
        """P and Q, internal units."""
        axial, transverse = hy.make_vars(*AMPLITUDES)
        return axial, transverse

    @cached_property
    def mean_square(self) -> Symbolic:
        """<sin^2 f> over the polhode."""
        largest, epsilon = self.driven.parameter, self.driven.epsilon
        return self.driven.torques.mean_square(*self.amplitudes, self.number, largest, epsilon)

    @cached_property
    def amplitude_rates(self) -> list[Symbolic]:
        """Derivatives of P and Q, per internal unit of time."""
        nodes = self.driven.nodes
        return self.driven.torques.rates(*self.amplitudes, self.number, nodes, self.mean_square)

    @cached_property
    def momentum_size(self) -> Symbolic:
        axial, transverse = self.amplitudes
        ratio = as_factor(self.number(self.driven.polhodes.ratio))
        return hy.sqrt(axial * axial + ratio * (transverse * transverse))

    @cached_property
    def derivatives(self) -> list[Symbolic]:
        if not self.average.sources:
            return [hy.expression(0.0)] * 3
        s = self.direction
        return cross(self._pull(s), s)

    @cached_property
    def _excess(self) -> Symbolic:
        """(3 <m . I m> - tr I) / 2 over the size of the momentum, internal units of time."""
        context, polhodes = self.scene.context, self.driven.polhodes
        first, second, third = (context.ldexp(x, -self.scaling.inertia) for x in polhodes.moments)
        axial, transverse = self.amplitudes
        p, q = axial * axial, transverse * transverse
        ratio = polhodes.ratio
        # I1 r (1 - S) + I2 S - I3 (1 - r) S along Q^2
        steady = as_factor(self.number(first * ratio * 3 / 2))
        varying = as_factor(self.number((second - ratio * first - (1 - ratio) * third) * 3 / 2))
        squares = hy.sum(
            [as_factor(self.number(third * 3 / 2)) * p, (steady + varying * self.mean_square) * q]
        )
        trace = self.number((first + second + third) / 2)
        size = self.momentum_size
        return (squares / (size * size) - trace) / size

    def _strength(self, source: Source) -> Symbolic:
        """Precession constant over the mean tensor's present excess over L."""
        context = self.scene.context
        # strength in 1/s^2, times inertia over momentum, per internal unit of time
        strength = context.ldexp(source.strength, 2 * self.scaling.time)
        return as_factor(self.number(strength)) * self._excess

    @cached_property
    def rotational_energy(self) -> Symbolic:
        context, polhodes = self.scene.context, self.driven.polhodes
        first, _, third = (context.ldexp(x, -self.scaling.inertia) for x in polhodes.moments)
        axial, transverse = self.amplitudes
        along: Any = as_factor(self.number(1 / (2 * third)))
        across: Any = as_factor(self.number(polhodes.ratio / (2 * first)))
        return hy.sum([along * (axial * axial), across * (transverse * transverse)])


# --- spin-orbit resonance -----------------------------------------------------------------------------------

SLOW = ["rw", "rx", "ry", "rz", "la", "lb", "excess"]
"""States: the quaternion of the axes a, b, c, and the momentum along them less p n C along c."""


@dataclass(frozen=True)
class ResonantMechanics(AveragedMechanics):
    """Mechanics of an average that keeps the resonant angle."""

    @property
    def resonance(self) -> Resonance:
        """The resonance that is kept."""
        return self.carried(self.average.resonance)

    @cached_property
    def slow_matrix(self) -> list[list[Symbolic]]:
        """Rotation matrix whose columns are a, b, c in space axes."""
        return quaternion_matrix(list(hy.make_vars(*SLOW[:4])))

    @cached_property
    def slow_momentum(self) -> list[Symbolic]:
        """Angular momentum along a, b, c, internal units."""
        context, motion = self.scene.context, self.average.motion
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
        context, (least, middle, most) = self.scene.context, self.average.motion.moments
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
        k1, k2, k3, k4, k5, k6, k7, k8 = (
            self.scaled(k, -self.scaling.energy) for k in self.resonance.second_order
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
        motion = self.average.motion
        size, about, m = self.momentum_size, self.about, self.slow_momentum
        inverse = self._inverse_moments
        pace = self.scaled(self.resonance.pace, self.scaling.time)
        across = m[0] * m[0] + m[1] * m[1]
        free = [inverse[0] * m[0] - pace * about[0], inverse[1] * m[1] - pace * about[1]]
        # w_c - p n s_c without their common part
        free.append(inverse[2] * hy.make_vars(SLOW[6]) + pace * (across / (size * (size + m[2]))))
        whole = self.scaled(motion.momentum, -self.scaling.momentum)
        parts = [self._secular(x) for x in self.average.sources if x is not self.resonance.source]
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
            for x in self.average.motion.moments
        ]

    @cached_property
    def _momentum_rates(self) -> list[Symbolic]:
        """Derivative of the momentum along a, b, c, internal units."""
        a, b, c = self.average.motion.moments
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


_OF_FIGURE = ("figure_axis",)
_WHY = {
    "spin_averaged": "the direction of the angular momentum, under torques averaged over the body's free "
    "rotation; the norm and the energy are constant",
    "orbit_averaged": "the direction of the angular momentum, under torques averaged over the body's free "
    "rotation and over the sources' orbits; the norm and the energy are constant",
}

_WHY_TURNED = "the direction of the angular momentum, under gravity gradients averaged over the free rotation"
_WHY_AT_REST = "the direction of the angular momentum, which torques of the body alone don't turn on average"


class Averaged(Formulation):
    """The direction of the angular momentum, and its slow companions."""

    carries_rates = False
    resolves_rotation = False
    twin = None
    average: Average

    def __init__(self, average: Average) -> None:
        self.average, self.longitude = average, average.longitude
        summed = average.driven is not None and average.driven.nodes
        self.wide = average.resonance is not None or bool(summed)
        self.variables = Variables(average.level, general=False)  # type: ignore[misc]  # the scene decides

    @classmethod
    def along(cls, scene: Scene, loads: Sequence[Load], along: Average | None) -> Averaged:
        """The average of a scene, or the one already chosen of a motion that the scene is a part of."""
        average = average_of(scene, loads, replace(choose_scaling(scene), rates=(0, 0, 0)), along)
        _refuse_unavailable(average, scene.config.output.record)
        refuse_without_plane(scene, loads)
        return cls(average)

    def requirements(self, scene: Scene) -> Requirements:
        """What is carried, and what isn't."""
        left_out = [("attitude", f'[model] level = "{self.average.level}" averages over the rotation')]
        if self.average.over_orbits:
            left_out.append(("anomalies", "the torques are averaged over the orbits"))
        return Requirements(True, False, False, scene.config.output.record, {}, left_out)

    def assembled(self, plan: ModelPlan, number: Rounder) -> tuple[Mechanics, list[StateBlock]]:
        m, blocks = self._resonant(plan, number) if self.average.resonance else self._direction(plan, number)
        if (states := m.point_masses) is not None:
            blocks.append(states.block())
        if m.sky is not None:
            blocks.append(m.sky.block())
        return m, blocks

    def _mechanics(
        self,
        kind: type[AveragedMechanics],
        plan: ModelPlan,
        number: Rounder,
        rates: list[Symbolic],
        attitude: AttitudeStates,
    ) -> Any:
        return kind(
            plan.scene, plan.scaling, plan.numbers, rates, attitude, None, None, None, number,
            plan.orbit_tags, tables=plan.tables, loads=list(plan.loads), average=self.average,
        )  # fmt: skip

    def _resonant(self, plan: ModelPlan, number: Rounder) -> tuple[AveragedMechanics, list[StateBlock]]:
        """States of a body in spin-orbit resonance."""
        average, unit = self.average, plan.scaling.momentum
        resonance, initial = required(average.resonance), average.initial(unit)
        q = list(hy.make_vars(*SLOW[:4]))
        norm = hy.sqrt(hy.sum([x * x for x in q]))
        defect = "quaternion_norm", "norm of the slow quaternion", norm
        attitude = AttitudeStates(SLOW[:4], [], initial[:4], [], q, "state", defect=defect)
        m: ResonantMechanics = self._mechanics(ResonantMechanics, plan, number, q[:3], attitude)
        why = (
            f"the body is in resonance with [[loads]] number {resonance.source.number}, {resonance.name}: rw "
            "to rz are the quaternion of its axes turned back by so many turns to a revolution, la, lb and "
            "excess the momentum beyond that rotation, under torques averaged over rotation and orbits"
        )
        exponents = [0] * 4 + [unit] * 3
        return m, [StateBlock(SLOW, m.slow_derivatives, initial, exponents=exponents, why=why)]

    def _direction(self, plan: ModelPlan, number: Rounder) -> tuple[AveragedMechanics, list[StateBlock]]:
        """The momentum's direction, its amplitudes where torques of the body change them, and orbits."""
        average = self.average
        s = list(hy.make_vars(*DIRECTION))
        norm = hy.sqrt(hy.sum([x * x for x in s]))
        defect = "momentum_axis_norm", "norm of the momentum's direction", norm
        start = list(average.start)
        attitude = AttitudeStates(DIRECTION, [], start, [], [], "state", defect=defect, chord=1.0)
        kind = AveragedMechanics if average.driven is None else DrivenMechanics
        m = self._mechanics(kind, plan, number, s, attitude)
        why = _WHY[average.level]
        if average.driven is not None:
            why = _WHY_TURNED if average.sources else _WHY_AT_REST
        blocks = [StateBlock(DIRECTION, m.derivatives, average.start, why=why)]
        if isinstance(m, DrivenMechanics):
            blocks.append(_amplitudes(m))
        if average.tides is not None and (block := average.tides.block(m, s)) is not None:
            blocks.append(block)
        for orbit in plan.tables:
            what = "elements of" if average.over_orbits else "where"
            which = "the source's orbit" if average.over_orbits else "the source is"
            block = m.table(orbit).block
            blocks.append(replace(block, why=f'gravity_gradient: {what} {which}, by "{orbit.name}"'))
        return m, blocks

    def rate_bound(self, plan: ModelPlan) -> Any:
        """See ``Formulation``: of the momentum's turning rate."""
        return self.average.rate_bound


def _amplitudes(m: DrivenMechanics) -> StateBlock:
    """P and Q of a driven motion."""
    unit = m.scaling.momentum
    return StateBlock(
        AMPLITUDES,
        m.amplitude_rates,
        m.driven.states(unit),
        exponents=[unit] * 2,
        why=f"size of the momentum and energy of rotation, under {' and '.join(m.driven.titles)}: its "
        "largest components along the axis that it circles and across it",
    )


def _refuse_unavailable(average: Average, record: Sequence[str] | None) -> None:
    """Refuse observables that need every rotation resolved."""
    for name in record or ():
        if name in _OF_FIGURE and not average.figure:
            why = "the body tumbles, so that its figure axis points nowhere on average; record momentum_axis "
            why += "instead"
        elif not average.provides(name):
            why = f'needs every rotation, which [model] level = "{average.level}" averages over'
        else:
            continue
        raise ConfigError(
            Problem("[output] record", f'given "{name}": {why}; choose level = "full" to have it')
        )
