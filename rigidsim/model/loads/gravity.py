"""What a source of gravity does, wherever it is placed: to a point's second degree, and beyond.

**The body to second degree, the source as a point** (``Attraction``; MacCullagh). With r the distance of the
source and c the unit vector to it in body axes, torque and potential energy are

    N = (3 G M / r^3) c x (I c),      U = -G M m / r - (G M / 2 r^3) (tr I - 3 c . I c).

The force on a body in flight follows from U. Where the origin of the space axes is a body that the source
accelerates as well, what is felt there is the difference, the tidal or third-body acceleration (Montenbruck &
Gill 2000, Satellite Orbits, ch. 3): of a source at s, G M (s - x) / |s - x|^3 - G M s / |s|^3.

**The body's field of degree 3 and more** (``BodyField``, the key ``degree``). With f_n the body's harmonics,

    U = -(G M m / r) sum (R/r)^n f_n(c),       N = -(G M m / r) sum (R/r)^n c x grad f_n,
    a = (G M / r^2) sum (R/r)^n ((n + 1) f_n c + c x (c x grad f_n)).

**The oblateness of the source** (``SourceFigure``, the key ``figure``). With u along the line between both, p
the pole of the source, s = u . p, K = G M J2 R'^2 / 2, and t the trace of I,

    U = (K m / r^3) (3 s^2 - 1)
      + (3 K / 2 r^5) (5 (1 - 7 s^2) u . I u + 20 s u . I p - 2 p . I p + t (5 s^2 - 1)),
    N = (15 K / r^5) ((1 - 7 s^2) u x I u + 2 s (u x I p + p x I u) - (2/5) p x I p),

the leading term of figure against figure (Schutz 1981, Celest. Mech. 24, 173; Williams et al. 2001, J.
Geophys. Res. 106, 27933). The terms without I have no torque and act in flight alone.

**The source's harmonics** (``SourceField``, the key ``gravity_field``), with u from its centre to the body in
axes that turn about its pole at a constant rate, and the body as a point:

    U = -(G M m / r) sum (R/r)^n f_n(u),
    a = -(G M / r^2) sum (R/r)^n ((n + 1) f_n u + u x (u x grad f_n)).

**The Earth's pole of date**, as an expression of time, is that of IAU 1976 precession with the 18.6-year term
of nutation. Precession by Lieske's angles (Lieske et al. 1977, A&A 58, 1); nutation by the largest term of
IAU 1980 in longitude and obliquity, with its values of J2000, in axes that have turned by zeta only: 0.02
arcsec within a century of J2000, where all other terms are worth up to 1.5 arcsec. In axes of the ecliptic of
J2000 it is turned by the obliquity there.

**Uniform gravity** is a torque about a fixed point, or free fall of a body that moves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter
from typing import Annotated, Any, Literal, Self, TypeVar

import heyoka as hy
from pydantic import Field, StrictInt, StrictStr, Tag

from rigidsim.errors import ConfigError, Problem, ensure, required
from rigidsim.model.harmonics import Harmonics, Series, TurningHarmonics, frame_of, turning
from rigidsim.model.kinematics import Kinematics, along_axes, inertia_times, quadratic_form, seconds
from rigidsim.model.load import Load, Term
from rigidsim.model.orbits import Pull
from rigidsim.model.placements import (
    AmongMasses,
    FlownAbout,
    FlownByKernel,
    FlownByMass,
    PlacedAsMass,
    PlacedAtRest,
    PlacedByKernel,
    PlacedBySeries,
    PlacedByTable,
    PlacedInPlane,
    PlacedOnOrbit,
    Placement,
    SourcePlace,
    kernel_body,
    refuse_series,
)
from rigidsim.model.rotations import Symbolic, along, apply, transpose
from rigidsim.model.scaling import potential_amplitude
from rigidsim.model.two_part import as_factor
from rigidsim.scene.arithmetic import Vector, across, cross, dot, norm, parallel, unit_vectors
from rigidsim.scene.bodies.gravity_field import LEAST, MOST, GravityField, HarmonicsTable
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.choices import MEAN, ORBIT_AVERAGED
from rigidsim.scene.epochs import J2000, Epoch
from rigidsim.scene.exact import ZERO, parse_number
from rigidsim.scene.fields import (
    NAME_OR_VECTOR,
    Acceleration,
    Angle,
    BodyName,
    ConfigTable,
    Dimensionless,
    Direction,
    GravitationalParameter,
    Metre,
    Positive,
    Range,
    Rate,
    Triple,
    excludes,
    name_or_vector,
    one_of,
)
from rigidsim.scene.kernels.reading import exactly
from rigidsim.scene.orbits import (
    SIDES,
    Elements,
    KeplerOrbit,
    Orbit,
    OrbitFields,
    attracting_body,
    resolve_orbit,
    resolve_tabulated_orbit,
)
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT, PointMasses
from rigidsim.scene.readable import length_text
from rigidsim.scene.registry import (
    EffectPart,
    LoadFields,
    SceneLoad,
    Setting,
    SourceFields,
    degree_parts,
    register_load,
)
from rigidsim.scene.scene import Scene
from rigidsim.scene.space_axes import ECLIPTIC, obliquity, to_ecliptic
from rigidsim.scene.swept import plain
from rigidsim.scene.validation_messages import nearest

_CENTURY = 86400 * 36525  # s
_ARCSEC = 3600 * 180
# arcsec, in powers of centuries since J2000
_ZETA = ("0", "2306.2181", "0.30188", "0.017998")
_THETA = ("0", "2004.3109", "-0.42665", "-0.041833")
_NODE = ("450160.280", "-6962890.539")
"""Mean longitude of the Moon's ascending node."""
_IN_LONGITUDE, _IN_OBLIQUITY, _OBLIQUITY = "-17.1996", "9.2025", "84381.448"


def earth_pole(m: Kinematics, epoch: Epoch, axes: str) -> list[Symbolic]:
    """Unit vector (to 1e-9) along the Earth's axis of figure, in the scene's space axes.

    Args:
        epoch: date of the scene's time 0.
        axes: name of the space axes.
    """
    context = m.scene.context
    unit = m.number(context.one / _CENTURY)
    centuries = unit * seconds(m, since=epoch)

    def arcsec(text: str) -> Any:
        return context.mpf(text) * context.pi / _ARCSEC

    def angle(coefficients: Sequence[str]) -> Symbolic:
        numbers = [m.number(arcsec(x)) for x in coefficients]
        total = hy.expression(numbers[-1])
        for x in reversed(numbers[:-1]):
            total = x + centuries * total
        return total

    zeta, theta, node = map(angle, (_ZETA, _THETA, _NODE))
    (c1, s1), (c2, s2) = ((hy.cos(x), hy.sin(x)) for x in (zeta, theta))
    x = m.number(arcsec(_IN_LONGITUDE) * context.sin(arcsec(_OBLIQUITY))) * hy.sin(node)
    y = m.number(arcsec(_IN_OBLIQUITY)) * hy.cos(node)
    along, across = c1 * x + s1 * y, c1 * y - s1 * x
    radial = c2 * along + s2
    equator = [c1 * radial + s1 * across, c1 * across - s1 * radial, c2 - s2 * along]
    if axes != ECLIPTIC:
        return equator
    c, s = map(m.number, obliquity(context))
    return to_ecliptic(equator, (c, s))


# --- placed sources -----------------------------------------------------------------------------------------


def _of_placement(name: str) -> Any:
    return property(attrgetter(f"placement.{name}"))


@dataclass(frozen=True, kw_only=True)
class Placed(Load):
    """Base of loads whose source is where its ``placement`` says."""

    placement: Placement

    orbit, table, sights = map(_of_placement, ("orbit", "table", "sights"))
    axes, epoch, seconds_ahead = map(_of_placement, ("axes", "epoch", "seconds_ahead"))
    plane, without_plane = map(_of_placement, ("plane", "without_plane"))
    wide, of_time = map(_of_placement, ("wide", "of_time"))

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return frozenset({"attitude", "flight"} if self.placement.flies else {"attitude"})

    def seen(self, m: Kinematics) -> tuple[list[Symbolic], SourcePlace]:
        """``SourcePlace.line`` in body axes, and the place."""
        place = self.placement.seen(m)
        return m.seen(place.line), place

    def source_direction(self, m: Kinematics) -> list[Symbolic]:
        line, place = self.seen(m)
        return [-x for x in line] if place.outward else line

    def source_place(self, m: Kinematics) -> SourcePlace:
        return self.placement.seen(m)

    def source_at_start(self, scene: Scene) -> Vector:
        return self.placement.at_start(scene)

    def motion(self, m: Kinematics) -> list[Symbolic]:
        """Velocity of a body in flight as seen from its source, space axes, units of speed."""
        return self.placement.velocity(m)

    def motion_at_start(self, scene: Scene) -> Vector:
        return self.placement.velocity_at_start(scene)

    def fastest_rate(self, scene: Scene) -> Any:
        return self.placement.fastest_rate(scene)


PartT = TypeVar("PartT", bound="ByPlacedSource")


@dataclass(frozen=True, kw_only=True)
class ByPlacedSource(Placed):
    """Base of what a source of gravity does.

    Attributes:
        gravitational_parameter: G M of the source, m^3/s^2 (mpf).
        pulls: whether its force accelerates the body.
        beside: the attraction to second degree by the same source; None of that one.
    """

    gravitational_parameter: Any
    pulls: bool = False
    beside: Attraction | None = None

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        return self.placement.rests

    @property
    def reacts(self) -> bool:  # type: ignore[override]
        return isinstance(self.placement, AmongMasses)

    @property
    def attracting_point(self) -> Vector | None:  # type: ignore[override]
        return self.placement.point

    @property
    def corotating_orbit(self) -> KeplerOrbit | None:  # type: ignore[override]
        orbit = self.placement.orbit
        return orbit if orbit is not None and orbit.circular and orbit.fixed_plane else None

    def with_point_masses(self, masses: PointMasses) -> SceneLoad:
        return replace(self, placement=self.placement.with_point_masses(masses))

    # --- what it does ---------------------------------------------------------------------------------------

    def per_distance(self, m: Kinematics, place: SourcePlace, power: int, exponent: int) -> Any:
        """G M over the unit of distance to a power, times 2^exponent (mpf)."""
        return m.scene.context.ldexp(self.gravitational_parameter / place.unit**power, exponent)

    def acceleration(self, m: Kinematics) -> tuple[int, list[Symbolic]]:
        """A sign, and the components of the centre of mass's acceleration times it, space axes."""
        raise NotImplementedError

    def force(self, m: Kinematics) -> list[Term]:
        if not self.pulls:
            return []
        sign, parts = self.acceleration(m)
        return along_axes(m, sign, 0, parts)

    def reaction(self, m: Kinematics) -> list[Pull]:
        if not (self.reacts and isinstance(self.placement, AmongMasses) and self.placement.masses.full):
            return []
        sign, parts = self.acceleration(m)
        return self.placement.reaction(m, parts, sign)

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """True: a symmetric tensor has no torque about its axis."""
        return True


@dataclass(frozen=True, kw_only=True)
class Attraction(ByPlacedSource):
    """Attraction to second degree, which is the gravity gradient of a distant source."""

    has_source = True

    @property
    def title(self) -> str:  # type: ignore[override]
        return "central_gravity" if self.pulls else "gravity_gradient"

    @property
    def gradient_source(self) -> Self | None:
        return None if self.placement.flies else self

    def part(self, kind: type[PartT], **more: Any) -> PartT:
        """What the source does beyond this attraction."""
        return kind(
            gravitational_parameter=self.gravitational_parameter, placement=self.placement, pulls=self.pulls,
            beside=self, **more,
        )  # fmt: skip

    @property
    def remark(self) -> str:  # type: ignore[override]
        return "" if self.table is None else self.table.described

    def pictured(self) -> dict[str, Any] | None:
        what = "source" if self.attracting_point is None else "attractor"
        depiction = {"what": what, "gravitational_parameter": float(self.gravitational_parameter)}
        return None if self.reacts else depiction | self.placement.pictured()

    def fixed_source(self, scene: Scene) -> tuple[Any, Vector] | None:
        if self.placement.flies or not self.placement.rests:
            return None
        place = self.placement.at_start(scene)
        distance = norm(scene.context, place)
        return 3 * self.gravitational_parameter / distance**3, [x / distance for x in place]

    # --- what it does ---------------------------------------------------------------------------------------

    def torque(self, m: Kinematics) -> list[Term]:
        line, place = self.seen(m)
        strength, factor = 3 * self.per_distance(m, place, 3, 2 * m.scaling.time), place.inverse**3
        if m.shape is not None:
            turned = cross(line, inertia_times(m, line))
            return along_axes(m, strength, 0, [factor * x for x in turned])
        return tensor_terms(m, strength, lambda a, j: factor * (line[a] * line[j]))

    def potential(self, m: Kinematics) -> Symbolic | None:
        """Without the part that depends on nothing but time; with the inertial force of a falling origin."""
        (line, place), scaling = self.seen(m), m.scaling
        second = self.per_distance(m, place, 3, scaling.inertia - scaling.energy) / 2
        if not self.placement.dynamic:
            return as_factor(m.number(3 * second)) * (place.inverse**3 * quadratic_form(m, line))
        energy = -(m.number(second) * place.inverse**3 * (trace(m) - 3.0 * quadratic_form(m, line)))
        if self.pulls:
            mass = m.carried(m.scene.body.mass)
            energy = energy - m.number(mass * self.per_distance(m, place, 1, -scaling.energy)) * place.inverse
            if falling := self._falling(m, scaling.length - scaling.energy):
                energy = energy + m.number(mass) * dot(falling, m.carried(m.position))
        return energy

    def acceleration(self, m: Kinematics) -> tuple[int, list[Symbolic]]:
        """(G M / r^2 + (3 G M / 2 m r^4) (tr I - 5 c . I c)) R c + (3 G M / m r^4) R I c; the first term only
        if it pulls: point masses attract each other as points anyway.
        """
        (line, place), scaling = self.seen(m), m.scaling
        shift = scaling.time - scaling.speed
        ratio = (
            self.per_distance(m, place, 4, shift + scaling.inertia) * 3 / (2 * m.carried(m.scene.body.mass))
        )
        second = m.number(ratio) * place.inverse**4
        radial = second * (trace(m) - 5.0 * quadratic_form(m, line))
        if self.pulls:
            radial = m.number(self.per_distance(m, place, 2, shift)) * place.inverse**2 + radial
        turned = apply(m.matrix, inertia_times(m, line))
        parts = [radial * x + 2.0 * second * y for x, y in zip(place.line, turned, strict=True)]
        return -1 if place.outward else 1, parts

    def force(self, m: Kinematics) -> list[Term]:
        falling = self._falling(m, m.scaling.time - m.scaling.speed) if self.pulls else []
        less = [[-x for x in e] for e in unit_vectors(m.scene.context)] if falling else []
        return [*super().force(m), *zip(less, falling, strict=True)]

    def _falling(self, m: Kinematics, exponent: int) -> list[Symbolic]:
        """Acceleration of the origin times 2^exponent, internal units; empty for one that doesn't fall."""
        if self.placement.falling is None:
            return []
        place = self.placement.falling.seen(m)
        factor = m.number(self.per_distance(m, place, 2, exponent)) * place.inverse**2
        return [factor * x for x in place.line]

    # --- sizes ----------------------------------------------------------------------------------------------

    def amplitude(self, scene: Scene) -> Any:
        """(3/2) (G M / r^3) (I_max - I_min) at the closest approach: range of the potential energy."""
        strength = 3 * self.gravitational_parameter / self.placement.nearest(scene) ** 3
        return strength * moments_range(scene) / 2

    def flight_bounds(self, scene: Scene, fed: Any) -> tuple[Any, Any] | None:
        return self.placement.flight_bounds(scene, fed)


# --- torques of tensors -------------------------------------------------------------------------------------


def tensor_terms(m: Kinematics, strength: Any, element: Callable[[int, int], Symbolic]) -> list[Term]:
    """Torque sum of strength S_aj e_a x (I e_j) of a symmetric tensor S in body axes, I being the constant
    tensor of inertia: the constant strength (mpf) becomes one coefficient with the moments.

    Args:
        element: S_aj, asked for where it has a torque.
    """
    units, columns = unit_vectors(m.scene.context), transpose(m.numbers.inertia)
    terms: list[Term] = []
    for a in range(3):
        for j in range(a, 3):
            vector = cross(units[a], columns[j])
            if j != a:
                vector = [x + y for x, y in zip(vector, cross(units[j], columns[a]), strict=True)]
            if any(x != 0 for x in vector):
                terms.append(([strength * x for x in vector], element(a, j)))
    return terms


def trace(m: Kinematics) -> Any:
    """tr I, internal units of inertia."""
    if m.shape is not None:
        return hy.sum([m.shape.matrix[i][i] for i in range(3)])
    return m.number(sum(m.numbers.inertia[i][i] for i in range(3)))


def moments_range(scene: Scene) -> Any:
    """I_max - I_min (mpf), kg m^2."""
    moments = scene.body.principal_moments
    return scene.context.maximum(moments) - scene.context.minimum(moments)


_UNROLLED = 3
"""Degree up to which the expressions of the torque alone are unrolled: beyond, and with the force, this takes
three to seven seconds to compile, ten times as long as compact code whose steps cost 1.7 times as much.
"""


@register_load(beside="degree")
@dataclass(frozen=True, kw_only=True)
class BodyField(ByPlacedSource):
    """Attraction of the body's field from degree 3 to a degree."""

    field: GravityField
    degree: int

    title = "gravity_field"
    unaveraged = (
        "the gravity field of degree 3 and more has no average, which the gradient alone has",
        "set degree = 2",
    )

    @property
    def wide(self) -> bool:  # type: ignore[override]
        return self.placement.wide or self.reacts or self.pulls or self.degree > _UNROLLED

    def acts(self) -> bool:
        return bool(self.coefficients)

    @cached_property
    def coefficients(self) -> Series:
        """Those that aren't zero, unnormalized (mpf)."""
        return self.field.to(self.degree)

    def _energy(self, m: Kinematics, place: SourcePlace, n: int) -> Any:
        """-G M m R^n over the unit of distance to the power of n + 1, internal units of energy (mpf)."""
        size = m.scene.body.mass * (self.field.radius / place.unit) ** n
        return -size * self.per_distance(m, place, 1, -m.scaling.energy)

    def _seen(self, m: Kinematics) -> tuple[Harmonics, SourcePlace]:
        """Harmonics of the direction to the source in body axes, and its place."""
        direction, place = self.source_direction(m), self.placement.seen(m)
        return Harmonics(direction, m.number, m.scene.context), place

    def _torque(self, m: Kinematics) -> list[Symbolic]:
        """Components in body axes, internal units of energy."""
        seen, place = self._seen(m)
        return seen.turned(self.coefficients, lambda n: self._energy(m, place, n), place.inverse, 1)

    def torque(self, m: Kinematics) -> list[Term]:
        terms = along_axes(m, 1, 0, self._torque(m))
        return [term for term in terms if term[1] != hy.expression(0.0)]

    def potential(self, m: Kinematics) -> Symbolic | None:
        seen, place = self._seen(m)
        found: Symbolic = seen.scalar(
            self.coefficients, lambda n: self._energy(m, place, n), place.inverse, 1
        )
        return found

    def acceleration(self, m: Kinematics) -> tuple[int, list[Symbolic]]:
        context, scaling, (seen, place) = m.scene.context, m.scaling, self._seen(m)
        first = self.per_distance(m, place, 2, scaling.time - scaling.speed)
        ratio = self.field.radius / place.unit
        outward = seen.scalar(self.coefficients, lambda n: (n + 1) * first * ratio**n, place.inverse, 2)
        arm = m.carried(m.scene.body.mass) * place.unit
        lever = context.ldexp(-1 / arm, scaling.energy + scaling.time - scaling.speed)
        turned = cross(place.direction, apply(m.matrix, self._torque(m)))
        factor = m.number(lever) * place.inverse
        return 1, [outward * u + factor * x for u, x in zip(place.direction, turned, strict=True)]

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """Whether the field is symmetric about the axis, too."""
        context = m.scene.context
        return all(across(context, x, axis) for x in turning(self.coefficients, context).values())

    def amplitude(self, scene: Scene) -> Any:
        """Twice a bound of the potential energy at the closest approach: |P_nm|^2 <= (n + m)! / (n - m)!."""
        context, near, total = scene.context, self.placement.nearest(scene), scene.context.zero
        for (n, m, _), value in self.coefficients.items():
            highest = context.sqrt(context.mpf(math.factorial(n + m)) / math.factorial(n - m))
            total += abs(value) * highest * (self.field.radius / near) ** n
        return 2 * total * self.gravitational_parameter * scene.body.mass / near

    # --- from the config ------------------------------------------------------------------------------------

    @staticmethod
    def effect_parts(fields: Any) -> Iterator[EffectPart]:
        field_ = "of the body's field"
        degrees = range(LEAST, (fields.degree or 0) + 1)
        yield from degree_parts(degrees, field_, lambda n: {"degree": n - 1})
        if fields.degree is None:
            words = f"degree {LEAST} and more {field_}"
            yield EffectPart("field", words, missing="no degree is given")

    @classmethod
    def beside_of(cls, load: Any, fields: Any, around: Setting) -> Load | None:
        if fields.degree < LEAST or not isinstance(load, Attraction):
            return None
        degree, field, placement = fields.degree, around.body.gravity, load.placement
        if field is None:
            what = "[body] has no gravity_field; give it, or leave degree out (the inertia tensor "
            raise around.fault("degree", f"given {degree}, but {what}is degree 2)")
        if degree > field.degree:
            raise around.fault(
                "degree", f"given {degree}, but [body] gravity_field ends at degree {field.degree}"
            )
        if not placement.dynamic and (near := placement.nearest(around)) < field.radius:
            far, radius = (length_text(float(plain(x))) for x in (near, field.radius))
            raise around.fault(
                "degree",
                f"given for a source at {far} from the body's centre, within the radius {radius} of "
                "[body] gravity_field, where the series doesn't hold; place the source outside, or leave "
                "degree out",
            )
        return load.part(cls, field=field, degree=degree)


EARTH = "iau1976"
_MOST_CENTURIES = 20
"""From J2000: the polynomials' last terms make a degree of the pole there."""

_POSSIBLE = Range(
    lambda x: -1 <= x <= 0.5,
    "-1 (a needle along the pole) to 0.5 (a ring), such as 1.0826e-3 of the Earth (J2 = -C20, unnormalized),",
)


class SourceFigureTable(ConfigTable):
    """``figure`` of a source: its oblateness."""

    J2: Annotated[Dimensionless, _POSSIBLE] = Field(examples=[1.0826e-3])
    """unnormalized coefficient J2 = -C20"""
    radius: Positive[Metre] = Field(examples=["6378.137 km"])
    """equatorial radius, to which J2 refers"""
    pole: Annotated[
        Annotated[Literal["iau1976"], Tag(NAME_OR_VECTOR[0])] | Annotated[Direction, Tag(NAME_OR_VECTOR[1])],
        name_or_vector('"iau1976" (the Earth\'s, by precession and nutation) or a vector in space axes'),
    ] = Field(examples=["iau1976", [0, 0, 1]])
    """direction of the axis of figure: a vector in space axes, or iau1976, the Earth's of date"""


@register_load(beside="figure")
@dataclass(frozen=True, kw_only=True)
class SourceFigure(ByPlacedSource):
    """Torque of the source's oblateness on the body's inertia, and in flight its force.

    Attributes:
        size: its J2 R'^2, m^2 (mpf).
        pole: unit vector (mpf, space axes) that rests; None for the Earth's.
        context: the scene's arithmetic.
        epoch, axes: date of time 0 and the space axes, for the Earth's.
    """

    size: Any
    context: Any
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
        orbit, context = super().corotating_orbit, self.context
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
            return along_axes(m, strength, 0, [factor * x for x in sums])
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
        given, context, placement = fields.figure, around.context, load.placement
        radius = given.radius.at(context)
        if load.pulls:
            refuse_inside(load, radius, "figure", around)
        elif not placement.dynamic and placement.nearest(around) < radius:
            near, far = (length_text(float(plain(x))) for x in (placement.nearest(around), radius))
            raise around.fault(
                "figure.radius",
                f"given {far}, but the source comes to {near} from the body, which would be within it; "
                "check both",
            )
        size = given.J2.at(context) * radius**2
        if isinstance(given.pole, str):
            _refuse_pole(fields.source, around)
            return load.part(cls, size=size, context=context, pole=None, epoch=around.epoch, axes=around.axes)
        pole = [x.at(context) for x in given.pole]
        far = norm(context, pole)
        return load.part(cls, size=size, context=context, pole=[x / far for x in pole])


def refuse_inside(load: Attraction, radius: Any, key: str, around: Setting) -> None:
    """Refuse a radius of the attracting body within which the body starts, and one that moves."""
    ensure(
        load.attracting_point is not None,
        around.fault(key, "given for an attracting body that moves; allowed for one at rest, with position"),
    )
    far = norm(around.context, load.placement.at_start(around))
    if far < radius:
        given, there = (around.context.nstr(x, 6) for x in (radius, far))
        raise around.fault(
            f"{key}.radius",
            f"given {given} m, but the body starts {there} m from the attracting point, where the "
            "series doesn't hold; check both",
        )


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
            raise around.fault(
                "figure.pole",
                f'given "{EARTH}", a pole of date, which takes {what}; give {example}, or a vector',
            )
    ensure(
        source in (None, "earth", "399", "earth_moon_barycenter"),
        around.fault(
            "figure.pole",
            f'given "{EARTH}", the Earth\'s pole, for the source "{source}"; give its own as a vector',
        ),
    )
    ahead = float(required(around.epoch).since_j2000())
    far = max(abs(float(plain(t)) + ahead) for t in (around.start, around.end)) / _CENTURY
    if far > _MOST_CENTURIES:
        raise around.fault(
            "figure.pole",
            f'given "{EARTH}" for a run that goes {far:.3g} centuries from J2000; its precession holds '
            f"for {_MOST_CENTURIES}: give a shorter run, or a vector",
        )


class SourceFieldTable(HarmonicsTable):
    """``gravity_field`` of ``central_gravity``: coefficients in axes that turn about the pole at a rate."""

    least = 2
    below = "gravitational_parameter and position"
    radius: Positive[Metre] = Field(examples=["6378.1366 km"])
    """reference radius R of C and S"""
    C: dict[StrictStr, Dimensionless] = Field(default_factory=dict, examples=[{"2,0": -1.0826e-3}])
    """unnormalized coefficients of cos m lon by "degree,order", from degree 2 on: C_20 is minus J2"""
    S: dict[StrictStr, Dimensionless] = Field(default_factory=dict, examples=[{"2,2": -9.0387e-7}])
    """likewise with sin m lon"""
    pole: Direction = Field(examples=[[0, 0, 1]])
    """direction of its axis of rotation, space axes"""
    rate: Rate = Field(ZERO, examples=["7.2921151e-5 rad/s"], json_schema_extra={"default": 0})
    """rate at which it turns about the pole"""
    prime_meridian: Angle = Field(ZERO, examples=["100 deg"], json_schema_extra={"default": 0})
    """angle of longitude 0 at time 0 from its equator's node on the plane XY (from X if they coincide)"""


@register_load(beside="gravity_field")
@dataclass(frozen=True, kw_only=True)
class SourceField(ByPlacedSource):
    """Force of the harmonics of a point at rest."""

    field: TurningHarmonics

    title = "gravity_field"
    reads = frozenset({"flight"})
    wide = True

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        return self.field.rests

    def acts(self) -> bool:
        return bool(self.field.coefficients)

    def torque(self, m: Kinematics) -> list[Any]:
        return []

    def potential(self, m: Kinematics) -> Symbolic | None:
        place = self.placement.seen(m)
        strength, ratio = self.per_distance(m, place, 1, -m.scaling.energy), self.field.radius / place.unit
        strength = -strength * m.carried(m.scene.body.mass)
        return self.field.scalar(m, place, lambda n: strength * ratio**n)

    def acceleration(self, m: Kinematics) -> tuple[int, list[Symbolic]]:
        place, shift = self.placement.seen(m), m.scaling.time - m.scaling.speed
        strength, ratio = -self.per_distance(m, place, 2, shift), self.field.radius / place.unit
        return 1, self.field.vector(m, place, lambda n: strength * ratio**n)

    def amplitude(self, scene: Scene) -> Any:
        return scene.context.zero  # no torque

    def fastest_rate(self, scene: Scene) -> Any:
        return scene.context.zero if self.conservative else abs(self.field.rate)

    # --- from the config ------------------------------------------------------------------------------------

    @classmethod
    def beside_of(cls, load: Any, fields: Any, around: Setting) -> Load:
        given, context = fields.gravity_field, around.context
        ensure(
            fields.figure is None or "2,0" not in given.C,
            around.fault("gravity_field.C", 'given "2,0" and figure, whose J2 is the same; remove one'),
        )
        found = given.coefficients(context, lambda text: around.fault("gravity_field", text))
        frame = frame_of(context, [x.at(context) for x in given.pole], given.prime_meridian.at(context))
        radius, rate = given.radius.at(context), given.rate.at(context)
        refuse_inside(load, radius, "gravity_field", around)
        field = TurningHarmonics({key: c for key, c in found.items() if c != 0}, radius, frame, rate)
        return load.part(cls, field=field)

    @staticmethod
    def effect_parts(fields: Any) -> Iterator[EffectPart]:
        table = fields.gravity_field
        given = [(name, key) for name in ("C", "S") for key in getattr(table, name, ())]
        keys = [(int(key.partition(",")[0]), f"gravity_field.{name}.{key}") for name, key in given]
        yield from degree_parts(
            sorted({n for n, _ in keys})[1:],
            "of that gravity",
            lambda n: dict.fromkeys(key for degree, key in keys if degree >= n),
            "field-degree",
            ("field",),
        )
        missing = "" if table else "no gravity_field is given"
        words = "gravity of the attracting body beyond a point"
        yield EffectPart("field", words, {"gravity_field": None}, missing=missing)


class AttractingFields(SourceFields):
    """Keys of a load whose source attracts the body."""

    degree: StrictInt | None = Field(
        None,
        ge=2,
        le=MOST,
        description="degree of [body] gravity_field to which this source attracts the body; by default 2, "
        "which is the inertia tensor",
        examples=[4],
    )
    figure: SourceFigureTable | None = Field(
        None,
        description="oblateness of the source itself: torque on the body's figure, and force in flight",
        examples=[{"J2": 1.0826e-3, "radius": "6378.137 km", "pole": "iau1976"}],
    )


class GravityGradientFields(OrbitFields, AttractingFields):
    """Torque of a distant attracting body, to second degree (MacCullagh's formula)."""

    rules = (one_of("orbit", "satellite_orbit", "position", "ephemeris", "source", why=SIDES),)
    kind: Literal["gravity_gradient"]
    gravitational_parameter: Positive[GravitationalParameter] | None = Field(
        default=None, description="G M of the attracting body", examples=["3.986004418e14 m^3/s^2"]
    )
    position: Triple[Metre] | None = Field(
        default=None, description="position of a source at rest, space axes", examples=[["7000 km", 0, 0]]
    )
    ephemeris: Literal["sun", "moon"] | None = Field(
        default=None,
        description="geocentric position of Sun or Moon, from analytic series in the ecliptic of J2000",
    )
    source: BodyName | None = Field(
        default=None,
        description="a body of the [ephemeris] kernel, as seen from [body] host; a package gives its "
        "gravitational_parameter",
        examples=["earth"],
    )


class CentralGravityFields(AttractingFields):
    """A point that attracts a freely flying body: force and torque to second degree."""

    rules = (one_of("orbit", "source", "position", least=0), excludes("orbit", "gravitational_parameter"))
    kind: Literal["central_gravity"]
    gravitational_parameter: Positive[GravitationalParameter] | None = Field(
        default=None, description="G M of the attracting point", examples=["3.986004418e14 m^3/s^2"]
    )
    source: BodyName | None = Field(
        default=None,
        description="the attracting body of the [ephemeris] kernel, instead of position; a package gives its "
        "gravitational_parameter",
        examples=["moon"],
    )
    orbit: Orbit | None = Field(
        default=None,
        description="the attracting point mass in [[bodies]], instead of gravitational_parameter and "
        "position",
        examples=[{"body": "earth"}],
    )
    position: Triple[Metre] = Field(
        default_factory=lambda: [ZERO] * 3,
        description="position of the attracting point, space axes",
        json_schema_extra={"default": [0, 0, 0]},
    )

    atmosphere_rate: Triple[Rate] | None = Field(
        default=None,
        description="angular velocity of its atmosphere, space axes, for vrx vry vrz in expressions",
        examples=[[0, 0, "7.292115e-5 rad/s"]],
    )
    gravity_field: SourceFieldTable | None = Field(
        default=None,
        description="gravity of the attracting body beyond a point, in axes that turn with it: its force",
        examples=[{"radius": "6378.1366 km", "C": {"3,0": 2.5e-6}, "pole": [0, 0, 1]}],
    )

    def placed_by(self, *, free_flight: bool) -> frozenset[str] | None:
        return frozenset({"flight"})


@register_load
class GravityGradient(SceneLoad):
    """The torque of a distant body on an orbit, at a fixed place, by series or a kernel, or of a point mass.

    For an ephemeris the space axes are the mean ecliptic and equinox of J2000, and time counts from the
    scene's epoch, by default J2000.
    """

    Fields = GravityGradientFields

    @classmethod
    def resolve(cls, fields: GravityGradientFields, around: Setting) -> Attraction:
        if fields.orbit is not None and fields.orbit.body is not None:
            ensure(
                fields.gravitational_parameter is None,
                around.fault(
                    "gravitational_parameter", "given with orbit.body, which determines it; remove it"
                ),
            )
            masses, number = required(around.bodies), attracting_body(fields.orbit, around)
            ensure(
                masses.host is not None or not masses.full,
                around.fault(
                    "kind",
                    'given "gravity_gradient" for a body that flies by itself under coupling = "full"; '
                    'give "central_gravity", whose force the bodies feel',
                ),
            )
            placed = FlownByMass if masses.host is None else PlacedAsMass
            mass: Placement = placed(masses, number)
            return Attraction(gravitational_parameter=masses.strengths[number], placement=mass)
        strength = _strength(fields, around)
        return Attraction(gravitational_parameter=strength, placement=_distant(fields, strength, around))


def _distant(fields: GravityGradientFields, strength: Any, around: Setting) -> Placement:
    if fields.source is not None:
        return PlacedByKernel.of(fields.source, around)
    if fields.elements is not None and fields.elements.plane_of is not None:
        return _in_plane(fields.elements, strength, around)
    if fields.elements is not None and fields.elements.table is not None:
        return PlacedByTable(resolve_tabulated_orbit(fields.elements, strength, around))
    if fields.elements is not None:
        return PlacedOnOrbit(resolve_orbit(fields.elements, strength, around))
    if fields.ephemeris is not None:
        refuse_series(around)
        ensure(
            around.axes in (None, ECLIPTIC),
            ConfigError(
                Problem(
                    "[frame] axes",
                    f'given "{around.axes}", but the ephemeris of [[loads]] number {around.number + 1} is '
                    f'in "{ECLIPTIC}"; write that, or leave axes out',
                )
            ),
        )
        return PlacedBySeries(fields.ephemeris, around.epoch or J2000)
    position = [x.at(around.context) for x in fields.position or []]
    ensure(
        any(x != 0 for x in position),
        around.fault("position", "given the origin, where the body is; another point is allowed"),
    )
    return PlacedAtRest(position)


def _in_plane(elements: Elements, strength: Any, around: Setting) -> PlacedInPlane:
    """An orbit in the plane of another load's, for the equations of precession in the literature."""
    config, context = around.config, around.context
    key, name = f"{elements.key}.plane_of", str(elements.plane_of)
    on_orbits = {
        load.name: number for number, load in enumerate(config.loads)
        if isinstance(load, GravityGradientFields) and load.name and load.elements is not None
        and load.elements.plane_of is None and getattr(load.elements, "body", None) is None
    }  # fmt: skip
    allowed = ", ".join(on_orbits) or "none; give a gravity_gradient with an orbit a name"
    what = f'given "{name}"{nearest(name, on_orbits)}; allowed: {allowed}'
    ensure(name in on_orbits, around.fault(key, what))
    model = config.model
    first = model.level == ORBIT_AVERAGED and model.order == 1 and model.start == MEAN
    what = 'is for averaged orbits; give [model] level = "orbit_averaged", order = 1 and start = "mean"'
    ensure(first, around.fault(key, what))
    axis = elements.semi_major_axis
    if axis is None:
        raise around.fault(f"{elements.key}.semi_major_axis", "missing; it is needed")
    other = config.loads[on_orbits[name]]
    there = around.at("loads", on_orbits[name])
    mass = context.zero if around.body.mass is None else around.body.mass
    both = strength + context.mpf(GRAVITATIONAL_CONSTANT) * mass
    return PlacedInPlane(
        _distant(other, _strength(other, there), there), axis.at(context), elements.eccentricity.at(context),
        elements.inclination.at(context), context.sqrt(both / axis.at(context) ** 3),
    )  # fmt: skip


@register_load
class CentralGravity(SceneLoad):
    """The force and torque of what a body flies by: a point at rest, a body of a kernel, a point mass."""

    Fields = CentralGravityFields

    @classmethod
    def resolve(cls, fields: CentralGravityFields, around: Setting) -> Attraction:
        if fields.orbit is not None:
            return _flown_by_mass(fields.orbit, around)
        if around.position is None:
            what = 'given "central_gravity" for a body without a position; give [initial] position and '
            raise around.fault("kind", f'{what}velocity, or use "gravity_gradient" for a prescribed orbit')
        strength = _strength(fields, around)
        place: Placement = FlownAbout(strength, [x.at(around.context) for x in fields.position])
        if (
            fields.source is not None and fields.source != around.host
        ):  # which is the origin of the space axes
            ephemeris = kernel_body(fields.source, around)
            place = FlownByKernel(PlacedByKernel(ephemeris, ephemeris.sight(fields.source, around.host)))
        ensure(
            any(x != 0 for x in place.at_start(around)),
            around.fault("kind", "the body starts at the attracting point; start it elsewhere"),
        )
        return Attraction(gravitational_parameter=strength, placement=place, pulls=True)


def _flown_by_mass(orbit: Orbit, around: Setting) -> Attraction:
    ensure(
        orbit.body is not None,
        around.fault("orbit", "given without body; the name of one of [[bodies]] is allowed"),
    )
    number, masses = attracting_body(orbit, around), required(around.bodies)
    ensure(
        masses.host is None,
        around.fault(
            "kind",
            'given "central_gravity", but [body] host makes the body one of [[bodies]], which attract '
            'each other anyway; give "gravity_gradient"',
        ),
    )
    place = FlownByMass(masses, number)
    return Attraction(gravitational_parameter=masses.strengths[number], placement=place, pulls=True)


def _strength(fields: GravityGradientFields | CentralGravityFields, around: Setting) -> Any:
    """The gravitational parameter (mpf, m^3/s^2): as given, or of a body of the kernel its own."""
    given, found = fields.gravitational_parameter, None
    what = "missing; it is needed"
    if fields.source is not None:
        kernel = kernel_body(fields.source, around).kernel
        found, what = (
            kernel.strength(fields.source),
            f'missing; {kernel.name} has none of "{fields.source}": give it',
        )
    if given is not None:
        return given.at(around.context)
    if found is None:
        raise around.fault("gravitational_parameter", what)
    return exactly(around.context, found)


STANDARD_GRAVITY = 9.80665  # m/s^2
_ON_EARTH = (
    0.01  # relative range of gravity on the ground of the Earth, 9.76 to 9.83 m/s^2, and of its rounding
)
_UPRIGHT = 0.9  # of its size: a pull along Z


class UniformGravityFields(LoadFields):
    """A uniform field: a torque about the fixed point, or free fall in a scene with a position."""

    kind: Literal["uniform_gravity"]
    acceleration: Triple[Acceleration] = Field(
        default_factory=lambda: [parse_number(a, "m/s^2") for a in ("0", "0", "-9.80665")],
        description="acceleration of free fall, space axes",
        examples=[[0, 0, -3.72]],
        json_schema_extra={"default": [0, 0, -9.80665]},
    )


@register_load
@dataclass(frozen=True)
class UniformGravity(Load):
    """The sum of all uniform fields: a torque com x M R^T g about a fixed point, or free fall."""

    acceleration: Vector  # space axes, m/s^2 (mpf)
    pivoted: bool = False  # whether it turns the body about a fixed point
    Fields = UniformGravityFields
    title = "uniform_gravity"
    conservative = True

    @classmethod
    def resolve(cls, fields: UniformGravityFields, around: Setting) -> UniformGravity:
        return cls([a.at(around.context) for a in fields.acceleration])

    @classmethod
    def of(cls, scene: Scene) -> list[UniformGravity]:
        """All uniform fields of a scene combined into one load; an empty list if the scene has none."""
        return [] if scene.gravity is None else [cls(scene.gravity, scene.torque_arm is not None)]

    @property
    def uniform_field(self) -> Vector:  # type: ignore[override]
        return self.acceleration

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return frozenset({"vertical"} if self.pivoted else ())

    def amplitude(self, scene: Scene) -> Any:
        """M g l, half the range of the potential energy about a fixed point; zero in free fall."""
        return potential_amplitude(scene)

    def torque(self, m: Kinematics) -> list[Term]:
        """Torque of the weight about the fixed point, vertical x arm."""
        if m.vertical is None or m.numbers.arm is None:
            return []
        units = unit_vectors(m.scene.context)
        return [(cross(units[a], m.numbers.arm), m.vertical[a]) for a in range(3)]

    def force(self, m: Kinematics) -> list[Term]:
        """Free-fall acceleration of the centre of mass."""
        if m.velocity is None or m.scene.gravity is None:
            return []
        context, scaling = m.scene.context, m.scaling
        pull = [context.ldexp(g, scaling.time - scaling.speed) for g in m.scene.gravity]
        return [(pull, hy.expression(1.0))]

    def potential(self, m: Kinematics) -> Symbolic | None:
        """Potential energy: M g times the height above the fixed point, or -M g . x in free flight."""
        context, scene, scaling = m.scene.context, m.scene, m.scaling
        if m.vertical is not None and m.numbers.arm is not None:
            return hy.sum([m.number(a) * v for a, v in zip(m.numbers.arm, m.vertical, strict=True) if a])
        mass = scene.body.mass
        if m.position is None or scene.gravity is None or mass is None:
            return None
        weights = [context.ldexp(-mass * g, scaling.length - scaling.energy) for g in scene.gravity]
        terms = [m.number(k) * x for k, x in zip(weights, m.position, strict=True) if k]
        return hy.sum(terms) if terms else None

    def linear_potential(self, scene: Scene) -> tuple[Vector, Vector] | None:
        """M com (body axes) and g (space axes) about a fixed point; None in free fall."""
        return None if scene.torque_arm is None else (scene.torque_arm, self.acceleration)

    def cautions(self, fields: UniformGravityFields, where: str, scene: Scene) -> Iterator[Caution]:
        pull = [float(x) for x in fields.acceleration]
        size = math.hypot(*pull)
        standard = abs(size / STANDARD_GRAVITY - 1) < _ON_EARTH or size == 10
        if standard and pull[2] > _UPRIGHT * size:
            given = ", ".join(f"{x:.6g}" for x in pull)
            falling = ", ".join(f"{-x + 0.0:.6g}" for x in pull)
            what = f"given [{given}], which points up along Z; write [{falling}] for a fall down along -Z"
            yield Caution(WarningCode.GRAVITY_UPWARDS, f"{where} acceleration: {what}")
