"""Names of sources in expressions: where the body sees the source of a load, and the source's shadow.

Directions are in body axes and take the attitude; distances don't, and neither do shadows. ``altitude`` and
``vrx vry vrz`` are height above the body flown about, and velocity relative to its air: of the first load by
which the body in flight is attracted and that has a radius or a rate of its atmosphere; the first one of all
where none has.

``shadow_NAME`` is the share of a source's disc that the body sees past other sources with a radius.

Discs of angular radii a (of the source) and b (of what is before it), an angle c apart, overlap in

    a^2 (A - sin A cos A) + b^2 (B - sin B cos B),   tan A = y / x,   tan B = y / (c - x),
    x = (c^2 + a^2 - b^2) / 2 c,   y^2 = a^2 - x^2

(Montenbruck & Gill, Satellite Orbits, 2000, section 3.4.2). At the contacts, c = a + b and c = |a - b|, this
is a power 3/2 of the distance from them, and has no series. The penumbra is therefore taken to begin and end
a little within the contacts, on two surfaces

    sin^2((a + b)/2) - sin^2(c/2) = d sin a sin b,   sin^2(c/2) - sin^2((a - b)/2) = d sin a sin b,

where the share jumps by less than 2 d^(3/2): d is such that this is below the working precision. A source
without a radius is a point, whose shadow jumps at c = b. What covers it is several bodies' only if they are
apart: the shares that are seen past each are multiplied.
"""

from __future__ import annotations

import operator
import random
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.names import in_si
from rigidsim.model.placements import SourcePlace
from rigidsim.model.rotations import apply, transpose
from rigidsim.model.two_part import rounded
from rigidsim.scene.arithmetic import Vector, bits_in_use, cross, norm
from rigidsim.scene.arithmetic import apply as apply_numbers
from rigidsim.scene.arithmetic import transpose as transposed
from rigidsim.scene.attitude import rotation_matrix
from rigidsim.scene.expressions.names import PLACES, NameProvider, Readable, provides
from rigidsim.scene.expressions.tree import names_used
from rigidsim.scene.readable import length_text
from rigidsim.scene.registry import LoadFields
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.swept import plain

RELATIVE_NAMES = ("vrx", "vry", "vrz")
_FLIGHT = frozenset({"flight", PLACES})
_AXES = "xyz"


@dataclass(frozen=True)
class SeenSource:
    """A load whose source is at a known place.

    Attributes:
        number: place of the load in ``[[loads]]``, from 0.
        fields: its keys in the config.
        states: those that the place takes, see ``Readable.states``.
    """

    number: int
    fields: LoadFields
    states: frozenset[str]

    @property
    def name(self) -> str:
        """Empty for a load without one."""
        return self.fields.name or ""

    @property
    def extended(self) -> bool:
        """Whether its radius is given."""
        return getattr(self.fields, "radius", None) is not None

    def radius(self, context: Any) -> Any:
        """Radius of the source, m (mpf)."""
        return self.fields.radius.at(context)  # type: ignore[attr-defined]

    def of(self, scene: Scene) -> Any:
        """The load itself."""
        return scene.given_loads[self.number]


def sources_of(config: Config) -> list[SeenSource]:
    """All loads of a config whose sources are at known places."""
    flies, found = config.initial.flies, []
    for number, fields in enumerate(config.loads):
        states = fields.placed_by(free_flight=flies)
        if states is not None:
            found.append(SeenSource(number, fields, states | {PLACES}))
    return found


def read_in(scene: Scene) -> frozenset[str]:
    """Names that any of a scene's expressions reads."""
    return names_used(*scene.formulas())


def in_body_axes(scene: Scene, space: Vector) -> Vector:
    """A vector of space axes at the start (mpf), in body axes."""
    return apply_numbers(transposed(rotation_matrix(scene.quaternion)), space)


def flown_about(config: Config) -> SeenSource | None:
    """The load about whose source the body flies through air; None without one."""
    if not config.initial.flies:
        return None
    found = [x for x in sources_of(config) if hasattr(x.fields, "atmosphere_rate")]
    with_air = [x for x in found if x.extended or x.fields.atmosphere_rate is not None]  # type: ignore[attr-defined]
    return next(iter(with_air or found), None)


# --- what the body sees, in numbers or in expressions -------------------------------------------------------


@dataclass(frozen=True)
class View:
    """Where the body sees its sources, SI: at the start (mpf), or along the motion (expressions).

    Attributes:
        number: a constant (mpf) in this arithmetic, whose ``functions`` are sin, asin, sqrt and atan2.
        choose: the second or the third of its arguments, by the first.
        place, velocity: of a load's source, and of the body as seen from that, space axes.
        in_body: a vector of space axes in body axes.
    """

    scene: Scene
    functions: Any
    number: Callable[[Any], Any]
    greater: Callable[[Any, Any], Any]
    both: Callable[[list[Any]], Any]
    choose: Callable[[Any, Any, Any], Any]
    place: Callable[[Any], SourcePlace]
    velocity: Callable[[Any], list[Any]]
    in_body: Callable[[list[Any]], list[Any]]

    @classmethod
    def at_start(cls, scene: Scene) -> View:
        """In numbers."""
        context = scene.context

        def place(load: Any) -> SourcePlace:
            vector = load.source_at_start(scene)
            far = norm(context, vector)
            return SourcePlace([x / far for x in vector], 1 / far, context.one)

        return cls(
            scene, context, lambda x: x, operator.gt, all, lambda of, x, y: x if of else y, place,
            lambda load: load.motion_at_start(scene), partial(in_body_axes, scene),
        )  # fmt: skip

    @classmethod
    def along_motion(cls, m: Kinematics) -> View:
        """In expressions."""
        return cls(
            m.scene, hy, lambda x: hy.expression(rounded(m.number(x))), hy.gt, hy.logical_and, hy.select,
            lambda load: load.source_place(m),
            lambda load: [in_si(m, v, m.scaling.speed) for v in load.motion(m)],
            lambda vector: apply(transpose(m.matrix), vector),
        )  # fmt: skip

    def distance(self, place: SourcePlace) -> Any:
        """Of a source, m."""
        return self.number(place.unit) / place.inverse


class SeenNames(NameProvider):
    """Names that ``values`` of a view stand for."""

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """Of those that are read: the series of an ephemeris takes a while."""
        return self.values(View.at_start(scene), read_in(scene))

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        return self.values(View.along_motion(m), frozenset(names))

    def values(self, view: View, names: frozenset[str]) -> Mapping[str, Any]:
        """Values of its names that are asked for, or more."""
        raise NotImplementedError


@provides
class SourceNames(SeenNames):
    """Direction of each named source and its distance."""

    brings = "ux_NAME, uy_NAME, uz_NAME, r_NAME with a load that has this name and a source at a known place"

    def names(self, config: Config) -> Iterable[Readable]:
        """See ``NameProvider``."""
        for source in _named(config):
            for axis in _AXES:
                yield Readable(f"u{axis}_{source.name}", "", source.states | {"attitude"}, 1)
            yield Readable(f"r_{source.name}", "m", source.states)

    def elsewhere(self, config: Config) -> str:
        """Any load may have a name."""
        return self.brings

    def at_random(
        self, scene: Scene, start: Mapping[str, Any], generator: random.Random
    ) -> Mapping[str, Any]:
        """Any directions, and distances about as large as at the start."""
        found: dict[str, Any] = {}
        for source in _named(scene.config):
            directions, far = _names(source)
            if far in start:
                vector = [scene.context.mpf(generator.gauss(0, 1)) for _ in _AXES]
                size = norm(scene.context, vector)
                found |= zip(directions, [x / size for x in vector], strict=True)
                found[far] = start[far] * scene.context.mpf(generator.uniform(0.5, 2))
        return found

    def values(self, view: View, names: frozenset[str]) -> Mapping[str, Any]:
        """See ``SeenNames``."""
        found: dict[str, Any] = {}
        for source in _named(view.scene.config):
            directions, far = _names(source)
            if names & {*directions, far}:
                place = view.place(source.of(view.scene))
                found[far] = view.distance(place)
                if names & set(directions):
                    found |= zip(directions, view.in_body(place.direction), strict=True)
        return found


def _named(config: Config) -> Iterator[SeenSource]:
    return (source for source in sources_of(config) if source.name)


def _names(source: SeenSource) -> tuple[list[str], str]:
    return [f"u{axis}_{source.name}" for axis in _AXES], f"r_{source.name}"


@provides
class FlightNames(SeenNames):
    """Names of a flight about a body with a surface and air."""

    def names(self, config: Config) -> Iterable[Readable]:
        """See ``NameProvider``."""
        source = flown_about(config)
        if source is not None and source.extended:
            yield Readable("altitude", "m", _FLIGHT)
        if source is not None:
            yield from (Readable(name, "m/s", _FLIGHT | {"attitude"}) for name in RELATIVE_NAMES)

    def elsewhere(self, config: Config) -> str:
        """See ``NameProvider``."""
        if (source := flown_about(config)) is None:
            return "altitude, vrx, vry, vrz in flight, with central_gravity"
        return "" if source.extended else "altitude with a radius of the central_gravity"

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """All of them."""
        return self.values(View.at_start(scene), frozenset({"altitude", *RELATIVE_NAMES}))

    def values(self, view: View, names: frozenset[str]) -> Mapping[str, Any]:
        """See ``SeenNames``."""
        source, context = flown_about(view.scene.config), view.scene.context
        if source is None or not names & {"altitude", *RELATIVE_NAMES}:
            return {}
        load, found = source.of(view.scene), {}
        place = view.place(load)
        far = view.distance(place)
        if source.extended:
            found["altitude"] = far - view.number(source.radius(context))
        if names & set(RELATIVE_NAMES):
            relative, given = view.velocity(load), source.fields.atmosphere_rate  # type: ignore[attr-defined]
            rate = [x.at(context) for x in given or ()]
            if any(x != 0 for x in rate):
                swept = cross([view.number(x) for x in rate], [-far * x for x in place.direction])
                relative = [v - u for v, u in zip(relative, swept, strict=True)]
            found |= zip(RELATIVE_NAMES, view.in_body(relative), strict=True)
        return found


# --- shadows ------------------------------------------------------------------------------------------------

_PAST = {
    True: "(1 - step(inner))*full + step(inner)*(step(outer)*partly + 1 - step(outer))",
    False: "step(outer)*full + 1 - step(outer)",
}
"""The share that is seen past one body, of a disc and of a point."""
_PARTS = {True: ("inner", "outer", "partly", "full"), False: ("outer", "full")}


@dataclass(frozen=True)
class _Pair:
    """A named source, and another one with a radius, which may cover it."""

    source: SeenSource
    other: SeenSource

    @property
    def parts(self) -> dict[str, str]:
        """What the share is written in, and names for it, which no text of a user's can have."""
        start = f"shadow_{self.source.name} {self.other.number}"
        return {part: f"{start} {part}" for part in _PARTS[self.source.extended]}

    def formula(self) -> tuple[str, dict[str, Readable]]:
        """The share in terms of the source's names."""
        text, found = _PAST[self.source.extended], {}
        states = self.source.states | self.other.states
        for part, name in self.parts.items():
            own = f"{part}{self.other.number}"
            text = text.replace(part, own)
            found[own] = Readable(name, "", states, 1, long=True)
        return f"({text})", found


@provides
class Shadows(SeenNames):
    """The share of each named source that is seen past others."""

    brings = "shadow_NAME with a load that has this name and another one whose source has a radius"

    def names(self, config: Config) -> Iterable[Readable]:
        """See ``NameProvider``."""
        found: dict[str, list[_Pair]] = {}
        for pair in _pairs(config):
            found.setdefault(pair.source.name, []).append(pair)
        for name, pairs in found.items():
            written = [pair.formula() for pair in pairs]
            parts = {key: part for _, own in written for key, part in own.items()}
            states = frozenset[str]().union(*(part.states for part in parts.values()))
            text = "*".join(text for text, _ in written)
            jumps = "" if pairs[0].source.extended else "give its source a radius, for a penumbra"
            yield Readable(f"shadow_{name}", "", states, 1, jumps=jumps, formula=text, parts=parts)

    def elsewhere(self, config: Config) -> str:
        """Any load may have a name."""
        return self.brings

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        """See ``SeenNames``; refused inside what may cover a source."""
        view, read = View.at_start(scene), read_in(scene)
        for pair in _pairs(scene.config):
            if read & set(pair.parts.values()):
                _refuse_inside(pair.other, view.distance(view.place(pair.other.of(scene))), scene.context)
        return self.values(view, read)

    def at_random(
        self, scene: Scene, start: Mapping[str, Any], generator: random.Random
    ) -> Mapping[str, Any]:
        """Any share, on all sides of the contacts."""
        least = {name: 0 if name.endswith(("partly", "full")) else -1 for name in start}
        return {name: scene.context.mpf(generator.uniform(x, 1)) for name, x in least.items()}

    def values(self, view: View, names: frozenset[str]) -> Mapping[str, Any]:
        """See ``SeenNames``."""
        found: dict[str, Any] = {}
        for pair in _pairs(view.scene.config):
            if names & set(pair.parts.values()):
                here, there = (view.place(x.of(view.scene)) for x in (pair.source, pair.other))
                size, other = (
                    view.number(x.radius(view.scene.context) / place.unit) * place.inverse
                    if x.extended
                    else None
                    for x, place in ((pair.source, here), (pair.other, there))
                )
                nearer = view.greater(view.number(here.unit / there.unit) * there.inverse, here.inverse)
                values = _shares(view, [here.direction, there.direction], size, other, nearer)
                found |= {name: values[part] for part, name in pair.parts.items()}
        return found


def _refuse_inside(source: SeenSource, far: Any, context: Any) -> None:
    radius = source.radius(context)
    if far <= radius:
        given, distance = (length_text(float(plain(x))) for x in (radius, far))
        raise ConfigError(
            Problem(
                f"[[loads]] number {source.number + 1} radius",
                f"given {given}, but the body starts {distance} from the source's centre, inside it, where "
                "no shadow is known; check the unit, the orbit and the start",
            )
        )


def _pairs(config: Config) -> Iterator[_Pair]:
    found = sources_of(config)
    for source in found:
        others = (x for x in found if x.extended and x.number != source.number)
        yield from (_Pair(source, other) for other in others if source.name)


def _shares(view: View, units: list[Any], first: Any, second: Any, before: Any) -> dict[str, Any]:
    """The parts of ``_Pair.parts``.

    Args:
        units: unit vectors to the source and to the other one.
        first: sine of the source's angular radius; None of a point.
        second: the same of the other one.
        before: whether the other one is nearer.
    """
    functions, context, choose = view.functions, view.scene.context, view.choose
    one = view.number(context.one)
    apart = _square(units[0][0] - units[1][0])
    for x, y in zip(units[0][1:], units[1][1:], strict=True):
        apart = apart + _square(x - y)
    apart = apart / 4.0
    b = functions.asin(second)
    if first is None:
        least = _square(functions.sin(b / 2.0))
        return {"outer": least - apart, "full": choose(before, 0.0 * one, one)}
    a = functions.asin(first)
    inside, outside = (_square(functions.sin(x / 2.0)) for x in (a - b, a + b))
    edge = context.ldexp(context.one, -(bits_in_use(context) // 2))
    edge = view.number(edge) * (first * second)
    inner, outer = apart - inside, outside - apart
    partial = view.both([view.greater(x - edge / 2.0, 0.0) for x in (inner, outer)])
    covered = _covered(view, a, b, choose(partial, apart, (inside + outside) / 2.0))
    ring = choose(view.greater(a - b, 0.0), one - _square(b / a), 0.0 * one)
    return {
        "inner": inner - edge,
        "outer": outer - edge,
        "partly": choose(before, one - covered, one),
        "full": choose(before, ring, one),
    }


def _covered(view: View, a: Any, b: Any, apart: Any) -> Any:
    """Share of a disc of angular radius a under one of b, for sin^2 of half the angle between them."""
    functions = view.functions
    c = 2.0 * functions.asin(functions.sqrt(apart))
    x = (c * c + (a - b) * (a + b)) / (2.0 * c)
    product = (a + b - c) * (a + b + c) * (c - a + b) * (c + a - b)
    y = functions.sqrt(view.choose(view.greater(product, 0.0), product, 0.0 * c + 1.0)) / (2.0 * c)
    area = a * a * functions.atan2(y, x) + b * b * functions.atan2(y, c - x) - c * y
    return area * view.number(1 / view.scene.context.pi) / (a * a)


def _square(value: Any) -> Any:
    return value * value
