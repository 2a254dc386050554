"""Symbolic meshes (a toy top, globes, the Earth with its continents), and edges and circles drawn on meshes.

The coasts are Natural Earth's, 1:110m, which are in the public domain; ``data/coasts.txt`` says from where.
Longitude zero is the body's x axis, as `rigidsim`'s Earth, whose equatorial moments are equal, leaves open.
"""

from functools import lru_cache
from importlib.resources import files
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rigidsim.look.solids import MINOR_SEGMENTS, Array, Color, Mesh, ball, revolved
from rigidsim.scene.bodies.shapes import StraightPiece

_BELTS = MINOR_SEGMENTS // 2  # each of two rings of faces, so that their edges are even
_SHARP = np.cos(np.deg2rad(25.0))  # between the normals of two faces: what counts as an edge
WIDTH = 720  # width of the map in pixels: half a degree each, about what a screen resolves of half a globe
_SEA, _LAND, _ICE = (58, 108, 176), (146, 156, 98), (226, 232, 236)
_SOUTHERN_ICE, _NORTHERN_ICE = -60.0, (72.0, 80.0)  # degrees of latitude: land that is shown white


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
    height = mesh.vertices[mesh.triangles].mean(axis=1)[:, 2] / half_sizes[2]
    belt = (np.floor((np.arcsin(np.clip(height, -1, 1)) / np.pi + 0.5) * _BELTS).astype(int) % 2) * 0.07
    shade = (0.78 + 0.2 * height - belt)[:, None]
    colors = np.clip(np.array(color) * shade, 0, 255).astype(np.uint8)
    return Mesh(mesh.vertices, mesh.triangles, mesh.normals, np.repeat(colors, 3, axis=0))


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


_MARIA = (  # longitude, latitude (deg) and diameter (km) of the round ones: IAU's Gazetteer, rounded
    *((-16, 33, 1100), (18, 27, 670), (31, 9, 870), (59, 16, 520), (53, -8, 800), (35, -15, 340)),
    *((-39, -24, 420), (-17, -21, 700), (-22, -10, 350), (4, 13, 240), (82, 57, 230), (-95, -20, 290)),
    *((87, -2, 370), (86, 13, 360), (-55, 18, 1200)),
)
_MOON, _MARE = 1737.4, (118, 117, 114)


def maria() -> Mesh:
    """The Moon's larger dark plains as discs on the unit sphere, the axis of least moment x at 0 deg."""
    corners = []
    around = np.linspace(0, 2 * np.pi, 33)
    for longitude, latitude, size in _MARIA:
        lon, lat = np.deg2rad(longitude), np.deg2rad(latitude)
        middle = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
        east = np.array([-np.sin(lon), np.cos(lon), 0.0])
        north = np.cross(middle, east)
        rings = [
            np.cos(r) * middle
            + np.sin(r) * (np.cos(around)[:, None] * east + np.sin(around)[:, None] * north)
            for r in np.linspace(0.0, size / 2 / _MOON, 6)
        ]
        for inner, outer in pairwise(rings):
            corners += [np.stack([inner[:-1], outer[:-1], outer[1:]], axis=1)]
            corners += [np.stack([inner[:-1], outer[1:], inner[1:]], axis=1)]
    points = np.concatenate(corners).reshape(-1, 3)
    triangles = np.arange(len(points), dtype=np.uint32).reshape(-1, 3)
    colors = np.tile(np.array(_MARE, dtype=np.uint8), (len(points), 1))
    return Mesh(1.002 * points, triangles, points, colors)


def sharp_edges(mesh: Mesh) -> Array:
    """Edges (E, 2, 3) of a mesh along which its faces meet at more than 25 degrees."""
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # No vertices are shared: those at one place are told by their rounded coordinates.
    keys = np.round(corners.reshape(-1, 3) / mesh.reach() * 1e6).astype(np.int64)
    _, names = np.unique(keys, axis=0, return_inverse=True)
    names = names.reshape(-1, 3)
    pairs = np.concatenate([names[:, [0, 1]], names[:, [1, 2]], names[:, [2, 0]]])
    ends = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    faces = np.tile(np.arange(len(corners)), 3)
    sorted_pairs = np.sort(pairs, axis=1)
    order = np.lexsort((sorted_pairs[:, 1], sorted_pairs[:, 0]))
    same = (sorted_pairs[order[1:]] == sorted_pairs[order[:-1]]).all(axis=1)
    first, second = order[:-1][same], order[1:][same]
    sharp = np.einsum("ij,ij->i", normals[faces[first]], normals[faces[second]]) < _SHARP
    return np.asarray(ends[first[sharp]])


@lru_cache(maxsize=1)
def coasts() -> list[Array]:
    """Rings (points, 2) of longitude and latitude, degrees; longitudes may go on past 180."""
    text = (files("rigidsim.look") / "data" / "coasts.txt").read_text(encoding="ascii")
    rings = [line for line in text.splitlines() if not line.startswith("#")]
    return [np.array([pair.split(",") for pair in ring.split()], dtype=np.float64) / 10 for ring in rings]


def land_map() -> NDArray[np.bool_]:
    """Whether the middles of pixels (WIDTH / 2, WIDTH) are land: from the north pole down, east from 0."""
    rings = coasts()
    first = np.concatenate(rings)
    second = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    height = WIDTH // 2
    land = np.zeros((height, WIDTH), dtype=bool)
    for row, latitude in enumerate(90 - (np.arange(height) + 0.5) * 180 / height):
        crossed = (first[:, 1] > latitude) != (second[:, 1] > latitude)
        a, b = first[crossed], second[crossed]
        east = a[:, 0] + (latitude - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
        # A point is inside if an odd number of coasts lies to its west, counted on the unrolled map.
        pixel = np.ceil(east / 360 * WIDTH - 0.5).astype(np.int64)
        turns, pixel = np.divmod(pixel, WIDTH)
        crossings = np.bincount(pixel, minlength=WIDTH)
        land[row] = (np.cumsum(crossings) + turns.sum()) % 2 == 1
    return land


@lru_cache(maxsize=1)
def earth_map() -> NDArray[np.uint8]:
    """The map in colours, (height, width, 3), a little brighter towards the north."""
    land = land_map()
    latitude = (90 - (np.arange(len(land)) + 0.5) * 180 / len(land))[:, None]
    low, high = _NORTHERN_ICE
    ice = np.where(latitude < _SOUTHERN_ICE, 1.0, np.clip((latitude - low) / (high - low), 0, 1))[..., None]
    ground = ice * np.array(_ICE) + (1 - ice) * np.array(_LAND)
    shade = 0.9 + 0.1 * np.sin(np.deg2rad(latitude))
    return np.asarray(np.where(land[..., None], ground, _SEA) * shade[..., None], dtype=np.uint8)


def earth(half_sizes: Array) -> Mesh:
    """An ellipsoid textured with the map."""
    mesh = ball(*half_sizes)
    unit = mesh.vertices / half_sizes
    longitude = np.arctan2(unit[:, 1], unit[:, 0]) / (2 * np.pi) % 1.0
    latitude = np.arcsin(np.clip(unit[:, 2], -1, 1)) / np.pi
    corners = longitude.reshape(-1, 3)
    # Of a triangle that ends at the seam, corners there are at the end of the map and not at its beginning;
    # one at a pole, where every longitude meets, has that between its neighbours'.
    seam = (corners < 0.25) & (corners.max(axis=1, keepdims=True) > 0.75)
    corners = np.where(seam, corners + 1.0, corners)
    pole = (np.hypot(unit[:, 0], unit[:, 1]) < 1e-9).reshape(-1, 3)
    others = np.where(pole, 0.0, corners).sum(axis=1, keepdims=True) / (~pole).sum(axis=1, keepdims=True)
    corners = np.where(pole, others, corners)
    places = np.stack([corners.ravel(), 0.5 - latitude], axis=1)
    return Mesh(mesh.vertices, mesh.triangles, mesh.normals, mesh.colors, earth_map(), places)
