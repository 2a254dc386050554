"""Attraction of the body by a point, to second degree (MacCullagh):

U = -G M m / r - (G M / 2 r^3) (tr I - 3 c . I c),   c = R^T r/|r| from the point to the body.
"""

from __future__ import annotations

from typing import Any

from rigidsim.model.gradient import gradient_terms
from rigidsim.model.kinematics import Kinematics, inertia_times, quadratic_form
from rigidsim.model.load import Load, Term
from rigidsim.model.rotations import Symbolic, apply, transpose
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.registry import Surroundings


class PointAttraction(Load):
    """Base of loads by a point that may come near, at rest or moving."""

    has_source = True

    @property
    def strength(self) -> Any:
        """Gravitational parameter of the point, m^3/s^2 (mpf)."""
        raise NotImplementedError

    def seen(self, m: Kinematics) -> tuple[list[Symbolic], Symbolic]:
        """Unit direction from the point to the body, space axes, and 1/r (1/length)."""
        raise NotImplementedError

    def source_direction(self, m: Kinematics) -> list[Symbolic]:
        return [-x for x in self._seen_from_body(m)[0]]

    def torque(self, m: Kinematics) -> list[Term]:
        """Torque (3 G M / r^3) c x (I c)."""
        body, inverse = self._seen_from_body(m)
        return gradient_terms(m, body, self.scaled(m, 3, 2 * m.scaling.time), inverse**3)

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """True: c x (I c) has no component along an axis of symmetry."""
        return True

    def scaled(self, m: Kinematics, length_power: int, extra: int) -> Any:
        """G M over length^power times 2^extra, internal units."""
        return m.scene.context.ldexp(self.strength, extra - length_power * m.scaling.length)

    def pull(self, m: Kinematics, *, as_point: bool) -> tuple[list[Symbolic], list[Symbolic]]:
        """Minus the body's acceleration, as a sum of parts along the direction and along R I c:

        (G M / r^2 + (3 G M / 2 m r^4) (tr I - 5 c . I c)) R c  and  (3 G M / m r^4) R I c.

        Args:
            as_point: whether the first part includes the attraction of the body as a point.
        """
        space, inverse = self.seen(m)
        body, scaling = apply(transpose(m.matrix), space), m.scaling
        shift = scaling.time - scaling.speed
        ratio = self.scaled(m, 4, shift + scaling.inertia) * 3 / (2 * m.carried(m.scene.body.mass))
        second = m.number(ratio) * inverse**4
        radial = second * (self._trace(m) - 5.0 * quadratic_form(m, body))
        if as_point:
            radial = m.number(self.scaled(m, 2, shift)) * inverse**2 + radial
        turned = apply(m.matrix, inertia_times(m, body))
        return [radial * x for x in space], [2.0 * second * y for y in turned]

    def second_degree(self, m: Kinematics) -> Symbolic:
        """Minus the potential energy by the body's shape."""
        body, inverse = self._seen_from_body(m)
        second = self.scaled(m, 3, m.scaling.inertia - m.scaling.energy) / 2
        return m.number(second) * inverse**3 * (self._trace(m) - 3.0 * quadratic_form(m, body))

    def as_point(self, m: Kinematics) -> Symbolic:
        """Minus the potential energy of the body as a point."""
        point = self.scaled(m, 1, -m.scaling.energy) * m.carried(m.scene.body.mass)
        return m.number(point) * self.seen(m)[1]

    def _seen_from_body(self, m: Kinematics) -> tuple[list[Symbolic], Symbolic]:
        space, inverse = self.seen(m)
        return apply(transpose(m.matrix), space), inverse

    def _trace(self, m: Kinematics) -> Any:
        return m.number(sum(m.numbers.inertia[i][i] for i in range(3)))


def positive_strength(given: Any, around: Surroundings) -> Any:
    """A gravitational parameter, m^3/s^2 (mpf); refused if it is missing or isn't positive."""
    if given is None:
        raise around.fault("gravitational_parameter", "missing; it is needed")
    if given.sign <= 0:
        raise around.fault("gravitational_parameter", f"given {float(given):g}; a positive number is allowed")
    return given.at(around.context)
