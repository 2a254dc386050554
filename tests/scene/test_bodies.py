"""Inertia of bodies against integrals over their volume and the theorems of every mechanics course."""

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rigidsim import parse
from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.bodies.shapes import SHAPES
from rigidsim.scene.scene import build_scene

DIGITS = 50
CONTEXT = context_for(DIGITS)
LAST = CONTEXT.mpf(2) ** (16 - CONTEXT.prec)  # some tens of roundings of the context
CLOSE = 200 * np.finfo(float).eps  # sums of some hundred terms of one sign in double


def body(table: str) -> Any:
    text = f'name = "body"\n[body]\n{table}\n[initial]\nangular_velocity = [0, 0, 0]\n[time]\nend = 1\n'
    return build_scene(parse(f"{text}[integrator]\nprecision = {DIGITS}\n")).body


def numbers(matrix: Any) -> np.ndarray:
    return np.array(matrix, dtype=float)


def number(value: Fraction | int) -> Any:
    value = Fraction(value)
    return CONTEXT.mpf(value.numerator) / value.denominator


# ---- shapes against integrals -----------------------------------------------------------------------------


def line(low: float, high: float, count: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights: exact for polynomials up to degree 11."""
    x, w = np.polynomial.legendre.leggauss(count)
    return (high + low) / 2 + (high - low) / 2 * x, (high - low) / 2 * w


def circle(count: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Equal steps around a circle: exact for trigonometric polynomials up to degree 7."""
    return 2 * np.pi * np.arange(count) / count, np.full(count, 2 * np.pi / count)


def nodes(*rules: tuple[np.ndarray, np.ndarray]) -> Iterator[np.ndarray]:
    """Product rule: the coordinates of all nodes, and last the products of the weights."""
    yield from (x.ravel() for x in np.meshgrid(*(rule[0] for rule in rules), indexing="ij"))
    yield np.prod([w.ravel() for w in np.meshgrid(*(r[1] for r in rules), indexing="ij")], axis=0)


def ball(a: float, b: float, c: float) -> tuple[np.ndarray, np.ndarray]:
    r, u, phi, w = nodes(line(0, 1), line(-1, 1), circle())
    s = np.sqrt(1 - u**2)
    return np.stack([a * r * s * np.cos(phi), b * r * s * np.sin(phi), c * r * u], 1), w * r**2


def tube(inner: float, outer: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    r, phi, z, w = nodes(line(inner, outer), circle(), line(-height / 2, height / 2))
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], 1), w * r


def cone(radius: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Apex at the origin, opening towards +z."""
    r, phi, z, w = nodes(line(0, 1), circle(), line(0, height))
    width = radius * z / height
    return np.stack([r * width * np.cos(phi), r * width * np.sin(phi), z], 1), w * r * width**2


def torus(major: float, minor: float) -> tuple[np.ndarray, np.ndarray]:
    r, t, phi, w = nodes(line(0, minor), circle(), circle())
    rho = major + r * np.cos(t)
    return np.stack([rho * np.cos(phi), rho * np.sin(phi), r * np.sin(t)], 1), w * r * rho


def shell(radius: float) -> tuple[np.ndarray, np.ndarray]:
    u, phi, w = nodes(line(-1, 1), circle())
    s = np.sqrt(1 - u**2)
    return radius * np.stack([s * np.cos(phi), s * np.sin(phi), u], 1), w


def box(*edges: float) -> tuple[np.ndarray, np.ndarray]:
    """A cuboid, or with an edge of zero a plate or a rod."""
    rules = [line(-e / 2, e / 2) if e else (np.zeros(1), np.ones(1)) for e in edges]
    *xyz, w = nodes(*rules)
    return np.stack(xyz, 1), w


def disk(radius: float) -> tuple[np.ndarray, np.ndarray]:
    r, phi, w = nodes(line(0, radius), circle())
    return np.stack([r * np.cos(phi), r * np.sin(phi), 0 * r], 1), w * r


def ring(radius: float) -> tuple[np.ndarray, np.ndarray]:
    phi, w = circle()
    return radius * np.stack([np.cos(phi), np.sin(phi), 0 * phi], 1), w


def moments_of(points: np.ndarray, weights: np.ndarray, mass: float) -> tuple[np.ndarray, np.ndarray]:
    """Inertia tensor about the origin and centre of mass of weighted points."""
    m = mass * weights / weights.sum()
    squares = np.einsum("n,ni,nj->ij", m, points, points)
    return np.trace(squares) * np.eye(3) - squares, m @ points / mass


SOLIDS = {
    "cuboid": ("size = [0.7, 1.9, 3.1]", lambda: box(0.7, 1.9, 3.1)),
    "plate": ("size = [0.7, 1.9]", lambda: box(0.7, 1.9, 0)),
    "ellipsoid": ("semi_axes = [0.7, 1.9, 3.1]", lambda: ball(0.7, 1.9, 3.1)),
    "sphere": ("radius = 1.3", lambda: ball(1.3, 1.3, 1.3)),
    "spherical_shell": ("radius = 1.3", lambda: shell(1.3)),
    "cylinder": ("radius = 1.3\nheight = 0.4", lambda: tube(0, 1.3, 0.4)),
    "tube": ("inner_radius = 0.9\nouter_radius = 1.3\nheight = 0.4", lambda: tube(0.9, 1.3, 0.4)),
    "cone": ("radius = 1.3\nheight = 2.4", lambda: cone(1.3, 2.4)),
    "rod": ("length = 1.7", lambda: box(0, 0, 1.7)),
    "disk": ("radius = 1.3", lambda: disk(1.3)),
    "ring": ("radius = 1.3", lambda: ring(1.3)),
    "torus": ("major_radius = 1.9\nminor_radius = 0.6", lambda: torus(1.9, 0.6)),
}


def test_every_shape_is_tested() -> None:
    assert SOLIDS.keys() == SHAPES.keys()


@pytest.mark.parametrize("name", SOLIDS)
def test_shape_about_another_point_is_the_integral_from_there(name: str) -> None:
    dimensions, rule = SOLIDS[name]
    points, weights = rule()
    _, center = moments_of(points, weights, 1.0)
    reference = np.array([0.3, -0.8, 1.1])
    expected, seen = moments_of(points - center - reference, weights, 2.5)
    solid = body(f'shape = "{name}"\nmass = 2.5\n{dimensions}\nreference = [0.3, -0.8, 1.1]')
    np.testing.assert_allclose(numbers(solid.inertia), expected, rtol=0, atol=CLOSE * expected.max())
    np.testing.assert_allclose(numbers(solid.center_of_mass), seen, rtol=0, atol=CLOSE)


# ---- points -----------------------------------------------------------------------------------------------


def points_table(masses: list[int], positions: list[tuple[int, int, int]], reference: str = "") -> str:
    entries = [f"{{mass = {m}, position = {list(p)}}}" for m, p in zip(masses, positions, strict=True)]
    return f"points = [{', '.join(entries)}]\n{reference}"


coordinates = st.integers(-100, 100)
clouds = st.lists(
    st.tuples(coordinates, coordinates, coordinates), min_size=3, max_size=8, unique=True
).flatmap(
    lambda positions: st.tuples(
        st.lists(st.integers(1, 100), min_size=len(positions), max_size=len(positions)), st.just(positions)
    )
)


def on_a_line(positions: list[tuple[int, int, int]], *more: tuple[int, int, int]) -> bool:
    moved = np.array([*positions, *more]) - np.array(positions[0])
    return np.linalg.matrix_rank(moved) < 2


@given(clouds)
def test_points_about_the_origin(cloud: tuple[list[int], list[tuple[int, int, int]]]) -> None:
    """Ixx + Iyy + Izz = 2 sum m r^2, and every product of inertia, against whole numbers."""
    masses, positions = cloud
    assume(not on_a_line(positions, (0, 0, 0)))
    found = body(points_table(masses, positions, "reference = [0, 0, 0]"))
    squares = [
        [sum(m * p[i] * p[j] for m, p in zip(masses, positions, strict=True)) for j in range(3)]
        for i in range(3)
    ]
    trace = sum(squares[i][i] for i in range(3))
    assert found.inertia == [[trace * (i == j) - squares[i][j] for j in range(3)] for i in range(3)]
    assert sum(found.inertia[i][i] for i in range(3)) == 2 * trace


# ---- composite bodies -------------------------------------------------------------------------------------


@given(st.tuples(*[st.integers(-10, 10)] * 4).filter(any))
def test_a_parts_quaternion_turns_its_tensor(q: tuple[int, ...]) -> None:
    """Part to body: I = R diag R^T, with scipy's R of the same quaternion."""
    turned = body(f'parts = [{{shape = "cuboid", mass = 2, size = [0.7, 1.9, 3.1], quaternion = {list(q)}}}]')
    straight = numbers(body('shape = "cuboid"\nmass = 2\nsize = [0.7, 1.9, 3.1]').inertia)
    w, x, y, z = q
    r = Rotation.from_quat([x, y, z, w]).as_matrix()
    np.testing.assert_allclose(numbers(turned.inertia), r @ straight @ r.T, rtol=0, atol=CLOSE)


def test_a_parts_euler_angles_turn_its_tensor() -> None:
    """Intrinsic angles, as scipy's capitals mean them; the config's sequence unless the part has one."""
    part = 'shape = "cuboid", mass = 2, size = [0.7, 1.9, 3.1], euler_angles = ["40 deg", 0.6, "pi/4"]'
    straight = numbers(body('shape = "cuboid"\nmass = 2\nsize = [0.7, 1.9, 3.1]').inertia)
    r = Rotation.from_euler("ZYX", [np.deg2rad(40), 0.6, np.pi / 4]).as_matrix()
    turned = body(f'parts = [{{{part}, euler_sequence = "zyx"}}]')
    np.testing.assert_allclose(numbers(turned.inertia), r @ straight @ r.T, rtol=0, atol=CLOSE)
    text = f'name = "b"\nintegrator.euler_sequence = "zyx"\n[body]\nparts = [{{{part}}}]\n'
    scene = build_scene(parse(text + "[initial]\nangular_velocity = [0, 0, 1]\n[time]\nend = 1"))
    np.testing.assert_allclose(numbers(scene.body.inertia), r @ straight @ r.T, rtol=0, atol=CLOSE)
