"""Loads that push on the surfaces of the body: along the stream that they meet (air, light), and along the
normals of plates.

The expressions read names, as a user's own do (``rigidsim.scene.expressions.names``): directions of sources,
shadows, the velocity relative to the air. So their kinks and jumps, at which a plate comes out of the light
or the stream, are surfaces on which steps end, and the states that they take are carried.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.names import written
from rigidsim.model.rotations import Symbolic, apply
from rigidsim.scene.arithmetic import Vector, cross, diagonal, norm
from rigidsim.scene.bodies.outside import OuterSurface, Plate
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import Expression, states_read
from rigidsim.scene.registry import Setting

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
        axes = diagonal([m.scene.context.ldexp(largest, -m.scaling.energy)] * 3)
        return [(axis, x) for axis, x in zip(axes, parts, strict=True) if x is not None]

    def force(self, m: Kinematics) -> list[Term]:
        """Acceleration of a freely flying body: the force over its mass."""
        if m.velocity is None or not self.pushes:
            return []
        context = m.scene.context
        largest, parts = self._in_body(m, torque=False)
        size = context.ldexp(largest / m.carried(m.scene.body.mass), m.scaling.time - m.scaling.speed)
        pushed = apply(m.matrix, [hy.expression(0.0) if x is None else x for x in parts])
        return list(zip(diagonal([size] * 3), pushed, strict=True))


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
        """Those of the body, counted from 1; refused if there are none."""
        body = self.around.body
        if not body.surfaces:
            what = "given for a body without surfaces; give [[body.surfaces]], such as normal and area of a "
            raise self.around.fault("", what + "plate, size of a box, or radius of a sphere")
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
