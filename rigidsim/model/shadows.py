"""``shadow_NAME``: the share of a source's disc that the body sees past other sources with a radius.

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

import random
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load_words import length_text
from rigidsim.model.sources import SeenSource, read_in, sources_of
from rigidsim.model.two_part import rounded
from rigidsim.scene.arithmetic import bits_in_use, norm
from rigidsim.scene.expressions.names import NameProvider, Readable, provides
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config
from rigidsim.scene.tracing.numbers import plain

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
        """The share in terms of names of its own."""
        text, found = _PAST[self.source.extended], {}
        states = self.source.states | self.other.states
        for part, name in self.parts.items():
            own = f"{part}{self.other.number}"
            text = text.replace(part, own)
            found[own] = Readable(name, "", states, 1, long=True)
        return f"({text})", found


@provides
class Shadows(NameProvider):
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
        """Of those that are read."""
        found: dict[str, Any] = {}
        read, context = read_in(scene), scene.context
        for pair in _pairs(scene.config):
            if not read & set(pair.parts.values()):
                continue
            places = [x.of(scene).source_at_start(scene) for x in (pair.source, pair.other)]
            far = [norm(context, place) for place in places]
            units = [[x / r for x in place] for place, r in zip(places, far, strict=True)]
            size = pair.source.radius(context) / far[0] if pair.source.extended else None
            _refuse_inside(pair.other, far[1], context)
            before = far[1] < far[0]
            values = _in_numbers(context).parts(units, size, pair.other.radius(context) / far[1], before)
            found |= {name: values[part] for part, name in pair.parts.items()}
        return found

    def at_random(
        self, scene: Scene, start: Mapping[str, Any], generator: random.Random
    ) -> Mapping[str, Any]:
        """Any share, on all sides of the contacts."""
        least = {name: 0 if name.endswith(("partly", "full")) else -1 for name in start}
        return {name: scene.context.mpf(generator.uniform(x, 1)) for name, x in least.items()}

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        """See ``NameProvider``."""
        found: dict[str, Any] = {}
        context = m.scene.context
        for pair in _pairs(m.scene.config):
            if not set(names) & set(pair.parts.values()):
                continue
            here, there = (x.of(m.scene).source_place(m) for x in (pair.source, pair.other))
            size, other = (
                _number(m, x.radius(context) / place.unit) * place.inverse if x.extended else None
                for x, place in ((pair.source, here), (pair.other, there))
            )
            before = hy.gt(_number(m, here.unit / there.unit) * there.inverse, here.inverse)
            values = _in_expressions(m).parts([here.direction, there.direction], size, other, before)
            found |= {name: values[part] for part, name in pair.parts.items()}
        return found


def _refuse_inside(source: SeenSource, far: Any, context: Any) -> None:
    radius = source.radius(context)
    if far <= radius:
        given, distance = (length_text(float(plain(x))) for x in (radius, far))
        what = f"given {given}, but the body starts {distance} from the source's centre, inside it, where no "
        what += "shadow is known; check the unit, the orbit and the start"
        raise ConfigError(Problem(f"[[loads]] number {source.number + 1} radius", what))


def _pairs(config: Config) -> Iterator[_Pair]:
    found = sources_of(config)
    for source in found:
        others = (x for x in found if x.extended and x.number != source.number)
        yield from (_Pair(source, other) for other in others if source.name)


@dataclass(frozen=True)
class _Share:
    """The share in arithmetic that is either mpf's or heyoka's.

    Attributes:
        choose: the second or the third of its arguments, by the first.
        above: whether all values are above zero.
    """

    context: Any
    functions: Any  # sin, asin, sqrt, atan2
    number: Callable[[Any], Any]
    choose: Callable[[Any, Any, Any], Any]
    above: Callable[[list[Any]], Any]

    def parts(self, units: list[Any], first: Any, second: Any, before: Any) -> dict[str, Any]:
        """The parts of ``_Pair.parts``.

        Args:
            units: unit vectors to the source and to the other one.
            first: sine of the source's angular radius; None of a point.
            second: that of the other one's.
            before: whether the other one is nearer.
        """
        one = self.number(self.context.one)
        apart = _square(units[0][0] - units[1][0])
        for x, y in zip(units[0][1:], units[1][1:], strict=True):
            apart = apart + _square(x - y)
        apart = apart / 4.0
        b = self.functions.asin(second)
        if first is None:
            least = _square(self.functions.sin(b / 2.0))
            return {"outer": least - apart, "full": self.choose(before, 0.0 * one, one)}
        a = self.functions.asin(first)
        inside, outside = (_square(self.functions.sin(x / 2.0)) for x in (a - b, a + b))
        edge = self.context.ldexp(self.context.one, -(bits_in_use(self.context) // 2))
        edge = self.number(edge) * (first * second)
        inner, outer = apart - inside, outside - apart
        partial = self.above([inner - edge / 2.0, outer - edge / 2.0])
        covered = self._covered(a, b, self.choose(partial, apart, (inside + outside) / 2.0))
        ring = self.choose(self.above([a - b]), one - _square(b / a), 0.0 * one)
        return {
            "inner": inner - edge,
            "outer": outer - edge,
            "partly": self.choose(before, one - covered, one),
            "full": self.choose(before, ring, one),
        }

    def _covered(self, a: Any, b: Any, apart: Any) -> Any:
        """Share of a disc of angular radius a under one of b, for sin^2 of half the angle between them."""
        c = 2.0 * self.functions.asin(self.functions.sqrt(apart))
        x = (c * c + (a - b) * (a + b)) / (2.0 * c)
        product = (a + b - c) * (a + b + c) * (c - a + b) * (c + a - b)
        y = self.functions.sqrt(self.choose(self.above([product]), product, 0.0 * c + 1.0)) / (2.0 * c)
        area = a * a * self.functions.atan2(y, x) + b * b * self.functions.atan2(y, c - x) - c * y
        return area * self.number(1 / self.context.pi) / (a * a)


def _in_numbers(context: Any) -> _Share:
    return _Share(
        context,
        context,
        lambda x: x,
        lambda of, x, y: x if of else y,
        lambda values: all(x > 0 for x in values),
    )


def _in_expressions(m: Kinematics) -> _Share:
    def above(values: list[Any]) -> Any:
        return hy.logical_and([hy.gt(x, 0.0) for x in values])

    return _Share(m.scene.context, hy, partial(_number, m), hy.select, above)


def _square(value: Any) -> Any:
    return value * value


def _number(m: Kinematics, value: Any) -> Any:
    return hy.expression(rounded(m.number(value)))
