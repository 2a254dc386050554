"""Forces on a freely flying body: which of them leave some momentum of its flight constant."""

from __future__ import annotations

from rigidsim.model import fixed_axes
from rigidsim.model.capabilities import Attracting, having
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.scene.arithmetic import Vector, norm, parallel


def _pulling(m: Mechanics) -> list[Load]:
    return [load for load in m.loads if any(x != 0 for vector, _ in load.force(m) for x in vector)]


def _points(m: Mechanics) -> list[Vector]:
    return [load.attracting_point for load in having(Attracting, m.loads)]


def one_point(m: Mechanics) -> bool:
    """Whether all loads attract to one common point, and there is at least one."""
    points = _points(m)
    return bool(points) and len(points) == len(m.acting) and all(point == points[0] for point in points)


def line(m: Mechanics) -> Vector | None:
    """Unit vector of the line through all attracting points about which no load exerts a moment on the body's
    motion; None without such a line, or if the whole momentum is conserved.
    """
    points, context = _points(m), m.scene.context
    if not points or one_point(m):
        return None
    directions = [[x - y for x, y in zip(point, points[0], strict=True)] for point in points[1:]]
    others = [load for load in m.loads if not isinstance(load, Attracting)]
    if m.scene.gravity is not None and any(load.uniform_field is not None for load in others):
        directions.append(m.scene.gravity)
    directions = [d for d in directions if any(x != 0 for x in d)]
    if not directions or not all(parallel(context, directions[0], d) for d in directions):
        return None
    size = norm(context, directions[0])
    axis = [x / size for x in directions[0]]
    if any(load.uniform_field is None for load in _pulling(m) if load in others):
        return None
    return axis if fixed_axes.keeps(m, axis, others) else None


def falls_freely(m: Mechanics) -> bool:
    """Whether uniform gravity is the only force."""
    pulling = _pulling(m)
    return bool(pulling) and all(load.uniform_field is not None for load in pulling)
