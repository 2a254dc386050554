"""The torque of a source that is oblate itself: ``figure`` of a gravity gradient.

With u the unit vector to the source and p its pole, both in body axes, s = u . p, its J2 and radius R',

    U = (15 G M J2 R'^2 / 2 r^5) ((1 - 7 s^2) u . I u / 2 + 2 s u . I p - p . I p / 5),
    N = (15 G M J2 R'^2 / 2 r^5) ((1 - 7 s^2) u x I u + 2 s (u x I p + p x I u) - (2/5) p x I p),

(Schutz 1981, Celest. Mech. 24, 173; Williams et al. 2001, J. Geophys. Res. 106, 27933), the leading term of
figure against figure. It acts beside the load that has the key, which takes the source as a point.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import heyoka as hy
from pydantic import Field, Tag

from rigidsim.model.earth_pole import earth_pole
from rigidsim.model.gradient import GradientSource, tensor_terms
from rigidsim.model.kinematics import Kinematics, inertia_times
from rigidsim.model.load import Load, Term
from rigidsim.model.load_words import length_text
from rigidsim.model.loads.gravity_field import AttractingFields, least_distance
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.arithmetic import Vector, cross, norm, parallel, unit_vectors
from rigidsim.scene.effect_parts import EffectPart
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.fields import (
    NAME_OR_VECTOR,
    ConfigTable,
    Dimensionless,
    Direction,
    Metre,
    Positive,
    Range,
    name_or_vector,
)
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.registry import Setting
from rigidsim.scene.scene import Scene
from rigidsim.scene.tracing.numbers import plain

EARTH = "iau1976"
_CENTURY = 36525 * 86400.0
_MOST_CENTURIES = 20
"""From J2000: the polynomials' last terms make a degree of the pole there."""


_POSSIBLE = Range(
    lambda x: -1 <= x <= 0.5,
    "-1 (a needle along the pole) to 0.5 (a ring), such as 1.0826e-3 of the Earth (J2 = -C20, unnormalized),",
)


class SourceFigure(ConfigTable):
    """``figure`` of a source: its oblateness."""

    J2: Annotated[Dimensionless, _POSSIBLE] = Field(examples=[1.0826e-3])
    """its unnormalized coefficient J2 = -C20"""
    radius: Positive[Metre] = Field(examples=["6378.137 km"])
    """its equatorial radius, to which J2 refers"""
    pole: Annotated[
        Annotated[Literal["iau1976"], Tag(NAME_OR_VECTOR[0])] | Annotated[Direction, Tag(NAME_OR_VECTOR[1])],
        name_or_vector('"iau1976" (the Earth\'s, by precession and nutation) or a vector in space axes'),
    ] = Field(examples=["iau1976", [0, 0, 1]])
    """direction of its axis of figure: a vector in space axes, or iau1976, the Earth's of date"""


class FigureFields(AttractingFields):
    """Keys of a load whose source may be oblate."""

    figure: SourceFigure | None = Field(
        None,
        description="oblateness of the source itself: torque on the body's figure, and force in flight",
        examples=[{"J2": 1.0826e-3, "radius": "6378.137 km", "pole": "iau1976"}],
    )


@dataclass(frozen=True, kw_only=True)
class FigureAttraction(Load):
    """Torque of the source's oblateness on the body's inertia.

    Attributes:
        beside: the load by the same source as a point.
        strength: G M of the source, m^3/s^2 (mpf).
        size: its J2 R'^2, m^2 (mpf).
        radius: R', m (mpf).
        pole: unit vector (mpf, space axes) that rests; None for the Earth's.
        number: of the load in the config, from 1.
        epoch, axes: date of time 0 and the space axes, for the Earth's.
        context: the scene's arithmetic.
    """

    beside: Any
    strength: Any
    size: Any
    radius: Any
    pole: Vector | None
    number: int
    context: Any
    epoch: Epoch | None = None
    axes: str | None = None

    title = "figure"
    unaveraged = "the figure of a source has no average", "leave figure out"

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return frozenset(self.beside.reads)

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        return bool(self.beside.conservative) and self.pole is not None

    @property
    def orbit(self) -> KeplerOrbit | None:  # type: ignore[override]
        return self.beside.orbit

    @property
    def table(self) -> TabulatedOrbit | None:  # type: ignore[override]
        return self.beside.table

    @property
    def corotating_orbit(self) -> KeplerOrbit | None:  # type: ignore[override]
        """The orbit of the source, if its pole is along the orbit's normal."""
        orbit = self.beside.corotating_orbit
        if orbit is None or self.pole is None:
            return None
        return orbit if parallel(self.context, orbit.normal(self.context), self.pole) else None

    def acts(self) -> bool:
        return bool(self.size != 0)

    # --- what it does ---------------------------------------------------------------------------------------

    def _seen(self, m: Kinematics) -> tuple[list[Symbolic], list[Symbolic], Symbolic]:
        """u and p in body axes, and s."""
        u = m.carried(self.beside.source_direction(m))
        if self.pole is not None:
            space = m.fixed(self.pole)
        else:
            space = earth_pole(m, m.carried(self.epoch), m.carried(self.axes))
        p = m.seen(space)
        return u, p, hy.sum([a * b for a, b in zip(u, p, strict=True)])

    def _strength(self, m: Kinematics) -> tuple[Any, Symbolic | None]:
        """15 G M J2 R'^2 / 2 r^5 in internal units: a constant (mpf), and the factor by which it varies."""
        place, context = self.beside.source_place(m), m.scene.context
        value = 15 * self.strength * self.size / (2 * place.unit**5)
        constant = place.inverse == hy.expression(1.0)
        return context.ldexp(value, 2 * m.scaling.time), None if constant else place.inverse**5

    def torque(self, m: Kinematics) -> list[Term]:
        u, p, s = self._seen(m)
        strength, factor = self._strength(m)
        shrunk, fifths = 1.0 - 7.0 * (s * s), m.number(m.scene.context.mpf(2) / 5)
        if m.shape is not None:
            turned, turned_pole = inertia_times(m, u), inertia_times(m, p)
            mixed = [x + y for x, y in zip(cross(u, turned_pole), cross(p, turned), strict=True)]
            sums = [
                shrunk * a + 2.0 * (s * b) - fifths * c
                for a, b, c in zip(cross(u, turned), mixed, cross(p, turned_pole), strict=True)
            ]
            parts = sums if factor is None else [factor * x for x in sums]
            return [
                ([strength * x for x in unit], y)
                for unit, y in zip(unit_vectors(m.scene.context), parts, strict=True)
            ]
        # the tensor (1 - 7 s^2) u u + 2 s (u p + p u) - (2/5) p p is the symmetric part of u v - (2/5) p p
        v = [shrunk * a + 4.0 * (s * b) for a, b in zip(u, p, strict=True)]

        def element(a: int, j: int) -> Symbolic:
            found = 0.5 * (u[a] * v[j] + u[j] * v[a]) - fifths * (p[a] * p[j])
            return found if factor is None else factor * found

        return tensor_terms(m, strength, element)

    def potential(self, m: Kinematics) -> Symbolic | None:
        u, p, s = self._seen(m)
        strength, factor = self._strength(m)
        turned, turned_pole = inertia_times(m, u), inertia_times(m, p)

        def product(a: list[Symbolic], b: list[Symbolic]) -> Symbolic:
            return hy.sum([x * y for x, y in zip(a, b, strict=True)])

        fifth = m.number(m.scene.context.one / 5)
        inner = 0.5 * ((1.0 - 7.0 * (s * s)) * product(u, turned)) + 2.0 * (s * product(u, turned_pole))
        inner = m.number(strength) * (inner - fifth * product(p, turned_pole))
        return inner if factor is None else factor * inner

    # --- what it conserves ----------------------------------------------------------------------------------

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """True: the tensor of a symmetric body has no torque about its axis."""
        return True

    # --- sizes, and what readers are told -------------------------------------------------------------------

    def amplitude(self, scene: Scene) -> Any:
        """15 G M J2 R'^2 / r^5 times the difference of moments, more than any direction of u and p gives."""
        moments, context = scene.body.principal_moments, scene.context
        difference = context.maximum(moments) - context.minimum(moments)
        near = least_distance(self.beside, scene)
        return 15 * self.strength * abs(self.size) / near**5 * difference

    @staticmethod
    def effect_parts(fields: FigureFields) -> Iterator[EffectPart]:
        missing = "" if fields.figure else "no figure is given"
        yield EffectPart("figure", "oblateness of the source itself", {"figure": None}, missing=missing)

    @classmethod
    def beside_of(cls, load: Any, fields: FigureFields, around: Setting) -> Load:
        """See ``SceneLoad``."""
        given, context = fields.figure, around.context
        assert given is not None
        radius = given.radius.at(context)
        if isinstance(load, GradientSource) and load.placement.nearest(context) < radius:
            near = length_text(float(plain(load.placement.nearest(context))))
            what = (
                f"given {length_text(float(plain(radius)))}, but the source comes to {near} from the body, "
            )
            raise around.fault("figure.radius", what + "which would be within it; check both")
        strength = getattr(load, "gravitational_parameter", None) or load.strength
        made = cls(
            beside=load, strength=strength, size=given.J2.at(context) * radius**2, radius=radius, pole=None,
            number=around.number + 1, context=context,
        )  # fmt: skip
        if isinstance(given.pole, str):
            known = (
                ("[time] epoch", around.epoch, 'epoch = "2000-01-01T12:00:00 TDB"'),
                ("[frame] axes", around.axes, 'axes = "ICRF"'),
            )
            for what, found, example in known:
                if found is None:
                    why = f'given "{EARTH}", a pole of date, which takes {what}; give {example}, or a vector'
                    raise around.fault("figure.pole", why)
            _refuse_other_pole(getattr(fields, "source", None), around)
            return replace(made, epoch=around.epoch, axes=around.axes)
        pole = [x.at(context) for x in given.pole]
        size = norm(context, pole)
        return replace(made, pole=[x / size for x in pole])


def _refuse_other_pole(source: str | None, around: Setting) -> None:
    """Refuse the Earth's pole for another body, and beyond the centuries that its polynomials are for."""
    if source not in (None, "earth", "399", "earth_moon_barycenter"):
        what = f'given "{EARTH}", the Earth\'s pole, for the source "{source}"; give its own as a vector'
        raise around.fault("figure.pole", what)
    if around.epoch is not None:
        ahead = float(around.epoch.since_j2000())
        far = max(abs(float(plain(t)) + ahead) for t in (around.start, around.end)) / _CENTURY
        if far > _MOST_CENTURIES:
            what = (
                f'given "{EARTH}" for a run that goes {far:.3g} centuries from J2000; its precession holds '
            )
            what += f"for {_MOST_CENTURIES}: give a shorter run, or a vector"
            raise around.fault("figure.pole", what)
