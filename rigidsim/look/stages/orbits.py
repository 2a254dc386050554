"""Parts shared by satellites and bodies on free orbits: the local frame, and the planet in a picture of the
orbit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigidsim.look.solids import Mesh
from rigidsim.look.stages.bodies import FIELD, Subject, direction_of, plane_view
from rigidsim.look.stages.parts import (
    FAINT,
    PALE,
    SPACE,
    TRACK,
    Array,
    Camera,
    Line,
    Solid,
    Spot,
    Stage,
    trail,
    viewer_quaternion,
)
from rigidsim.look.surroundings import GREY, Globe, called
from rigidsim.look.symbols import globe, graticule

ORBIT_BODY = 0.11  # reach of the enlarged body, in units of the orbit's largest distance
NORMAL: tuple[int, int, int] = (190, 150, 255)
FORWARD: tuple[int, int, int] = (150, 205, 110)
_ALMOST = 0.93  # of the least distance: a larger planet would swallow the enlarged body


def local_frame(position: Array, normal: Array) -> Array:
    """Rotations (rows, 3, 3) from the local frame to space: x forward, y against the orbit's normal, z to the
    attracting body.

    Args:
        position: (rows, 3) from the attracting body.
        normal: (3,) or (rows, 3), the orbit's normal; need not be exactly across the position.
    """
    down = -position / np.linalg.norm(position, axis=1, keepdims=True)
    forward = np.cross(np.broadcast_to(normal, position.shape), -down)
    forward = forward / np.linalg.norm(forward, axis=1, keepdims=True)
    return np.stack([forward, np.cross(down, forward), down], axis=2)


def orbit_stage(subject: Subject, quaternion: Array | None, position: Array, planet: Globe | None) -> Stage:
    """The orbit about its planet, both to one scale, with the body enlarged.

    Args:
        quaternion: (rows, 4) w x y z of the body in space.
        position: (rows, 3), m, from the planet.
    """
    unit = float(np.nanmax(np.linalg.norm(position, axis=1)))
    nearest = float(np.nanmin(np.linalg.norm(position, axis=1))) / unit
    places = position / unit
    radius = min(planet.radius / unit, _ALMOST * nearest) if planet is not None else 0.02
    color = planet.color if planet is not None else GREY
    name = planet.name if planet is not None else "attracting point"
    sizes = np.full(3, radius)
    elevation, azimuth = plane_view(places)
    direction = direction_of(max(elevation, np.deg2rad(28.0)), azimuth)
    camera = Camera(1.3 / np.sin(FIELD / 2) * direction, np.zeros(3), np.array([0.0, 0.0, 1.0]))
    stage = Stage(
        root="path",
        title=f"Orbit about {called(planet, 'attracting point')}",
        unit=unit,
        meshes=[mesh.scaled(ORBIT_BODY) for mesh in subject.meshes],
        points=subject.points * ORBIT_BODY,
        axis_length=0.0,
        quaternion=None if quaternion is None else viewer_quaternion(quaternion),
        translation=places,
        arrows=[],
        trails=[trail("track", TRACK, places, words="orbit")],
        solids=[Solid("planet", globe(sizes, color))],
        spots=[Spot("planet", name, PALE, np.array([0.0, 0.0, radius + 0.06]))],
        camera=camera,
    )
    if radius > 0.1:
        stage.lines.extend(
            [
                Line(f"graticule/{k}", (20, 24, 30), line, SPACE, 0.7, 0.5)
                for k, line in enumerate(graticule(sizes))
            ]
        )
    return stage


def horizon(planet: Globe | None, place: str, *, below: float = 2.2) -> tuple[list[Solid], list[Line]]:
    """The planet's surface beneath the body, not to scale: a spherical cap of radius ten units, z down."""
    color = planet.color if planet is not None else GREY
    radius = 9.0
    whole = globe(np.full(3, radius), color)
    center = np.array([0.0, 0.0, below + radius])
    moved = Mesh(whole.vertices + center, whole.triangles, whole.normals, whole.colors)
    lines = [
        Line(f"horizon/{k}", FAINT, line + center, place, 0.6, 0.35)
        for k, line in enumerate(graticule(np.full(3, radius), 15.0))
    ]
    return [Solid("horizon", moved, place)], lines


def without_axes(stage: Stage) -> Stage:
    """A stage without body axes."""
    return replace(stage, axis_length=0.0)
