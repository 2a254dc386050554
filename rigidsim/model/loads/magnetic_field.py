"""A magnetic field as loads know it: uniform, of a dipole along an orbit or in flight, or the Earth's; and
``bx by bz``, the field where the body is, body axes.
"""

from __future__ import annotations

import math
import random
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import Annotated, Any, ClassVar, Literal, cast

import heyoka as hy
from pydantic import Field, StrictInt, Tag

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, loads_of
from rigidsim.model.load_words import length_text, value_text
from rigidsim.model.loads.attraction import Attraction
from rigidsim.model.placements.placement import SourcePlace
from rigidsim.model.rotations import Symbolic
from rigidsim.model.sources import free_flight, in_body_axes, read_in
from rigidsim.model.turning_harmonics import TurningHarmonics
from rigidsim.model.two_part import rounded
from rigidsim.scene.arithmetic import Vector, apply, dot, norm, transpose
from rigidsim.scene.bodies.presets import EARTH
from rigidsim.scene.earth_axes import earth_axes, rotation_rate
from rigidsim.scene.effect_parts import EffectPart
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.names import PLACES, NameProvider, Readable, provides
from rigidsim.scene.fields import (
    NAME_OR_VECTOR,
    GravitationalParameter,
    InUnit,
    Metre,
    Positive,
    Rule,
    Triple,
    name_or_vector,
    one_of,
)
from rigidsim.scene.geomagnetic_field import MOST, RADIUS, igrf
from rigidsim.scene.orbit_keys import OrbitFields
from rigidsim.scene.orbits import KeplerOrbit, resolve_orbit
from rigidsim.scene.registry import Setting
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.tracing.numbers import plain

FIELD_NAMES = ("bx", "by", "bz")
IGRF = "igrf"
_LEAST = 0.99
"""Radii from the centre below which a start is refused; the poles are at 0.998."""
_FIELD_CONSTANT = "1e-7"
"""mu_0 / 4 pi, T m/A: CODATA 2022 has 0.99999999987(16) times this, measured since the SI of 2019."""


MagneticMoment = Annotated[ExactNumber, InUnit("A m^2")]
FluxDensity = Annotated[ExactNumber, InUnit("T")]


class MagneticFieldFields(OrbitFields):
    """Keys of a magnetic field: uniform, or of a dipole about which the body moves, or the Earth's."""

    rules: ClassVar[tuple[Rule, ...]] = (
        *OrbitFields.rules,
        one_of("field", "source_moment"),
        one_of("field", "orbit", "satellite_orbit", least=0),
    )
    kind: str
    field: (
        Annotated[
            Annotated[Literal["igrf"], Tag(NAME_OR_VECTOR[0])]
            | Annotated[Triple[FluxDensity], Tag(NAME_OR_VECTOR[1])],
            name_or_vector('"igrf" (the Earth\'s) or a vector in space axes'),
        ]
        | None
    ) = Field(
        default=None,
        description='uniform flux density, space axes; or "igrf", the Earth\'s field, which turns with it, '
        "for a body in flight",
        examples=[["30 uT", 0, 0], "igrf"],
    )
    field_degree: StrictInt | None = Field(
        default=None,
        ge=1,
        le=MOST,
        description=f"degree of the igrf: 1 is a tilted dipole; by default {MOST}, all of it",
        examples=[6],
    )
    source_moment: Triple[MagneticMoment] | None = Field(
        default=None,
        description="magnetic moment of the source, space axes, with orbit, satellite_orbit or in flight",
        examples=[[0, 0, -7.7e22]],
    )
    position: Triple[Metre] | None = Field(
        default=None,
        description="place of the source, space axes, for a body with a position; by default the "
        "point of its central_gravity",
        examples=[[0, 0, 0]],
    )
    gravitational_parameter: Positive[GravitationalParameter] | None = Field(
        default=None, description="G M of the source, from which the orbit's period follows"
    )

    def placed_by(self, *, free_flight: bool) -> frozenset[str] | None:
        if self.elements is not None:
            return frozenset()
        return frozenset({"flight"}) if free_flight and self.of_place else None

    @property
    def of_place(self) -> bool:
        """Whether the field of a body in flight is that where it is."""
        return self.source_moment is not None or self.field == IGRF


def numbers(values: list[ExactNumber], around: Setting) -> Vector:
    """Values of a key as mpf."""
    return [x.at(around.context) for x in values]


def _refuse_elsewhere(fields: MagneticFieldFields, around: Setting) -> None:
    """Refuse keys that go with a flight, or with an orbit, where the body has none."""
    host = around.bodies is not None and around.bodies.host is not None
    if fields.elements is not None and (around.free_flight or host):
        why = "has a position, where the field is taken: remove it and gravitational_parameter"
        why = why if around.free_flight else "is one of [[bodies]]; a uniform field is allowed"
        raise around.fault(fields.elements.key, f"given for a body that {why}")
    if fields.field_degree is not None and fields.field != IGRF:
        raise around.fault("field_degree", f'given without field = "{IGRF}", whose degree it is; remove it')
    if fields.elements is None and fields.gravitational_parameter is not None:
        raise around.fault(
            "gravitational_parameter", "given without an orbit, whose period it is for; remove it"
        )
    if fields.of_place and fields.elements is None and not around.free_flight:
        key = "field" if fields.field == IGRF else "source_moment"
        what = (
            "given for a body without a place; give [initial] position and velocity, or source_moment with "
        )
        raise around.fault(key, what + "an orbit, or a uniform field")
    if fields.position is not None and not (around.free_flight and fields.of_place):
        what = (
            f'given; allowed with source_moment or "{IGRF}", for a body with [initial] position and velocity'
        )
        raise around.fault("position", what)


@dataclass(frozen=True)
class EarthField:
    """The Earth's field: coefficients (T) at the epoch, in axes that turn with the Earth.

    Its potential is a sum c_n r^-(n+1) f_n with Schmidt semi-normalized coefficients (Alken et al. 2021,
    Earth, Planets and Space 73, 49, eq. 1), and B minus its gradient,

        B = sum (R/r)^(n+2) ((n + 1) f_n u + u x (u x grad f_n)).

    Attributes:
        harmonics: unnormalized, with the Earth's axes at time 0 and its rate.
        epoch: the date.
    """

    harmonics: TurningHarmonics
    epoch: Epoch

    @classmethod
    def of(cls, degree: int | None, around: Setting) -> EarthField:
        """The field to a degree; refused where date and axes aren't known."""
        axes = around.axes or (around.ephemeris.axes if around.ephemeris is not None else None)
        epoch, context = around.epoch, around.context
        known = (
            ("[time] epoch", epoch, 'epoch = "2026-01-01T00:00:00 UTC"'),
            ("[frame] axes", axes, 'axes = "ICRF"'),
        )
        for what, found, example in known:
            if found is None:
                why = f'given "{IGRF}", which turns with the Earth and takes {what}; give {example}'
                raise around.fault("field", why)
        assert epoch is not None
        assert axes is not None
        try:
            given = igrf(epoch, degree or MOST)
            for second in (around.start, around.end):
                igrf(epoch.uniform().after(Decimal(round(plain(second)))), 1)
            frame = earth_axes(epoch, axes, context)
        except ValueError as error:
            why = f'given "{IGRF}" for a run from {epoch}; {error}: a run within 1970 to 2029 is allowed'
            raise around.fault("field", why) from None
        coefficients = {}
        for (n, m, sine), value in given.items():
            tesla = ExactNumber(value / 10**9).at(context)
            share = context.mpf(math.factorial(n - m)) / math.factorial(n + m)
            if value:
                coefficients[n, m, sine] = tesla * (context.sqrt(2 * share) if m else 1)
        radius = context.mpf(RADIUS)
        harmonics = TurningHarmonics(coefficients, radius, frame, rotation_rate(context))
        return cls(harmonics, epoch)

    def dipole(self, constant: Any) -> Vector:
        """The magnetic moment of degree 1 at time 0, space axes, A m^2 (mpf).

        Args:
            constant: mu_0 / 4 pi.
        """
        c = self.harmonics.coefficients
        size = self.harmonics.radius**3 / constant
        moment = [size * c[key] for key in ((1, 1, False), (1, 1, True), (1, 0, False))]
        return apply(transpose(self.harmonics.frame), moment)

    def over(self, m: Kinematics, centre: Vector, size: Any) -> list[Symbolic]:
        """B over a size (mpf, T), space axes."""
        which = IGRF, self.epoch, self.harmonics.degree, *centre, size
        if which not in m.made:
            unit = m.scene.context.ldexp(m.scene.context.one, m.scaling.length)
            ratio = self.harmonics.radius / unit
            m.made[which] = self.harmonics.vector(m, m.seen_from(centre), lambda n: ratio ** (n + 2) / size)
        return m.made[which]

    def within(self, far: Any) -> bool:
        """Whether a distance from the centre is inside the Earth."""
        return bool(far < _LEAST * self.harmonics.radius)


@dataclass(frozen=True, kw_only=True)
class InMagneticField(Load):
    """Base of loads by a magnetic field (Jackson, Classical Electrodynamics, sections 5.6 and 5.7).

    The field of a centred dipole M is B = (mu_0 / 4 pi r^3) (3 (M . c) c - M) in direction c. The ``place``
    of the dipole about which the body flies (space axes, m) is empty where it is the point that attracts it.
    """

    source: Vector  # the field itself (T), or M (A m^2) of a dipole; space axes
    orbit: KeplerOrbit | None = None  # of the source seen from the body (which only reverses c)
    place: Vector | None = None  # None if it doesn't fly about a dipole
    name: str = ""
    earth: EarthField | None = None  # whose field it is; the source is then its dipole at time 0

    @classmethod
    def field_of(cls, fields: MagneticFieldFields, around: Setting) -> dict[str, Any]:
        """What the keys say of the field, worked out: source, orbit, place and name."""
        flies = around.free_flight and fields.of_place
        _refuse_elsewhere(fields, around)
        strength, context = fields.gravitational_parameter, around.context
        found: dict[str, Any] = {"name": fields.name or ""}
        if fields.field == IGRF:
            earth = EarthField.of(fields.field_degree, around)
            found |= {"earth": earth, "source": earth.dipole(context.mpf(_FIELD_CONSTANT))}
        else:
            found["source"] = numbers(fields.source_moment or cast("list[ExactNumber]", fields.field), around)
        if flies:
            found["place"] = numbers(fields.position or [], around)
            if found["place"] == around.position:
                raise around.fault("position", "the body starts at the dipole; start it elsewhere")
        elif fields.elements is not None:
            motion = None if strength is None else strength.at(context)
            for key in ("body", "table"):
                if getattr(fields.elements, key, None) is not None:
                    what = f"given for a {fields.kind}, which takes elements alone; gravity_gradient takes a "
                    raise around.fault(f"{fields.elements.key}.{key}", what + key)
            found["orbit"] = resolve_orbit(fields.elements, motion, around)
        return found

    @staticmethod
    def effect_parts(fields: MagneticFieldFields) -> Iterator[EffectPart]:
        """Each degree of the Earth's field above the first, with those above it."""
        if fields.field != IGRF:
            yield EffectPart("igrf", "the Earth's magnetic field", missing=f'field isn\'t "{IGRF}"')
            return
        most = fields.field_degree or MOST
        for n in range(most, 1, -1):
            words = f"degrees {n} to {most}" if n < most else f"degree {n}"
            wider = tuple(f"field-degree-{d}" for d in range(2, n))
            yield EffectPart(
                f"field-degree-{n}", f"{words} of the Earth's magnetic field", {"field_degree": n - 1}, wider
            )

    def read_by(self, names: frozenset[str]) -> bool:
        """On an orbit, whose states it brings: its field, or names of its source."""
        own = f"_{self.name} " if self.name else " no name "
        return self.orbit is not None and any(x in FIELD_NAMES or own in f"{x} " for x in names)

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        if not self.acts():
            return frozenset()
        return frozenset({"attitude"} if self.place is None else {"attitude", "flight"})

    @property
    def uniform(self) -> bool:
        """Whether the field is the same everywhere."""
        return self.orbit is None and self.place is None

    @property
    def wide(self) -> bool:  # type: ignore[override]
        """Whether its expressions are too long to be unrolled: those of an Earth that turns take seconds."""
        return self.earth is not None

    @property
    def has_source(self) -> bool:  # type: ignore[override]
        return self.orbit is not None

    def source_direction(self, m: Kinematics) -> list[Symbolic] | None:
        return None if self.orbit is None else m.seen(m.orbit(self.orbit).direction)

    # --- its field, and where it is from --------------------------------------------------------------------

    def source_place(self, m: Kinematics) -> SourcePlace:
        if self.orbit is not None:
            orbit = m.orbit(self.orbit)
            return SourcePlace(orbit.direction, orbit.inverse_distance, self.orbit.semi_major_axis)
        outward, inverse = m.seen_from(self._centre(m.scene))
        unit = m.scene.context.ldexp(m.scene.context.one, m.scaling.length)
        return SourcePlace([-x for x in outward], inverse, unit)

    def source_at_start(self, scene: Scene) -> Vector:
        if self.orbit is not None:
            return self.orbit.place(scene.context, scene.start)
        return [a - x for x, a in zip(scene.position or [], self._centre(scene), strict=True)]

    def flux_density(self, m: Kinematics) -> list[Symbolic]:
        if all(x == 0 for x in self.source):
            return [hy.expression(0.0)] * 3
        size = rounded(m.number(self._size(m.scene)))
        return [size * x for x in self._field(m)]

    def flux_density_at_start(self, scene: Scene) -> Vector:
        if self.uniform:
            return self.source
        place, context = self.source_at_start(scene), scene.context
        if self.earth is not None:
            return self.earth.harmonics.at(context, [-x for x in place], scene.start)
        far = norm(context, place)
        along, size = dot(self.source, place) / far, context.mpf(_FIELD_CONSTANT) / far**3
        return [size * (3 * along * x / far - e) for e, x in zip(self.source, place, strict=True)]

    def same_field(self, other: object) -> bool:
        """Whether another load gives the same field once more."""
        own = self.source, self.orbit, self.place, self.earth
        return isinstance(other, InMagneticField) and own == (
            other.source, other.orbit, other.place, other.earth,
        )  # fmt: skip

    def most(self, scene: Scene) -> Any:
        """Largest field, T: of a dipole over its poles at pericentre."""
        size = self._size(scene)
        if self.uniform:
            return size
        if self.orbit is None:
            return 2 * size * (self._far(scene) / self._nearest(scene)) ** 3
        return 2 * size * (self.orbit.semi_major_axis / self.orbit.pericentre) ** 3

    def _size(self, scene: Scene) -> Any:
        """Size of the field, T; of a dipole's, over its equator at the semi-major axis or at the start."""
        size = norm(scene.context, self.source)
        if self.uniform:
            return size
        far = self._far(scene) if self.orbit is None else self.orbit.semi_major_axis
        return scene.context.mpf(_FIELD_CONSTANT) * size / far**3

    def _centre(self, scene: Scene) -> Vector:
        """Position of the dipole about which the body flies, m; refused if it isn't told."""
        if self.place:
            return self._checked(self.place, scene)
        points = [load.attracting_point for load in loads_of(scene) if load.attracting_point is not None]
        if not points or any(point != points[0] for point in points):
            found = "several points" if points else "no point at rest"
            what = f"missing; it is needed where {found} attracts the body by central_gravity"
            raise ConfigError(Problem(f"[[loads]] {self.title} position", what))
        return self._checked(points[0], scene)

    def _checked(self, centre: Vector, scene: Scene) -> Vector:
        """The place; refused where the Earth's field is that of another body, or the body starts inside."""
        if self.earth is None:
            return centre
        where, given = f"[[loads]] {self.title} field", f'given "{IGRF}", the Earth\'s, '
        for load in loads_of(scene):
            if not isinstance(load, Attraction) or load.attracting_point != centre:
                continue
            if not EARTH.attracts_by(strength := load.gravitational_parameter):
                what = f"where {value_text(strength, 'm^3/s^2')} attracts the body, which isn't the "
                what += f"Earth; give source_moment, or {EARTH.gravitational_parameter:g} m^3/s^2"
                raise ConfigError(Problem(where, given + what))
        far = norm(scene.context, [x - a for x, a in zip(scene.position or [], centre, strict=True)])
        if self.earth.within(far):
            what = f"but the body starts {length_text(float(plain(far)))} from its centre, inside it; check "
            raise ConfigError(Problem(where, f"{given}{what}[initial] position and its unit"))
        return centre

    def _far(self, scene: Scene) -> Any:
        """Distance from the dipole at the start, m."""
        pairs = zip(scene.position or [], self._centre(scene), strict=True)
        return norm(scene.context, [x - a for x, a in pairs])

    def _nearest(self, scene: Scene) -> Any:
        """Least distance from the dipole, m: that of the Kepler orbit about it, or the start's."""
        loads, centre = loads_of(scene), self._centre(scene)
        pulling = [x for x in loads if isinstance(x, Attraction) and x.attracting_point == centre]
        return pulling[0].placement.nearest(scene) if len(pulling) == 1 else self._far(scene)

    def _field(self, m: Kinematics) -> list[Symbolic]:
        """Field B divided by ``_size``, body axes."""
        length = norm(m.scene.context, self.source)
        unit = m.fixed([x / length for x in self.source])
        if self.uniform:
            return m.seen(unit)
        if self.earth is not None:
            return m.seen(self.earth.over(m, self._centre(m.scene), self._size(m.scene)))
        if self.orbit is None:
            c, inverse = m.seen_from(self._centre(m.scene))
            falling = (m.number(m.scene.context.ldexp(self._far(m.scene), -m.scaling.length)) * inverse) ** 3
        else:
            place = m.orbit(self.orbit)
            c, falling = place.direction, place.inverse_distance**3
        along = 3.0 * hy.sum([e * x for e, x in zip(unit, c, strict=True)])
        space = [falling * (along * x - e) for e, x in zip(unit, c, strict=True)]
        return m.seen(space)

    def fastest_rate(self, scene: Scene) -> Any:
        """Angular rate at pericentre, rad/s; in flight that at the start."""
        if self.place is not None:
            return norm(scene.context, scene.velocity or []) / self._far(scene)
        return scene.context.zero if self.orbit is None else self.orbit.fastest_rate(scene.context)


@provides
class FieldNames(NameProvider):
    """The sum of all fields, in which one that several loads give counts once."""

    brings = "bx, by, bz with the field of a magnetic_dipole"

    def names(self, config: Config) -> Iterable[Readable]:
        """See ``NameProvider``."""
        flies, states, found = free_flight(config), {"attitude", PLACES}, False
        for fields in config.loads:
            if isinstance(fields, MagneticFieldFields):
                found, states = True, states | (fields.placed_by(free_flight=flies) or set())
        return (Readable(name, "T", frozenset(states)) for name in FIELD_NAMES if found)

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        if not read_in(scene) & set(FIELD_NAMES):
            return {}
        found = [load.flux_density_at_start(scene) for load in _fields_of(scene)]
        return dict(zip(FIELD_NAMES, in_body_axes(scene, _total(found)), strict=True))

    def at_random(
        self, scene: Scene, start: Mapping[str, Any], generator: random.Random
    ) -> Mapping[str, Any]:
        """Any field, about as large as at the start."""
        size = norm(scene.context, list(start.values())) if start else scene.context.zero
        return {name: size * scene.context.mpf(generator.gauss(0, 1)) for name in start}

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        if not set(names) & set(FIELD_NAMES):
            return {}
        found = [load.flux_density(m) for load in _fields_of(m.scene)]
        return dict(zip(FIELD_NAMES, _total(found), strict=True))


def _total(vectors: list[list[Any]]) -> list[Any]:
    return [sum(x[1:], x[0]) for x in zip(*vectors, strict=True)]


def _fields_of(scene: Scene) -> list[InMagneticField]:
    found: list[InMagneticField] = []
    for load in scene.given_loads:
        if isinstance(load, InMagneticField) and not any(load.same_field(x) for x in found):
            found.append(load)
    return found
