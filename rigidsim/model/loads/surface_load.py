"""Loads that push on the surfaces of the body: each push is a constant vector times an expression.

The expressions read names, as a user's own do (``rigidsim.scene.expressions.names``): directions of sources,
shadows, the velocity relative to the air. So their kinks and jumps, at which a plate comes out of the light
or the stream, are surfaces on which steps end, and the states that they take are carried.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load, Term
from rigidsim.model.load_words import value_text
from rigidsim.model.names import written
from rigidsim.model.rotations import Symbolic, apply
from rigidsim.scene.arithmetic import Vector, cross, diagonal, norm, unit_vectors
from rigidsim.scene.bodies.outside import OuterSurface, Plate
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import Expression, evaluate, states_read
from rigidsim.scene.initial_values import start_values
from rigidsim.scene.registry import Setting
from rigidsim.scene.scene import Scene


@dataclass(frozen=True)
class Push:
    """A force ``along`` (mpf, body axes) times an expression, at a ``place`` (m, body axes)."""

    along: Vector
    expression: Expression
    place: Vector


@dataclass(frozen=True)
class SurfaceLoad(Load):
    """The sum of its pushes times the product of its factors, which are the same for all."""

    pushes: tuple[Push, ...]
    factors: tuple[Expression, ...]
    flies: bool  # whether it accelerates the centre of mass

    def acts(self) -> bool:
        return bool(self.pushes)

    @property
    def expressions(self) -> tuple[Expression, ...]:
        """All different ones, factors first."""
        return tuple(dict.fromkeys((*self.factors, *(push.expression for push in self.pushes))))

    def formulas(self) -> list[Expression]:
        return list(self.expressions)

    @property
    def reads(self) -> frozenset[str]:  # type: ignore[override]
        return states_read(*self.expressions) | {"attitude"} | ({"flight"} if self.flies else set())

    def _acting(self, m: Kinematics) -> list[tuple[Push, Symbolic]]:
        """The pushes with their expressions times the factors."""
        factors = written(m, self.factors)
        found = dict(zip(self.expressions, written(m, self.expressions), strict=True))
        return [(push, hy.prod([*factors, found[push.expression]])) for push in self.pushes]

    def torque(self, m: Kinematics) -> list[Term]:
        """Torque place x force."""
        size = m.scene.context.ldexp(m.scene.context.one, -m.scaling.energy)
        found = []
        for push, value in self._acting(m):
            arm = [size * x for x in cross(push.place, push.along)]
            if any(x != 0 for x in arm):
                found.append((arm, value))
        return found

    def force(self, m: Kinematics) -> list[Term]:
        """Acceleration of a freely flying body: the force over its mass."""
        if m.velocity is None or not self.pushes:
            return []
        context = m.scene.context
        acting = self._acting(m)
        size = context.ldexp(1 / m.carried(m.scene.body.mass), m.scaling.time - m.scaling.speed)
        # in units of the largest push, so that sums of them are within the range of single precision
        largest = context.maximum([abs(x) for push in self.pushes for x in push.along])
        sums = []
        for i in range(3):
            parts = [m.number(p.along[i] / largest) * value for p, value in acting if p.along[i] != 0]
            sums.append(hy.sum(parts) if parts else hy.expression(0.0))
        return list(zip(diagonal([size * largest] * 3), apply(m.matrix, sums), strict=True))

    def _at_start(self, scene: Scene) -> tuple[Vector, Vector]:
        """Body axes, N and N m (mpf)."""
        context, values = scene.context, start_values(scene)
        factor = context.one
        for x in self.factors:
            factor = factor * evaluate(x, values, context)
        force, torque = [context.zero] * 3, [context.zero] * 3
        for push in self.pushes:
            size = factor * evaluate(push.expression, values, context)
            force = [f + size * x for f, x in zip(force, push.along, strict=True)]
            turning = cross(push.place, push.along)
            torque = [t + size * x for t, x in zip(torque, turning, strict=True)]
        return force, torque

    def told(self, scene: Scene) -> str:
        count = len(scene.config.body.surfaces or [])
        said = f"{self._words()} on {count} surface{'s' if count != 1 else ''}: "
        if not self.acts():
            return f"{said}no torque whatever the attitude"
        force, torque = (norm(scene.context, x) for x in self._at_start(scene))
        pushed = f"{value_text(force, 'N')} and " if self.flies else ""
        return f"{said}{pushed}{value_text(torque, 'N m')} at the start"

    def _words(self) -> str:
        return self.title


class Pushes:
    """What makes the pushes of a load on the surfaces of a body.

    Args:
        title: of the load.
        vector: names of the components of the vector that surfaces are met from, body axes.

    Attributes:
        found: the pushes so far; those of a vanishing size are left out.
    """

    def __init__(self, around: Setting, title: str, vector: Sequence[str]) -> None:
        self.around, self._title = around, title
        self.found: list[Push] = []
        self._vector = tuple(vector)
        self._flies = around.free_flight

    def acting(self) -> tuple[Push, ...]:
        """Those that turn the body, or all of a body in flight."""
        turns = (any(x != 0 for x in cross(push.place, push.along)) for push in self.found)
        return tuple(p for p, turning in zip(self.found, turns, strict=True) if turning or self._flies)

    def surfaces(self) -> Iterator[tuple[int, OuterSurface]]:
        """Those of the body, counted from 1; refused if there are none."""
        body = self.around.body
        if not body.surfaces:
            what = "given for a body without surfaces; give [[body.surfaces]], such as normal and area of a "
            raise self.around.fault("", what + "plate, size of a box, or radius of a sphere")
        yield from enumerate(body.surfaces, start=1)

    def along_vector(self, surface: OuterSurface, size: Any, number: int = 0, *, speed: bool = False) -> None:
        """A push along the vector, with ``speed`` times its length; on a plate as far as it faces it."""
        first, second, third = self._vector
        length = f"sqrt({first}^2 + {second}^2 + {third}^2)*" if speed else ""
        for axis, name in zip(unit_vectors(self.around.context), self._vector, strict=True):
            self.add(surface, [size * x for x in axis], number, 1, f"{length}{name}")

    def add(
        self, surface: OuterSurface, along: Vector, number: int = 0, power: int = 1, text: str = ""
    ) -> None:
        """A push times a text; on a plate times a power of the vector's component along the normal."""
        if all(x == 0 for x in along):
            return
        if not isinstance(surface, Plate):
            self.found.append(Push(along, self.parsed(text), surface.position))
            return
        context = self.around.context
        facing, given = self._facing(surface, number)
        length = norm(context, [x.at(context) for x in surface.normal]) ** power
        factors = [f"max({facing}, 0)", *([f"({facing})"] * (power - 1)), *([text] if text else [])]
        where = f"[body] {surface.place}, under {self.around.where(self._title)}"
        expression = self.parsed("*".join(factors), parameters=given, where=where)
        self.found.append(Push([x / length for x in along], expression, surface.position))

    def _facing(self, plate: Plate, number: int) -> tuple[str, dict[str, ExactNumber]]:
        """The vector's component along the normal as written, in text, and what stands for numbers there."""
        sign, given = "" if plate.side > 0 else "-", {}
        terms = []
        for axis, x, name in zip("xyz", plate.normal, self._vector, strict=True):
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
