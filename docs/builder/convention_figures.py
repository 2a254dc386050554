"""Pictures of the conventions: ``python docs/builder/convention_figures.py`` draws them into docs/figures.

The axes that they show are turned by the package's own rotations, so that no picture contradicts the code.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from matplotlib import pyplot
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rigidsim.scene import attitude

FIGURES = Path(__file__).resolve().parents[1] / "figures"
_COLOURS = ("#d1495b", "#3a9a5b", "#2f6fbf")
_GREY = "#9aa3ad"
_ANGLES = {
    "zxz": (math.radians(50), math.radians(40), math.radians(55)),
    "zyx": (math.radians(65), math.radians(25), math.radians(35)),
}
SEQUENCES = {"zxz": "precession φ, tilt θ, spin ψ", "zyx": "yaw φ, pitch θ, roll ψ"}


def matrix(sequence: str, angles: tuple[float, ...]) -> np.ndarray:
    """R of intrinsic rotations, body to space, from the package."""
    context = mpmath.MPContext()
    quaternion = attitude.quaternion_from_euler(context, [context.mpf(a) for a in angles], sequence)
    rows = attitude.rotation_matrix(attitude.unit_quaternion(context, quaternion))
    return np.array([[float(x) for x in row] for row in rows])


def arrow(axes: Any, end: np.ndarray, colour: str, name: str, *, pale: bool = False) -> None:
    """From the origin."""
    axes.quiver(0, 0, 0, *end, color=colour, lw=1.2 if pale else 2.2, arrow_length_ratio=0.1)
    axes.text(*(1.14 * end), name, color=colour, fontsize=11, ha="center", va="center")


def arc(axes: Any, start: np.ndarray, end: np.ndarray, colour: str, name: str, size: float = 0.5) -> None:
    """Of a great circle, from one direction to another."""
    angle = math.acos(np.clip(start @ end, -1, 1))
    steps = np.linspace(0, 1, 40)[:, None] * angle
    across = end - (start @ end) * start
    across /= np.linalg.norm(across)
    points = size * (np.cos(steps) * start + np.sin(steps) * across)
    for edge in (points[0], points[-1]):
        axes.plot(*np.array([0 * edge, edge]).T, color=colour, lw=0.8, ls=":")
    axes.plot(*points.T, color=colour, lw=1.6)
    axes.text(*(1.25 * points[len(points) // 2]), name, color=colour, fontsize=11, ha="center")


def empty(axes: Any, title: str) -> None:
    """A cube without its frame, seen from above at an angle."""
    axes.set_box_aspect((1, 1, 1), zoom=1.3)
    axes.set(xlim=(-0.9, 0.9), ylim=(-0.9, 0.9), zlim=(-0.75, 1.05))
    axes.set_axis_off()
    axes.view_init(elev=24, azim=28)
    axes.set_title(title, fontsize=10.5, y=1.0)


def euler(axes: Any, sequence: str) -> None:
    """Space axes in grey, body axes in colour, and the three turns."""
    empty(axes, f"{sequence}: {SEQUENCES[sequence]}")
    for direction, name in zip(np.eye(3), "XYZ", strict=True):
        arrow(axes, direction, _GREY, name, pale=True)
    partial = [matrix(sequence, (*_ANGLES[sequence][:n], *(0.0,) * (3 - n))) for n in range(4)]
    for n, name in enumerate("φθψ"):
        # of the two axes across the one turned about, that which shows the turn best
        turned = [k for k in range(3) if "xyz"[k] != sequence[n]]
        k = turned[-1] if sequence[n] == "x" else turned[0]
        sizes = (0.55, 0.7, 0.85)
        arc(axes, partial[n][:, k], partial[n + 1][:, k], "#6b4fa0", name, sizes[n])
    for direction, name, colour in zip(partial[3].T, "xyz", _COLOURS, strict=True):
        arrow(axes, direction, colour, name)


def quaternion(axes: Any) -> None:
    """A turn by an angle about an axis takes body axes from space axes."""
    empty(axes, "q = [cos(α/2), n sin(α/2)]: a turn by α about n")
    n, angle = np.array([1.0, 1.0, 2.0]) / math.sqrt(6), math.radians(75)
    context = mpmath.MPContext()
    q = [math.cos(angle / 2), *(math.sin(angle / 2) * n)]
    rows = attitude.rotation_matrix([context.mpf(x) for x in q])
    turned = np.array([[float(x) for x in row] for row in rows])
    for direction, name in zip(np.eye(3), "XYZ", strict=True):
        arrow(axes, direction, _GREY, name, pale=True)
    for direction, name, colour in zip(turned.T, "xyz", _COLOURS, strict=True):
        arrow(axes, direction, colour, name)
    arrow(axes, 1.15 * n, "#1b2733", "n")
    steps = np.linspace(0, angle, 40)
    start = np.eye(3)[0]
    along = (start @ n) * n
    across = start - along
    path = along + np.cos(steps)[:, None] * across + np.sin(steps)[:, None] * np.cross(n, start)
    axes.plot(*path.T, color="#6b4fa0", lw=1.6)
    axes.text(*(1.12 * path[20]), "α", color="#6b4fa0", fontsize=11)


def obliquity(axes: Any) -> None:
    """Reference plane, equator, node, obliquity."""
    empty(axes, "obliquity ε and longitude Ω of the equator's node")
    tilt, node = math.radians(35), math.radians(40)
    normal = np.array([0, 0, 1.0])
    line = np.array([math.cos(node), math.sin(node), 0])
    pole = np.cos(tilt) * normal + np.sin(tilt) * np.cross(line, normal)
    turn = np.linspace(0, 2 * math.pi, 120)[:, None]
    plane = 0.9 * (np.cos(turn) * np.eye(3)[0] + np.sin(turn) * np.eye(3)[1])
    equator = 0.9 * (np.cos(turn) * line + np.sin(turn) * np.cross(pole, line))
    axes.plot(*plane.T, color=_GREY, lw=1.2)
    axes.plot(*equator.T, color=_COLOURS[2], lw=1.4)
    arrow(axes, np.eye(3)[0], _GREY, "X", pale=True)
    arrow(axes, normal, _GREY, "normal", pale=True)
    arrow(axes, pole, _COLOURS[2], "axis")
    arrow(axes, 0.9 * line, "#1b2733", "node")
    arc(axes, np.eye(3)[0], line, "#6b4fa0", "Ω", 0.45)
    arc(axes, normal, pole, "#6b4fa0", "ε", 0.6)


def local(axes: Any, title: str, names: str, columns: np.ndarray, *, pole: bool = False) -> None:
    """A body on its orbit, with the axes of a local frame there; the normal or the pole in grey."""
    empty(axes, title)
    axes.set(xlim=(-0.7, 0.7), ylim=(-0.55, 0.85), zlim=(-0.75, 0.65))
    here, tilt = math.radians(80), math.radians(-25)
    turn = np.linspace(0, 2 * math.pi, 160)[:, None]
    across = np.array([0, math.cos(tilt), math.sin(tilt)])
    orbit = 0.6 * (np.cos(turn) * np.eye(3)[0] + np.sin(turn) * across)
    place = 0.6 * (math.cos(here) * np.eye(3)[0] + math.sin(here) * across)
    axes.plot(*orbit.T, color=_GREY, lw=1.2)
    axes.scatter(0, 0, 0, s=260, color="#9cc3e6")
    axes.scatter(*place, s=22, color="#1b2733")
    arrow(axes, np.eye(3)[2] * 0.55, _GREY, "Z", pale=True) if pole else None
    up = place / np.linalg.norm(place)
    normal = np.cross(np.eye(3)[0], across)
    east = np.cross(np.eye(3)[2], up)
    east /= np.linalg.norm(east)
    first = (np.cross(up, east), east) if pole else (np.cross(normal, up), -normal)
    frame = np.array([*first, -up]).T @ columns
    for direction, name, colour in zip(frame.T, names.split(), _COLOURS, strict=True):
        axes.quiver(*place, *(0.5 * direction), color=colour, lw=2.2, arrow_length_ratio=0.15)
        axes.text(*(place + 0.62 * direction), name, color=colour, fontsize=10, ha="center", va="center")


def draw_local_frames() -> None:
    """The three local frames side by side."""
    figure = pyplot.figure(figsize=(10, 3.6))
    outward = np.array([[0, 1, 0], [0, 0, -1], [-1, 0, 0]], dtype=float)
    panels = (
        ("lvlh, vvlh: z to the source", "x y z", np.eye(3), False),
        ("rsw, rtn, ric: x outward, z the normal", "x y z", outward, False),
        ("ned: north, east, to the source", "north east z", np.eye(3), True),
    )
    for place, (title, names, columns, pole) in enumerate(panels, 1):
        local(figure.add_subplot(1, 3, place, projection="3d"), title, names, columns, pole=pole)
    figure.subplots_adjust(left=0, right=1, bottom=0, top=0.92, wspace=0)
    save(figure, "local_frames.png")


def save(figure: Any, name: str) -> None:
    """With few colours."""
    figure.savefig(FIGURES / name, dpi=90)
    Image.open(FIGURES / name).convert("RGB").quantize(96).save(FIGURES / name, optimize=True)


def main() -> None:
    """Draw all four conventions on one sheet, and the local frames."""
    figure = pyplot.figure(figsize=(10, 9.2))
    for place, draw in enumerate(
        (quaternion, obliquity, lambda a: euler(a, "zxz"), lambda a: euler(a, "zyx")), 1
    ):
        draw(figure.add_subplot(2, 2, place, projection="3d"))
    figure.subplots_adjust(left=0, right=1, bottom=0, top=0.95, wspace=0, hspace=0.1)
    save(figure, "conventions.png")
    draw_local_frames()


if __name__ == "__main__":
    main()
