"""The Earth's continents: a map of land and sea, and a globe that wears it.

The coasts are Natural Earth's, 1:110m, which are in the public domain; ``data/coasts.txt`` says from where.
Longitude zero is the body's x axis, as `rigidsim`'s Earth, whose equatorial moments are equal, leaves open.
"""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from rigidsim.look.solids import Mesh, ball

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

WIDTH = 720
"""Width of the map in pixels: half a degree each, about what a screen resolves of half a globe."""
_SEA, _LAND, _ICE = (58, 108, 176), (146, 156, 98), (226, 232, 236)
_SOUTHERN_ICE, _NORTHERN_ICE = -60.0, (72.0, 80.0)  # degrees of latitude: land that is shown white


@lru_cache(maxsize=1)
def coasts() -> list[Array]:
    """Rings (points, 2) of longitude and latitude, degrees; longitudes may go on past 180."""
    text = (files("rigidsim.look") / "data" / "coasts.txt").read_text(encoding="ascii")
    rings = [line for line in text.splitlines() if not line.startswith("#")]
    return [np.array([pair.split(",") for pair in ring.split()], dtype=np.float64) / 10 for ring in rings]


def land_map(width: int = WIDTH) -> NDArray[np.bool_]:
    """Whether the middles of pixels (width / 2, width) are land: from the north pole down, east from 0."""
    rings = coasts()
    first = np.concatenate(rings)
    second = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    height = width // 2
    land = np.zeros((height, width), dtype=bool)
    for row, latitude in enumerate(90 - (np.arange(height) + 0.5) * 180 / height):
        crossed = (first[:, 1] > latitude) != (second[:, 1] > latitude)
        a, b = first[crossed], second[crossed]
        east = a[:, 0] + (latitude - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
        # A point is inside if an odd number of coasts lies to its west, counted on the unrolled map.
        pixel = np.ceil(east / 360 * width - 0.5).astype(np.int64)
        turns, pixel = np.divmod(pixel, width)
        crossings = np.bincount(pixel, minlength=width)
        land[row] = (np.cumsum(crossings) + turns.sum()) % 2 == 1
    return land


@lru_cache(maxsize=1)
def earth_map() -> Pixels:
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
