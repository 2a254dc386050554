"""An oblate body about which another flies: ``figure`` of ``central_gravity``.

With u the unit vector from the source to the body, p its pole, s = u . p, K = G M J2 R'^2 / 2, the body's
mass m, its tensor I in space axes and t its trace, the potential energy is that of the body as a point and by
its shape to second degree,

    U = (K m / r^3) (3 s^2 - 1)
      + (3 K / 2 r^5) (5 (1 - 7 s^2) u . I u + 20 s u . I p - 2 p . I p + t (5 s^2 - 1)).

Its torque is that of ``source_figure``, and its force minus its gradient.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics, inertia_times
from rigidsim.model.load import Load, Term
from rigidsim.model.loads.central_gravity import CentralGravity
from rigidsim.model.loads.source_figure import FigureAttraction, FigureFields
from rigidsim.model.rotations import Symbolic, apply
from rigidsim.scene.arithmetic import Vector, norm, unit_vectors
from rigidsim.scene.effect_parts import EffectPart
from rigidsim.scene.registry import Setting, register_load
from rigidsim.scene.scene import Scene


@dataclass(frozen=True)
class FigureInFlight(FigureAttraction):
    """Torque and force of the oblateness of a point at rest, which unrolled take seconds to compile."""

    wide = True

    def _flown(self, m: Kinematics) -> tuple[Any, Any]:
        """K m over the unit of distance to the power of 3, energy; K over its power of 5, internal (mpf)."""
        context, unit = m.scene.context, self.beside.source_place(m).unit
        size, mass = self.strength * self.size / 2, m.carried(m.scene.body.mass)
        point = context.ldexp(size * mass / unit**3, -m.scaling.energy)
        return point, context.ldexp(size / unit**5, 2 * m.scaling.time)

    def potential(self, m: Kinematics) -> Symbolic | None:
        shaped, inverse = super().potential(m), self.beside.source_place(m).inverse
        _, _, s = self._seen(m)
        point, second = self._flown(m)
        trace = m.number(second * 3 / 2) * self.beside.trace(m) * (5.0 * (s * s) - 1.0)
        flat = m.number(point) * (3.0 * (s * s) - 1.0)
        return m.carried(shaped) + inverse**3 * (flat + inverse**2 * trace)

    def force(self, m: Kinematics) -> list[Term]:
        """Acceleration -(3 K / r^4) ((1 - 5 s^2) u + 2 s p) - (15 K / 2 m r^6) (shape's part)."""
        context, scaling, place = m.scene.context, m.scaling, self.beside.source_place(m)
        towards, p, s = self._seen(m)
        u, s = [-x for x in towards], -s
        turned, turned_pole, trace = inertia_times(m, u), inertia_times(m, p), self.beside.trace(m)

        def product(a: list[Symbolic], b: list[Symbolic]) -> Symbolic:
            return hy.sum([x * y for x, y in zip(a, b, strict=True)])

        a, b, c, ss = product(u, turned), product(u, turned_pole), product(p, turned_pole), s * s
        outward = (63.0 * ss - 7.0) * a - 28.0 * (s * b) + 2.0 * c + (1.0 - 7.0 * ss) * trace
        along = 4.0 * b + 2.0 * (s * trace) - 14.0 * (s * a)
        shape = [
            outward * w + along * x + (2.0 - 14.0 * ss) * y + 4.0 * (s * z)
            for w, x, y, z in zip(u, p, turned, turned_pole, strict=True)
        ]
        size, shift = self.strength * self.size / 2, scaling.time - scaling.speed
        mass = m.carried(m.scene.body.mass)
        first = m.number(context.ldexp(-3 * size / place.unit**4, shift))
        second = m.number(context.ldexp(-15 * size / (2 * mass * place.unit**6), shift + scaling.inertia))
        point = [(1.0 - 5.0 * ss) * x + 2.0 * (s * y) for x, y in zip(u, p, strict=True)]
        inner = [
            place.inverse**4 * (first * x + second * place.inverse**2 * y)
            for x, y in zip(point, shape, strict=True)
        ]
        return list(zip(unit_vectors(context), apply(m.matrix, inner), strict=True))

    def fastest_rate(self, scene: Scene) -> Any:
        return self.beside.fastest_rate(scene)


def refuse_inside(around: Setting, centre: Vector, radius: Any, key: str) -> None:
    """Refuse a body that starts within the radius of the one that attracts it."""
    assert around.position is not None
    far = norm(around.context, [x - a for x, a in zip(around.position, centre, strict=True)])
    if far < radius:
        given, there = (around.context.nstr(x, 6) for x in (radius, far))
        what = f"given {given} m, but the body starts {there} m from the attracting point, where the series "
        raise around.fault(f"{key}.radius", what + "doesn't hold; check both")


@register_load(beside="figure")
class Figures:
    """What ``figure`` brings: a torque along an orbit, with a force in flight."""

    @staticmethod
    def effect_parts(fields: FigureFields) -> Iterator[EffectPart]:
        """See ``SceneLoad``."""
        return FigureAttraction.effect_parts(fields)

    @classmethod
    def beside_of(cls, load: Any, fields: FigureFields, around: Setting) -> Load:
        """See ``SceneLoad``."""
        if isinstance(load, CentralGravity):
            made: Any = FigureInFlight.beside_of(load, fields, around)
            refuse_inside(around, load.position, made.radius, "figure")
            return made
        if load.title == CentralGravity.title:
            what = "given for an attracting body that moves; allowed for one at rest, with position"
            raise around.fault("figure", what)
        return FigureAttraction.beside_of(load, fields, around)
