"""Equations of motion of the body rates, of the vertical in body axes, and of free flight.

Every coefficient is worked out in the scene's arithmetic (mpmath with guard bits) and rounded once, to
the working precision, by ``number``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import heyoka as hy

from rigidsim.model.rotations import Expression, ExpressionMatrix
from rigidsim.model.scaling import Scaling
from rigidsim.scene.context import dot, norm
from rigidsim.scene.scene import Scene

if TYPE_CHECKING:
    from rigidsim.model.loads import Term
    from rigidsim.model.mechanics import Mechanics

Number = Callable[[Any], Any]
"""From an mpf to the working precision's scalar, rounded once."""

LEVI_CIVITA = {
    (0, 1, 2): 1, (1, 2, 0): 1, (2, 0, 1): 1,
    (0, 2, 1): -1, (2, 1, 0): -1, (1, 0, 2): -1,
}  # fmt: skip


@dataclass(frozen=True)
class ScaledNumbers:
    """The scene's constants in internal units (see ``Scaling``), as mpf.

    Attributes:
        inertia, inverse_inertia: 3x3.
        rate_units: the three rates' own units.
        arm: M com |g|, body axes: the potential energy is ``arm . vertical``; None without a torque.
        up: unit vector against gravity, space axes; None without gravity.
    """

    inertia: list[list[Any]]
    inverse_inertia: list[list[Any]]
    rate_units: list[Any]
    arm: list[Any] | None
    up: list[Any] | None


def scaled_numbers(scene: Scene, scaling: Scaling) -> ScaledNumbers:
    """Bring the scene's constants to internal units; powers of two only, so nothing is rounded."""
    context = scene.context
    one = context.one
    up = None
    if scene.gravity is not None and any(g != 0 for g in scene.gravity):
        strength = norm(context, scene.gravity)
        up = [-g / strength for g in scene.gravity]
    arm = None
    if scene.torque_arm is not None:
        assert scene.gravity is not None
        strength = norm(context, scene.gravity)
        arm = [context.ldexp(a * strength, -scaling.energy) for a in scene.torque_arm]
    return ScaledNumbers(
        [[context.ldexp(x, -scaling.inertia) for x in row] for row in scene.body.inertia],
        [[context.ldexp(x, scaling.inertia) for x in row] for row in scene.inverse_inertia],
        [context.ldexp(one, e) for e in scaling.rates],
        arm,
        up,
    )


def negligible(context: Any, value: Any, scale: Any) -> bool:
    """True for what is left of a zero after the scene's own rounding."""
    return abs(value) <= abs(scale) * context.mpf(2) ** (24 - context.prec)


def rate_equations(m: Mechanics, torque: list[Term]) -> list[Expression]:
    """Euler's equations I w' = (I w) x w + torque, solved for the scaled rates' derivatives.

    Written as quadratic forms in the rates, so that principal and arbitrary body axes are one case: in
    principal axes the coefficients that vanish are left out (Landau & Lifshitz, Mechanics, eq. 36.4-5).

    Args:
        torque: terms of all loads, body axes, internal units.
    """
    context, numbers, states = m.scene.context, m.numbers, m.rate_states
    zero = context.zero
    inverse, inertia, units = numbers.inverse_inertia, numbers.inertia, numbers.rate_units
    largest_inverse = max(abs(x) for row in inverse for x in row)
    scale = largest_inverse * max(abs(x) for row in inertia for x in row)
    result = []
    for i in range(3):
        quadratic: dict[tuple[int, int], Any] = {}
        for (axis, a, b), sign in LEVI_CIVITA.items():
            for j in range(3):
                pair = (min(j, b), max(j, b))
                term = sign * inverse[i][axis] * inertia[a][j] * units[j] * units[b] / units[i]
                quadratic[pair] = quadratic.get(pair, zero) + term
        terms = [
            m.number(c) * (states[j] * states[b])
            for (j, b), c in quadratic.items()
            if not negligible(context, c, scale * units[j] * units[b] / units[i])
        ]
        for vector, expression in torque:
            coefficient = dot(inverse[i], vector) / units[i]
            size = largest_inverse * max(abs(x) for x in vector) / units[i]
            if not negligible(context, coefficient, size):
                terms.append(m.number(coefficient) * expression)
        result.append(hy.sum(terms) if terms else hy.expression(0.0))
    return result


def vertical_from_attitude(
    matrix: ExpressionMatrix, numbers: ScaledNumbers, number: Number
) -> list[Expression]:
    """The unit vector against gravity, R^T up, in body axes."""
    assert numbers.up is not None
    terms = [[number(u) * matrix[i][k] for i, u in enumerate(numbers.up) if u != 0] for k in range(3)]
    return [hy.sum(column) for column in terms]


def vertical_equations(vertical: list[Expression], rates: list[Expression]) -> list[Expression]:
    """Poisson's equations g' = g x w of a direction fixed in space, seen from the body."""
    g, w = vertical, rates
    return [
        g[1] * w[2] - g[2] * w[1],
        g[2] * w[0] - g[0] * w[2],
        g[0] * w[1] - g[1] * w[0],
    ]


def flight_equations(m: Mechanics, force: list[Term]) -> tuple[list[Expression], list[Expression]]:
    """x' = v and v' = force over mass, in the units of position and speed."""
    assert m.velocity is not None
    context, scaling = m.scene.context, m.scaling
    ratio = m.number(context.ldexp(context.one, scaling.speed + scaling.time - scaling.length))
    accelerations = []
    for i in range(3):
        terms = [m.number(vector[i]) * expression for vector, expression in force if vector[i] != 0]
        accelerations.append(hy.sum(terms) if terms else hy.expression(0.0))
    return [ratio * v for v in m.velocity], accelerations
