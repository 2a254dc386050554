"""Meshes against the closed forms of the polyhedra that they are."""

from collections import Counter

import numpy as np
import pytest

from rigidsim.look.solids import MINOR_SEGMENTS, SEGMENTS, Mesh, solid_mesh
from rigidsim.scene.bodies.shapes import THINNESS

# Area of the regular polygon inscribed in the unit circle, over pi.
POLYGON = SEGMENTS / (2 * np.pi) * np.sin(2 * np.pi / SEGMENTS)
TUBE_POLYGON = MINOR_SEGMENTS / (2 * np.pi) * np.sin(2 * np.pi / MINOR_SEGMENTS)

# solid, dimensions, exact volume of its polyhedron, half extents
CASES = {
    "cuboid": ({"size": [1, 2, 3]}, 6.0, (0.5, 1.0, 1.5)),
    "plate": ({"size": [1, 2]}, 2 * 2 * THINNESS, (0.5, 1.0, THINNESS)),
    "cylinder": ({"radius": 2, "height": 3}, 12 * np.pi * POLYGON, (2, 2, 1.5)),
    "rod": ({"length": 2}, np.pi * 8 * THINNESS**2 * POLYGON, (2 * THINNESS, 2 * THINNESS, 1)),
    "disk": ({"radius": 1}, 2 * np.pi * 2 * THINNESS / 2 * POLYGON, (1, 1, THINNESS)),
    "tube": ({"inner_radius": 1, "outer_radius": 2, "height": 3}, 9 * np.pi * POLYGON, (2, 2, 1.5)),
    # Pappus, for the inscribed polygon of the tube, turned about the axis in SEGMENTS steps.
    "torus": (
        {"major_radius": 2, "minor_radius": 0.5},
        2 * np.pi * 2 * np.pi * 0.25 * TUBE_POLYGON * POLYGON,
        (2.5, 2.5, 0.5),
    ),
}


def volume_of(mesh: Mesh) -> float:
    """By the divergence theorem, positive when normals point outwards."""
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("solid", CASES)
def test_volume_and_extent_are_those_of_the_polyhedron(solid: str) -> None:
    dimensions, volume, half = CASES[solid]
    mesh = solid_mesh(solid, dimensions)
    assert volume_of(mesh) == pytest.approx(volume, rel=1e-12)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), half, rtol=1e-12)
    np.testing.assert_allclose(mesh.vertices.min(axis=0), -np.array(half), rtol=1e-12)


EXAMPLES = {name: case[0] for name, case in CASES.items()} | {
    "ellipsoid": {"semi_axes": [1, 2, 3]},
    "sphere": {"radius": 2},
    "spherical_shell": {"radius": 2},
    "cone": {"radius": 1, "height": 4},
    "ring": {"radius": 1},
}


@pytest.mark.parametrize("solid", EXAMPLES)
def test_surface_is_closed_and_normals_point_outwards(solid: str) -> None:
    mesh = solid_mesh(solid, EXAMPLES[solid])
    corners = mesh.corners
    # Every edge is run once in each direction: closed, and all triangles turned the same way.
    keys = np.round(corners / mesh.reach(), 9) + 0.0
    edges: Counter[tuple[tuple[float, ...], tuple[float, ...]]] = Counter()
    for triangle in keys:
        a, b, c = (tuple(map(float, corner)) for corner in triangle)
        edges.update([(a, b), (b, c), (c, a)])
    assert all(edges[(b, a)] == count == 1 for (a, b), count in edges.items())
    assert volume_of(mesh) > 0
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=2), 1, rtol=1e-9)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    along = np.einsum("tij,tj->ti", mesh.normals, facing)
    assert (along > 0).all()
