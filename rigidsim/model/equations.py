"""Equations of motion of the body rates, of vertical and quaternion, and of free flight.

Every coefficient is worked out in the scene's arithmetic (mpmath with guard bits) and rounded once, to
the working precision, by ``number``.
"""

from __future__ import annotations

from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Term
from rigidsim.model.numbers import Rounder, ScaledNumbers
from rigidsim.model.rotations import Symbolic, SymbolicMatrix
from rigidsim.scene.arithmetic import dot, negligible
from rigidsim.scene.tracing.numbers import largest_of

LEVI_CIVITA = {
    (0, 1, 2): 1, (1, 2, 0): 1, (2, 0, 1): 1,
    (0, 2, 1): -1, (2, 1, 0): -1, (1, 0, 2): -1,
}  # fmt: skip


def rate_equations(m: Kinematics, torque: list[Term]) -> list[Symbolic]:
    """Euler's equations I w' = (I w) x w + torque, solved for the scaled rates' derivatives.

    Written as quadratic forms in the rates, so that principal and arbitrary body axes are one case: in
    principal axes the coefficients that vanish are left out (Landau & Lifshitz, Mechanics, eq. 36.4-5).

    Args:
        torque: terms of all loads and carriers, body axes, internal units.
    """
    context, numbers, states = m.scene.context, m.numbers, m.rate_states
    zero = context.zero
    inverse, inertia, units = numbers.inverse_inertia, numbers.inertia, numbers.rate_units
    largest_inverse = largest_of([abs(x) for row in inverse for x in row])
    tiny = negligible(context)
    scale = largest_inverse * largest_of([abs(x) for row in inertia for x in row])
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
            if abs(c) > tiny * (scale * units[j] * units[b] / units[i])
        ]
        for vector, expression in torque:
            coefficient = dot(inverse[i], vector) / units[i]
            size = largest_inverse * largest_of([abs(x) for x in vector]) / units[i]
            if abs(coefficient) > tiny * size:
                terms.append(m.number(coefficient) * expression)
        result.append(hy.sum(terms) if terms else hy.expression(0.0))
    return result


def vertical_from_attitude(matrix: SymbolicMatrix, numbers: ScaledNumbers, number: Rounder) -> list[Symbolic]:
    """Unit vector against gravity, R^T up, in body axes."""
    assert numbers.up is not None
    terms = [[number(u) * matrix[i][k] for i, u in enumerate(numbers.up) if u != 0] for k in range(3)]
    return [hy.sum(column) for column in terms]


def vertical_equations(vertical: list[Symbolic], rates: list[Symbolic]) -> list[Symbolic]:
    """Poisson's equations g' = g x w of a direction fixed in space, seen from the body."""
    g, w = vertical, rates
    return [
        g[1] * w[2] - g[2] * w[1],
        g[2] * w[0] - g[0] * w[2],
        g[0] * w[1] - g[1] * w[0],
    ]


def quaternion_kinematics(q: list[Symbolic], rates: list[Symbolic]) -> list[Symbolic]:
    """q (0, w) / 2 for a quaternion [w, x, y, z] and rates in body axes."""
    w, x, y, z = q
    p, r, s = rates
    return [
        0.5 * (-x * p - y * r - z * s),
        0.5 * (w * p + y * s - z * r),
        0.5 * (w * r + z * p - x * s),
        0.5 * (w * s + x * r - y * p),
    ]


def flight_equations(m: Kinematics, force: list[Term]) -> tuple[list[Symbolic], list[Symbolic]]:
    """x' = v and v' = force over mass, in the units of position and speed."""
    assert m.velocity is not None
    context, scaling = m.scene.context, m.scaling
    ratio = m.number(context.ldexp(context.one, scaling.speed + scaling.time - scaling.length))
    accelerations = []
    for i in range(3):
        terms = [m.number(vector[i]) * expression for vector, expression in force if vector[i] != 0]
        accelerations.append(hy.sum(terms) if terms else hy.expression(0.0))
    return [ratio * v for v in m.velocity], accelerations
