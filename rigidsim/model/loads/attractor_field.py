"""The gravity of the attracting body beyond a point: ``gravity_field`` of ``central_gravity``.

With u the unit vector from its centre to the body in its own axes, r the distance and f_n its harmonics of
degree n, the body, of mass m, has as a point

    U = -(G M m / r) sum (R/r)^n f_n(u),
    a = -(G M / r^2) sum (R/r)^n ((n + 1) f_n u + u x (u x grad f_n)).

The axes turn about the pole at a constant rate; a field without orders above 0 rests.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.loads.central_gravity import (
    AttractorFieldTable,
    CentralGravity,
    CentralGravityFields,
    coefficients_of,
)
from rigidsim.model.loads.figure_in_flight import refuse_inside
from rigidsim.model.rotations import Symbolic
from rigidsim.model.turning_harmonics import Outward, TurningHarmonics, frame_of
from rigidsim.scene.arithmetic import unit_vectors
from rigidsim.scene.effect_parts import EffectPart
from rigidsim.scene.registry import Setting, register_load
from rigidsim.scene.scene import Scene


@register_load(beside="gravity_field")
@dataclass(frozen=True, kw_only=True)
class AttractorField(Load):
    """Force of the harmonics of a point at rest.

    Attributes:
        beside: the attraction of the point itself.
        field: its harmonics without dimension.
        number: of the load in the config, from 1.
        context: the scene's arithmetic.
    """

    beside: CentralGravity
    field: TurningHarmonics
    number: int
    context: Any

    title = "gravity_field"
    reads = frozenset({"flight"})
    wide = True

    @classmethod
    def beside_of(cls, load: Any, fields: CentralGravityFields, around: Setting) -> Load:
        """See ``SceneLoad``."""
        given, context = fields.gravity_field, around.context
        assert given is not None
        if not isinstance(load, CentralGravity):
            what = "given for an attracting body that moves; allowed for one at rest, with position"
            raise around.fault("gravity_field", what)
        if fields.figure is not None and "2,0" in given.C:
            raise around.fault("gravity_field.C", 'given "2,0" and figure, whose J2 is the same; remove one')
        frame = frame_of(context, [x.at(context) for x in given.pole], given.prime_meridian.at(context))
        field = TurningHarmonics(
            coefficients_of(given, around), given.radius.at(context), frame, given.rate.at(context)
        )
        refuse_inside(around, load.position, field.radius, "gravity_field")
        return cls(beside=load, field=field, number=around.number + 1, context=context)

    @staticmethod
    def effect_parts(fields: CentralGravityFields) -> Iterator[EffectPart]:
        """See ``SceneLoad``."""
        missing = "" if fields.gravity_field else "no gravity_field is given"
        words = "gravity of the attracting body beyond a point"
        keys = [] if fields.gravity_field is None else _by_degree(fields.gravity_field)
        most, wider = max((n for n, _ in keys), default=0), ["field"]
        parts = []
        for n in sorted({n for n, _ in keys})[1:]:
            without = {f"gravity_field.{key}": None for degree, key in keys if degree >= n}
            which = f"degrees {n} to {most}" if n < most else f"degree {n}"
            parts.append(EffectPart(f"field-degree-{n}", f"{which} of that gravity", without, tuple(wider)))
            wider.append(f"field-degree-{n}")
        yield from reversed(parts)
        yield EffectPart("field", words, {"gravity_field": None}, missing=missing)

    def acts(self) -> bool:
        return bool(self.field.coefficients)

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        return self.field.rests

    # --- what it does ---------------------------------------------------------------------------------------

    def _seen(self, m: Kinematics) -> tuple[Outward, Any]:
        """Direction from the centre with the inverse distance, and the unit of that, m (mpf)."""
        context = m.scene.context
        return self.beside.seen(m), context.ldexp(context.one, m.scaling.length)

    def potential(self, m: Kinematics) -> Symbolic | None:
        outward, unit = self._seen(m)
        strength = self.beside.strength * m.carried(m.scene.body.mass) / unit
        strength, ratio = m.scene.context.ldexp(-strength, -m.scaling.energy), self.field.radius / unit
        return self.field.scalar(m, outward, lambda n: strength * ratio**n)

    def force(self, m: Kinematics) -> list[Term]:
        outward, unit = self._seen(m)
        strength, shift = -self.beside.strength / unit**2, m.scaling.time - m.scaling.speed
        strength, ratio = m.scene.context.ldexp(strength, shift), self.field.radius / unit
        parts = self.field.vector(m, outward, lambda n: strength * ratio**n)
        return list(zip(unit_vectors(m.scene.context), parts, strict=True))

    # --- sizes, and what readers are told -------------------------------------------------------------------

    def amplitude(self, scene: Scene) -> Any:
        return scene.context.zero  # no torque

    def fastest_rate(self, scene: Scene) -> Any:
        return scene.context.zero if self.conservative else abs(self.field.rate)


def _by_degree(table: AttractorFieldTable) -> list[tuple[int, str]]:
    """The degree of each coefficient, with its key."""
    found = [(name, key) for name in ("C", "S") for key in getattr(table, name)]
    return [(int(key.partition(",")[0]), f"{name}.{key}") for name, key in found]
