"""Positions of the sources of an averaged motion: Kepler orbits as functions of time, tables by their
elements.

The terms of a table are those of ``orbit_terms`` with the instantaneous axis, eccentricity and plane. If the
pericentre goes round, second-order terms that go round with it are periodic and left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import heyoka as hy

from rigidsim.model.averaged.average import Average
from rigidsim.model.averaged.orbit_terms import (
    Ellipse,
    OrbitPlace,
    equinoctial_axes,
    nutation,
    plane_vectors,
    turned,
)
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.orbits.prescribed import ElementStates, OrbitStates, element_states
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.state_blocks import StateBlock
from rigidsim.model.two_part import as_factor, rounded
from rigidsim.scene.arithmetic import dot
from rigidsim.scene.orbit_tables.pieces import AXIS, TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit


@dataclass(frozen=True)
class TableTerms:
    """A tabulated orbit as an average uses it."""

    states: ElementStates
    number: Rounder

    def _value(self, element: str) -> Symbolic:
        return rounded(self.states.values[element])

    @cached_property
    def _cubed(self) -> Symbolic:
        """(mean axis / axis)^3."""
        axis = self._value(AXIS)
        return 1.0 / (axis * axis * axis)

    @cached_property
    def ellipse(self) -> Ellipse:
        """Ellipse of the moment, its mean motion per internal unit of time."""
        k, h = self._value("k"), self._value("h")
        square = k * k + h * h
        return Ellipse(hy.sqrt(square), square, hy.sqrt(1.0 - square), rounded(self.states.pace), False)

    @cached_property
    def place(self) -> OrbitPlace | None:
        """Position of the source; None if the mean longitude isn't carried."""
        longitude = self.states.mean_longitude
        if longitude is None:
            return None
        q, p = self._value("q"), self._value("p")
        periapsis = hy.atan2(self._value("h"), self._value("k"))
        anomaly = hy.kepE(self.ellipse.eccentricity, longitude - periapsis)
        axes = equinoctial_axes(q, p, hy.sqrt(1.0 - p * p - q * q))
        vectors = turned(axes, (hy.cos(periapsis), hy.sin(periapsis)))
        return OrbitPlace(hy.cos(anomaly), hy.sin(anomaly), *vectors)

    @cached_property
    def seen(self) -> OrbitStates:
        """Orbit states as where the orbit is resolved; no direction if the position is unknown."""
        at, states = self.place, self.states
        if at is None:
            return OrbitStates(states.block, [], states.normal, hy.expression(1.0))
        e = self.ellipse.eccentricity
        inverse = 1.0 / (1.0 - e * at.cosine)
        x, y = (at.cosine - e) * inverse, self.ellipse.root * at.sine * inverse
        direction = [x * p + y * t for p, t in zip(at.pericentre, at.across, strict=True)]
        return OrbitStates(states.block, direction, states.normal, inverse / self._value(AXIS))

    def secular(self, rate: Any, s: list[Symbolic]) -> list[Symbolic]:
        """Vector whose product with s is s', to second order; k (mpf) is that at the mean axis."""
        normal, ellipse = self.states.normal, self.ellipse
        z = dot(normal, s)
        first = as_factor(self.number(-rate)) * (ellipse.secular_factor * self._cubed * z)
        # (k^2 / 4) c1 (1 - 3 z^2)
        across = ellipse.across * (self._cubed * self._cubed) / ellipse.motion
        second = as_factor(self.number(rate * rate / 4)) * (across * (3.0 * (z * z) - 1.0))
        factor = first + second
        return [factor * x for x in normal]

    def nutation(self, rate: Any, s: list[Symbolic]) -> list[Symbolic]:
        """See ``orbit_terms.nutation``; ``rate`` as above."""
        assert self.place is not None
        root = self.ellipse.root
        size = self._cubed / (self.ellipse.motion * (root * root * root))
        factor = as_factor(self.number(rate / 2)) * size
        return nutation(hy, self.ellipse, self.place, factor, s, lambda x: x)


@dataclass(frozen=True)
class SourcesSeen(Mechanics):
    """The part of an averaged motion's mechanics that locates the sources."""

    average: Average | None = None

    @property
    def of(self) -> Average:
        """The average that is carried."""
        return self.carried(self.average)

    def orbit(self, orbit: KeplerOrbit) -> OrbitStates:
        """See ``Kinematics``; here a function of time, without states.

        The digits that the phase loses as time goes on shift the direction only in proportion to the
        nutation, and a torque without states of its own allows steps twice as long.
        """
        at = self._place(orbit)
        if orbit.circular:
            inverse, x, y = hy.expression(1.0), at.cosine, at.sine
        else:
            context, e = self.scene.context, orbit.eccentricity
            inverse = 1.0 / (1.0 - self.number(e) * at.cosine)
            x = (at.cosine - self.number(e)) * inverse
            y = self.number(context.sqrt(1 - e * e)) * at.sine * inverse
        direction = [x * p + y * t for p, t in zip(at.pericentre, at.across, strict=True)]
        return OrbitStates(StateBlock([], [], []), direction, self._normal(orbit), inverse)

    def _place(self, orbit: KeplerOrbit) -> OrbitPlace:
        """Position of a source on its orbit."""
        mean = self._moving(orbit.mean_anomaly, orbit.mean_motion)
        e = hy.expression(self.number(orbit.eccentricity))
        anomaly = mean if orbit.circular else hy.kepE(e, mean)
        vectors = plane_vectors(
            self._turned(orbit.inclination, 0),
            self._turned(orbit.ascending_node, orbit.node_rate),
            self._turned(orbit.periapsis, orbit.periapsis_rate),
        )
        return OrbitPlace(hy.cos(anomaly), hy.sin(anomaly), *vectors)

    def _normal(self, orbit: KeplerOrbit) -> list[Symbolic]:
        c, s = self._turned(orbit.inclination, 0)
        node_c, node_s = self._turned(orbit.ascending_node, orbit.node_rate)
        return [node_s * s, -(node_c * s), c]

    def _in_plane(self, orbit: KeplerOrbit) -> tuple[Symbolic, Symbolic, Symbolic | None]:
        """Position over a, from the node, and a/r if it varies."""
        mean = self._moving(orbit.mean_anomaly, orbit.mean_motion)
        if orbit.circular:
            return hy.cos(mean), hy.sin(mean), None
        context, e = self.scene.context, orbit.eccentricity
        anomaly = hy.kepE(hy.expression(self.number(e)), mean)
        c, sine = hy.cos(anomaly), hy.sin(anomaly)
        x, y = c - self.number(e), self.number(context.sqrt(1 - e * e)) * sine
        w_c, w_s = self._turned(orbit.periapsis, orbit.periapsis_rate)
        return w_c * x - w_s * y, w_s * x + w_c * y, 1.0 / (1.0 - self.number(e) * c)

    def _turned(self, angle: Any, rate: Any) -> tuple[Symbolic, Symbolic]:
        """Cosine and sine of an angle that advances uniformly."""
        if rate == 0:
            context = self.scene.context
            return as_factor(self.number(context.cos(angle))), as_factor(self.number(context.sin(angle)))
        moving = self._moving(angle, rate)
        return hy.cos(moving), hy.sin(moving)

    def _moving(self, angle: Any, rate: Any) -> Symbolic:
        """An angle that advances uniformly."""
        start = hy.expression(self.number(angle))
        if rate == 0:
            return start
        unit = self.scene.context.ldexp(self.scene.context.one, self.scaling.time)
        return start + self.number(rate * unit) * hy.time

    @cached_property
    def _by_table(self) -> dict[TabulatedOrbit, TableTerms]:
        """For each table, its contribution to an average over orbits."""
        return {
            table: TableTerms(
                element_states(table, place, self.scaling.time, self.scene.start, self.number), self.number
            )
            for table, place in self.tables.items()
        }

    def table(self, orbit: TabulatedOrbit) -> OrbitStates:
        """Averaged over the orbit it has no direction unless the mean longitude is carried."""
        return self._by_table[orbit].seen if self.of.over_orbits else super().table(orbit)

    def table_block(self, table: TabulatedOrbit) -> StateBlock:
        """The states of a tabulated orbit."""
        return self.table(table).block
