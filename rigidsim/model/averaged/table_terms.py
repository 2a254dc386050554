"""The torque of a source on a tabulated orbit, averaged over the orbit.

The terms are those of ``orbit_terms`` with the instantaneous axis, eccentricity and plane. If the pericentre
goes round, second-order terms that go round with it are periodic and left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import heyoka as hy

from rigidsim.model.averaged.orbit_terms import Ellipse, OrbitPlace, equinoctial_axes, nutation, turned
from rigidsim.model.orbits.kepler_states import OrbitStates
from rigidsim.model.orbits.table_states import ElementStates, TablePlace, element_states
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.two_part import as_factor, rounded
from rigidsim.scene.arithmetic import dot
from rigidsim.scene.orbit_tables.pieces import AXIS, TabulatedOrbit


@dataclass(frozen=True)
class TableTerms:
    """A tabulated orbit as an average uses it."""

    states: ElementStates
    number: Rounder

    @classmethod
    def of(
        cls, table: TabulatedOrbit, place: TablePlace, time_exponent: int, start: Any, number: Rounder
    ) -> TableTerms:
        """Carry the orbit's elements: see ``element_states``."""
        return cls(element_states(table, place, time_exponent, start, number), number)

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
        """Orbit states like those of a motion that resolves the orbit; without a direction if the position is
        unknown.
        """
        at, states = self.place, self.states
        if at is None:
            return OrbitStates(states.block, [], states.normal, hy.expression(1.0))
        e = self.ellipse.eccentricity
        inverse = 1.0 / (1.0 - e * at.cosine)
        x, y = (at.cosine - e) * inverse, self.ellipse.root * at.sine * inverse
        direction = [x * p + y * t for p, t in zip(at.pericentre, at.across, strict=True)]
        return OrbitStates(states.block, direction, states.normal, inverse / self._value(AXIS))

    def secular(self, rate: Any, s: list[Symbolic]) -> list[Symbolic]:
        """Vector whose cross product with s is s', to second order.

        Args:
            rate: k at the mean axis, per internal unit of time (mpf).
        """
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
