"""Axes fixed in space about which no torque acts, and the integrals of gravity gradients of fixed sources.

Two kinds of potential are looked at together, since the torques of several loads may add up to what none has
by itself. With R from body to space axes, loads of a linear one,

    U = - sum a_k . R^T f_k     (a weight, a dipole in a uniform field, a constant force),

turn the body about an axis n unless sum a_k (f_k x n)^T = 0; loads of a quadratic one,

    U = (1/2) sum s_k c_k . I c_k,  c_k = R^T d_k,  s_k = 3 G M_k / R_k^3     (fixed sources, MacCullagh),

unless n x S is antisymmetric, S = sum s_k d_k d_k^T. The latter alone have two integrals beside the energy,
for any sources (Bogoyavlensky, Commun. Math. Phys. 94, 1984, 255), which follow from the Lax pair
L(h) = h^2 J^2 + h M + V with J = (tr I) / 2 - I and V = R^T S R (Manakov's for S = 0):

    B = |L|^2 - tr(adj(I) V),     adj(I) = det(I) I^-1
    K = L . S L - tr(S) |L|^2 + tr(adj(I) V^2).

For a single source B is Brun's, |L|^2 - 3 (G M / R^3) det(I) (c . I^-1 c) (Brun, Ofvers. Kongl. Svenska
Vet.-Akad. Forh. 7, 1893, 455), and K follows from it and L . d.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any

import heyoka as hy

from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic, apply, transpose
from rigidsim.scene.arithmetic import Matrix, Vector, cross, dot, eigen, negligible, norm, parallel


def _outer(a: Vector, b: Vector) -> Matrix:
    return [[x * y for y in b] for x in a]


def _added(matrices: list[Matrix]) -> Matrix:
    return reduce(
        lambda a, b: [[x + y for x, y in zip(r, s, strict=True)] for r, s in zip(a, b, strict=True)], matrices
    )


def _size(context: Any, matrix: Matrix) -> Any:
    return context.maximum(abs(x) for row in matrix for x in row)


def _linear(m: Mechanics, loads: Sequence[Load]) -> list[tuple[Vector, Vector]]:
    return [pair for load in loads if (pair := load.linear_potential(m.scene)) is not None]


def _sources(m: Mechanics, loads: Sequence[Load]) -> list[tuple[Any, Vector]]:
    return [pair for load in loads if (pair := load.fixed_source(m.scene)) is not None]


def _source_matrix(sources: list[tuple[Any, Vector]]) -> Matrix:
    """S (1/s^2) of at least one source."""
    return _added([_outer([s * x for x in d], d) for s, d in sources])


def keeps(m: Mechanics, axis: Vector, loads: Sequence[Load] | None = None) -> bool:
    """Whether no torque of these loads (or any) acts about a unit axis in space, however the body moves."""
    context = m.scene.context
    tiny = negligible(context)
    turning = [load for load in m.turning if loads is None or load in loads]
    linear, sources = _linear(m, turning), _sources(m, turning)
    if linear:
        along = _added([_outer(a, cross(f, axis)) for a, f in linear])
        if _size(context, along) > tiny * sum(_size(context, _outer(a, f)) for a, f in linear):
            return False
    if sources:
        s = _source_matrix(sources)
        turned = transpose([cross(axis, column) for column in transpose(s)])  # n x S
        twisted = max(abs(turned[i][j] + turned[j][i]) for i in range(3) for j in range(i + 1))
        if twisted > tiny * _size(context, s):
            return False
    return not any(
        load.turns_about(m, axis)
        for load in turning
        if load.linear_potential(m.scene) is None and load.fixed_source(m.scene) is None
    )


def field_axis(m: Mechanics) -> Vector | None:
    """Unit vector along the one field to which the linear potentials combine; None if they don't. Without
    any it is the axis that another load spares.
    """
    linear = _linear(m, m.turning)
    if not linear:
        spared = [load.spared_axis(m.scene) for load in m.turning]
        return next((axis for axis in spared if axis is not None), None)
    context = m.scene.context
    total = _added([_outer(a, f) for a, f in linear])
    tiny = negligible(context) * sum(_size(context, _outer(a, f)) for a, f in linear)
    row = max(total, key=lambda row: norm(context, row))
    size = norm(context, row)
    if size <= tiny:
        return None
    axis = [x / size for x in row]
    return axis if all(norm(context, cross(other, axis)) <= tiny for other in total) else None


def source_axis(m: Mechanics) -> Vector | None:
    """Unit vector towards fixed sources on one line, or else along their axis of symmetry; or None."""
    sources = _sources(m, m.turning)
    if not sources:
        return None
    s = _source_matrix(sources)
    values, axes = eigen(m.scene.context, s)
    tiny = negligible(m.scene.context) * _size(m.scene.context, s)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        if abs(values[j] - values[k]) <= tiny < abs(values[i] - values[j]):
            towards = sources[0][1]
            return axes[i] if dot(axes[i], towards) >= 0 else [-x for x in axes[i]]
    return None


def weight_axis(m: Mechanics) -> Vector | None:
    """Unit vector against gravity if gravity exerts a torque; None otherwise."""
    return m.numbers.up if m.numbers.arm is not None else None


def _kept(m: Mechanics, axis: Vector | None, *others: Vector | None) -> Vector | None:
    """The axis, if no torque acts about it and it is none of the others; None otherwise."""
    named = [other for other in others if other is not None]
    if axis is None or any(parallel(m.scene.context, axis, other) for other in named):
        return None
    return axis if keeps(m, axis) else None


def free_axis(m: Mechanics, which: int) -> Vector | None:
    """Space axis without a torque about it, if some torque acts and no other name is its own; or None."""
    context = m.scene.context
    axis = [context.one if i == which else context.zero for i in range(3)]
    return _kept(m, axis, weight_axis(m), source_axis(m), field_axis(m)) if m.torque else None


def kept_source_axis(m: Mechanics) -> Vector | None:
    """``source_axis`` if the momentum along it is conserved and it isn't the vertical; None otherwise."""
    return _kept(m, source_axis(m), weight_axis(m))


def kept_field_axis(m: Mechanics) -> Vector | None:
    """``field_axis`` under the same condition, if it isn't a source's axis either; None otherwise."""
    return _kept(m, field_axis(m), weight_axis(m), source_axis(m))


def along(m: Mechanics, axis: Vector) -> Symbolic:
    """Angular momentum along an axis in space, internal units."""
    return hy.sum([m.number(n) * x for n, x in zip(axis, m.momentum_space, strict=True) if n != 0])


# --- sources alone ----------------------------------------------------------------------------------------


def sources_alone(m: Mechanics) -> bool:
    """Whether all torque comes from fixed sources."""
    turning = [] if m.carriers else m.turning
    return bool(turning) and all(load.fixed_source(m.scene) is not None for load in turning)


def several_directions(m: Mechanics) -> bool:
    """Whether all torque comes from fixed sources that lie in more than one direction."""
    directions = [d for _, d in _sources(m, m.loads)] if sources_alone(m) else []
    return not all(parallel(m.scene.context, directions[0], other) for other in directions[1:])


def _squares(m: Mechanics) -> tuple[list[tuple[Any, Vector, Symbolic]], Symbolic]:
    """Value s, d, and d . R adj(I) R^T d for each principal direction d of S (internal units); |L|^2."""
    context = m.scene.context
    values, axes = eigen(context, _source_matrix(_sources(m, m.loads)))
    a, b, c = m.numbers.inertia
    inertia = [cross(b, c), cross(c, a), cross(a, b)]  # its adjugate
    rows = []
    for value, axis in zip(values, axes, strict=True):
        s = context.ldexp(value, 2 * m.scaling.time)
        if abs(s) <= context.ldexp(max(values), 2 * m.scaling.time) * negligible(context):
            continue
        d = apply(transpose(m.matrix), m.fixed(axis))
        terms = [
            m.number(inertia[i][j]) * (d[i] * d[j]) for i in range(3) for j in range(3) if inertia[i][j] != 0
        ]
        rows.append((s, axis, hy.sum(terms)))
    return rows, hy.sum([x * x for x in m.momentum_body])


def brun_constant(m: Mechanics) -> Symbolic:
    """B, internal units of momentum squared."""
    rows, squared = _squares(m)
    return squared - hy.sum([m.number(s) * seen for s, _, seen in rows])


def bogoyavlensky_constant(m: Mechanics) -> Symbolic:
    """K, internal units of (momentum / time) squared."""
    rows, squared = _squares(m)
    trace = sum((s for s, _, _ in rows), m.scene.context.zero)
    terms = [m.number(-trace) * squared]
    for s, axis, seen in rows:
        momentum = along(m, axis)
        terms += [m.number(s) * (momentum * momentum), m.number(s * s) * seen]
    return hy.sum(terms)


def largest_brun(m: Mechanics, momentum: Any) -> Any:
    """|L|^2 + tr(S) times the largest product of two moments, SI, for a size of the momentum."""
    moments = sorted(m.scene.body.principal_moments)
    return momentum**2 + source_trace(m) * moments[1] * moments[2]


def source_trace(m: Mechanics) -> Any:
    """tr(S), 1/s^2."""
    s = _source_matrix(_sources(m, m.loads))
    return sum(s[i][i] for i in range(3))


# --- forces on a body in flight that leave some momentum constant -------------------------------------------


def _pulling(m: Mechanics) -> list[Load]:
    return [load for load in m.loads if any(x != 0 for vector, _ in load.force(m) for x in vector)]


def _points(m: Mechanics) -> list[Vector]:
    return [point for load in m.loads if (point := load.attracting_point) is not None]


def one_point(m: Mechanics) -> bool:
    """Whether all loads attract to one common point, and there is at least one."""
    points = _points(m)
    return bool(points) and len(points) == len(m.acting) and all(point == points[0] for point in points)


def attracting_line(m: Mechanics) -> Vector | None:
    """Unit vector of the line through all attracting points about which no load turns the body's motion; None
    without such a line, or if the whole momentum is conserved.
    """
    points, context = _points(m), m.scene.context
    if not points or one_point(m):
        return None
    about = [(load, line) for load in m.loads if (line := load.symmetry_line()) is not None]
    points += [point for _, (point, _) in about]
    directions = [[x - y for x, y in zip(point, points[0], strict=True)] for point in points[1:]]
    directions += [axis for _, (_, axis) in about]
    known = [id(load) for load, _ in about]
    others = [x for x in m.loads if x.attracting_point is None and id(x) not in known]
    if m.scene.gravity is not None and any(load.uniform_field is not None for load in others):
        directions.append(m.scene.gravity)
    directions = [d for d in directions if any(x != 0 for x in d)]
    if not directions or not all(parallel(context, directions[0], d) for d in directions):
        return None
    size = norm(context, directions[0])
    axis = [x / size for x in directions[0]]
    if any(load.uniform_field is None for load in _pulling(m) if load in others):
        return None
    return axis if keeps(m, axis, others) else None


def falls_freely(m: Mechanics) -> bool:
    """Whether uniform gravity is the only force."""
    pulling = _pulling(m)
    return bool(pulling) and all(load.uniform_field is not None for load in pulling)
