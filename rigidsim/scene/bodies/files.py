"""Bodies in files of other tools: meshes of uniform density, and links of robots (URDF, MJCF).

Of a mesh the config keeps moments (``moments_of``) instead of triangles. The volume that it bounds is cut
into tetrahedra over its triangles; Grundmann & Moeller's rule of 15 points (1978, SIAM J. Numer. Anal. 15,
282) integrates polynomials of degree 5 over each exactly: volume, centre, inertia tensor, and the gravity
field to degree 4 (unnormalized coefficients; recursions of Cunningham 1970, Celest. Mech. 2, 207).
Coordinates and sums are doubles. For pictures it keeps triangles, too, on a grid of 2^-15 of the largest
distance; of more than ``_DRAWN`` triangles those that are left when vertices in a cell become one.

A link's inertia is about its centre of mass, in axes of the link: URDF's roll, pitch and yaw turn about fixed
axes, MJCF's ``fullinertia`` is xx yy zz xy xz yz. Numbers keep the digits of the file.
"""

from __future__ import annotations

import math
import tomllib
from base64 import b64encode
from collections.abc import Callable, Mapping
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidsim.errors import ConfigError, ensure

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

LINKS = {"robot": "URDF", "mujoco": "MJCF"}
"""Formats of links by the root of their XML."""
_MESHES = (".obj", ".off", ".ply", ".stl")
_XML = (".urdf", ".xml", ".mjcf")
_DEGREES = (3, 4)
_ROUNDING = 1e-14
"""Of sums over triangles: places, elements of a tensor and coefficients below it are zero by symmetry."""
_DRAWN = 5000
_GRID = 2**15 - 1
_VOLUME = 1e-9
"""Volume over the volume of the bounding box below which nothing is enclosed."""

Refusal = Callable[[str], ConfigError]


def is_mesh(name: str) -> bool:
    """Whether a file's name says mesh; others are texts of links."""
    return Path(name).suffix.lower() not in _XML


def moments_of(path: Path) -> str:
    """Moments of a mesh (TOML) in the file's unit of length, for unit density, about its centre of mass.

    Raises:
        ValueError: trimesh is missing or can't read it, or the mesh bounds no volume.
    """
    if path.suffix.lower() not in _MESHES:
        kinds = ", ".join((*_MESHES, *_XML))
        raise ValueError(f"its suffix {path.suffix!r} names no mesh or robot; allowed: {kinds}")
    try:
        import trimesh
    except ImportError:
        raise ValueError("a mesh needs trimesh, which is missing: pip install 'rigidsim[mesh]'") from None
    try:
        mesh = trimesh.load_mesh(path, process=True)
        triangles, closed = np.asarray(mesh.triangles, dtype=float), bool(mesh.is_watertight)
        vertices, faces = np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces)
    except Exception as error:  # trimesh raises whatever its parsers do
        raise ValueError(f"trimesh can't read it ({type(error).__name__}: {error})") from None
    if not (len(triangles) and closed and mesh.is_winding_consistent):
        fault = (
            "its triangles leave holes"
            if len(triangles) and not closed
            else "its triangles are none, or face both ways"
        )
        raise ValueError(f"{fault}, so that it bounds no volume; close and orient the mesh in its program")
    center = triangles.reshape(-1, 3).mean(axis=0)
    extent = np.prod(np.ptp(triangles.reshape(-1, 3), axis=0))
    triangles = triangles - center
    volumes = np.linalg.det(triangles) / 6
    volume = math.fsum(volumes)
    if abs(volume) <= _VOLUME * extent:
        raise ValueError("its triangles bound no volume; give a plate as a shape, or its tensor")
    off = np.array([math.fsum(volumes * x) for x in triangles.mean(axis=1).T * 0.75]) / volume
    triangles, radius = triangles - off, float(np.linalg.norm(triangles - off, axis=2).max())
    volumes = np.linalg.det(triangles) / 6
    second, field = np.zeros((3, 3)), dict.fromkeys(_harmonics(np.zeros((1, 3))), 0j)
    for weight, corners in _rule():
        points = np.einsum("j,ijk->ik", corners, triangles)
        second += weight * np.einsum("i,ij,ik->jk", volumes, points, points)
        for key, values in _harmonics(points / radius).items():
            field[key] += weight * complex((volumes * values).sum()) / volume
    tensor = (np.trace(second) * np.eye(3) - (second + second.T) / 2) * math.copysign(1, volume)
    tensor[np.abs(tensor) < _ROUNDING * tensor.max()] = 0
    drawn, among = _drawn(vertices - center - off, faces[:, :: 1 if volume > 0 else -1], radius)
    drawn += ["simplified = true"] if among < len(faces) else []
    lines = [f"# moments of {path.name}, {len(triangles)} triangles, for unit density; {among} are drawn"]
    place = np.where(np.abs(center + off) < _ROUNDING * radius, 0.0, center + off)
    lines += [f"volume = {abs(volume)!r}", f"center = {place.tolist()}"]
    lines += [f"tensor = {tensor.tolist()}", "[gravity_field]", f"radius = {radius!r}"]
    for name, part in (("C", "real"), ("S", "imag")):
        sizes = {f'"{n},{m}"': getattr(value, part) for (n, m), value in field.items() if m or name == "C"}
        lines.append(
            f"{name} = {{{', '.join(f'{k} = {v!r}' for k, v in sizes.items() if abs(v) > _ROUNDING)}}}"
        )
    return "\n".join([*lines, "[drawing]", f"step = {radius / _GRID!r}", *drawn])


def _drawn(vertices: np.ndarray, faces: np.ndarray, radius: float) -> tuple[list[str], int]:
    """Vertices from the centre of mass in steps, and their numbers in triangles, for ``look.solids``; and how
    many triangles.
    """
    for cells in (_GRID, *(2**k for k in range(8, 1, -1)), 3, 2, 1):  # across the radius
        rounded = np.round(vertices * (cells / radius)).astype(np.int64)
        _, cell, counts = np.unique(rounded, axis=0, return_inverse=True, return_counts=True)
        named = cell.reshape(-1)[faces]
        named = named[(named != np.roll(named, 1, axis=1)).all(axis=1)]
        if len(named) <= _DRAWN:
            break
    sums = np.stack([np.bincount(cell.reshape(-1), x) for x in vertices.T], axis=1)
    places = np.round(sums / counts[:, None] * (_GRID / radius)).astype("<i2")
    used, numbers = np.unique(named, return_inverse=True)
    tables = {"vertices": places[used], "triangles": numbers.astype("<u2")}
    return [f'{k} = "{b64encode(x.tobytes()).decode()}"' for k, x in tables.items()], len(named)


def _rule() -> list[tuple[float, np.ndarray]]:
    """Weights, over a tetrahedron's volume, and what three corners add to a point; the fourth is 0."""
    found = []
    for i in range(3):
        weight = (-1) ** i * (8 - 2 * i) ** 5 * 6 / (16 * math.factorial(i) * math.factorial(8 - i))
        parts = [beta for beta in product(range(3 - i), repeat=4) if sum(beta) == 2 - i]
        found += [(weight, (2 * np.array(beta[:3]) + 1) / (8 - 2 * i)) for beta in parts]
    return found


def _harmonics(points: np.ndarray) -> dict[tuple[int, int], np.ndarray]:
    """C + i S of unit masses at points in units of the reference radius, degrees 3 and 4, by (n, m)."""
    x, y, z = points.T
    square = x * x + y * y + z * z
    solid = {(0, 0): np.ones(len(points), complex)}
    for n in range(1, _DEGREES[-1] + 1):
        for m in range(n):
            before = solid.get((n - 2, m), 0)
            solid[n, m] = ((2 * n - 1) * z * solid[n - 1, m] - (n + m - 1) * square * before) / (n - m)
        solid[n, n] = (2 * n - 1) * (x + 1j * y) * solid[n - 1, n - 1]
    return {
        (n, m): value * ((2 - (m == 0)) * math.factorial(n - m) / math.factorial(n + m))
        for (n, m), value in solid.items() if n in _DEGREES
    }  # fmt: skip


def mesh_moments(text: str) -> dict[str, Any]:
    """What ``moments_of`` wrote, numbers as texts."""
    return tomllib.loads(text, parse_float=str)


# --- links of robots ----------------------------------------------------------------------------------------


def link_inertia(text: str, link: str | None, refusal: Refusal) -> dict[str, Any]:
    """Mass, tensor, centre of mass and axes of a link, as the keys of a part."""
    from xml.etree import ElementTree  # which few configs need

    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise refusal(f"which is no XML ({error}); URDF and MJCF are allowed") from None
    ensure(
        root.tag in LINKS,
        refusal(f"whose root is <{root.tag}>; <robot> (URDF) and <mujoco> (MJCF) are allowed"),
    )
    places = root.iter("link" if root.tag == "robot" else "body")
    found = {
        place.get("name", ""): inertial
        for place in places
        if (inertial := place.find("inertial")) is not None
    }
    allowed = ", ".join(found) or "none; export the model with the inertia that its program works out"
    if link is None:
        ensure(
            len(found) == 1, refusal(f"without link; give one of its links that have <inertial>: {allowed}")
        )
    else:
        ensure(link in found, refusal(f'which has no link "{link}" with <inertial>; allowed: {allowed}'))
    inertial = found[link] if link is not None else next(iter(found.values()))
    try:
        return (_urdf if root.tag == "robot" else _mjcf)(inertial)
    except (KeyError, ValueError) as error:
        what = (
            f"whose <inertial> lacks {error}"
            if isinstance(error, KeyError)
            else f"whose <inertial> has {error}"
        )
        raise refusal(f"{what}; mass, place and tensor are needed") from None


def _urdf(inertial: Element) -> dict[str, Any]:
    origin, mass, tensor = (
        {} if x is None else x.attrib for x in map(inertial.find, ("origin", "mass", "inertia"))
    )
    roll, pitch, yaw = _numbers(origin, "rpy", 3, "0 0 0")
    return {
        "mass": mass["value"],
        "position": _numbers(origin, "xyz", 3, "0 0 0"),
        "euler_angles": [yaw, pitch, roll],
        "euler_sequence": "zyx",
        "inertia_tensor": [[tensor["i" + "".join(sorted(a + b))] for b in "xyz"] for a in "xyz"],
    }


def _mjcf(inertial: Element) -> dict[str, Any]:
    given = inertial.attrib
    turned = sorted({"euler", "axisangle", "xyaxes", "zaxis"} & set(given))
    if turned:
        raise ValueError(
            f"{turned[0]}, which the compiler's settings change: save the compiled model, which has quat"
        )
    if "fullinertia" in given:
        xx, yy, zz, xy, xz, yz = _numbers(given, "fullinertia", 6)
        tensor = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    else:
        a, b, c = _numbers(given, "diaginertia", 3)
        tensor = [[a, "0", "0"], ["0", b, "0"], ["0", "0", c]]
    quaternion = _numbers(given, "quat", 4, "1 0 0 0")
    placed = {"position": _numbers(given, "pos", 3), "quaternion": quaternion}
    return {"mass": given["mass"], **placed, "inertia_tensor": tensor}


def _numbers(given: Mapping[str, str], key: str, count: int, otherwise: str | None = None) -> list[str]:
    """Texts of an attribute's numbers."""
    found = (given[key] if otherwise is None else given.get(key, otherwise)).split()
    if len(found) != count:
        raise ValueError(f"{len(found)} numbers in {key}, where {count} belong")
    return found
