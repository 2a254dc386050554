"""Magnetic fields: uniform, of a dipole along an orbit or in flight, or the Earth's; what they do to a
magnetic moment and to a conductor that turns; and ``bx by bz``, the field where the body is, with its rate of
change there ``dbx dby dbz``, body axes.
"""

from __future__ import annotations

import math
import random
from bisect import bisect_right
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import date
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from importlib.resources import files
from typing import Annotated, Any, ClassVar, Literal, Self, cast

import heyoka as hy
from pydantic import Field, StrictInt, Tag

from rigidsim.errors import ensure, required
from rigidsim.model.harmonics import TurningHarmonics
from rigidsim.model.kinematics import Kinematics, along_axes
from rigidsim.model.load import Term
from rigidsim.model.loads.gravity import CentralGravity, CentralGravityFields, Placed
from rigidsim.model.names import written
from rigidsim.model.placements import NOWHERE, FlownAbout, PlacedOnOrbit, Placement
from rigidsim.model.rotations import Symbolic, along
from rigidsim.model.sources import in_body_axes, read_in
from rigidsim.model.two_part import as_factor, rounded
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, norm, transpose, unit_vectors
from rigidsim.scene.bodies.gravity_field import Harmonic
from rigidsim.scene.bodies.presets import EARTH
from rigidsim.scene.epochs import DIGITS, Epoch
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.names import PLACES, NameProvider, Readable, provides
from rigidsim.scene.expressions.tree import Constant, Expression, states_read
from rigidsim.scene.fields import (
    NAME_OR_VECTOR,
    GravitationalParameter,
    InUnit,
    Metre,
    NotNegative,
    NumberOrFormula,
    Positive,
    Rule,
    Triple,
    excludes,
    name_or_vector,
    one_of,
    together,
)
from rigidsim.scene.orbits import OrbitFields, resolve_orbit
from rigidsim.scene.readable import length_text, value_text
from rigidsim.scene.registry import EffectPart, Setting, degree_parts, register_load
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.space_axes import earth_axes, rotation_rate
from rigidsim.scene.swept import plain

MOST = 13
"""Its degree."""
RADIUS = 6371200  # m, to which the coefficients refer


def igrf(epoch: Epoch, degree: int) -> dict[Harmonic, Fraction]:
    """Gauss coefficients at a date, nT, Schmidt semi-normalized: g_nm of cosines and h_nm of sines.

    Between two years of the table they are linear in time, as the IGRF is defined.

    Args:
        degree: up to which they are given, 1 to ``MOST``.

    Raises:
        ValueError: a date without coefficients.
    """
    years, table = _table()
    uniform = epoch.uniform()
    day = uniform.day + Fraction(uniform.ticks, 86400 * 10**DIGITS)
    begins = [date(year, 1, 1).toordinal() for year in years]
    if not begins[0] <= day <= begins[-1]:
        raise ValueError(f"the coefficients of IGRF-14 that are kept here are for {years[0]} to {years[-1]}")
    at = min(bisect_right(begins, day), len(years) - 1)
    share = Fraction(day - begins[at - 1], begins[at] - begins[at - 1])
    return {
        key: values[at - 1] + share * (values[at] - values[at - 1])
        for key, values in table.items()
        if key[0] <= degree
    }


@lru_cache(maxsize=1)
def _table() -> tuple[list[int], dict[Harmonic, list[Fraction]]]:
    """Years, and the values of each coefficient in them."""
    text = (files("rigidsim.scene") / "data" / "igrf14.txt").read_text(encoding="ascii")
    head, *rows = (line.split() for line in text.splitlines() if not line.startswith("#"))
    found = {}
    for n, m, *values in rows:
        found[int(n), abs(int(m)), int(m) < 0] = [Fraction(x) for x in values]
    return [int(year) for year in head[2:]], found


# --- loads --------------------------------------------------------------------------------------------------


FIELD_NAMES = ("bx", "by", "bz")
CHANGE_NAMES = ("dbx", "dby", "dbz")
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
    ensure(
        fields.field_degree is None or fields.field == IGRF,
        around.fault("field_degree", f'given without field = "{IGRF}", which alone has a degree; remove it'),
    )
    ensure(
        fields.elements is not None or fields.gravitational_parameter is None,
        around.fault("gravitational_parameter", "given without an orbit, whose period needs it; remove it"),
    )
    if fields.of_place and fields.elements is None and not around.free_flight:
        key = "field" if fields.field == IGRF else "source_moment"
        raise around.fault(
            key,
            "given for a body without a place; give [initial] position and velocity, or source_moment "
            "with an orbit, or a uniform field",
        )
    ensure(
        fields.position is None or (around.free_flight and fields.of_place),
        around.fault(
            "position",
            f'given; allowed with source_moment or "{IGRF}", for a body with [initial] position and velocity',
        ),
    )


# --- fields -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class UniformField:
    """A field that is the same everywhere.

    Attributes:
        source: the field itself, T; of others the moment M of their dipole, A m^2; space axes (mpf).
        placement: of its source.
    """

    source: Vector
    placement: Placement = NOWHERE

    @property
    def uniform(self) -> bool:
        """Whether it is the same everywhere."""
        return self.placement is NOWHERE

    def size(self, scene: Scene) -> Any:
        """Order of its size, T (mpf)."""
        return norm(scene.context, self.source)

    def most(self, scene: Scene) -> Any:
        """Its largest size, T (mpf)."""
        return self.size(scene)

    def over_size(self, m: Kinematics) -> list[Symbolic]:
        """B over ``size``, space axes."""
        length = norm(m.scene.context, self.source)
        return m.fixed([x / length for x in self.source])

    def at_start(self, scene: Scene) -> Vector:
        """B at the start, space axes, T (mpf)."""
        return self.at(scene.context, [] if self.uniform else self.placement.at_start(scene), scene.start)

    def at(self, context: Any, place: Vector, time: Any) -> Vector:
        """B where the source is at a place (m) as seen from the body, space axes, T (mpf)."""
        return self.source

    def change(self, m: Kinematics) -> list[Symbolic]:
        """Derivative of ``over_size`` along the orbit or flight, per internal unit of time, space axes."""
        if self.uniform:
            return [hy.expression(0.0)] * 3
        if self.placement.orbit is not None:
            block = m.orbit(self.placement.orbit).block
            moving = list(zip(block.variables, block.derivatives, strict=True))
        else:
            ratio = m.scaled(1, m.scaling.speed + m.scaling.time - m.scaling.length)
            pairs = zip(m.carried(m.position), m.carried(m.velocity), strict=True)
            moving = [(x, ratio * v) for x, v in pairs]
        moment = hy.make_vars("moment")  # heyoka doesn't differentiate by time
        field = hy.subs(self.over_size(m), {hy.time: moment})
        rates = [hy.sum([hy.diff(x, by) * y for by, y in [*moving, (moment, 1.0)]]) for x in field]
        return list(hy.subs(rates, {moment: hy.time}))

    def change_at_start(self, scene: Scene) -> Vector:
        """The same at the start, T/s (mpf), by a central difference that leaves a third of the digits."""
        context, placement = scene.context, self.placement
        if self.uniform:
            return [context.zero] * 3
        if placement.orbit is not None:
            place, velocity, _ = placement.motion_at_start(scene)
        else:
            place, velocity = placement.at_start(scene), [-v for v in placement.velocity_at_start(scene)]
        step = context.ldexp(norm(context, place) / norm(context, velocity), -context.prec // 3)
        before, after = (
            self.at(context, [x + s * v for x, v in zip(place, velocity, strict=True)], scene.start + s)
            for s in (-step, step)
        )
        return [(x - y) / (2 * step) for x, y in zip(after, before, strict=True)]


class DipoleField(UniformField):
    """A centred dipole M, B = (mu_0 / 4 pi r^3) (3 (M . c) c - M) in direction c (Jackson, Classical
    Electrodynamics, section 5.6).
    """

    def _far(self, scene: Scene) -> Any:
        """The semi-major axis, or the distance at the start, m."""
        orbit = self.placement.orbit
        return norm(scene.context, self.placement.at_start(scene)) if orbit is None else orbit.semi_major_axis

    def size(self, scene: Scene) -> Any:
        """Over its equator."""
        return scene.context.mpf(_FIELD_CONSTANT) * super().size(scene) / self._far(scene) ** 3

    def most(self, scene: Scene) -> Any:
        """Over its poles at the closest approach."""
        return 2 * self.size(scene) * (self._far(scene) / self.placement.nearest(scene)) ** 3

    def over_size(self, m: Kinematics) -> list[Symbolic]:
        unit, place = super().over_size(m), self.placement.seen(m)
        falling = (as_factor(m.number(self._far(m.scene) / place.unit)) * place.inverse) ** 3
        across = 3.0 * along(unit, place.line)
        return [falling * (across * x - e) for e, x in zip(unit, place.line, strict=True)]

    def at(self, context: Any, place: Vector, time: Any) -> Vector:
        far = norm(context, place)
        across, size = dot(self.source, place) / far, context.mpf(_FIELD_CONSTANT) / far**3
        return [size * (3 * across * x / far - e) for e, x in zip(self.source, place, strict=True)]


@dataclass(frozen=True, kw_only=True)
class EarthField(DipoleField):
    """The Earth's field: coefficients (T) at the epoch, in axes that turn with the Earth.

    Its potential is a sum c_n r^-(n+1) f_n with Schmidt semi-normalized coefficients (Alken et al. 2021,
    Earth, Planets and Space 73, 49, eq. 1), and B minus its gradient,

        B = sum (R/r)^(n+2) ((n + 1) f_n u + u x (u x grad f_n)).

    Attributes:
        harmonics: unnormalized, with the Earth's axes at time 0 and its rate; degree 1 is the dipole.
        epoch: the date.
    """

    harmonics: TurningHarmonics
    epoch: Epoch

    def over_size(self, m: Kinematics) -> list[Symbolic]:
        size = self.size(m.scene)
        which = IGRF, self.epoch, self.harmonics.degree, *m.carried(self.placement.point), size
        if which not in m.cache:
            place = self.placement.seen(m)
            ratio = self.harmonics.radius / place.unit
            m.cache[which] = self.harmonics.vector(m, place, lambda n: ratio ** (n + 2) / size)
        return m.cache[which]

    def at(self, context: Any, place: Vector, time: Any) -> Vector:
        return self.harmonics.at(context, [-x for x in place], time)


def field_of(fields: MagneticFieldFields, around: Setting) -> UniformField:
    """The field that the keys describe."""
    _refuse_elsewhere(fields, around)
    if not fields.of_place:
        return UniformField(numbers(cast("list[ExactNumber]", fields.field), around))
    if fields.field == IGRF:
        return _earth_field(fields.field_degree, _flown_about(fields, around), around)
    placement = _flown_about(fields, around) if around.free_flight else _on_orbit(fields, around)
    return DipoleField(numbers(fields.source_moment or [], around), placement)


def _on_orbit(fields: MagneticFieldFields, around: Setting) -> PlacedOnOrbit:
    elements, given = required(fields.elements), fields.gravitational_parameter
    for key in ("body", "table"):
        ensure(
            getattr(elements, key, None) is None,
            around.fault(
                f"{elements.key}.{key}",
                f"given for a {fields.kind}, which takes elements alone; gravity_gradient takes a " + key,
            ),
        )
    return PlacedOnOrbit(resolve_orbit(elements, None if given is None else given.at(around.context), around))


def _flown_about(fields: MagneticFieldFields, around: Setting) -> FlownAbout:
    """Place of the dipole about which the body flies: as given, or the one point that attracts the body."""
    given = ((n, x) for n, x in enumerate(around.config.loads) if isinstance(x, CentralGravityFields))
    pulling = [CentralGravity.resolve(x, around.at("loads", n)) for n, x in given]
    points = [load.attracting_point for load in pulling if load.attracting_point is not None]
    centre = points[0] if points else []
    if fields.position is not None:
        centre = numbers(fields.position, around)
    elif not points or any(point != centre for point in points):
        what = "several points" if points else "no point at rest"
        what = f"missing; it is needed where {what} attracts the body by central_gravity"
        raise around.fault("position", what)
    strengths = [load.gravitational_parameter for load in pulling if load.attracting_point == centre]
    other = next((x for x in strengths if not EARTH.attracts_by(x)), None)
    if fields.field == IGRF and other is not None:
        raise around.fault(
            "field",
            f'given "{IGRF}", the Earth\'s, where {value_text(other, "m^3/s^2")} attracts the body, '
            "which "
            f"isn't the Earth; give source_moment, or {EARTH.gravitational_parameter:g} m^3/s^2",
        )
    ensure(
        centre != around.position,
        around.fault("position", "the body starts at the dipole; start it elsewhere"),
    )
    return FlownAbout(strengths[0] if len(strengths) == 1 else None, centre)


def _earth_field(degree: int | None, placement: FlownAbout, around: Setting) -> EarthField:
    """The Earth's field to a degree; refused where date and axes aren't known, or inside the Earth."""
    axes = around.axes or (around.ephemeris.axes if around.ephemeris is not None else None)
    epoch, context = around.epoch, around.context
    given = f'given "{IGRF}", '
    if epoch is None or axes is None:
        what = '[time] epoch; give epoch = "2026-01-01T00:00:00 UTC"'
        what = what if epoch is None else '[frame] axes; give axes = "ICRF"'
        raise around.fault("field", f"{given}which turns with the Earth and takes {what}")
    try:
        gauss = igrf(epoch, degree or MOST)
        for second in (around.start, around.end):
            igrf(epoch.uniform().after(Decimal(round(plain(second)))), 1)
        frame = earth_axes(epoch, axes, context)
    except ValueError as error:
        raise around.fault(
            "field", f"{given}for a run from {epoch}; {error}: a run within 1970 to 2029 is allowed"
        ) from None
    c = {}
    for (n, m, sine), value in gauss.items():
        share = context.mpf(math.factorial(n - m)) / math.factorial(n + m)
        if value:
            size = context.sqrt(2 * share) if m else 1
            c[n, m, sine] = ExactNumber(value / 10**9).at(context) * size
    radius, far = context.mpf(RADIUS), norm(context, placement.at_start(around))
    if far < _LEAST * radius:
        there = length_text(float(plain(far)))
        raise around.fault(
            "field",
            f"{given}the Earth's, but the body starts {there} from its centre, inside it; check "
            "[initial] position and its unit",
        )
    dipole = [
        radius**3 / context.mpf(_FIELD_CONSTANT) * c[1, *key] for key in ((1, False), (1, True), (0, False))
    ]
    harmonics = TurningHarmonics(c, radius, frame, rotation_rate(context))
    return EarthField(apply(transpose(frame), dipole), placement, harmonics=harmonics, epoch=epoch)


@dataclass(frozen=True, kw_only=True)
class InMagneticField(Placed):
    """Base of loads by a magnetic field."""

    field: UniformField
    name: str

    @classmethod
    def within(cls, fields: MagneticFieldFields, around: Setting, **more: Any) -> Self:
        """The load in the field that the keys describe."""
        field = field_of(fields, around)
        return cls(field=field, placement=field.placement, name=fields.name or "", **more)

    @staticmethod
    def effect_parts(fields: MagneticFieldFields) -> Iterator[EffectPart]:
        """Each degree of the Earth's field above the first, with those above it."""
        if fields.field != IGRF:
            yield EffectPart("igrf", "the Earth's magnetic field", missing=f'field isn\'t "{IGRF}"')
            return
        degrees, words = range(2, (fields.field_degree or MOST) + 1), "of the Earth's magnetic field"
        yield from degree_parts(degrees, words, lambda n: {"field_degree": n - 1}, "field-degree")

    def read_by(self, names: frozenset[str]) -> bool:
        """On an orbit, whose states it brings: its field, or names of its source."""
        own = f"_{self.name} " if self.name else " no name "
        return self.orbit is not None and any(
            x in (*FIELD_NAMES, *CHANGE_NAMES) or own in f"{x} " for x in names
        )

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return super().reads if self.acts() else frozenset()

    @property
    def wide(self) -> bool:  # type: ignore[override]
        """Whether its expressions are too long to be unrolled: a turning Earth's take seconds."""
        return isinstance(self.field, EarthField)

    @property
    def has_source(self) -> bool:  # type: ignore[override]
        return self.orbit is not None

    def b(self, m: Kinematics) -> list[Symbolic]:
        """The field over its size, body axes."""
        return m.seen(self.field.over_size(m))

    def flux_density(self, m: Kinematics) -> list[Symbolic]:
        if all(x == 0 for x in self.field.source):
            return [hy.expression(0.0)] * 3
        size = rounded(m.number(self.field.size(m.scene)))
        return [size * x for x in self.b(m)]

    def flux_change(self, m: Kinematics) -> list[Symbolic]:
        """Rate at which the field changes in the body's axes, T/s: R^T B' - w x B."""
        if all(x == 0 for x in self.field.source):
            return [hy.expression(0.0)] * 3
        size = rounded(m.number(m.scene.context.ldexp(self.field.size(m.scene), -m.scaling.time)))
        turned = cross(self.b(m), m.rates)
        return [size * (x + y) for x, y in zip(m.seen(self.field.change(m)), turned, strict=True)]


@provides
class FieldNames(NameProvider):
    """The sum of all fields, in which one that several loads give counts once."""

    brings = "bx, by, bz and dbx, dby, dbz with the field of a magnetic_dipole"

    def names(self, config: Config) -> Iterable[Readable]:
        """See ``NameProvider``."""
        flies, states, found = config.initial.flies, {"attitude", PLACES}, False
        for fields in config.loads:
            if isinstance(fields, MagneticFieldFields):
                found, states = True, states | (fields.placed_by(free_flight=flies) or set())
        for names, unit in ((FIELD_NAMES, "T"), (CHANGE_NAMES, "T/s")):
            yield from (Readable(name, unit, frozenset(states)) for name in names if found)

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        values: dict[str, Any] = {}
        if not read_in(scene) & {*FIELD_NAMES, *CHANGE_NAMES}:
            return values
        fields = [load.field for load in _fields_of(scene)]
        b = in_body_axes(scene, _total([field.at_start(scene) for field in fields]))
        values |= zip(FIELD_NAMES, b, strict=True)
        if read_in(scene) & {*CHANGE_NAMES}:
            changes = in_body_axes(scene, _total([field.change_at_start(scene) for field in fields]))
            turned = cross(b, scene.angular_velocity)
            values |= zip(CHANGE_NAMES, [x + y for x, y in zip(changes, turned, strict=True)], strict=True)
        return values

    def at_random(
        self, scene: Scene, start: Mapping[str, Any], generator: random.Random
    ) -> Mapping[str, Any]:
        """Any field and change, about as large as at the start."""
        found: dict[str, Any] = {}
        for names in (FIELD_NAMES, CHANGE_NAMES):
            values = [start[name] for name in names if name in start]
            size = norm(scene.context, values) if values else scene.context.zero
            found |= {x: size * scene.context.mpf(generator.gauss(0, 1)) for x in names if x in start}
        return found

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        loads, found = _fields_of(m.scene), dict[str, Any]()
        if set(names) & {*FIELD_NAMES}:
            found |= zip(FIELD_NAMES, _total([load.flux_density(m) for load in loads]), strict=True)
        if set(names) & {*CHANGE_NAMES}:
            found |= zip(CHANGE_NAMES, _total([load.flux_change(m) for load in loads]), strict=True)
        return found


def _total(vectors: list[list[Any]]) -> list[Any]:
    return [sum(x[1:], x[0]) for x in zip(*vectors, strict=True)]


def _fields_of(scene: Scene) -> list[InMagneticField]:
    found: list[InMagneticField] = []
    for load in scene.given_loads:
        if isinstance(load, InMagneticField) and not any(load.field == x.field for x in found):
            found.append(load)
    return found


class MagneticDipoleFields(MagneticFieldFields):
    """Torque m x B on a dipole of the body, in a uniform ``field`` (space axes), or in the field of a centred
    dipole ``source_moment`` (space axes) around which the body moves on an orbit, or in flight as it flies.
    """

    kind: Literal["magnetic_dipole"]
    moment: Triple[Annotated[Any, NumberOrFormula("A m^2")]] = Field(
        description="magnetic moment of the body, body axes: numbers, or expressions of t, the state, "
        "bx by bz and [parameters], such as a law of magnetorquers; zero for a field alone",
        examples=[["0 A m^2", "0 A m^2", "0.5 A m^2"]],
    )


@register_load
@dataclass(frozen=True, kw_only=True)
class MagneticDipole(InMagneticField):
    """Torque m x B, potential -m . B (Jackson, Classical Electrodynamics, sections 5.6 and 5.7)."""

    moment: Vector  # m, body axes, A m^2 (mpf)
    Fields = MagneticDipoleFields
    title = "magnetic_dipole"

    @classmethod
    def resolve(cls, fields: MagneticDipoleFields, around: Setting) -> MagneticDipole:
        if any(isinstance(x, str) for x in fields.moment):
            law = tuple(
                Constant(x) if isinstance(x, ExactNumber) else around.expression(f"moment[{i}]", x, "A m^2")
                for i, x in enumerate(fields.moment)
            )
            return SteeredDipole.within(fields, around, moment=[around.context.zero] * 3, law=law)
        return cls.within(fields, around, moment=numbers(fields.moment, around))

    def acts(self) -> bool:
        return any(x != 0 for x in self.moment) and any(x != 0 for x in self.field.source)

    @property
    def conservative(self) -> bool:  # type: ignore[override]
        """Whether the field is uniform: along a flight its torque does work without a force."""
        return self.field.uniform or not self.acts()

    def _moment(self, m: Kinematics) -> Vector:
        """m times the field's size, internal units of energy."""
        size, exponent = self.field.size(m.scene), -m.scaling.energy
        return [m.scene.context.ldexp(x * size, exponent) for x in self.moment]

    def torque(self, m: Kinematics) -> list[Term]:
        if not self.acts():
            return []
        moment, axes = self._moment(m), unit_vectors(m.scene.context)
        return [(cross(moment, axis), b) for axis, b in zip(axes, self.b(m), strict=True)]

    def potential(self, m: Kinematics) -> Symbolic | None:
        if not self.acts():
            return None
        pairs = zip(self._moment(m), self.b(m), strict=True)
        return -hy.sum([m.number(x) * b for x, b in pairs if x != 0])

    def linear_potential(self, scene: Scene) -> tuple[Vector, Vector] | None:
        return (self.moment, self.field.source) if self.field.uniform else None

    def amplitude(self, scene: Scene) -> Any:
        """Largest 2 m B."""
        return 2 * norm(scene.context, self.moment) * self.field.most(scene)


@dataclass(frozen=True, kw_only=True)
class SteeredDipole(MagneticDipole):
    """A moment given by expressions, as by a law of magnetorquers."""

    law: tuple[Expression, ...] = ()  # its components, A m^2, body axes
    conservative = False

    def acts(self) -> bool:
        return any(x != 0 for x in self.field.source)

    def read_by(self, names: frozenset[str]) -> bool:
        return False

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return super().reads | states_read(*self.law)

    def torque(self, m: Kinematics) -> list[Term]:
        pulled = cross(written(m, self.law), self.b(m))
        return along_axes(m, self.field.size(m.scene), -m.scaling.energy, pulled)

    def potential(self, m: Kinematics) -> Symbolic | None:
        return None

    def linear_potential(self, scene: Scene) -> tuple[Vector, Vector] | None:
        return None

    def amplitude(self, scene: Scene) -> Any | None:
        return None


Conductivity = Annotated[ExactNumber, InUnit("S/m")]
MagneticTensor = Annotated[ExactNumber, InUnit("S m^4")]


class EddyCurrentsFields(MagneticFieldFields):
    """Torque (M (w x B)) x B of the currents that a magnetic field induces in a conductor turning in it."""

    rules = (
        *MagneticFieldFields.rules,
        one_of("conductivity", "magnetic_tensor", why="the latter for a conductor that is no sphere"),
        excludes("magnetic_tensor", "radius", "thickness"),
        together("conductivity", "radius"),
    )
    kind: Literal["eddy_currents"]
    conductivity: NotNegative[Conductivity] | None = Field(
        default=None, description="of a conducting sphere, with its radius", examples=["3.5e7 S/m"]
    )
    radius: Positive[Metre] | None = Field(
        default=None, description="of the sphere, outside", examples=["30 cm"]
    )
    thickness: Positive[Metre] | None = Field(
        default=None,
        description="of the wall of a hollow sphere; without it the sphere is solid",
        examples=["2 mm"],
    )
    magnetic_tensor: Triple[NotNegative[MagneticTensor]] | None = Field(
        default=None,
        description="diagonal of M in body axes, for another conductor, instead of conductivity and radius",
        examples=[["2.1e4 S m^4", "2.1e4 S m^4", "9.8e3 S m^4"]],
    )


@register_load
@dataclass(frozen=True, kw_only=True)
class EddyCurrents(InMagneticField):
    """Torque (M (w x B)) x B on a conductor whose currents follow the field without delay.

    A sphere's M is (2 pi / 15) s (R^5 - (R - d)^5): the induced electric field -r x B' / 2 is tangent to all
    spheres, so each layer has its own currents (Landau & Lifshitz, Electrodynamics of Continuous Media,
    section 63).
    """

    moments: Vector  # of M, body axes, S m^4 (mpf)
    Fields = EddyCurrentsFields
    title = "eddy_currents"
    unaveraged = "the torque of eddy currents has no average", "leave it out, use viscous_torque"

    @classmethod
    def resolve(cls, fields: EddyCurrentsFields, around: Setting) -> EddyCurrents:
        if fields.magnetic_tensor is not None:
            moments = numbers(fields.magnetic_tensor, around)
        else:
            moments = [_of_sphere(fields, around)] * 3
        return cls.within(fields, around, moments=moments)

    def acts(self) -> bool:
        return any(x != 0 for x in self.moments) and any(x != 0 for x in self.field.source)

    def torque(self, m: Kinematics) -> list[Term]:
        """Sum over axes k, l of the constant vectors M_k e_k x e_l times (w x b)_k b_l, b the field over its
        size.
        """
        if not self.acts():
            return []
        context, b, terms = m.scene.context, self.b(m), []
        scale, axes = context.ldexp(self.field.size(m.scene) ** 2, -m.scaling.momentum), unit_vectors(context)
        induced = cross(m.rates, b)
        for k, moment in enumerate(self.moments):
            for n, axis in enumerate(axes):
                if moment != 0 and n != k:
                    vector = cross([scale * moment * x for x in axes[k]], axis)
                    terms.append((vector, induced[k] * b[n]))
        return terms

    def direction(self, scene: Scene) -> Vector | None:
        return self.field.source if self.field.uniform else None

    def keeps_axial(self, m: Kinematics, axis: Vector) -> bool:
        """False: it damps any spin across the field."""
        return False

    def amplitude(self, scene: Scene) -> Any:
        return scene.context.zero  # it only removes energy


def _of_sphere(fields: EddyCurrentsFields, around: Setting) -> Any:
    context = around.context
    radius, inside = required(fields.radius).at(context), context.zero
    if fields.thickness is not None:
        inside = radius - fields.thickness.at(context)
        if inside < 0:
            raise around.fault(
                "thickness", f"given {float(fields.thickness):g}; more than 0, up to the radius, is allowed"
            )
    return 2 * context.pi / 15 * required(fields.conductivity).at(context) * (radius**5 - inside**5)
