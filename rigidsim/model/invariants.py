"""Invariants that few scenes have: momenta along axes that loads spare, and integrals of special motions.

**Gradients of fixed sources.** With R from body to space axes, a potential

    U = (1/2) sum s_k c_k . I c_k,  c_k = R^T d_k,  s_k = 3 G M_k / R_k^3     (MacCullagh),

alone has two integrals beside the energy, for any sources (Bogoyavlensky, Commun. Math. Phys. 94, 1984, 255),
which follow from the Lax pair L(h) = h^2 J^2 + h M + V with J = (tr I) / 2 - I, V = R^T S R and
S = sum s_k d_k d_k^T (Manakov's for S = 0):

    B = |L|^2 - tr(adj(I) V),     adj(I) = det(I) I^-1
    K = L . S L - tr(S) |L|^2 + tr(adj(I) V^2).

For a single source B is Brun's, |L|^2 - 3 (G M / R^3) det(I) (c . I^-1 c) (Brun, Ofvers. Kongl. Svenska
Vet.-Akad. Forh. 7, 1893, 455), and K follows from it and L . d.

**Tops.** Besides Lagrange's two heavy tops are integrable: symmetric bodies (moments A = B and C) whose
centre of mass lies in the equatorial plane. In the axes e1 towards the centre of mass, e3 along the axis of
symmetry and e2 = e3 x e1, with g the vertical seen from the body and k = M g l / C:

    A = 2 C: K = (w1^2 - w2^2 - k g1)^2 + (2 w1 w2 - k g2)^2          (Kovalevskaya 1889)
    A = 4 C: G = w3 (w1^2 + w2^2) - k w1 g3, on L_z = 0 alone          (Goryachev 1900, Chaplygin 1901)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import heyoka as hy

from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.mechanical import (
    linear_momentum,
    linear_momentum_scale,
    mass_exponent,
    momentum_scale,
    total_momentum,
    total_momentum_scale,
)
from rigidsim.model.observables.observable import (
    MOMENTUM,
    SPACE,
    Observable,
    only_when_named,
    register_all,
    same_unit,
)
from rigidsim.model.probing import attracting_line, kept_axes
from rigidsim.model.rotations import Symbolic, transpose
from rigidsim.model.rotations import apply as turned
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Vector, apply, cross, dot, eigen, negligible, norm, parallel


def _along(m: Mechanics, axis: Vector, vector: list[Symbolic]) -> Symbolic:
    """Component along a constant axis (mpf); its zeros may be rounding."""
    tiny = negligible(m.scene.context)
    return hy.sum([m.number(e) * x for e, x in zip(axis, vector, strict=True) if abs(e) > tiny])


def _across(m: Mechanics, axis: Vector, vector: list[Symbolic]) -> list[Symbolic]:
    """Part of a vector across a constant unit axis (mpf)."""
    unit = [m.number(x) for x in axis]
    along = hy.sum([u * x for u, x in zip(unit, vector, strict=True)])
    return [x - u * along for u, x in zip(unit, vector, strict=True)]


# --- gradients of fixed sources -----------------------------------------------------------------------------


def _sources_alone(m: Mechanics) -> list[tuple[Any, Vector]]:
    """s and d of all fixed sources; none unless all torque comes from them."""
    turning = [] if m.carriers or m.attitude is None else m.turning
    found = [load.fixed_source(m.scene) for load in turning]
    return [] if None in found else [pair for pair in found if pair is not None]


def _several_directions(m: Mechanics) -> bool:
    sources = _sources_alone(m)
    return not all(parallel(m.scene.context, sources[0][1], d) for _, d in sources[1:])


def _source_matrix(m: Mechanics) -> list[Vector]:
    """S, 1/s^2."""
    return [[sum(s * d[i] * d[j] for s, d in _sources_alone(m)) for j in range(3)] for i in range(3)]


def _squares(m: Mechanics) -> tuple[list[tuple[Any, Vector, Symbolic]], Symbolic]:
    """Value s, d, and d . R adj(I) R^T d for each principal direction d of S (internal units); |L|^2."""
    context = m.scene.context
    values, axes = eigen(context, _source_matrix(m))
    a, b, c = m.numbers.inertia
    inertia = [cross(b, c), cross(c, a), cross(a, b)]  # its adjugate
    rows = []
    for value, axis in zip(values, axes, strict=True):
        s = context.ldexp(value, 2 * m.scaling.time)
        if abs(s) <= context.ldexp(max(values), 2 * m.scaling.time) * negligible(context):
            continue
        d = turned(transpose(m.matrix), m.fixed(axis))
        terms = [
            m.number(inertia[i][j]) * (d[i] * d[j]) for i in range(3) for j in range(3) if inertia[i][j] != 0
        ]
        rows.append((s, axis, hy.sum(terms)))
    return rows, hy.sum([x * x for x in m.momentum_body])


def _brun(m: Mechanics) -> list[Symbolic]:
    """B, internal units of momentum squared."""
    rows, squared = _squares(m)
    return [squared - hy.sum([m.number(s) * seen for s, _, seen in rows])]


def _bogoyavlensky(m: Mechanics) -> list[Symbolic]:
    """K, internal units of (momentum / time) squared."""
    rows, squared = _squares(m)
    trace = sum((s for s, _, _ in rows), m.scene.context.zero)
    terms = [m.number(-trace) * squared]
    for s, axis, seen in rows:
        momentum = _along(m, axis, m.momentum_space)
        terms += [m.number(s) * (momentum * momentum), m.number(s * s) * seen]
    return [hy.sum(terms)]


def _brun_scale(m: Mechanics) -> tuple[Any, str]:
    moments, matrix = sorted(m.scene.body.principal_moments), _source_matrix(m)
    trace = sum(matrix[i][i] for i in range(3))
    value = momentum_scale(m)[0] ** 2 + trace * moments[1] * moments[2]
    return value, "squared angular momentum plus 3 G M / R^3 times the largest product of two moments"


def _bogoyavlensky_scale(m: Mechanics) -> tuple[Any, str]:
    matrix = _source_matrix(m)
    value = sum(matrix[i][i] for i in range(3)) * _brun_scale(m)[0]
    return value, "sum of 3 G M / R^3 times the scale of Brun's constant"


# --- tops ---------------------------------------------------------------------------------------------------


class _Top(NamedTuple):
    """A symmetric heavy top whose centre of mass lies in its equatorial plane; mpf, SI."""

    frame: list[Vector]  # e1, e2, e3, body axes
    equatorial: Any  # moments A = B
    axial: Any  # moment C
    strength: Any  # M g l, J


def _top(m: Mechanics, ratio: int) -> _Top | None:
    """The scene as a top with A = B = ratio C, for 4 with L_z = 0; None for others, and under more loads."""
    context, scene = m.scene.context, m.scene
    axis, arm, tiny = m.symmetry_direction, scene.torque_arm, negligible(context)
    if m.vertical is None or axis is None or arm is None or scene.gravity is None or m.carriers:
        return None
    length = norm(context, arm)
    first = [a / length for a in arm]
    equatorial, axial = (dot(e, apply(scene.body.inertia, e)) for e in (first, axis))
    alone = all(load.uniform_field is not None for load in m.turning) and abs(dot(first, axis)) <= tiny
    if not alone or axial == 0 or abs(equatorial - ratio * axial) > equatorial * tiny:
        return None
    momentum = apply(scene.body.inertia, scene.angular_velocity)
    vertical = apply(transpose(attitude.rotation_matrix(scene.quaternion)), scene.gravity)
    if ratio == 4 and abs(dot(momentum, vertical)) > norm(context, momentum) * norm(context, vertical) * tiny:
        return None
    frame = [first, cross(axis, first), list(axis)]
    return _Top(frame, equatorial, axial, length * norm(context, scene.gravity))


def _in_frame(m: Mechanics, ratio: int) -> tuple[list[Symbolic], list[Symbolic], Any]:
    """Rates and vertical in the top's frame, and k, in internal units."""
    top = m.carried(_top(m, ratio))
    rates, vertical = ([_along(m, axis, v) for axis in top.frame] for v in (m.rates, m.carried(m.vertical)))
    return rates, vertical, m.number(m.scene.context.ldexp(top.strength / top.axial, 2 * m.scaling.time))


def _kovalevskaya(m: Mechanics) -> list[Symbolic]:
    w, g, k = _in_frame(m, 2)
    real, imaginary = w[0] * w[0] - w[1] * w[1] - k * g[0], 2.0 * (w[0] * w[1]) - k * g[1]
    return [real * real + imaginary * imaginary]


def _goryachev_chaplygin(m: Mechanics) -> list[Symbolic]:
    w, g, k = _in_frame(m, 4)
    return [w[2] * (w[0] * w[0] + w[1] * w[1]) - k * w[0] * g[2]]


def _largest(m: Mechanics, ratio: int) -> tuple[Any, Any, Any]:
    """Bounds of the squared equatorial rate and of the axial rate, all energy in one of them; k."""
    top, w = m.carried(_top(m, ratio)), m.scene.angular_velocity
    twice = dot(w, apply(m.scene.body.inertia, w)) + 4 * top.strength
    return twice / top.equatorial, m.scene.context.sqrt(twice / top.axial), top.strength / top.axial


def _kovalevskaya_scale(m: Mechanics) -> tuple[Any, str]:
    equatorial, _, k = _largest(m, 2)
    return (equatorial + k) ** 2, "largest (w1^2 + w2^2 + M g l / C)^2 by energy"


def _goryachev_chaplygin_scale(m: Mechanics) -> tuple[Any, str]:
    equatorial, axial, k = _largest(m, 4)
    value = axial * equatorial + k * m.scene.context.sqrt(equatorial)
    return value, "largest w3 (w1^2 + w2^2) + M g l w1 / C by energy"


# --- momenta ------------------------------------------------------------------------------------------------


def _line(m: Mechanics) -> Vector | None:
    """Along which the total momentum is constant."""
    return None if m.velocity is None or m.attitude is None else attracting_line(m)


def _beginning(m: Mechanics) -> Vector:
    """Initial direction of L."""
    scene = m.scene
    begun = apply(
        attitude.rotation_matrix(scene.quaternion), apply(scene.body.inertia, scene.angular_velocity)
    )
    return [x / norm(scene.context, begun) for x in begun]


def _damped_alike(m: Mechanics) -> bool:
    """Whether the body turns, under dampings alone that add up to a multiple of the inertia tensor."""
    found = [c for load in m.turning if (c := load.damping()) is not None]
    at_rest = all(w == 0 for w in m.scene.angular_velocity)
    if m.carriers or not found or len(found) < len(m.turning) or at_rest or m.attitude is None:
        return False
    inertia, k = m.scene.body.inertia, max(range(3), key=lambda i: m.scene.body.inertia[i][i])
    total = [sum((c[i] for c in found), m.scene.context.zero) for i in range(3)]
    wanted = [[total[k] / inertia[k][k] * x for x in row] for row in inertia]
    differences = [(total[i] if i == j else 0) - wanted[i][j] for i in range(3) for j in range(3)]
    return all(abs(d) <= total[k] * negligible(m.scene.context) for d in differences)


def _falls_freely(m: Mechanics) -> bool:
    """Whether uniform gravity is the only force on a body in flight."""

    def pulls(load: Load) -> bool:
        return any(x != 0 for vector, _ in load.force(m) for x in vector)

    pulling = [load for load in m.loads if m.velocity is not None and pulls(load)]
    return bool(pulling) and all(load.uniform_field is not None for load in pulling)


def _only_if(holds: Callable[[Mechanics], object]) -> Callable[[Mechanics], str | None]:
    return lambda m: None if holds(m) else "this scene has none"


def _momentum_along(name: str, words: str, why: str) -> Observable:
    """Angular momentum along one of the ``kept_axes``."""
    return Observable(
        f"angular_momentum_{name}", (), "kg m2 s-1", f"angular momentum along {words}",
        lambda m: [_along(m, kept_axes(m)[name], m.momentum_space)], same_unit(MOMENTUM, 1), "space axes", (),
        lambda _: f"no load has a torque about {why}", momentum_scale,
        absent=_only_if(lambda m: m.attitude is not None and name in kept_axes(m)),
    )  # fmt: skip


TOPS = (
    Observable(
        "kovalevskaya_constant", (), "rad4 s-4", "Kovalevskaya's constant", _kovalevskaya,
        same_unit(lambda m: -4 * m.scaling.time, 1), "", (),
        lambda _: "A = B = 2 C, and the centre of mass lies in the equatorial plane (Kovalevskaya)",
        _kovalevskaya_scale, absent=_only_if(lambda m: _top(m, 2)),
    ),
    Observable(
        "goryachev_chaplygin_constant", (), "rad3 s-3", "Goryachev's and Chaplygin's constant",
        _goryachev_chaplygin, same_unit(lambda m: -3 * m.scaling.time, 1), "", (),
        lambda _: "A = B = 4 C, the centre of mass lies in the equatorial plane, and L_z = 0 (Goryachev, "
        "Chaplygin)",
        _goryachev_chaplygin_scale, absent=_only_if(lambda m: _top(m, 4)),
    ),
)  # fmt: skip

WATCHED = (
    _momentum_along("source", "the axis of the fixed sources", "the direction of a fixed source"),
    _momentum_along("field", "the uniform field", "the direction of the field"),
    *(_momentum_along(x, f"the space axis {x.upper()}", "this axis") for x in "xyz"),
    Observable(
        "angular_momentum_across", SPACE, "kg m2 s-1", "angular momentum across its initial direction",
        lambda m: _across(m, _beginning(m), m.momentum_space), same_unit(MOMENTUM, 3), "space axes", (),
        lambda _: "the damping is in proportion to the inertia tensor", momentum_scale,
        by_default=only_when_named, absent=_only_if(_damped_alike),  # zeros
    ),
    Observable(
        "brun_constant", (), "kg2 m4 s-2", "Brun's constant", _brun,
        same_unit(lambda m: 2 * m.scaling.momentum, 1), "", (),
        lambda _: "all torques are gravity gradients of fixed sources (Brun)", _brun_scale,
        absent=_only_if(_sources_alone),
    ),
    Observable(
        "bogoyavlensky_constant", (), "kg2 m4 s-4", "Bogoyavlensky's constant", _bogoyavlensky,
        same_unit(lambda m: 2 * (m.scaling.momentum - m.scaling.time), 1), "", (),
        lambda _: "all torques are gravity gradients of fixed sources (Bogoyavlensky)", _bogoyavlensky_scale,
        absent=_only_if(_several_directions),
    ),
    Observable(
        "total_angular_momentum_axial", (), "kg m2 s-1",
        "angular momentum along the line of the attracting points, orbital plus spin",
        lambda m: [_along(m, m.carried(_line(m)), total_momentum(m))], same_unit(MOMENTUM, 1), "space axes",
        (),
        lambda _: "no load turns the motion about the line of the attracting points", total_momentum_scale,
        absent=_only_if(_line),
    ),
    Observable(
        "linear_momentum_horizontal", SPACE, "kg m s-1", "linear momentum across gravity",
        lambda m: _across(m, m.carried(m.numbers.up), linear_momentum(m)),
        same_unit(lambda m: m.scaling.speed + mass_exponent(m), 3), "space axes", (),
        lambda _: "the only force is uniform gravity", linear_momentum_scale, absent=_only_if(_falls_freely),
    ),
)  # fmt: skip

register_all(*TOPS, *WATCHED)
