"""A potential outside a body by harmonics in axes that turn about its pole at a constant rate.

With u the unit vector from its centre in these axes, r the distance and f_n harmonics of degree n, the
potential sum c_n r^-(n+1) f_n(u) has the gradient

    - sum c_n r^-(n+2) ((n + 1) f_n u + u x (u x grad f_n)).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.harmonics import Harmonics, by_degree, by_powers, polynomial, turning
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import (
    Matrix,
    Vector,
    apply,
    cross,
    dot,
    norm,
    parallel,
    transpose,
    unit_vectors,
)
from rigidsim.scene.bodies.gravity_field import Harmonic

Outward = tuple[list[Symbolic], Symbolic]
"""Unit vector from the centre to the body, and one unit of distance over the distance."""


@dataclass(frozen=True)
class TurningHarmonics:
    """Coefficients in axes of their own.

    Attributes:
        coefficients: of unnormalized harmonics (mpf).
        radius: to which they refer, m (mpf).
        frame: its x (towards longitude 0 at time 0), y and z (its pole), unit vectors of space axes (mpf).
        rate: about the pole, rad/s (mpf).
    """

    coefficients: dict[Harmonic, Any]
    radius: Any
    frame: Matrix
    rate: Any

    @property
    def degree(self) -> int:
        """The highest degree; 0 without any."""
        return max((n for n, _, _ in self.coefficients), default=0)

    @property
    def zonal(self) -> bool:
        """Whether it is symmetric about its pole."""
        return all(m == 0 for _, m, _ in self.coefficients)

    @property
    def rests(self) -> bool:
        """Whether it doesn't depend on time."""
        return self.zonal or self.rate == 0

    def _turn(self, m: Kinematics) -> tuple[Symbolic, Symbolic] | None:
        """Cosine and sine of the angle by which its axes have turned; None where that doesn't matter."""
        if self.rests:
            return None
        angle = m.number(m.scene.context.ldexp(self.rate, m.scaling.time)) * hy.time
        return hy.cos(angle), hy.sin(angle)

    def inside(self, m: Kinematics, outward: Outward) -> Outward:
        """The same direction in its own axes."""
        space, inverse = outward
        x, y, z = (hy.sum([e * u for e, u in zip(m.fixed(axis), space, strict=True)]) for axis in self.frame)
        if (turn := self._turn(m)) is not None:
            c, s = turn
            x, y = c * x + s * y, c * y - s * x
        return [x, y, z], inverse

    def scalar(self, m: Kinematics, outward: Outward, sizes: Callable[[int], Any]) -> Symbolic:
        """Sum of f_n times a constant (mpf) of each degree and the inverse distance to the power of n + 1."""
        u, inverse = self.inside(m, outward)
        harmonics, parts = Harmonics(u, m.number, m.scene.context), []
        for n, series in by_degree(self.coefficients):
            scaled = {key: sizes(n) * c for key, c in polynomial(series, m.scene.context).items()}
            parts.append((n, harmonics.summed(scaled)))
        return by_powers(parts, inverse, 1)

    def vector(self, m: Kinematics, outward: Outward, sizes: Callable[[int], Any]) -> list[Symbolic]:
        """Sum of (n + 1) f_n u + u x (u x grad f_n) likewise, to the power of n + 2; space axes."""
        u, inverse = self.inside(m, outward)
        context = m.scene.context
        harmonics, radial = Harmonics(u, m.number, context), []
        turned: list[list[tuple[int, Symbolic]]] = [[], [], []]
        for n, series in by_degree(self.coefficients):
            scaled = {key: (n + 1) * sizes(n) * c for key, c in polynomial(series, context).items()}
            radial.append((n, harmonics.summed(scaled)))
            vectors = turning(series, context)
            for axis, part in enumerate(turned):
                along = {key: sizes(n) * vector[axis] for key, vector in vectors.items()}
                if any(c != 0 for c in along.values()):
                    part.append((n, harmonics.summed(along)))
        outwards = by_powers(radial, inverse, 2)
        lever = cross(u, [by_powers(part, inverse, 2) for part in turned])
        x, y, z = (outwards * a + b for a, b in zip(u, lever, strict=True))
        if (turn := self._turn(m)) is not None:
            c, s = turn
            x, y = c * x - s * y, s * x + c * y
        rows = [m.fixed([axis[i] for axis in self.frame]) for i in range(3)]
        return [hy.sum([e * a for e, a in zip(row, (x, y, z), strict=True)]) for row in rows]

    def at(self, context: Any, place: Vector, time: Any) -> Vector:
        """Sum of (R/r)^(n+2) ((n + 1) f_n u + u x (u x grad f_n)) at a place seen from the centre (mpf, m,
        space axes) and a time, s.
        """
        frame = self.frame_at(context, time)
        far = norm(context, place)
        u = [dot(axis, place) / far for axis in frame]
        values, total = Harmonics(u, lambda x: x, context), [context.zero] * 3
        for n, series in by_degree(self.coefficients):
            size = (self.radius / far) ** (n + 2)
            radial = sum((c * values[k] for k, c in polynomial(series, context).items()), context.zero)
            torque = [context.zero] * 3
            for key, vector in turning(series, context).items():
                torque = [a + b * values[key] for a, b in zip(torque, vector, strict=True)]
            pairs = zip(total, u, cross(u, torque), strict=True)
            total = [t + size * ((n + 1) * radial * a + b) for t, a, b in pairs]
        return apply(transpose(frame), total)

    def frame_at(self, context: Any, time: Any) -> Matrix:
        """Its axes at a time."""
        c, s = context.cos(self.rate * time), context.sin(self.rate * time)
        x, y, z = self.frame
        return [
            [c * a + s * b for a, b in zip(x, y, strict=True)],
            [c * b - s * a for a, b in zip(x, y, strict=True)],
            z,
        ]


def frame_of(context: Any, pole: Vector, meridian: Any) -> Matrix:
    """Unit vectors of x, y and z of a body with a pole (of any length), whose longitude 0 is at an angle from
    the ascending node of its equator on the plane XY, or from X if the two coincide.
    """
    pole = [x / norm(context, pole) for x in pole]
    first, _, up = unit_vectors(context)
    node = first if parallel(context, pole, up) else cross(up, pole)
    node = [x / norm(context, node) for x in node]
    c, s = context.cos(meridian), context.sin(meridian)
    first = [c * a + s * b for a, b in zip(node, cross(pole, node), strict=True)]
    return [first, cross(pole, first), pole]
