"""Mechanics of an averaged motion: directions of the body's axes in space, but no rotation about them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import heyoka as hy

from rigidsim.model.averaged.average import DIRECTION, Average
from rigidsim.model.averaged.orbit_terms import (
    Ellipse,
    OrbitPlace,
    TableTerms,
    nutation,
    second_order,
)
from rigidsim.model.averaged.sources import Source
from rigidsim.model.load import Load, Term
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.orbits.prescribed import OrbitStates, element_states
from rigidsim.model.rotations import Symbolic
from rigidsim.model.state_blocks import StateBlock
from rigidsim.model.two_part import as_factor
from rigidsim.scene.arithmetic import cosine_and_sine, cross, dot
from rigidsim.scene.kepler import plane_vectors
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit

_LIGHT = 299792458  # m/s


@dataclass(frozen=True)
class AveragedMechanics(Mechanics):
    """Mechanics of an averaged motion; ``rates`` is the rate at which the momentum turns, in space axes."""

    average: Average | None = None

    @property
    def of(self) -> Average:
        """The average that is carried."""
        return self.carried(self.average)

    @property
    def unit(self) -> Any:
        """Internal unit of time, s (mpf)."""
        return self.scene.context.ldexp(self.scene.context.one, self.scaling.time)

    @property
    def turning_rate(self) -> Any:
        return self.of.rate_bound

    def tells(self, name: str) -> bool:
        return self.of.tells(name)

    @property
    def kept_by_average(self) -> str | None:
        if self.of.driven is not None or self.of.resonance is not None:
            return None
        return "averaged over the free rotation, a gravity gradient has no torque along the momentum"

    @property
    def conserves_energy(self) -> bool:
        """False: the energy of the free rotation is a constant."""
        return False

    # --- where the sources are ------------------------------------------------------------------------------

    def orbit(self, orbit: KeplerOrbit) -> OrbitStates:
        """See ``Kinematics``; here a function of time, without states.

        The digits that the phase loses as time goes on shift the direction only in proportion to the
        nutation, and a torque without states of its own allows steps twice as long.
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
        mean = self._moving(orbit.mean_anomaly, orbit.mean_motion)
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
        moving = self._moving(angle, rate)
        return hy.cos(moving), hy.sin(moving)

    def _moving(self, angle: Any, rate: Any) -> Symbolic:
        """An angle that advances uniformly."""
        start = hy.expression(self.number(angle))
        if rate == 0:
            return start
        return start + self.number(rate * self.unit) * hy.time

    @cached_property
    def _by_table(self) -> dict[TabulatedOrbit, TableTerms]:
        """For each table, its contribution to an average over orbits."""
        given, number = (self.scaling.time, self.scene.start, self.number), self.number
        return {x: TableTerms(element_states(x, at, *given), number) for x, at in self.tables.items()}

    def table(self, orbit: TabulatedOrbit) -> OrbitStates:
        """Averaged over the orbit it has no direction unless the mean longitude is carried."""
        return self._by_table[orbit].seen if self.of.over_orbits else super().table(orbit)

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
        if self.of.over_orbits:
            return cross(total([self._secular(source) for source in self.of.sources] + geodetic), s)
        pull = self._pull(s)
        if self.of.figure == 0 or not self._second:
            return cross(total([pull, *geodetic]), s)
        # the torque acts on the circled axis, which is offset from the momentum by d = -a s x s'; to second
        # order this gives (G - a G^2 + 2 a (s . G s) G) s x s for a pull G s
        context = self.scene.context
        moment = self.of.motion.transverse / self.of.motion.momentum
        a = as_factor(self.number(context.ldexp(moment, -self.scaling.time)))
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
        eq. 40.33).
        """
        found = []
        for source in self.of.sources if self.scene.config.model.geodetic_precession else ():
            if source.has_elements:
                context = self.scene.context
                ellipse = source.ellipse(context, self.scene.start)
                strength = source.of.gravitational_parameter / source.of.placement.distance(context)
                size = 3 * strength * ellipse.motion / (2 * _LIGHT**2 * (1 - ellipse.square))
                table = source.of.table
                seen = self.orbit(self.carried(source.of.orbit)) if table is None else self.table(table)
                factor = as_factor(self.number(size * self.unit))
                found.append([factor * x for x in seen.normal])
        return found

    def _secular(self, source: Source) -> list[Symbolic]:
        """Secular pull -(k/2) (1 - e^2)^(-3/2) (n . s) n to second order; the pull of a source at rest."""
        context, s = self.scene.context, self.direction
        if source.of.table is not None:
            rate, table = self.of.rate(source) * self.unit, self._by_table[source.of.table]
            return table.secular(rate, s, second=self._second)
        if source.of.orbit is None:
            return self._pull_of(source, s)
        normal = self.orbit(source.of.orbit).normal
        size = source.secular_strength(context) * self.of.motion.excess / self.of.motion.momentum
        factor = as_factor(self.number(-size * self.unit)) * dot(normal, s)
        if not self._second:
            return [factor * x for x in normal]
        second = self._second_order(source, normal)
        return [factor * x + y for x, y in zip(normal, second, strict=True)]

    def _second_order(self, source: Source, normal: list[Symbolic]) -> list[Symbolic]:
        """Second-order term grad K of ``rigidsim.model.averaged.orbit_terms``."""
        orbit, s = source.of.orbit, self.direction
        assert orbit is not None
        context = self.scene.context
        steady, across = second_order(float(orbit.eccentricity))
        size = self.of.rate(source) ** 2 / (4 * orbit.mean_motion) * self.unit
        z = dot(normal, s)
        factor = self.number(size * context.mpf(across)) * (1.0 - 3.0 * (z * z))
        gradient = [factor * x for x in normal]
        if orbit.circular or not orbit.fixed_plane:  # where the pericentre moves, the rest is periodic
            return gradient
        at = source.place(context, self.scene.start)
        p, t = ([as_factor(self.number(c)) for c in vector] for vector in (at.pericentre, at.across))
        x, y = dot(p, s), dot(t, s)
        more = self.number(size * context.mpf(steady))
        towards = zip(gradient, normal, p, t, strict=True)
        return [g + more * ((x * x - y * y) * n + 2.0 * (z * (x * a - y * b))) for g, n, a, b in towards]

    def _pull(self, s: list[Symbolic]) -> list[Symbolic]:
        """G s, the sum of k (a/r)^3 (s . r) r, per internal unit of time; s' is its cross product with s."""
        return total([self._pull_of(source, s) for source in self.of.sources])

    def _pull_of(self, source: Source, s: list[Symbolic]) -> list[Symbolic]:
        place, distance = source.of.placement.seen(self), source.of.placement.distance(self.scene.context)
        factor = self._strength(source) * dot(place.line, s) * place.inverse**3
        if place.unit != distance:
            factor = self.number((distance / place.unit) ** 3) * factor
        return [factor * x for x in place.line]

    def _strength(self, source: Source) -> Symbolic:
        return as_factor(self.number(self.of.rate(source) * self.unit))

    # --- what is recorded -----------------------------------------------------------------------------------

    @cached_property
    def _axes(self) -> tuple[list[Symbolic], list[Symbolic], list[Symbolic]]:
        """Directions of momentum, figure and spin axis, of unit length to first order, space axes."""
        mean = self.direction
        lost = [hy.expression(float("nan"))] * 3
        momentum, sign = mean, self.of.figure
        if not self.of.short_period:
            figure = [float(sign) * x for x in mean] if sign else lost
            return mean, figure, mean
        if self.of.over_orbits:
            for source in self.of.sources:
                if source.has_elements:
                    more = self._nutation(source, mean)
                    momentum = [x + y for x, y in zip(momentum, more, strict=True)]
        if not sign:
            return momentum, lost, momentum
        # the circled axis is offset from the momentum by -a s x s', as above
        context, motion = self.scene.context, self.of.motion
        offset = context.ldexp(-(motion.transverse / motion.momentum), -self.scaling.time)
        factor = as_factor(self.number(offset))
        away = [factor * x for x in cross(momentum, cross(self._pull(momentum), momentum))]
        ratio = self.number(1 - motion.moments[2] / motion.transverse)
        figure = [float(sign) * (x + d) for x, d in zip(momentum, away, strict=True)]
        spin = [x + ratio * d for x, d in zip(momentum, away, strict=True)]
        return momentum, figure, spin

    def _nutation(self, source: Source, s: list[Symbolic]) -> list[Symbolic]:
        """Nutation with the period of a source's orbit, rad."""
        context, rate = self.scene.context, self.of.rate(source)
        if source.of.table is not None:
            return self._by_table[source.of.table].nutation(rate * self.unit, s)
        assert source.of.orbit is not None
        ellipse = Ellipse.of(context, source.of.orbit)
        size = self.number(rate / (2 * ellipse.motion * ellipse.root**3))
        return nutation(hy, ellipse, self._place(source.of.orbit), size, s, self.number)

    @cached_property
    def momentum_size(self) -> Any:
        context = self.scene.context
        return self.number(context.ldexp(self.of.motion.momentum, -self.scaling.momentum))

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
        """Energy of the free rotation, a constant."""
        context = self.scene.context
        return hy.expression(self.number(context.ldexp(self.of.energy, -self.scaling.energy)))

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
