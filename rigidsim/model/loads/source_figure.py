"""The oblateness of a source: ``figure`` of a load.

With u the unit vector between source and body, p the pole of the source, s = u . p, K = G M J2 R'^2 / 2, the
mass m of the body, its tensor I and t its trace, the potential energy, as a point and by shape to second
degree, is

    U = (K m / r^3) (3 s^2 - 1)
      + (3 K / 2 r^5) (5 (1 - 7 s^2) u . I u + 20 s u . I p - 2 p . I p + t (5 s^2 - 1)),

the leading term of figure against figure (Schutz 1981, Celest. Mech. 24, 173; Williams et al. 2001,
J. Geophys. Res. 106, 27933). The terms without I have no torque and act in flight alone. The torque is

    N = (15 K / r^5) ((1 - 7 s^2) u x I u + 2 s (u x I p + p x I u) - (2/5) p x I p).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field, Tag

from rigidsim.model.earth_pole import earth_pole
from rigidsim.model.kinematics import Kinematics, inertia_times
from rigidsim.model.load import Load, Term
from rigidsim.model.load_words import length_text
from rigidsim.model.loads.attraction import (
    Attraction,
    ByPlacedSource,
    along_axes,
    moments_range,
    tensor_terms,
    trace,
)
from rigidsim.model.placements.placement import SourcePlace
from rigidsim.model.rotations import Symbolic, along, apply
from rigidsim.scene.arithmetic import Vector, cross, norm, parallel
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
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.registry import Setting, register_load
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


class SourceFigureTable(ConfigTable):
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


@register_load(beside="figure")
@dataclass(frozen=True, kw_only=True)
class SourceFigure(ByPlacedSource):
    """Torque of the source's oblateness on the body's inertia, and in flight its force.

    Attributes:
        size: its J2 R'^2, m^2 (mpf).
        pole: unit vector (mpf, space axes) that rests; None for the Earth's.
        epoch, axes: date of time 0 and the space axes, for the Earth's.
    """

    size: Any
    pole: Vector | None
    epoch: Epoch | None = None
    axes: str | None = None

    title = "figure"
    unaveraged = "the figure of a source has no average", "leave figure out"
    reacts = False

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        return self.placement.rests and self.pole is not None

    @property
    def wide(self) -> bool:  # type: ignore[override]
        """Unrolled, the force takes seconds to compile."""
        return self.pulls

    @property
    def corotating_orbit(self) -> KeplerOrbit | None:  # type: ignore[override]
        """The orbit of the source, if its pole is along the orbit's normal."""
        orbit, context = super().corotating_orbit, self.size.context
        if orbit is None or self.pole is None or not parallel(context, orbit.normal(context), self.pole):
            return None
        return orbit

    def acts(self) -> bool:
        return bool(self.size != 0)

    def _seen(self, m: Kinematics) -> tuple[list[Symbolic], list[Symbolic], Symbolic, SourcePlace]:
        """u and p in body axes, s, and the source's place."""
        u, place = self.seen(m)
        if self.pole is not None:
            p = m.seen(m.fixed(self.pole))
        else:
            p = m.seen(earth_pole(m, m.carried(self.epoch), m.carried(self.axes)))
        return u, p, along(u, p), place

    def _per_distance(self, m: Kinematics, place: SourcePlace, power: int, exponent: int) -> Any:
        """K over the unit of distance to a power, times 2^exponent (mpf)."""
        return self.size / 2 * self.per_distance(m, place, power, exponent)

    def torque(self, m: Kinematics) -> list[Term]:
        u, p, s, place = self._seen(m)
        strength, factor = 15 * self._per_distance(m, place, 5, 2 * m.scaling.time), place.inverse**5
        fifths = m.number(m.scene.context.mpf(2) / 5)
        # the tensor (1 - 7 s^2) u u + 2 s (u p + p u) - (2/5) p p is the symmetric part of u v - (2/5) p p
        v = [(1.0 - 7.0 * (s * s)) * a + 4.0 * (s * b) for a, b in zip(u, p, strict=True)]
        if m.shape is not None:
            pairs = ((u, v), (v, u)), ((p, p),)
            mixed, own = ([cross(a, inertia_times(m, b)) for a, b in pair] for pair in pairs)
            sums = [0.5 * (x + y) - fifths * z for x, y, z in zip(*mixed, *own, strict=True)]
            return along_axes(m, strength, [factor * x for x in sums])
        return tensor_terms(
            m,
            strength,
            lambda a, j: factor * (0.5 * (u[a] * v[j] + u[j] * v[a]) - fifths * (p[a] * p[j])),
        )

    def potential(self, m: Kinematics) -> Symbolic | None:
        u, p, s, place = self._seen(m)
        scaling, squared, turned_pole = m.scaling, s * s, inertia_times(m, p)
        inner = 5.0 * ((1.0 - 7.0 * squared) * along(u, inertia_times(m, u)))
        inner = inner + 20.0 * (s * along(u, turned_pole)) - 2.0 * along(p, turned_pole)
        if self.pulls:
            inner = inner + trace(m) * (5.0 * squared - 1.0)
        second = 3 * self._per_distance(m, place, 5, scaling.inertia - scaling.energy) / 2
        energy = m.number(second) * place.inverse**5 * inner
        if self.pulls:
            point = m.carried(m.scene.body.mass) * self._per_distance(m, place, 3, -scaling.energy)
            energy = energy + m.number(point) * place.inverse**3 * (3.0 * squared - 1.0)
        return energy

    def acceleration(self, m: Kinematics) -> tuple[int, list[Symbolic]]:
        """(3 K / r^4) ((1 - 5 s^2) u + 2 s p) + (15 K / 2 m r^6) (shape's part), u away from the source."""
        u, p, s, place = self._seen(m)
        turned, turned_pole, size, shift = inertia_times(m, u), inertia_times(m, p), trace(m), m.scaling.time
        a, b, c, ss = along(u, turned), along(u, turned_pole), along(p, turned_pole), s * s
        outward = (63.0 * ss - 7.0) * a - 28.0 * (s * b) + 2.0 * c + (1.0 - 7.0 * ss) * size
        aside = 4.0 * b + 2.0 * (s * size) - 14.0 * (s * a)
        shift -= m.scaling.speed
        mass = m.carried(m.scene.body.mass)
        first = m.number(3 * self._per_distance(m, place, 4, shift))
        second = 15 * self._per_distance(m, place, 6, shift + m.scaling.inertia) / (2 * mass)
        point = [(1.0 - 5.0 * ss) * x + 2.0 * (s * y) for x, y in zip(u, p, strict=True)]
        shape = [
            outward * w + aside * x + (2.0 - 14.0 * ss) * y + 4.0 * (s * z)
            for w, x, y, z in zip(u, p, turned, turned_pole, strict=True)
        ]
        factor = m.number(second) * place.inverse**2
        inner = [place.inverse**4 * (first * x + factor * y) for x, y in zip(point, shape, strict=True)]
        return -1 if place.outward else 1, apply(m.matrix, inner)

    def amplitude(self, scene: Scene) -> Any:
        """30 K / r^5 times the difference of moments, more than any direction of u and p gives."""
        near = self.placement.nearest(scene)
        return 15 * self.gravitational_parameter * abs(self.size) / near**5 * moments_range(scene)

    # --- from the config ------------------------------------------------------------------------------------

    @staticmethod
    def effect_parts(fields: Any) -> Iterator[EffectPart]:
        missing = "" if fields.figure else "no figure is given"
        yield EffectPart("figure", "oblateness of the source itself", {"figure": None}, missing=missing)

    @classmethod
    def beside_of(cls, load: Any, fields: Any, around: Setting) -> Load:
        assert isinstance(load, Attraction)
        given, context, placement = fields.figure, around.context, load.placement
        radius = given.radius.at(context)
        if load.pulls:
            refuse_inside(load, radius, "figure", around)
        elif not placement.dynamic and placement.nearest(around) < radius:
            near, far = (length_text(float(plain(x))) for x in (placement.nearest(around), radius))
            what = f"given {far}, but the source comes to {near} from the body, which would be within it; "
            raise around.fault("figure.radius", what + "check both")
        size = given.J2.at(context) * radius**2
        if isinstance(given.pole, str):
            _refuse_pole(fields.source, around)
            return load.part(cls, size=size, pole=None, epoch=around.epoch, axes=around.axes)
        pole = [x.at(context) for x in given.pole]
        far = norm(context, pole)
        return load.part(cls, size=size, pole=[x / far for x in pole])


def refuse_inside(load: Attraction, radius: Any, key: str, around: Setting) -> None:
    """Refuse a radius of the attracting body within which the body starts, and one that moves."""
    if load.attracting_point is None:
        what = "given for an attracting body that moves; allowed for one at rest, with position"
        raise around.fault(key, what)
    far = norm(around.context, load.placement.at_start(around))
    if far < radius:
        given, there = (around.context.nstr(x, 6) for x in (radius, far))
        what = f"given {given} m, but the body starts {there} m from the attracting point, where the series "
        raise around.fault(f"{key}.radius", what + "doesn't hold; check both")


def _refuse_pole(source: str | None, around: Setting) -> None:
    """Refuse the Earth's pole without date and axes, for another body, and beyond the centuries that its
    polynomials are for.
    """
    known = (
        ("[time] epoch", around.epoch, 'epoch = "2000-01-01T12:00:00 TDB"'),
        ("[frame] axes", around.axes, 'axes = "ICRF"'),
    )
    for what, found, example in known:
        if found is None:
            why = f'given "{EARTH}", a pole of date, which takes {what}; give {example}, or a vector'
            raise around.fault("figure.pole", why)
    if source not in (None, "earth", "399", "earth_moon_barycenter"):
        what = f'given "{EARTH}", the Earth\'s pole, for the source "{source}"; give its own as a vector'
        raise around.fault("figure.pole", what)
    assert around.epoch is not None
    ahead = float(around.epoch.since_j2000())
    far = max(abs(float(plain(t)) + ahead) for t in (around.start, around.end)) / _CENTURY
    if far > _MOST_CENTURIES:
        what = f'given "{EARTH}" for a run that goes {far:.3g} centuries from J2000; its precession holds '
        raise around.fault("figure.pole", what + f"for {_MOST_CENTURIES}: give a shorter run, or a vector")
