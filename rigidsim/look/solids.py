"""Triangle meshes of the solids that bodies are made of, coloured so that a rotation shows.

Every mesh is a list of separate triangles, so that neighbouring patches keep sharp colours.

Maps have the north pole above and count longitudes eastwards from the body's x axis, which the preset Earth,
whose equatorial moments are equal, leaves open. ``data/earth.png`` has the coasts of Natural Earth 4.1.0,
1:110m (public domain, naturalearthdata.com), ``data/moon.png`` the larger maria as discs, by their places
and diameters in the IAU's Gazetteer.
"""

from base64 import b64decode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from itertools import product
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from rigidsim.scene import rotations
from rigidsim.scene.bodies import shapes
from rigidsim.scene.bodies.shapes import Arc, StraightPiece

Array = NDArray[np.float64]
Color = tuple[int, int, int]

SEGMENTS = 64  # around the axis; a multiple of 8, so that colour sectors end on an edge
MINOR_SEGMENTS = 32  # along an arc: around a tube or from pole to pole
MESH = "mesh"  # of a file, by its triangles
POINT = "point"  # a point mass, which has no shape and is drawn as a ball

# Faces of a cuboid carry the colour of the body axis that they face; the negative side is darker.
_AXIS_COLORS = ((214, 84, 76), (92, 172, 98), (78, 128, 205))
_DARKER = 0.62
_LIGHT = (232, 224, 206)
_UPPER = (70, 118, 190)
_LOWER = (200, 96, 62)
_CUBE = {"solid": "cuboid", "dimensions": {"size": [1.0, 1.0, 1.0]}}
_BARE = (92, 94, 100)  # the back of a plate that light and air meet from its front alone
_BELTS = MINOR_SEGMENTS // 2  # each of two rings of faces, so that their edges are even
_SHARP = np.cos(np.deg2rad(25.0))  # between the normals of two faces: what counts as an edge


@dataclass(frozen=True)
class Mesh:
    """A closed triangle mesh: corners and outward unit normals of the smooth surface (T, 3, 3), metres, the
    corners anticlockwise as seen from outside, and a colour (T, 3) of each triangle, or instead a picture
    (height, width, 3) with the corners' places in it (T, 3, 2), across and down, of its sizes.
    """

    corners: Array
    normals: Array
    colors: NDArray[np.uint8]
    places: Array
    picture: NDArray[np.uint8] | None = None

    @property
    def vertices(self) -> Array:
        """All corners (3 T, 3)."""
        return self.corners.reshape(-1, 3)

    def moved(self, rotation: Array, shift: Array) -> Self:
        """The mesh rotated by `rotation` (3, 3), then moved by `shift` (3,), metres."""
        return replace(self, corners=self.corners @ rotation.T + shift, normals=self.normals @ rotation.T)

    def scaled(self, factor: float) -> Self:
        """The mesh with all lengths multiplied by `factor` > 0."""
        return replace(self, corners=self.corners * factor)

    def reach(self) -> float:
        """Largest distance of a vertex from the origin, metres."""
        return float(np.sqrt((self.corners**2).sum(axis=2).max()))


def solid_mesh(solid: str, dimensions: Mapping[str, Any]) -> Mesh:
    """Mesh of a solid of ``SHAPES`` about its own centre of mass, in its own axes; dimensions in metres.

    A dimension of zero is drawn as a fiftieth of the largest one.
    """
    shape = shapes.SHAPES[solid]
    given = {key: np.asarray(dimensions[key], dtype=float).reshape(-1) for key in shape.dimensions}
    largest = max(value.max() for value in given.values())
    # Ideal rods and plates have no thickness; a picture of them needs some.
    outline = shape.outline(
        {key: np.maximum(value, shapes.THINNESS * largest).tolist() for key, value in given.items()}
    )
    match outline:
        case shapes.Box(x, y, z):
            return _box(x, y, z) if solid != "plate" else _two_sided(_box(x, y, z), _LOWER)
        case shapes.Ellipsoid(x, y, z):
            return ball(x, y, z)
        case shapes.Revolved(pieces):
            return revolved(pieces)


def body_meshes(drawing: Sequence[Mapping[str, Any]]) -> list[Mesh]:
    """Meshes (metres) of a body from the ``drawing`` of its recorded scene, in body axes, one per solid.

    Each is {"solid", "dimensions", "position", "quaternion"}: position of the solid's centre of mass in body
    axes from the reference point, metres; quaternion [w, x, y, z] turns the solid's axes to body axes. Of an
    empty list a unit cube. A `mesh` has step, vertices and triangles. The volume of a `point` goes with its
    `mass_fraction`; the largest radius is a sixth of the reach.
    """
    solids = [(entry, *_placement(entry)) for entry in drawing or [_CUBE]]
    meshes = [None if one["solid"] == POINT else _solid(one).moved(*place) for one, *place in solids]
    reach = max(
        float(np.linalg.norm(shift)) if mesh is None else mesh.reach()
        for mesh, (_, _, shift) in zip(meshes, solids, strict=True)
    )
    reach = reach or 1.0  # a single point at the reference point has no size

    def point(entry: Mapping[str, Any], turn: Array, shift: Array) -> Mesh:
        fraction = float(entry.get("dimensions", {}).get("mass_fraction", 1.0))
        radius = reach * max(np.cbrt(np.clip(fraction, 0.0, 1.0)) / 6, 0.03)
        return ball(radius, radius, radius, segments=32, rings=16).moved(turn, shift)

    return [mesh or point(*solid) for mesh, solid in zip(meshes, solids, strict=True)]


def _solid(entry: Mapping[str, Any]) -> Mesh:
    if entry["solid"] == MESH:
        return _of_triangles(**entry["dimensions"])
    mesh = solid_mesh(entry["solid"], entry.get("dimensions", {}))
    return _two_sided(mesh, _BARE) if entry.get("one_sided") else mesh


def _of_triangles(step: float, vertices: str, triangles: str, simplified: bool = False) -> Mesh:
    """A mesh as ``scene.bodies.files`` keeps it, in the colours of the axes that it faces; smooth where its
    triangles meet nearly flat, and at small ones that are left of a simplified mesh.
    """
    places = np.frombuffer(b64decode(vertices), "<i2").reshape(-1, 3) * step
    faces = np.frombuffer(b64decode(triangles), "<u2").reshape(-1, 3)
    corners = places[faces]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(areas, axis=1)
    corners, faces, areas = (x[sizes > 0] for x in (corners, faces, areas))
    flat = areas / sizes[sizes > 0, None]
    around = np.stack([np.bincount(faces.ravel(), np.repeat(x, 3), len(places)) for x in areas.T], axis=1)
    smooth = around[faces] / np.maximum(np.linalg.norm(around[faces], axis=2, keepdims=True), 1e-300)
    small = simplified & (np.linalg.norm(areas, axis=1) < np.median(sizes))
    even = (np.einsum("tij,tj->ti", smooth, flat) > _SHARP) | small[:, None]
    normals = np.where(even[..., None], smooth, flat[:, None, :])
    facing = normals.mean(axis=1)
    shade = facing**2 * np.where(facing > 0, 1.0, _DARKER)
    return Mesh(corners, normals, _painted(shade @ np.array(_AXIS_COLORS)), np.zeros((len(faces), 3, 2)))


def _two_sided(plate: Mesh, back: Color) -> Mesh:
    """A plate with its front (+z) in one colour, its back in another, and pale edges."""
    up = plate.normals[:, 0, 2:]
    return replace(plate, colors=_painted(np.select([up > 0.5, up < -0.5], [_UPPER, back], _LIGHT)))


def point_positions(drawing: Sequence[Mapping[str, Any]]) -> Array:
    """Positions (P, 3) of the point masses of a ``drawing``, body axes, metres; P may be 0."""
    points = [_placement(e)[1] for e in drawing if e["solid"] == POINT]
    return np.array(points, dtype=float).reshape(-1, 3)


def rotation_matrix(quaternion: Sequence[float] | Array) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4) [w, x, y, z] of any norm > 0."""
    q = np.asarray(quaternion, dtype=float)
    unit = np.moveaxis(q / np.sqrt(np.einsum("...i,...i->...", q, q))[..., None], -1, 0)
    return np.moveaxis(np.array(rotations.rotation_matrix(list(unit))), (0, 1), (-2, -1))


def _placement(entry: Mapping[str, Any]) -> tuple[Array, Array]:
    turn = entry.get("quaternion")  # absent or null: axes parallel to the body axes
    shift = np.asarray(entry.get("position") or (0.0, 0.0, 0.0), dtype=float)
    return rotation_matrix(turn if turn is not None else (1.0, 0.0, 0.0, 0.0)), shift


def _painted(colors: Any) -> NDArray[np.uint8]:
    """Colours (T, 3) as the viewer takes them."""
    return np.clip(colors, 0, 255).astype(np.uint8)


def _box(a: float, b: float, c: float) -> Mesh:
    corners, normals, colors = [], [], []
    half, axes = np.array([a, b, c]) / 2, np.eye(3)
    for k, sign in product(range(3), (1, -1)):
        first, second = axes[(k + 1) % 3], axes[(k + 2) % 3]
        quad = half * (sign * axes[k] + np.outer([-1, 1, 1, -1], first) + np.outer([-1, -1, 1, 1], second))
        corners += [quad[::sign][[0, 1, 2]], quad[::sign][[0, 2, 3]]]
        normals += 2 * [np.tile(sign * axes[k], (3, 1))]
        colors += 2 * [np.array(_AXIS_COLORS[k]) * (1.0 if sign > 0 else _DARKER)]
    return Mesh(np.array(corners), np.array(normals), _painted(colors), np.zeros((12, 3, 2)))


def revolved(pieces: Sequence[StraightPiece | Arc], *, middle: float = 0.0) -> Mesh:
    """Mesh of a solid of revolution about z from its outline, metres; its colours change at z = `middle`."""
    profile, normals = zip(*map(_profile, pieces), strict=True)
    return _revolve(np.concatenate(profile), np.concatenate(normals), middle=middle)


def _revolve(profile: Array, normals: Array, segments: int = SEGMENTS, *, middle: float = 0.0) -> Mesh:
    """Surface of revolution about z.

    `profile` and `normals` are (P, 2, 2): P straight pieces from one (radius, z) to the next, run
    so that the outside is on their right, with the (radial, axial) normal at both of their ends.
    """
    angle = np.linspace(0.0, 2 * np.pi, segments + 1)
    angle[-1] = 0.0  # the seam closes exactly
    turn = np.stack([np.cos(angle), np.sin(angle), np.ones(segments + 1)], axis=1)

    def triangles(grid: Array) -> Array:  # (P, 2, segments + 1, n) to (2 P segments, 3, n)
        (a, b), (d, c) = ((grid[:, k, :-1], grid[:, k, 1:]) for k in (0, 1))
        both = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)])
        return both.reshape(-1, 3, grid.shape[-1])

    corners = triangles(profile[:, :, None, [0, 0, 1]] * turn)
    count = len(profile)
    down = 1 - (np.arange(count)[:, None] + [0, 1]) / count
    across = np.linspace(0.0, 1.0, segments + 1)
    places = triangles(np.stack(np.broadcast_arrays(across, down[:, :, None]), axis=-1))
    upper = profile[..., 1].mean(axis=1) - middle > 1e-9 * np.abs(profile).max()
    hue = np.where(upper[:, None], _UPPER, _LOWER)[:, None]
    light = (np.arange(segments) * 8 // segments % 2)[:, None] == 1
    colors = np.tile(np.where(light, _LIGHT, hue).reshape(-1, 3), (2, 1))
    # triangles that shrink to a line where a profile meets the axis carry no area
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    keep = area > 1e-12 * area.max()
    turned = triangles(normals[:, :, None, [0, 0, 1]] * turn)
    return Mesh(corners[keep], turned[keep], _painted(colors)[keep], places[keep])


def _profile(piece: StraightPiece | Arc, rings: int = MINOR_SEGMENTS) -> tuple[Array, Array]:
    """Straight pieces of an outline, and the normals at their ends, as ``_revolve`` takes them."""
    if isinstance(piece, StraightPiece):  # in two, for its two colours
        nodes = np.linspace(piece.start, piece.stop, 3)
        along = nodes[-1] - nodes[0]
        normals = np.tile([along[1], -along[0]] / np.hypot(*along), (3, 1))
    else:
        angle = np.linspace(piece.start, piece.stop, rings + 1)
        outward = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        nodes = np.array(piece.center) + piece.radius * outward
        nodes[np.abs(nodes) < 1e-15 * np.abs(nodes).max()] = 0.0
        normals = outward * np.sign(piece.stop - piece.start)
    return np.stack([nodes[:-1], nodes[1:]], axis=1), np.stack([normals[:-1], normals[1:]], axis=1)


def ball(a: float, b: float, c: float, segments: int = SEGMENTS, rings: int = MINOR_SEGMENTS) -> Mesh:
    """Mesh of an ellipsoid with these semi-axes along x, y and z, metres."""
    unit = _revolve(*_profile(Arc((0.0, 0.0), 1.0, -np.pi / 2, np.pi / 2), rings), segments)
    axes = np.array([a, b, c])
    normals = unit.normals / axes
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return replace(unit, corners=unit.corners * axes, normals=normals)


def spinning_top(radius: float, height: float, whole: float) -> Mesh:
    """A top that stands on its tip at the origin, with a disk at some height, and a stem up to `whole`."""
    stem, rim = 0.09 * radius, 0.13 * radius
    pieces = (
        StraightPiece((0.0, 0.0), (0.30 * radius, height - 3.2 * rim)),
        StraightPiece((0.30 * radius, height - 3.2 * rim), (radius, height - rim)),
        StraightPiece((radius, height - rim), (radius, height + rim)),
        StraightPiece((radius, height + rim), (stem, height + 3.0 * rim)),
        StraightPiece((stem, height + 3.0 * rim), (stem, whole)),
        StraightPiece((stem, whole), (0.0, whole)),
    )
    return revolved(pieces, middle=height)


def globe(half_sizes: Array, color: Color) -> Mesh:
    """An ellipsoid in belts of two shades of a colour, brighter towards its north pole."""
    mesh = ball(*half_sizes)
    height = mesh.corners.mean(axis=1)[:, 2:] / half_sizes[2]
    belt = np.floor((np.arcsin(np.clip(height, -1, 1)) / np.pi + 0.5) * _BELTS) % 2 * 0.07
    return replace(mesh, colors=_painted(np.array(color) * (0.78 + 0.2 * height - belt)))


def graticule(half_sizes: Array, step: float = 30.0, lift: float = 1.004) -> list[Array]:
    """Meridians and parallels of an ellipsoid, a little above it, each (points, 3)."""
    around = np.linspace(0, 2 * np.pi, 97)
    half = np.linspace(-np.pi / 2, np.pi / 2, 49)
    lines = [
        np.stack([np.cos(half) * np.cos(at), np.cos(half) * np.sin(at), np.sin(half)], axis=1)
        for at in np.deg2rad(np.arange(0.0, 360.0, step))
    ]
    for latitude in np.deg2rad(np.arange(-90.0 + step, 90.0, step)):
        flat = np.cos(latitude)
        lines.append(
            np.stack([flat * np.cos(around), flat * np.sin(around), np.full(97, np.sin(latitude))], axis=1)
        )
    return [line * half_sizes * lift for line in lines]


def sharp_edges(mesh: Mesh) -> Array:
    """Edges (E, 2, 3) of a mesh along which its surface bends by more than 25 degrees."""
    corners = mesh.corners
    # No vertices are shared: rounded coordinates identify those at one place.
    keys = np.round(corners.reshape(-1, 3) / mesh.reach() * 1e6).astype(np.int64)
    _, names = np.unique(keys, axis=0, return_inverse=True)
    tables = (names.reshape(-1, 3), corners, mesh.normals)
    pairs, ends, normals = (np.concatenate([x[:, side] for side in ([0, 1], [1, 2], [2, 0])]) for x in tables)
    facing = normals.sum(axis=1)
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    sorted_pairs = np.sort(pairs, axis=1)
    order = np.lexsort((sorted_pairs[:, 1], sorted_pairs[:, 0]))
    same = (sorted_pairs[order[1:]] == sorted_pairs[order[:-1]]).all(axis=1)
    first, second = order[:-1][same], order[1:][same]
    sharp = np.einsum("ij,ij->i", facing[first], facing[second]) < _SHARP
    return np.asarray(ends[first[sharp]])


def pictured_globe(half_sizes: Array, name: str) -> Mesh:
    """An ellipsoid textured with the map of ``earth`` or ``moon``."""
    with (files("rigidsim.look") / "data" / f"{name}.png").open("rb") as file:
        return replace(ball(*half_sizes), picture=np.asarray(Image.open(file).convert("RGB")))
