"""A gravity gradient on a circular orbit with half the products, for runs with a loose tolerance.

A step of a Taylor series costs what its products cost. With r and f the unit vectors towards the attracting
body and across it in the orbit's plane, seen from the body, and s^2 = 3 G M / R^3,

    I_i w_i' = (I_j - I_k) (w_j w_k - s^2 r_j r_k),    r' = r x w + n f,    f' = f x w - n r.

Let u = s r. What the first two need of w and u are A = w_j w_k - u_j u_k and B = u_j w_k - w_j u_k, four
products; but A + B = (w_j + u_j)(w_k - u_k) and A - B = (w_j - u_j)(w_k + u_k) are two. That leaves 12
products in place of the 26 of the quaternion's equations (``rigidsim.model.frames.orbital``). It is how
so(4) falls apart into two so(3), on which Steklov's body rests (Bobenko 1986).

Of two orders next to each other the even one is far better here (what it leaves out turns the motion's phase
and keeps its energy), and at an order above the tolerance's a step may be longer. Steps of a given order are
relative to the largest state (Jorba & Zou 2005): a constant one, ``stride``, makes them as long as the
tolerance allows.

What it costs: rounding in u is that of w, so that r loses the factor w / s, and the quaternion's sign is that
nearest to the sample before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import heyoka as hy

from rigidsim.model import rotations
from rigidsim.model.formulations import AttitudeStates, OrbitalFrame
from rigidsim.model.frames.orbital import in_space, relative_attitude
from rigidsim.model.gradient_source import GradientSource
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.load import Load
from rigidsim.model.numbers import Rounder, ScaledNumbers
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Scaling
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import cross
from rigidsim.scene.integrator_table import Integrator
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene

NAMES = ["ux", "uy", "uz", "fx", "fy", "fz"]
_LOOSE = 1e-13
"""Tolerance above which the series' truncation error far exceeds rounding."""
_LEAST = 2.0**-6
"""Least s in units of the fastest rate; below it r would lose more than two digits."""
STRIDE = "stride"
_WHY = "constant: steps are relative to the largest state, and of their order they may be longer"
_ALIKE = 4
"""Largest ratio of s and n, whose quotient scales f: it is sqrt(3) where the motion's period is the
orbit's.
"""


def pairs_products(
    scene: Scene, loads: Sequence[Load], orbit: KeplerOrbit | None, scaling: Scaling, numbers: ScaledNumbers
) -> bool:
    """Whether a scene is carried in this form: a gravity gradient alone, principal body axes, an explicit
    loose tolerance, and nothing that needs the quaternion itself among the states.

    Args:
        orbit: orbit in whose frame the attitude is carried; None if it is carried in space axes.
    """
    source = loads[0].gradient_source if len(loads) == 1 else None
    if orbit is None or source is None:
        return False
    if not _loose(scene.config.integrator) or scene.events or scene.config.output.lyapunov:
        return False
    diagonal = all(numbers.inertia[i][j] == 0 for i in range(3) for j in range(3) if i != j)
    if not diagonal or any(unit != 1 for unit in numbers.rate_units) or scene.free_flight:
        return False
    s, n = _strength(scene, source.gravitational_parameter, orbit, scaling)
    return bool(s >= _LEAST and n < _ALIKE * s and s < _ALIKE * n)


def _loose(integrator: Integrator) -> bool:
    tolerance = integrator.tolerance
    plain = integrator.formulation == "auto" and integrator.hold_invariants is not True
    plain = plain and integrator.precision != "single"
    return plain and not isinstance(tolerance, str) and float(tolerance) >= _LOOSE


def _strength(scene: Scene, parameter: Any, orbit: KeplerOrbit, scaling: Scaling) -> tuple[Any, Any]:
    """s and n, internal units (mpf)."""
    context = scene.context
    s = context.sqrt(3 * parameter / orbit.semi_major_axis**3)
    return context.ldexp(s, scaling.time), context.ldexp(orbit.mean_motion, scaling.time)


def even_order(tolerance: float) -> tuple[float, float]:
    """Tolerance for which heyoka takes the intended even order, and the factor on the largest state that
    makes steps as long as the tolerance allows.

    heyoka chooses order and step for an error per step of e^(2 - 2 order) (Jorba & Zou 2005, eq. 11);
    steps grow by the order-th root of the factor.
    """
    due = 1 - math.log(tolerance) / 2
    even = 2 * math.ceil(due / 2)
    return math.exp(-2 * (even - 1.5)), 2.0 ** math.floor(2 * (even - due) / math.log(2))


def _sums(rates: Sequence[Symbolic]) -> tuple[list[Symbolic], list[Symbolic], list[Symbolic]]:
    """u, and for each i the products (w_j + u_j)(w_k - u_k) and (w_j - u_j)(w_k + u_k)."""
    u = list(hy.make_vars(*NAMES[:3]))
    plus = [w + x for w, x in zip(rates, u, strict=True)]
    minus = [w - x for w, x in zip(rates, u, strict=True)]
    cyclic = [((i + 1) % 3, (i + 2) % 3) for i in range(3)]
    return u, [plus[j] * minus[k] for j, k in cyclic], [minus[j] * plus[k] for j, k in cyclic]


def paired_rates(m: Kinematics) -> list[Symbolic]:
    """Derivatives of the body rates, including the gradient's torque."""
    numbers = m.numbers
    _, first, second = _sums(m.rate_states)
    result = []
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        coefficient = (numbers.inertia[j][j] - numbers.inertia[k][k]) * numbers.inverse_inertia[i][i] / 2
        moved = coefficient != 0
        result.append(m.number(coefficient) * (first[i] + second[i]) if moved else hy.expression(0.0))
    return result


def paired_states(
    scene: Scene,
    rates: list[Symbolic],
    source: GradientSource,
    scaling: Scaling,
    number: Rounder,
) -> AttitudeStates:
    """Six states, u = s r and (s / n) f, besides ``stride`` as a state of the load.

    The orbital frame follows from the time. It is recorded but acts on nothing, so that the digits lost in
    n t do not affect the motion.

    Args:
        source: the only load's source, which is on an orbit.
        rates: angular velocity states, body axes, 1 / unit of time.
    """
    assert source.orbit is not None
    orbit, context = source.orbit, scene.context
    s, n = _strength(scene, source.gravitational_parameter, orbit, scaling)
    u, first, second = _sums(rates)
    f = list(hy.make_vars(*NAMES[3:]))
    squared = number(n * n)
    turning = cross(f, rates)
    derivatives = [0.5 * (a - b) + squared * x for a, b, x in zip(first, second, f, strict=True)]
    derivatives += [turned - x for turned, x in zip(turning, u, strict=True)]
    start = attitude.rotation_matrix(relative_attitude(scene, orbit))
    initial = [s * x for x in start[0]] + [s / n * x for x in start[1]]

    towards = [number(1 / s) * x for x in u]
    across = [number(n / s) * x for x in f]
    relative = [towards, across, cross(towards, across)]
    half = number(n / 2) * hy.time + number(orbit.eccentric_anomaly(context, context.zero) / 2)
    turned = [hy.cos(half), hy.sin(half)]
    quaternion = rotations.quaternion_from_matrix(relative)
    matrix, quaternion = in_space(scene, orbit, turned, relative, quaternion, number)
    _, factor = even_order(float(scene.config.integrator.tolerance))
    stride = StateBlock([STRIDE], [hy.expression(0.0)], [factor * max(context.one, s / n)], why=_WHY)
    rows = ((0, 0), (0, 1), (1, 1))
    products = [hy.sum([a * b for a, b in zip(relative[i], relative[j], strict=True)]) for i, j in rows]
    defects = [x - 1.0 if i == j else x for x, (i, j) in zip(products, rows, strict=True)]
    return AttitudeStates(
        "orbital_directions",
        NAMES,
        derivatives,
        initial,
        matrix,
        quaternion,
        "nearest",
        defect=(
            "orthogonality_defect",
            "deviation of two axes of the orbital frame, seen from the body, from orthogonal unit vectors, "
            "root of their summed squares",
            hy.sqrt(hy.sum([x * x for x in defects])),
        ),
        orbital=OrbitalFrame(direction=relative[0], normal=relative[2], states=stride),
    )
