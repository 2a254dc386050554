"""Stage of a body that flies in a uniform gravity: its path over a ground, and the body as it turns."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.look import surroundings
from rigidsim.look.stages import generic
from rigidsim.look.stages.bodies import FIELD, Subject, vectors_of
from rigidsim.look.stages.parts import FAINT, PALE, PULL, SPACE, Camera, Line, Picture, Spot, Vector

if TYPE_CHECKING:
    from rigidsim.look.rows import Table

_LINES = 5  # of the ground's grid, to each side


def picture(dataset: Table, subject: Subject) -> Picture | None:
    """Picture of a body with a position under a uniform gravity and without attractor; None for others."""
    pull, position = surroundings.gravity(dataset), subject.position
    if pull is None or position is None or surroundings.told(dataset, "attractor"):
        return None
    arrows, trails, notes = vectors_of(dataset, subject, paths=False)
    stages = generic.with_track(subject, subject.stage(arrows, trails), notes)
    path = stages[-1]
    assert path.translation is not None
    up = -pull / np.linalg.norm(pull)
    points = path.translation[np.isfinite(path.translation).all(axis=1)]
    heights = points @ up
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    extent = max(float(np.linalg.norm(np.ptp(points, axis=0))), 0.3)
    # The ground is where heights count from, where that is near the path, or else just under it.
    level = (
        0.0 if path.origin and -0.05 * extent <= heights.min() <= extent else heights.min() - 0.15 * extent
    )
    flat = middle - (middle @ up) * up
    floor = flat + level * up
    first, second = _level_axes(points, up)
    size = 0.75 * extent
    lines = []
    for k in range(-_LINES, _LINES + 1):
        at = size * k / _LINES
        for name, u, v in (("a", first, second), ("b", second, first)):
            ends = np.stack([floor + at * u - size * v, floor + at * u + size * v])
            lines.append(Line(f"ground/{name}{k + _LINES}", FAINT, ends, SPACE, 0.7, 0.5))
    corner = floor - 0.85 * size * first
    high = max(float(heights.max()) - level, 0.3 * extent)
    gravity = Vector(
        "gravity",
        "gravity",
        PULL,
        corner + 0.9 * high * up,
        -0.45 * high * up,
        SPACE,
        "gravity",
        0.012 * extent,
    )
    center = floor + 0.5 * high * up
    direction = -second * 0.93 + 0.2 * first + 0.32 * up
    direction /= np.linalg.norm(direction)
    seen = Camera(center + 0.82 * extent / np.sin(FIELD / 2) * direction, center, up)
    start = Spot("start", "start", PALE, points[0], SPACE, 4.0)
    stages[-1] = replace(
        path,
        title="Flight" if len(stages) > 1 else path.title,
        lines=lines,
        vectors=[gravity],
        spots=[start],
        origin=path.origin and level == 0.0,
        camera=seen,
        axis_length=0.0,
    )
    order = list(reversed(stages))
    return Picture("flight in a uniform gravity", order, [], ("position", "angular_velocity", "tilt"), notes)


def _level_axes(points: np.ndarray, up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two level unit vectors, the first along the path's longest level extent."""
    flat = points - np.outer(points @ up, up)
    flat = flat - flat.mean(axis=0)
    _, spread, axes = np.linalg.svd(flat, full_matrices=False)
    first = axes[0]
    if spread[0] < 1e-9 or abs(first @ up) > 0.5:
        first = np.cross(np.eye(3)[np.abs(up).argmin()], up)
    if (points[-1] - points[0]) @ first < 0:
        first = -first
    first = first - up * (first @ up)
    first = first / np.linalg.norm(first)
    return first, np.cross(up, first)
