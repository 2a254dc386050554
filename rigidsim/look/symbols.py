"""Symbolic meshes (a toy top, globes, the Earth and the Moon by maps), and edges and circles on meshes.

Maps have the north pole above and count longitudes eastwards from the body's x axis, which the preset Earth,
whose equatorial moments are equal, leaves open. ``data/earth.png`` has the coasts of Natural Earth 4.1.0,
1:110m (public domain, naturalearthdata.com), ``data/moon.png`` the larger maria as discs, by their places
and diameters in the IAU's Gazetteer.
"""

from dataclasses import replace
from importlib.resources import files

import numpy as np
from PIL import Image

from rigidsim.look.solids import MINOR_SEGMENTS, Array, Color, Mesh, ball, revolved
from rigidsim.scene.bodies.shapes import StraightPiece

_BELTS = MINOR_SEGMENTS // 2  # each of two rings of faces, so that their edges are even
_SHARP = np.cos(np.deg2rad(25.0))  # between the normals of two faces: what counts as an edge


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


def pictured_globe(half_sizes: Array, name: str) -> Mesh:
    """An ellipsoid textured with the map of ``earth`` or ``moon``."""
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
    with (files("rigidsim.look") / "data" / f"{name}.png").open("rb") as file:
        picture = np.asarray(Image.open(file).convert("RGB"))
    return replace(mesh, picture=picture, places=places)
