"""The tensor of inertia as an object: what gives I w and w . I w / 2, and solves Euler's equations for w'.

All right-hand sides of the rates come from ``accelerations``. A tensor that varies is another class with the
same members; its ``change`` is dI/dt along the motion.

The tensor that turns is the one in the equations of motion. It differs from the one of the mass distribution,
which a gravity gradient feels, by what turns on a bearing (``rigidsim.scene.scene.Scene.turning_inertia``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.rotations import Symbolic, SymbolicMatrix
from rigidsim.model.scaling import Rounder, ScaledNumbers
from rigidsim.scene.arithmetic import Matrix, Vector, cross, dot, negligible

_LEVI_CIVITA = {
    (0, 1, 2): 1, (1, 2, 0): 1, (2, 0, 1): 1,
    (0, 2, 1): -1, (2, 1, 0): -1, (1, 0, 2): -1,
}  # fmt: skip


Term = tuple[Vector, Symbolic]


class Inertia:
    """A tensor of inertia, in internal units and body axes; ``times`` and ``solved`` are what a class of your
    own defines, and ``change`` if it varies.

    Attributes:
        number: rounds an mpf once to the working precision's scalar.
    """

    number: Rounder

    def times(self, vector: list[Symbolic]) -> list[Symbolic]:
        """I v."""
        raise NotImplementedError

    def solved(self, vector: list[Symbolic]) -> list[Symbolic]:
        """I^-1 v."""
        raise NotImplementedError

    def change(self) -> SymbolicMatrix | None:
        """dI/dt along the motion, per internal unit of time; None for a constant tensor."""
        return None

    def energy(self, rates: list[Symbolic], momentum: list[Symbolic]) -> Symbolic:
        """Kinetic energy of rotation w . I w / 2, with ``momentum`` I w."""
        return 0.5 * hy.sum([w * x for w, x in zip(rates, momentum, strict=True)])

    def accelerations(self, states: list[Symbolic], units: Vector, torque: Sequence[Term]) -> list[Symbolic]:
        """Derivatives of the rates' ``states``, each in its own unit, by I w' = (I w) x w - I' w + torque.

        Args:
            torque: terms of the torque on the body, internal units of energy.
        """
        number = self.number
        rates = [s if u == 1 else number(u) * s for s, u in zip(states, units, strict=True)]
        right = [[x] for x in cross(self.times(rates), rates)]
        for vector, expression in torque:
            for row, x in zip(right, vector, strict=True):
                row += [number(x) * expression] if x != 0 else []
        if (change := self.change()) is not None:
            for row, changes in zip(right, change, strict=True):
                row += [-(x * w) for x, w in zip(changes, rates, strict=True) if not absent(x)]
        turning = self.solved([hy.sum(row) for row in right])
        return [x if u == 1 else number(1 / u) * x for x, u in zip(turning, units, strict=True)]


@dataclass(frozen=True)
class MassDistribution:
    """One that changes: its tensor and dI/dt along the motion, body axes, internal units.

    Both are symmetric; an element that is zero for good is the number 0. Where the momentum is carried
    instead of the rates, nobody needs dI/dt: the states are then the rates that a body of the constant tensor
    would have with the same momentum.

    Attributes:
        rate_correction: angular velocity less these rates, 1 / time; None where rates are the states.
        distortion: what the tensor differs by from the constant one; known where the rates are corrected.
    """

    matrix: SymbolicMatrix
    change: SymbolicMatrix | None
    rate_correction: list[Symbolic] | None = None
    distortion: SymbolicMatrix | None = None


@dataclass(frozen=True)
class VaryingInertia(Inertia):
    """The tensor of a ``MassDistribution`` less a constant part, of what turns on bearings."""

    matrix: SymbolicMatrix
    rates: SymbolicMatrix | None
    number: Rounder

    @classmethod
    def of(cls, shape: MassDistribution, numbers: ScaledNumbers, number: Rounder) -> VaryingInertia:
        """The tensor of what turns with the body."""
        less = [
            [x - y for x, y in zip(*rows, strict=True)]
            for rows in zip(numbers.inertia, numbers.turning_inertia, strict=True)
        ]
        matrix = [
            [x - number(y) if y != 0 else x for x, y in zip(*rows, strict=True)]
            for rows in zip(shape.matrix, less, strict=True)
        ]
        return cls(matrix, shape.change, number)

    def times(self, vector: list[Symbolic]) -> list[Symbolic]:
        """See ``Inertia``."""
        return product(self.matrix, vector)

    def solved(self, vector: list[Symbolic]) -> list[Symbolic]:
        """See ``Inertia``: by the adjugate, unless the tensor is diagonal."""
        if all(absent(self.matrix[i][j]) for i in range(3) for j in range(3) if i != j):
            return [x / self.matrix[i][i] for i, x in enumerate(vector)]
        (a, f, e), (_, b, d), (_, _, c) = self.matrix
        adjugate = [
            [b * c - d * d, d * e - c * f, d * f - b * e],
            [d * e - c * f, a * c - e * e, e * f - a * d],
            [d * f - b * e, e * f - a * d, a * b - f * f],
        ]
        volume = hy.sum([hy.expression(x * y) for x, y in zip(self.matrix[0], adjugate[0], strict=True)])
        return [x / volume for x in product(adjugate, vector)]

    def change(self) -> SymbolicMatrix | None:
        """See ``Inertia``."""
        return self.rates


def absent(element: Any) -> bool:
    """Whether an element of a symbolic tensor is zero for good."""
    return isinstance(element, int | float) and element == 0


def product(matrix: SymbolicMatrix, vector: list[Symbolic]) -> list[Symbolic]:
    """M v without the elements that are zero for good."""
    rows = [[x * v for x, v in zip(row, vector, strict=True) if not absent(x)] for row in matrix]
    return [hy.sum(row) if row else hy.expression(0.0) for row in rows]


@dataclass(frozen=True)
class ConstantInertia(Inertia):
    """A constant tensor and its inverse, each element rounded once where it meets a state."""

    matrix: Matrix
    inverse: Matrix
    number: Rounder
    context: Any

    @classmethod
    def of(cls, numbers: ScaledNumbers, number: Rounder, context: Any) -> ConstantInertia:
        """The tensor of what turns with the body."""
        return cls(numbers.turning_inertia, numbers.inverse_inertia, number, context)

    def times(self, vector: list[Symbolic]) -> list[Symbolic]:
        """See ``Inertia``."""
        return self._product(self.matrix, vector)

    def solved(self, vector: list[Symbolic]) -> list[Symbolic]:
        """See ``Inertia``."""
        return self._product(self.inverse, vector)

    def _product(self, matrix: Matrix, vector: list[Symbolic]) -> list[Symbolic]:
        """Elements that are only rounding are left out."""
        least = self._size(matrix) * negligible(self.context)
        products = [[(x, w) for x, w in zip(row, vector, strict=True) if abs(x) > least] for row in matrix]
        return [hy.sum([self.number(x) * w for x, w in row]) for row in products]

    def _size(self, matrix: Matrix) -> Any:
        return self.context.maximum([abs(x) for row in matrix for x in row])

    def accelerations(self, states: list[Symbolic], units: Vector, torque: Sequence[Term]) -> list[Symbolic]:
        """See ``Inertia``: quadratic forms in the rates, so that principal and arbitrary body axes are one
        case; in principal axes the coefficients that vanish are left out (Landau & Lifshitz, Mechanics,
        eq. 36.4-5).
        """
        context, inverse, number = self.context, self.inverse, self.number
        zero, tiny = context.zero, negligible(context)
        largest_inverse = self._size(inverse)
        scale = largest_inverse * self._size(self.matrix)
        result = []
        for i in range(3):
            quadratic: dict[tuple[int, int], Any] = {}
            for (axis, a, b), sign in _LEVI_CIVITA.items():
                for j in range(3):
                    pair = (min(j, b), max(j, b))
                    term = sign * inverse[i][axis] * self.matrix[a][j] * units[j] * units[b] / units[i]
                    quadratic[pair] = quadratic.get(pair, zero) + term
            terms = [
                number(c) * (states[j] * states[b])
                for (j, b), c in quadratic.items()
                if abs(c) > tiny * (scale * units[j] * units[b] / units[i])
            ]
            for vector, expression in torque:
                coefficient = dot(inverse[i], vector) / units[i]
                size = largest_inverse * context.maximum(abs(x) for x in vector) / units[i]
                if abs(coefficient) > tiny * size:
                    terms.append(number(coefficient) * expression)
            result.append(hy.sum(terms))
        return result
