"""Bodies from meshes and links of robots, against sums over points, and scipy's rotations."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import seeds

import rigidsim
from rigidsim.look.solids import body_meshes
from rigidsim.scene.scene import build_scene

pytest.importorskip("trimesh")
REST = "[initial]\nangular_velocity = [0, 0, 1]\n[time]\nend = 1\n"


def built(folder: Path, table: str) -> Any:
    (folder / "scene.toml").write_text(f'name = "scene"\n{table}\n{REST}')
    return build_scene(rigidsim.load(folder / "scene.toml")).body


def steiner(mass: float, center: Any) -> np.ndarray:
    return mass * (np.dot(center, center) * np.eye(3) - np.outer(center, center))


def filled(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and volumes (Gauss and Duffy, exact to degree 9) of a tetrahedron."""
    x, w = np.polynomial.legendre.leggauss(6)
    a, b, c = (g.ravel() for g in np.meshgrid(*[(x + 1) / 2] * 3, indexing="ij"))
    weights = np.prod([g.ravel() for g in np.meshgrid(*[w / 2] * 3, indexing="ij")], axis=0) * a * a * b
    shares = np.stack([1 - a, a * (1 - b), a * b * (1 - c), a * b * c])
    return shares.T @ corners, weights * abs(np.linalg.det(corners[1:] - corners[0]))


def written(path: Path, corners: np.ndarray, rng: np.random.Generator) -> None:
    """A tetrahedron as OBJ, OFF, PLY, or as STL of text or bytes."""
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    if np.linalg.det(corners[1:] - corners[0]) < 0:
        faces = faces[:, ::-1]
    if path.suffix == ".obj":
        text = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in corners.tolist())
        path.write_text(text + "".join(f"f {a} {b} {c}\n" for a, b, c in faces + 1))
    elif path.suffix in (".off", ".ply"):
        head = "OFF\n4 4 0\n"
        if path.suffix == ".ply":
            head = "ply\nformat ascii 1.0\nelement vertex 4\n" + "".join(
                f"property double {x}\n" for x in "xyz"
            )
            head += "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
        places = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in corners.tolist())
        path.write_text(head + places + "".join(f"3 {a} {b} {c}\n" for a, b, c in faces))
    elif rng.random() < 0.5:
        facet = "facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n"
        lines = ("".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in corners[f].tolist()) for f in faces)
        path.write_text("solid s\n" + "".join(facet.format(x) for x in lines) + "endsolid s\n")
    else:
        kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
        rows = np.zeros(4, kind)
        rows["corners"] = corners[faces]
        path.write_bytes(b" " * 80 + np.uint32(4).tobytes() + rows.tobytes())


@pytest.mark.parametrize("seed", seeds(4, 120))
def test_a_mesh_has_the_moments_and_the_field_of_its_volume(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = (rng.uniform(-1, 1, (4, 3)) + rng.integers(-3, 4, 3)).astype("f4").astype(float)
    name, density = f"part.{('stl', 'obj', 'off', 'ply')[seed % 4]}", rng.uniform(1, 5)
    written(tmp_path / name, corners, rng)
    points, volumes = filled(corners / 100)
    mass = 1000 * density * volumes
    center = mass @ points / mass.sum()
    points -= center
    tensor = sum(steiner(m, x) for m, x in zip(mass, points, strict=True))
    found = built(tmp_path, f'[body]\nfile = "{name}"\nunit = "cm"\ndensity = "{density!r} g/cm^3"')
    assert float(found.mass) == pytest.approx(mass.sum(), rel=1e-12)
    np.testing.assert_allclose(np.array(found.inertia, float), tensor, rtol=0, atol=1e-12 * tensor.max())
    radius = np.linalg.norm(corners / 100 - center, axis=1).max()
    assert float(found.gravity.radius) == pytest.approx(radius, rel=1e-12)
    x, y, z = points.T / radius
    square, turned = x * x + y * y + z * z, x + 1j * y
    known = {  # Kaula 1966: integrals of solid harmonics
        (3, 0): z * (5 * z * z - 3 * square) / 2, (3, 1): turned * (5 * z * z - square) / 4,
        (3, 3): turned**3 / 24, (4, 0): (35 * z**4 - 30 * z * z * square + 3 * square**2) / 8,
        (4, 2): turned**2 * (7 * z * z - square) / 24, (4, 4): turned**4 / 192,
    }  # fmt: skip
    for (n, m), values in known.items():
        value, pair = mass @ values / mass.sum(), [(n, m, False), (n, m, True)]
        c, s = (float(found.gravity.coefficients.get(key, 0)) for key in pair)
        assert c + 1j * s == pytest.approx(value, abs=1e-13)
    [drawn] = body_meshes(found.drawing)  # from the centre of mass, with its outside outside
    apart = np.linalg.norm(drawn.vertices[:, None] - (corners / 100 - center), axis=2)
    assert drawn.corners.shape == (4, 3, 3)
    assert (apart.min(axis=1) < 2**-14 * radius).all()
    assert (np.einsum("tij,tj->ti", drawn.normals, drawn.corners.mean(axis=1)) > 0).all()


def test_a_large_mesh_is_drawn_with_fewer_triangles_and_once_placed(tmp_path: Path) -> None:
    """A ball of 10 mm at (30, 0, 0) mm, turned by a right angle about z and moved by 1 m along z."""
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=5, radius=10.0)
    ball.apply_translation([30, 0, 0])
    ball.export(tmp_path / "ball.stl")
    part = '[[body.parts]]\nfile = "ball.stl"\nunit = "mm"\nmass = 1\nposition = [0, 0, 1]\n'
    part += 'euler_angles = ["90 deg", 0, 0]\neuler_sequence = "zyx"\n'
    other = '[[body.parts]]\nshape = "sphere"\nradius = 0.1\nmass = 1\n'
    found = built(tmp_path, part + other + "[body]\nreference = [0, 0, 0]")
    drawn, _ = body_meshes(found.drawing)
    assert 1000 < len(drawn.corners) <= 5000 < len(ball.faces)
    sizes = np.linalg.norm(drawn.vertices - [0, 0.03, 1], axis=1)
    assert 0.0096 < sizes.min() <= sizes.max() < 0.01001


@pytest.mark.parametrize("seed", seeds(4, 60))
def test_links_of_robots_are_put_together_as_scipy_does(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    mass, place, angles = rng.uniform(1, 3), rng.normal(size=3), rng.uniform(-2, 2, 3)
    points = rng.normal(size=(9, 3))
    own = sum(steiner(1 / 9, x) for x in points - points.mean(axis=0))
    words = lambda *x: " ".join(repr(float(v)) for v in np.hstack(x))  # noqa: E731
    if seed % 2:
        name, turned = "robot.urdf", Rotation.from_euler("xyz", angles)
        tensor = " ".join(
            f'i{"xyz"[i]}{"xyz"[j]}="{float(own[i, j])!r}"' for i in range(3) for j in range(i, 3)
        )
        text = f'<robot><link name="a"/><link name="b"><inertial><origin xyz="{words(place)}" '
        text += (
            f'rpy="{words(angles)}"/><mass value="{mass!r}"/><inertia {tensor}/></inertial></link></robot>'
        )
    else:
        name, turned = "robot.xml", Rotation.from_quat(rng.normal(size=4))
        moments, own_axes = np.linalg.eigh(own)
        own_axes[:, 2] *= np.linalg.det(own_axes)
        plain = rng.random() < 0.5
        x, y, z, w = (turned * Rotation.from_matrix(own_axes) if plain else turned).as_quat()
        full = words(np.diag(own), own[0, 1], own[0, 2], own[1, 2])
        text = f'<mujoco><worldbody><body name="b"><inertial pos="{words(place)}" mass="{mass!r}" '
        given = f'diaginertia="{words(moments)}"' if plain else f'fullinertia="{full}"'
        text += f'quat="{words(w, x, y, z)}" {given}/></body></worldbody></mujoco>'
    (tmp_path / name).write_text(text)
    outer, origin = Rotation.from_rotvec(rng.normal(size=3)), rng.normal(size=3)
    x, y, z, w = outer.as_quat()
    # the link, and a tensor about the origin of another part
    center = rng.normal(size=3)
    about = (own + steiner(2.0, center)).tolist()
    found = built(
        tmp_path,
        f'[[body.parts]]\nfile = "{name}"\nlink = "b"\nposition = {origin.tolist()}\n'
        f"quaternion = {[float(v) for v in (w, x, y, z)]}\n[[body.parts]]\ninertia_tensor = {about}\n"
        f'about = "origin"\ncenter_of_mass = {center.tolist()}\nmass = 2\n[body]\nreference = [0, 0, 0]',
    )
    axes = (outer * turned).as_matrix()
    whole = axes @ own @ axes.T + steiner(mass, origin + outer.apply(place)) + own + steiner(2.0, center)
    np.testing.assert_allclose(np.array(found.inertia, float), whole, rtol=0, atol=1e-13 * whole.max())
    assert float(found.mass) == pytest.approx(mass + 2)


OPEN = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\n"

LINK = "<robot><link name='b'><inertial>"
TENSOR = "<inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link></robot>"


@pytest.mark.parametrize(
    ("name", "text", "keys", "said"),
    [
        ("a.obj", OPEN, "mass = 1", "leave holes"),
        ("a.obj", OPEN + "f 1 4 3\n", "mass = 1\ndensity = 2", "given both; a mesh needs one of mass and"),
        ("a.obj", OPEN + "f 1 4 3\n", 'mass = 1\nlink = "b"', "without links; remove link"),
        ("a.obj", OPEN + "f 1 4 3\n", 'mass = 1\nunit = "kg"', "unit"),
        ("a.step", "", "mass = 1", "allowed: .obj, .off, .ply, .stl, .urdf, .xml"),
        ("a.urdf", "<sdf/>", "", "whose root is <sdf>; <robot>"),
        ("a.urdf", "<robot><link name='b'/></robot>", "", "give one of its links that have <inertial>: none"),
        ("a.urdf", "<robot><link name='b'><inertial/></link></robot>", "", "whose <inertial> lacks 'value'"),
        ("a.urdf", f"{LINK}<mass value='much'/>{TENSOR}", "", "whose <inertial> has for mass"),
        ("a.urdf", "<robot>", "mass = 1", "has its own mass and units; remove mass"),
    ],
)
def test_files_that_are_no_bodies_are_refused_with_the_remedy(
    tmp_path: Path, name: str, text: str, keys: str, said: str
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(rigidsim.ConfigError, match=r"\[body\]") as caught:
        built(tmp_path, f'[body]\nfile = "{name}"\n{keys}')
    assert said in str(caught.value)
