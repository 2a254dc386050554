"""Stage of a body that flies in a uniform gravity: its path over a ground, and the body as it turns."""

from dataclasses import replace

import numpy as np
import xarray

from rigidsim.look import signals, surroundings
from rigidsim.look.stages.bodies import FIELD, Subject, vectors_of, with_track
from rigidsim.look.stages.parts import PALE, PULL, SPACE, Array, Camera, Picture, Spot, Vector, grid


def picture(dataset: xarray.Dataset, subject: Subject) -> Picture | None:
    """Picture of a body with a position under a uniform gravity and without attractor; None for others."""
    pull, position = surroundings.gravity(dataset), subject.position
    if pull is None or position is None or surroundings.told(dataset, "attractor"):
        return None
    arrows, trails, notes = vectors_of(dataset, subject, paths=False)
    *others, path = with_track(subject, subject.stage(arrows, trails), notes)
    assert path.translation is not None
    up = -pull / np.linalg.norm(pull)
    points = signals.finite_rows(path.translation)
    heights = points @ up
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    extent = max(float(np.linalg.norm(np.ptp(points, axis=0))), 0.3)
    # The ground is where heights count from, where that is near the path, or else just under it.
    above = path.origin and -0.05 * extent <= heights.min() <= extent
    level = 0.0 if above else heights.min() - 0.15 * extent
    floor = middle - (middle @ up) * up + level * up
    first, second = _level_axes(points, up)
    size = 0.75 * extent
    high = max(float(heights.max()) - level, 0.3 * extent)
    place = floor - 0.85 * size * first + 0.9 * high * up
    words = "gravity"
    gravity = Vector("gravity", words, PULL, place, -0.45 * high * up, SPACE, words, 0.012 * extent)
    center = floor + 0.5 * high * up
    direction = -second * 0.93 + 0.2 * first + 0.32 * up
    direction /= np.linalg.norm(direction)
    stage = replace(
        path,
        title="Flight" if others else path.title,
        lines=grid("ground", floor, first, second, size, 5, 0.5),
        vectors=[gravity],
        spots=[Spot("start", "start", PALE, points[0], SPACE, 4.0)],
        origin=path.origin and level == 0.0,
        camera=Camera(center + 0.82 * extent / np.sin(FIELD / 2) * direction, center, up),
        axis_length=0.0,
    )
    leading = ("position", "angular_velocity", "tilt")
    return Picture("flight in a uniform gravity", [stage, *others], [], leading, notes)


def _level_axes(points: Array, up: Array) -> tuple[Array, Array]:
    """Two level unit vectors, the first along the path's longest level extent."""
    flat = points - np.outer(points @ up, up)
    flat = flat - flat.mean(axis=0)
    _, spread, axes = np.linalg.svd(flat, full_matrices=False)
    first = axes[0]
    if spread[0] < 1e-9 or abs(first @ up) > 0.5:
        first, _ = signals.across(up)
    if (points[-1] - points[0]) @ first < 0:
        first = -first
    first = first - up * (first @ up)
    first = first / np.linalg.norm(first)
    return first, np.cross(up, first)
