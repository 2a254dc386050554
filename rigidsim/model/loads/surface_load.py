"""Loads that push on the surfaces of the body: along the stream that they meet (air, light), and along the
normals of plates.

The expressions read names, as a user's own do (``rigidsim.scene.expressions.names``): directions of sources,
shadows, the velocity relative to the air. So their kinks and jumps, at which a plate comes out of the light
or the stream, are surfaces on which steps end, and the states that they take are carried.

**Drag.** A plate of area A with unit normal n moves through the air with velocity v, and is met by it if n .
v > 0: the force is -rho C A (n . v) v / 2, for the area seen against the stream; a sphere's is -rho C pi
R^2 |v| v / 2 (Montenbruck & Gill, Satellite Orbits, 2000, section 3.5).

**Radiation pressure.** A plate, met by light from direction u with c = n . u > 0, is pushed by

    F = -P A c ((1 - s) u + 2 (s c + d/3) n)

with the shares s reflected and d scattered by Lambert's law (Montenbruck & Gill, section 3.4; Wertz,
Spacecraft Attitude Determination and Control, 1978, section 17.2.2); the integral over a sphere is -P pi R^2
(1 + 4 d/9) u. P is the irradiance over the speed of light, which falls with the square of the distance.

**Air.** ``air_density`` is the density of the Earth's air in NRLMSISE-00, for ``drag`` with density =
"nrlmsise00". It is heyoka's network (a thermoNET: Izzo, Acciarini & Biscani 2024, arXiv 2405.19384) of the
model of Picone et al. 2002, Journal of Geophysical Research 107, 1468, at the geodetic place of the body
above WGS 84. The constants of the network are doubles, in every precision.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from fractions import Fraction
from functools import lru_cache
from typing import Annotated, Any, Literal

import heyoka as hy
import numpy as np
from pydantic import Field, StrictBool

from rigidsim.errors import ConfigError, Problem, ensure, required
from rigidsim.model.kinematics import Kinematics, along_axes
from rigidsim.model.load import Load, Term, loads_of
from rigidsim.model.loads.applied import Applied
from rigidsim.model.loads.gravity import Attraction
from rigidsim.model.names import written
from rigidsim.model.plausibility import about_altitude
from rigidsim.model.rotations import Symbolic, apply
from rigidsim.model.sources import RELATIVE_NAMES, flown_about, read_in
from rigidsim.model.two_part import rounded
from rigidsim.scene.arithmetic import Matrix, Vector, cross, norm
from rigidsim.scene.arithmetic import apply as multiply
from rigidsim.scene.bodies.body import OuterSurface, Plate
from rigidsim.scene.bodies.presets import EARTH, known_body
from rigidsim.scene.cautions import Caution
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.names import PLACES, NameProvider, Readable, provides
from rigidsim.scene.expressions.tree import Expression, evaluate, names_used, states_read
from rigidsim.scene.fields import (
    Dimensionless,
    InUnit,
    Metre,
    NotNegative,
    NumberOrFormula,
    Positive,
    VariableName,
    together,
    within,
)
from rigidsim.scene.point_masses import kepler_reach
from rigidsim.scene.readable import length_text, value_text
from rigidsim.scene.registry import EffectPart, LoadFields, Setting, register_load
from rigidsim.scene.scene import Scene, start_values
from rigidsim.scene.schema import Config
from rigidsim.scene.space_axes import earth_axes, rotation_rate
from rigidsim.scene.surfaces import WIDE, narrow_parts, root_parts
from rigidsim.scene.swept import plain

NRLMSISE = "nrlmsise00"
AIR_DENSITY = "air_density"
LEAST = 150.0
"""Altitude (km) from which the network is used: below, it is wrong by half."""
_EQUATOR, _FLATTENING = 6378.137, 1 / 298.257223563  # km, WGS 84
_ORDINAL_0 = 1721424.5  # Julian date of the day before 0001-01-01
INDICES = ("f107", "f107a", "ap")


@provides
class AirDensity(NameProvider):
    """The density where the body is."""

    brings = f'{AIR_DENSITY} with a drag whose density is "{NRLMSISE}"'

    def names(self, config: Config) -> Iterable[Readable]:
        """See ``NameProvider``."""
        if flown_about(config) is not None and _asking(config):
            yield Readable(AIR_DENSITY, "kg/m^3", frozenset({"flight", PLACES}), long=True)

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """See ``NameProvider``; in double precision, as the network is known."""
        if AIR_DENSITY not in read_in(scene):
            return {}
        place = _geodetic_at_start(scene)
        indices = [float(plain(x)) for x in _indices(scene)]
        values = [*place, *indices, _day(scene) + float(plain(scene.start)) / 86400]
        return {AIR_DENSITY: scene.context.mpf(float(_compiled()[1](np.array(values))[0]))}

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        if AIR_DENSITY not in names:
            return {}
        key = (AIR_DENSITY,)
        if key not in m.cache:
            m.cache[key] = [_density(m)]
        return {AIR_DENSITY: m.cache[key][0]}


def height(m: Kinematics) -> Symbolic:
    """Geodetic altitude, km."""
    return _geodetic(m)[0]


def _geodetic_at_start(scene: Scene) -> list[float]:
    """Altitude (km), latitude and longitude (rad) of the body; refused where the model doesn't hold."""
    context, (source, rows) = scene.context, _known(scene)
    x, y, z = multiply(rows, [-x for x in source.source_at_start(scene)])
    turned = rotation_rate(context) * scene.start
    c, s = context.cos(turned), context.sin(turned)
    fixed = [float(plain(e)) / 1e3 for e in (c * x + s * y, c * y - s * x, z)]
    found = [float(e) for e in _compiled()[0](np.array(fixed))]
    if found[0] < LEAST:
        raise _fault(
            scene,
            f'given "{NRLMSISE}", but the body starts {length_text(found[0] * 1e3)} above the Earth; '
            "its "
            f"network holds from {LEAST:g} km on: start higher, or give density, altitude and "
            "scale_height",
        )
    return found


@lru_cache(maxsize=1)
def _compiled() -> tuple[Any, Any]:
    """Geodetic place of x, y, z (km), and density by that, f107, f107a, ap and day."""
    place, seven = hy.make_vars("x", "y", "z"), hy.make_vars("h", "lat", "lon", "f", "fa", "ap", "t")
    density = hy.model.nrlmsise00_tn(seven[:3], *seven[3:])
    return (
        hy.cfunc(hy.model.cart2geo(place, R_eq=_EQUATOR), place, compact_mode=True),
        hy.cfunc([density], seven, compact_mode=True),
    )


def _density(m: Kinematics) -> Symbolic:
    context = m.scene.context
    days = _number(m, context.ldexp(context.one, m.scaling.time) / 86400) * hy.time
    indices = [_number(m, x) for x in _indices(m.scene)]
    day = _number(m, context.mpf(_day(m.scene)))
    return hy.model.nrlmsise00_tn(_geodetic(m), *indices, day + days)


def _geodetic(m: Kinematics) -> list[Symbolic]:
    """Altitude (km), latitude and longitude (rad)."""
    key = ("geodetic",)
    if key not in m.cache:
        source, rows = _known(m.scene)
        place = source.source_place(m)
        far = _number(m, place.unit / 1000) / place.inverse
        space = [-far * x for x in place.direction]
        x, y, z = (hy.sum([e * a for e, a in zip(m.fixed(row), space, strict=True)]) for row in rows)
        angle = m.scaled(rotation_rate(m.scene.context), m.scaling.time) * hy.time
        c, s = hy.cos(angle), hy.sin(angle)
        m.cache[key] = hy.model.cart2geo([c * x + s * y, c * y - s * x, z], R_eq=_EQUATOR)
    return m.cache[key]


def _asking(config: Config) -> list[Any]:
    """Keys of the loads that take it."""
    return [fields for fields in config.loads if getattr(fields, "density", None) == NRLMSISE]


def _indices(scene: Scene) -> list[Any]:
    fields = _asking(scene.config)[0]
    return [getattr(fields, key).at(scene.context) for key in INDICES]


def _day(scene: Scene) -> float:
    """Days of UTC since the year's begin at time 0."""
    days = float(required(scene.epoch).universal_date()) - _ORDINAL_0
    return days - date(date.fromordinal(int(days)).year, 1, 1).toordinal()


def _known(scene: Scene) -> tuple[Any, Matrix]:
    """The load about whose source the air is, and the Earth's axes at time 0 as rows; what the model can't be
    worked out for is refused.
    """
    given = f'given "{NRLMSISE}", '
    known = (
        ("[time] epoch", scene.epoch, 'epoch = "2026-01-01T00:00:00 UTC"'),
        ("[frame] axes", scene.axes, 'axes = "ICRF"'),
    )
    for what, found, example in known:
        if found is None:
            raise _fault(scene, f"{given}a model of date and place, which takes {what}; give {example}")
    epoch, axes = required(scene.epoch), required(scene.axes)
    try:
        epoch.universal_date()
    except ValueError as error:
        raise _fault(scene, f"{given}at {epoch}, but {error}; give a later epoch") from None
    first, *others = _asking(scene.config)
    ensure(
        not any(getattr(x, key) != getattr(first, key) for x in others for key in INDICES),
        _fault(scene, f"{given}by several loads with different {', '.join(INDICES)}; give them the same"),
    )
    source = required(flown_about(scene.config)).of(scene)
    strength = source.gravitational_parameter
    if strength is not None and not EARTH.attracts_by(strength):
        what = f"the Earth's air, where {value_text(strength, 'm^3/s^2')} attracts the body, which isn't the "
        raise _fault(scene, f"{given}{what}Earth; give density, altitude and scale_height of its air")
    return source, earth_axes(epoch, axes, scene.context)


def _fault(scene: Scene, text: str) -> ConfigError:
    number = next(n for n, x in enumerate(scene.config.loads, 1) if getattr(x, "density", None) == NRLMSISE)
    return ConfigError(Problem(f"[[loads]] number {number} density", text))


def _number(m: Kinematics, value: Any) -> Any:
    return hy.expression(rounded(m.number(value)))


# --- pushes on surfaces -------------------------------------------------------------------------------------

Sum = Mapping[Expression, Any]
"""A sum of expressions times coefficients (mpf)."""


@dataclass(frozen=True)
class Push:
    """A force of a size (mpf) times an expression, at a ``place`` (m, body axes): along a vector (mpf, body
    axes), or along the stream (None).
    """

    size: Any
    expression: Expression
    place: Vector
    along: Vector | None = None

    @property
    def turns(self) -> bool:
        """Whether it has a torque at all."""
        return any(x != 0 for x in (self.place if self.along is None else cross(self.place, self.along)))


@dataclass(frozen=True)
class SurfaceLoad(Load):
    """The sum of its pushes times the product of its factors, which are the same for all."""

    pushes: tuple[Push, ...]
    stream: tuple[Expression, ...]  # components in body axes
    factors: tuple[Expression, ...]
    flies: bool  # whether it accelerates the centre of mass

    def acts(self) -> bool:
        return bool(self.pushes)

    @property
    def expressions(self) -> tuple[Expression, ...]:
        """All different ones, factors first."""
        return tuple(dict.fromkeys((*self.factors, *self.stream, *(push.expression for push in self.pushes))))

    def formulas(self) -> list[Expression]:
        return list(self.expressions)

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return states_read(*self.expressions) | {"attitude"} | ({"flight"} if self.flies else set())

    def _parts(self, *, torque: bool) -> tuple[list[Sum], list[Sum]]:
        """Sums (N or N m) by which the stream is multiplied, one of sizes or three of arms, and the sums
        along the body axes.
        """
        streaming = [
            (push, push.place if torque else [1, 0, 0]) for push in self.pushes if push.along is None
        ]
        others = [
            (push, cross(push.place, push.along) if torque else push.along)
            for push in self.pushes
            if push.along is not None
        ]
        return _joined(streaming)[: 3 if torque else 1], _joined(others)

    def _in_body(self, m: Kinematics, *, torque: bool) -> tuple[Any, list[Symbolic | None]]:
        """The largest coefficient (mpf), and the force or torque in units of it: so that sums are within the
        range of single precision; None where nothing acts.
        """
        parts, context = self._parts(torque=torque), m.scene.context
        largest = context.maximum(
            [context.zero, *(abs(x) for group in parts for y in group for x in y.values())]
        )
        values = dict(zip(self.expressions, written(m, self.expressions), strict=True))

        def total(part: Sum) -> Symbolic | None:
            terms = [m.number(x / largest) * values[expression] for expression, x in part.items()]
            return hy.sum(terms) if terms else None

        along, axes = ([total(part) for part in group] for group in parts)
        stream, factors, found = [values[x] for x in self.stream], [values[x] for x in self.factors], []
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            pairs = [(along[0], stream[i])]
            if len(along) == 3:
                pairs = [(along[j], stream[k]), (along[k], -stream[j])]
            terms = [x for x in (axes[i], *(a * b for a, b in pairs if a is not None)) if x is not None]
            found.append(hy.prod([*factors, hy.sum(terms)]) if terms else None)
        return largest, found

    def torque(self, m: Kinematics) -> list[Term]:
        """Torque place x force."""
        largest, parts = self._in_body(m, torque=True)
        terms = along_axes(m, largest, -m.scaling.energy, parts)
        return [term for term in terms if term[1] is not None]

    def force(self, m: Kinematics) -> list[Term]:
        """Acceleration of a freely flying body: the force over its mass."""
        if m.velocity is None or not self.pushes:
            return []
        largest, parts = self._in_body(m, torque=False)
        pushed = apply(m.matrix, [hy.expression(0.0) if x is None else x for x in parts])
        size, exponent = largest / m.carried(m.scene.body.mass), m.scaling.time - m.scaling.speed
        return along_axes(m, size, exponent, pushed)


def _joined(vectors: Iterable[tuple[Push, Vector]]) -> list[Sum]:
    """Components of the sum of vectors times the sizes of their pushes, without those that vanish."""
    found: list[dict[Expression, Any]] = [{}, {}, {}]
    for push, vector in vectors:
        for part, x in zip(found, vector, strict=True):
            part[push.expression] = part.get(push.expression, 0) + push.size * x
    return [{expression: x for expression, x in part.items() if x != 0} for part in found]


class Pushes:
    """What makes the pushes of a load on the surfaces of a body.

    Args:
        title: of the load.
        stream: names of the components of the vector that surfaces are met from, body axes.
    """

    def __init__(self, around: Setting, title: str, stream: Sequence[str]) -> None:
        self.around, self._title = around, title
        self._found: list[Push] = []
        self._names = tuple(stream)
        self.stream = tuple(self.parsed(name) for name in stream)

    def acting(self) -> tuple[Push, ...]:
        """The pushes that turn the body, or all of a body in flight."""
        return tuple(push for push in self._found if push.turns or self.around.free_flight)

    def surfaces(self) -> Iterator[tuple[int, OuterSurface]]:
        """Surfaces of the body, counted from 1; refused if there are none."""
        body = self.around.body
        ensure(
            body.surfaces,
            self.around.fault(
                "",
                "given for a body without surfaces; give [[body.surfaces]], such as normal and area of "
                "a plate, size of a box, or radius of a sphere",
            ),
        )
        yield from enumerate(body.surfaces, start=1)

    def on_sphere(self, sphere: OuterSurface, size: Any, *, speed: bool = False) -> None:
        """A push along the stream, with ``speed`` times its length."""
        text = f"sqrt({' + '.join(f'{name}^2' for name in self._names)})" if speed else "1"
        self._add(size, text, sphere)

    def on_plate(
        self, plate: Plate, number: int, size: Any, along: Vector | None = None, power: int = 1
    ) -> None:
        """A push along the stream or a vector times a power of how far the plate faces the stream: twice the
        larger of zero and the stream's component along the normal is what it and its size add up to.
        """
        context = self.around.context
        facing, given = self._facing(plate, number)
        length = 2 * norm(context, [x.at(context) for x in plate.normal])
        text = f"({facing} + abs({facing}))" + f"^{power}" * (power > 1)
        where = f"[body] {plate.place}, under {self.around.where(self._title)}"
        self._add(size / length**power, text, plate, along, parameters=given, where=where)

    def _add(
        self, size: Any, text: str, surface: OuterSurface, along: Vector | None = None, **options: Any
    ) -> None:
        if size != 0:
            self._found.append(Push(size, self.parsed(text, **options), surface.position, along))

    def _facing(self, plate: Plate, number: int) -> tuple[str, dict[str, ExactNumber]]:
        """The vector's component along the normal as written, in text, and what stands for numbers there."""
        sign, given = "" if plate.side > 0 else "-", {}
        terms = []
        for axis, x, name in zip("xyz", plate.normal, self._names, strict=True):
            if x.swept or (x.sign and abs(x.rational) != 1):
                given[f"n{number}{axis}"] = x.alone
                terms.append(f"n{number}{axis}*{name}")
            elif x.sign:
                terms.append(name if x.sign > 0 else f"(-{name})")
        text = " + ".join(terms)
        return (f"{sign}({text})" if sign or len(terms) > 1 else text), given

    def parsed(self, text: str, **options: Any) -> Expression:
        """The expression of a text, in which no parameters of the config stand."""
        return self.around.expression(self._title, text, **{"parameters": None, **options})


# --- drag ---------------------------------------------------------------------------------------------------

_FALLING = 2.0**-10  # ratio of the least to the largest distance of an orbit that all but meets the centre
_PLACES = 16  # along an orbit, between which what reads the altitude is smooth

Density = Annotated[Any, NumberOrFormula("kg/m^3")]


class DragFields(LoadFields):
    """Drag of the air on the surfaces of a body in flight."""

    rules = (together("altitude", "scale_height"), together("f107", "f107a", "ap"))
    kind: Literal["drag"]
    density: Density = Field(
        description="of the air: a number, an expression of altitude, t, the state and [parameters], or "
        '"nrlmsise00", the Earth\'s by that model',
        examples=["4e-12 kg/m^3", "nrlmsise00"],
    )
    f107: Annotated[Dimensionless, within("60", "400")] | None = Field(
        default=None,
        description="of nrlmsise00: solar flux at 10.7 cm of the day before, 1e-22 W/m^2/Hz",
        examples=[150],
    )
    f107a: Annotated[Dimensionless, within("60", "400")] | None = Field(
        default=None, description="of nrlmsise00: its mean of 81 days", examples=[150]
    )
    ap: Annotated[Dimensionless, within("0", "400")] | None = Field(
        default=None, description="of nrlmsise00: the day's geomagnetic index Ap", examples=[7]
    )
    scale_height: Positive[Metre] | None = Field(
        default=None,
        description="height over which the density falls to 1/e; by default density holds everywhere",
        examples=["60 km"],
    )
    altitude: Metre | None = Field(
        default=None, description="where the air has this density; with scale_height", examples=["400 km"]
    )


@register_load
@dataclass(frozen=True)
class Drag(SurfaceLoad):
    """Drag on plates and spheres; ``law`` is the density, where an expression gives it."""

    law: Expression | None = None
    Fields = DragFields
    title = "drag"

    @classmethod
    def resolve(cls, fields: DragFields, around: Setting) -> Drag:
        ensure(
            around.free_flight and RELATIVE_NAMES[0] in around.names,
            around.fault(
                "",
                "given without a velocity relative to the air; it takes [initial] position and "
                "velocity, and a central_gravity (atmosphere_rate there turns the air)",
            ),
        )
        pushes = Pushes(around, cls.title, RELATIVE_NAMES)
        half, factors, law = around.context.one / 2, [], None
        if (fields.density == NRLMSISE) != (fields.ap is not None):
            given = "missing" if fields.ap is None else f"given with another density than {NRLMSISE}"
            raise around.fault("ap", f'{given}; density = "{NRLMSISE}" takes {", ".join(INDICES)}')
        if fields.density == NRLMSISE:
            factors.append(pushes.parsed(AIR_DENSITY))
        elif isinstance(fields.density, ExactNumber):
            if fields.density.sign < 0:
                raise around.fault("density", f"given {float(fields.density):g}; zero or more is allowed")
            half = half * fields.density.at(around.context)
        else:
            law = around.expression("density", fields.density, "kg/m^3")
            factors.append(law)
        factors += _falling(fields, around)
        for number, surface in pushes.surfaces():
            size = -half * surface.drag_coefficient * surface.area
            if isinstance(surface, Plate):
                pushes.on_plate(surface, number, size)
            else:
                pushes.on_sphere(surface, size, speed=True)
        kind = DragInThermosphere if fields.density == NRLMSISE else cls
        return kind(pushes.acting(), pushes.stream, tuple(factors), around.free_flight, law)

    def narrow(self, m: Kinematics) -> list[Symbolic]:
        """What is narrow in it, but for what reads the altitude alone and changes by less than a transition
        along the orbit at the start: no step is longer than that orbit.
        """
        parts, reach = narrow_parts(*self.formulas()), _altitudes(m.scene)
        return written(m, [part for part in parts if reach is None or _range(part, reach, m.scene) > WIDE])

    def roots(self, m: Kinematics) -> list[Symbolic]:
        """Of the density alone in an orbit, where the speed of the air vanishes by coincidence only."""
        if _altitudes(m.scene) is None:
            return super().roots(m)
        return written(m, root_parts(*self.never_negative()))

    def never_negative(self) -> list[Expression]:
        return [] if self.law is None else [self.law]

    def cautions(self, fields: DragFields, where: str, scene: Scene) -> Iterator[Caution]:
        attractors = (x for x in scene.config.loads if getattr(x, "kind", "") == "central_gravity")
        strengths = (getattr(x, "gravitational_parameter", None) for x in attractors)
        known = any(x is not None and known_body(float(x)) is not None for x in strengths)
        if known and fields.altitude is not None:
            start = start_values(scene)["altitude"]
            yield from about_altitude(fields.altitude, float(start), where)


class DragInThermosphere(Drag):
    """Drag in NRLMSISE-00, which ends where the network of it does."""

    def range_ends(self, m: Kinematics) -> list[tuple[str, Symbolic]]:
        return [
            (
                f"the altitude fell below {LEAST:g} km, from which NRLMSISE-00 is known here",
                (height(m) - LEAST) / LEAST + 2.0**-20,
            )
        ]  # 14 cm: a run may start at the limit


def _altitudes(scene: Scene) -> tuple[Any, Any] | None:
    """Least and largest altitude (m, mpf) of the Kepler orbit at the start; None if it falls to the centre or
    leaves, or where a thrust or another body may change it.
    """
    source, context = flown_about(scene.config), scene.context
    load = None if source is None else source.of(scene)
    others = [x for x in loads_of(scene) if x is not load]
    if source is None or load is None or load.attracting_point is None or any(map(_steers, others)):
        return None
    place = [-x for x in load.source_at_start(scene)]
    least, largest = kepler_reach(context, place, load.motion_at_start(scene), load.gravitational_parameter)
    if largest is None or least < largest * _FALLING:
        return None
    surface = source.radius(context) if source.extended else context.zero
    return least - surface, largest - surface


def _steers(load: Load) -> bool:
    """Whether a load may change an orbit by much: a thrust, a body, or what Python gives."""
    if isinstance(load, Applied):
        return load.pushes
    return (isinstance(load, Attraction) and load.pulls) or not type(load).__module__.startswith("rigidsim.")


def _range(part: Expression, reach: tuple[Any, Any], scene: Scene) -> float:
    """Change of a part along a range of altitudes; infinite if it reads anything else."""
    context, (low, high) = scene.context, reach
    if names_used(part) != {"altitude"}:
        return math.inf
    places = [low + (high - low) * n / _PLACES for n in range(_PLACES + 1)]
    found = [evaluate(part, {"altitude": place}, context) for place in places]
    return float(context.maximum(found) - context.minimum(found))


def _falling(fields: DragFields, around: Setting) -> list[Expression]:
    """The factor by which the density falls with the altitude, if it does."""
    if fields.scale_height is None or fields.altitude is None:
        return []
    ensure(
        isinstance(fields.density, ExactNumber),
        around.fault(
            "scale_height",
            "given with an expression for density, which determines its fall; remove it and altitude",
        ),
    )
    ensure(
        "altitude" in around.names,
        around.fault("altitude", "given without a surface to count from; give the central_gravity a radius"),
    )
    given = {"base": fields.altitude.alone, "scale_height": fields.scale_height.alone}
    return [around.expression("drag", "exp((base - altitude)/scale_height)", parameters=given)]


# --- light --------------------------------------------------------------------------------------------------

SPEED_OF_LIGHT = 299792458  # m/s, exact
_AU = 149597870700  # m, exact (IAU 2012)
_SUN = ExactNumber(Fraction(1361))
"""Irradiance at 1 au, W/m^2: 1360.8 +- 0.5 (Kopp & Lean, Geophysical Research Letters 38, L01706, 2011)."""
Irradiance = Annotated[ExactNumber, InUnit("W/m^2")]


class RadiationPressureFields(LoadFields):
    """Light of a named source on the body's surfaces: absorbed, reflected and scattered."""

    kind: Literal["radiation_pressure"]
    light: VariableName = Field(
        description="name of the load whose source shines, as the Sun's gravity_gradient with name = "
        '"sun"; its shadow_NAME counts where the scene has one',
        examples=["sun"],
    )
    irradiance: NotNegative[Irradiance] = Field(
        default=_SUN,
        description="at 1 au; the Sun's by default",
        examples=["1361 W/m^2"],
        json_schema_extra={"default": 1361},
    )
    shadow: StrictBool = Field(default=True, description="whether shadow_NAME counts where the scene has it")


@register_load
@dataclass(frozen=True)
class RadiationPressure(SurfaceLoad):
    """Light of a named source on plates and spheres."""

    light: str
    Fields = RadiationPressureFields
    title = "radiation_pressure"

    @staticmethod
    def effect_parts(fields: RadiationPressureFields) -> Iterator[EffectPart]:
        missing = "" if fields.shadow else "shadow = false leaves it out"
        yield EffectPart("shadow", "shadow on that light", {"shadow": False}, missing=missing)

    @classmethod
    def resolve(cls, fields: RadiationPressureFields, around: Setting) -> RadiationPressure:
        name = fields.light
        if f"r_{name}" not in around.names:
            known = [x.removeprefix("r_") for x in around.names if x.startswith("r_")]
            have = f"sources of this scene: {', '.join(known)}" if known else "this scene has no named source"
            what = (
                f'given "{name}", which is no source; {have}. A load such as a gravity_gradient on an orbit '
            )
            raise around.fault("light", f'{what}with name = "{name}" gives its place')
        pushes = Pushes(around, cls.title, [f"u{axis}_{name}" for axis in "xyz"])
        pressure = fields.irradiance.at(around.context) / SPEED_OF_LIGHT
        for number, surface in pushes.surfaces():
            _push(pushes, number, surface, pressure)
        factors = [pushes.parsed(f"({_AU}/r_{name})^2")]
        if fields.shadow and f"shadow_{name}" in around.names:
            factors.append(pushes.parsed(f"shadow_{name}"))
        return cls(pushes.acting(), pushes.stream, tuple(factors), around.free_flight, name)


def _push(pushes: Pushes, number: int, surface: OuterSurface, pressure: Any) -> None:
    size = pressure * surface.area
    if not isinstance(surface, Plate):
        pushes.on_sphere(surface, -size * (1 + 4 * surface.diffuse / 9))
        return
    normal = surface.unit(pushes.around.context)
    pushes.on_plate(surface, number, -size * (1 - surface.specular))
    pushes.on_plate(surface, number, -2 * size * surface.specular, normal, power=2)
    pushes.on_plate(surface, number, -2 * size * surface.diffuse / 3, normal)
