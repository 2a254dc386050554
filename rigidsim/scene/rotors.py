"""``[[rotors]]``: wheels in the body as keys, and the tensor of what turns with the body beside them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic import Field, StrictBool

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.arithmetic import Matrix, cross, diagonal, dot, eigen
from rigidsim.scene.bodies.body import RigidBody
from rigidsim.scene.exact import ZERO
from rigidsim.scene.fields import (
    ConfigTable,
    Direction,
    Formula,
    Moment,
    NotNegative,
    Rate,
    VariableName,
)
from rigidsim.scene.swept import plain

_ROUNDING_OF_INPUT = 1e-14  # relative, of moments that a double-precision program printed


class RotorTable(ConfigTable):
    """A wheel in the body, symmetric about its axis, whose momentum is in every total. The body's own tensor
    includes it as if it were locked.
    """

    name: VariableName = Field(examples=["wheel"])
    """letters, digits and underscores, beginning with a letter; rate_NAME in expressions is its rate"""
    axis: Direction = Field(examples=[[0, 0, 1]])
    """direction of its axis, body axes; any length"""
    moment: NotNegative[Moment] = Field(examples=["0.01 kg m^2"])
    """moment of inertia about its axis"""
    rate: Rate = Field(ZERO, examples=["300 rad/s", "3000 rpm"])
    """rate about its axis relative to the body, at the start"""
    torque: Formula | None = Field(None, examples=["-k*wz"])
    """torque of its motor on it, N m: an expression of t, the state and [parameters]; its reaction acts on
    the body; without it the rotor turns freely
    """
    fixed: StrictBool = False
    """a motor keeps the rate, whatever torque that takes"""


def turning_inertia(context: Any, body: RigidBody, apart: Sequence[Matrix]) -> tuple[Matrix, Matrix]:
    """Tensor of what turns with the body, its own less the tensors of what turns ``apart``, and its inverse:
    by elements, so that numbers of a sweep stay in it.

    Raises:
        ConfigError: no body has such a tensor.
    """
    tensor = body.inertia
    for other in apart:
        tensor = [[x - y for x, y in zip(*rows, strict=True)] for rows in zip(tensor, other, strict=True)]
    half = sum((tensor[i][i] for i in range(3)), context.zero) / 2
    spread = [[(half if i == j else context.zero) - tensor[i][j] for j in range(3)] for i in range(3)]
    size = context.maximum([abs(x) for row in body.inertia for x in row])
    slack = context.mpf(_ROUNDING_OF_INPUT)
    fits = all(minor >= -slack * size**order for order, minor in _minors(spread))
    if not (fits and all(minor > slack * size**order for order, minor in _minors(tensor))):
        moments, _ = eigen(context, [[plain(x) for x in row] for row in tensor])
        listed = ", ".join(context.nstr(x, 8) for x in moments)
        what = (
            "given moments that the body's own tensor can't include: without the rotors' moments about their "
            f"axes it would have the principal moments {listed} kg m^2, which no body has (all are positive, "
            "and none is more than the sum of the others); make the rotors smaller, or add their tensors, "
            "as of locked wheels, to the tensor of [body]"
        )
        raise ConfigError(Problem("[[rotors]] moment", what))
    return tensor, _inverse(context, tensor)


def _minors(m: Matrix) -> list[tuple[int, Any]]:
    """(order, value) of all principal minors of a symmetric matrix."""
    pairs = [(0, 1), (1, 2), (0, 2)]
    return [
        *((1, m[i][i]) for i in range(3)),
        *((2, m[i][i] * m[j][j] - m[i][j] ** 2) for i, j in pairs),
        (3, dot(m[0], cross(m[1], m[2]))),
    ]


def _inverse(context: Any, m: Matrix) -> Matrix:
    """Inverse of a symmetric matrix: its adjugate over the determinant."""
    if all(m[i][j] == 0 for i in range(3) for j in range(3) if i != j):
        return diagonal([1 / m[i][i] for i in range(3)])
    rows = [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])]
    determinant = dot(m[0], rows[0])
    return [[x / determinant for x in row] for row in rows]
