"""Reference plane of obliquities and longitudes, as expressions: fixed in space, or a source's orbital plane.

Longitudes count from X turned by the smallest rotation that takes Z to the plane's normal n,

    X' = X - n_x (Z + n) / (1 + n_z),    Y' = Y - n_y (Z + n) / (1 + n_z)

(and X itself where n = -Z), so that nothing jumps while a plane moves. Space axes of an ephemeris have the
equinox as X.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.capabilities import WithoutPlane, having, plane_of
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.orbit_planes import OrbitPlane
from rigidsim.model.rotations import Symbolic, along
from rigidsim.scene.arithmetic import Vector, cross
from rigidsim.scene.frame import ORBIT
from rigidsim.scene.scene import Scene


@dataclass(frozen=True)
class ReferencePlane:
    """Reference plane as right-handed unit vectors, space axes."""

    first: list[Symbolic]  # from which longitudes count
    second: list[Symbolic]
    normal: list[Symbolic]  # from which obliquities count
    described: str  # which plane it is

    def components(self, vector: list[Symbolic]) -> list[Symbolic]:
        """Components along the plane's axes of a vector in space axes."""
        return [along(axis, vector) for axis in (self.first, self.second, self.normal)]


def refuse_without_plane(scene: Scene, loads: Sequence[Load]) -> None:
    """Refuse a scene that lacks the plane named by ``[frame] reference``."""
    if scene.reference is None:
        _orbit_plane(loads)


def flies_in_plane(scene: Scene, loads: Sequence[Load]) -> bool:
    """Whether the plane is that of the body's own flight."""
    return scene.reference is None and _orbit_plane(loads).flown


def reference_plane(m: Mechanics) -> ReferencePlane:
    """The plane named by ``[frame] reference``."""
    scene, context = m.scene, m.scene.context
    if scene.reference is not None:
        described = "XY plane of the space axes"
        if not isinstance(scene.config.frame.reference, str):
            given = ", ".join(context.nstr(x, 17) for x in scene.reference)
            described = f"plane with the normal [{given}] in space axes"
        return fixed_plane(m, scene.reference, described)
    plane = _orbit_plane(m.loads)
    fixed = plane.fixed(scene)
    if fixed is not None:
        return fixed_plane(m, fixed, plane.described)
    return _moving(plane.normal(m), plane.described)


def initial_normal(scene: Scene, loads: Sequence[Load]) -> Vector:
    """Approximate normal at the start (mpf, space axes), not of unit length."""
    return scene.reference if scene.reference is not None else _orbit_plane(loads).at_start(scene)


def plane_drift(scene: Scene, loads: Sequence[Load]) -> Any | None:
    """Bound of the rate (rad/s) at which the plane turns; None if unknown."""
    return scene.context.zero if scene.reference is not None else _orbit_plane(loads).drift(scene)


def _orbit_plane(loads: Sequence[Load]) -> OrbitPlane:
    """Plane of the first load that has one."""
    for load in loads:
        if (plane := plane_of(load)) is not None:
            return plane
    what = f'given "{ORBIT}", but no load of the scene has an orbit whose plane is known'
    why = next((x.without_plane for x in having(WithoutPlane, loads) if x.without_plane), "")
    what += f" ({why})" if why else ""
    raise ConfigError(Problem("[frame] reference", what + '; "space" or a normal [x, y, z] is allowed'))


def fixed_plane(m: Mechanics, normal: Vector, described: str) -> ReferencePlane:
    """A plane with a fixed unit normal (mpf, space axes); worked out exactly and rounded once."""
    context = m.scene.context
    x, y, z = normal
    one, zero = context.one, context.zero
    level = x == 0 and y == 0
    first = [one, zero, zero] if level else [one - x * x / (1 + z), -x * y / (1 + z), -x]
    axes = (first, cross(normal, first), normal)
    first, second, normal = map(m.fixed, axes)
    return ReferencePlane(first, second, normal, described)


def _moving(normal: list[Symbolic], described: str) -> ReferencePlane:
    x, y, z = normal
    inverse = 1.0 / (1.0 + z)
    cross_term = -(x * y * inverse)
    first = [1.0 - x * x * inverse, cross_term, -x]
    second = [cross_term, 1.0 - y * y * inverse, -y]
    return ReferencePlane(first, second, normal, described)
