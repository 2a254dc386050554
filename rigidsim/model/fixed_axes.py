"""Axes fixed in space about which no torque acts (``probing``), and integrals of gradients of fixed sources.

With R from body to space axes, a potential

    U = (1/2) sum s_k c_k . I c_k,  c_k = R^T d_k,  s_k = 3 G M_k / R_k^3     (fixed sources, MacCullagh),

alone has two integrals beside the energy, for any sources (Bogoyavlensky, Commun. Math. Phys. 94, 1984, 255),
which follow from the Lax pair L(h) = h^2 J^2 + h M + V with J = (tr I) / 2 - I, V = R^T S R and
S = sum s_k d_k d_k^T (Manakov's for S = 0):

    B = |L|^2 - tr(adj(I) V),     adj(I) = det(I) I^-1
    K = L . S L - tr(S) |L|^2 + tr(adj(I) V^2).

For a single source B is Brun's, |L|^2 - 3 (G M / R^3) det(I) (c . I^-1 c) (Brun, Ofvers. Kongl. Svenska
Vet.-Akad. Forh. 7, 1893, 455), and K follows from it and L . d.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import heyoka as hy

from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.probing import samples, spared, spared_axis
from rigidsim.model.rotations import Symbolic, apply, transpose
from rigidsim.scene.arithmetic import Matrix, Vector, cross, dot, eigen, negligible, parallel, unit_vectors


def _sources(m: Mechanics, loads: Sequence[Load]) -> list[tuple[Any, Vector]]:
    return [pair for load in loads if (pair := load.fixed_source(m.scene)) is not None]


def _source_matrix(sources: list[tuple[Any, Vector]]) -> Matrix:
    """S (1/s^2) of at least one source."""
    return [[sum(s * d[i] * d[j] for s, d in sources) for j in range(3)] for i in range(3)]


def keeps(m: Mechanics, axis: Vector, loads: Sequence[Load] | None = None) -> bool:
    """Whether no torque of these loads (or any) acts about a unit axis in space, however the body moves."""
    which = [i for i, load in enumerate(m.loads) if load in m.turning and (loads is None or load in loads)]
    return not which or spared(m, [[sample[i] for i in which] for sample in samples(m)], axis)


def kept_axes(m: Mechanics) -> dict[str, Vector]:
    """Unit axes in space without a torque about them, where some torque acts, by what momenta along them are
    called: the only one by sources at rest, or by a field; x, y and z by nothing else. The vertical is apart.
    """
    if "kept axes" in m.made:
        return m.made["kept axes"]
    found, context, up = {}, m.scene.context, weight_axis(m)
    marks = [mark for load in m.turning if (mark := load.direction(m.scene)) is not None]
    axis = spared_axis(m, samples(m)) if m.torque else None
    if axis is not None and not (up is not None and parallel(context, up, axis)):
        along = next((x for mark in marks if abs(x := dot(mark, axis)) > negligible(context)), context.one)
        axis = axis if along > 0 else [-x for x in axis]
        in_field = any(parallel(context, mark, axis) for mark in marks)
        if _sources(m, m.turning):
            found["source"] = axis
        elif in_field or all(abs(x) != 1 for x in axis):
            found["field"] = axis
    named = [*found.values(), *([] if up is None else [up])]
    for name, axis in zip("xyz", unit_vectors(context) if m.torque else [], strict=False):
        if not any(parallel(context, axis, other) for other in named) and keeps(m, axis):
            found[name] = axis
    m.made["kept axes"] = found
    return found


def weight_axis(m: Mechanics) -> Vector | None:
    """Unit vector against gravity if gravity exerts a torque; None otherwise."""
    return m.numbers.up if m.numbers.arm is not None else None


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
    """Whether nothing turns the motion, spin and orbit together, about an attracting point."""
    points, context = _points(m), m.scene.context
    return bool(points) and all(spared(m, samples(m, points[0]), axis) for axis in unit_vectors(context))


def attracting_line(m: Mechanics) -> Vector | None:
    """Unit vector of the one line through an attracting point about which nothing turns the motion."""
    points = _points(m)
    return spared_axis(m, samples(m, points[0])) if points else None


def falls_freely(m: Mechanics) -> bool:
    """Whether uniform gravity is the only force."""
    pulling = _pulling(m)
    return bool(pulling) and all(load.uniform_field is not None for load in pulling)
