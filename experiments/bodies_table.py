"""Are the principal moments of every shape in the schema those of the textbooks, to the last digit?

Method: every shape is described in a config of 30 digits, with awkward dimensions, and worked out by
``rigidsim.solve.problem.prepare`` (no integration); its moments are compared with closed forms typed in here.
Composites, reference points and particles follow; a short run of the square plate gives w and L for Poinsot's
construction, where the normal of the ellipsoid of inertia is the cross product of two of its tangents.

Held against (Landau & Lifshitz, Mechanics, section 32; standard tables): the formulas below, the theorems of
perpendicular and of parallel axes, m a^2 (1, 7, 8)/12 for a square plate about its corner, I1 + I2 >= I3, and
Ixx + Iyy + Izz = 2 sum m r^2. Tolerance 1e-30: the precision asked for (the scene carries 128 bits more).
L along the normal: 20 eps sqrt(steps) of double precision, the attitude's and the momentum's rounding. L and
w apart off the principal axes: sin of the angle is at least d sin(a) cos(a) / I_max for a direction that is
an angle a off the nearest axis, d the smallest difference of moments.

Run: python -m experiments.bodies_table [--full] [--out DIR]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from mpmath import mpf

if not __package__:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))

import rigidsim
from experiments.common import BLUE, CONFIGS, EPSILON, GREY, ORANGE, Check, main, new_figure, save, simulate
from experiments.measure import matrices
from rigidsim.scene.bodies.body import RigidBody
from rigidsim.scene.bodies.shapes import SHAPES
from rigidsim.solve.problem import prepare

NAME = "bodies_table"
DIGITS = 1e-30
DIMENSIONS = {
    "size": ["0.7", "1.1", "1.9"], "semi_axes": ["1.3", "0.9", "0.6"], "radius": ["0.8"], "height": ["1.7"],
    "length": ["2.3"], "major_radius": ["1.2"], "minor_radius": ["0.35"], "inner_radius": ["0.5"],
    "outer_radius": ["0.9"],
}  # fmt: skip
MASS = "2.3"

Formula = Callable[..., list[Any]]
FORMULAS: dict[str, tuple[str, Formula]] = {
    "cuboid": ("m(b²+c²)/12",
               lambda a, b, c: [(b * b + c * c) / 12, (a * a + c * c) / 12, (a * a + b * b) / 12]),
    "plate": ("m b²/12, m a²/12, m(a²+b²)/12", lambda a, b: [b * b / 12, a * a / 12, (a * a + b * b) / 12]),
    "ellipsoid": ("m(b²+c²)/5",
                  lambda a, b, c: [(b * b + c * c) / 5, (a * a + c * c) / 5, (a * a + b * b) / 5]),
    "sphere": ("2 m r²/5", lambda r: [2 * r * r / 5] * 3),
    "spherical_shell": ("2 m r²/3", lambda r: [2 * r * r / 3] * 3),
    "cylinder": ("m(3r²+h²)/12, m r²/2", lambda r, h: [(3 * r * r + h * h) / 12] * 2 + [r * r / 2]),
    "tube": ("m(3(r²+s²)+h²)/12, m(r²+s²)/2",
             lambda r, s, h: [(3 * (r * r + s * s) + h * h) / 12] * 2 + [(r * r + s * s) / 2]),
    "cone": ("3m(r²+h²/4)/20, 3m r²/10", lambda r, h: [3 * (r * r + h * h / 4) / 20] * 2 + [3 * r * r / 10]),
    "rod": ("m l²/12, 0", lambda x: [x * x / 12] * 2 + [mpf(0)]),
    "disk": ("m r²/4, m r²/2", lambda r: [r * r / 4] * 2 + [r * r / 2]),
    "ring": ("m r²/2, m r²", lambda r: [r * r / 2] * 2 + [r * r]),
    "torus": ("m(4R²+5r²)/8, m(4R²+3r²)/4",
              lambda big, r: [(4 * big * big + 5 * r * r) / 8] * 2 + [(4 * big * big + 3 * r * r) / 4]),
}  # fmt: skip
"""Per unit mass about the centre of mass; arguments are the dimensions in the schema's order."""

CONFIG = """
name = "body"
[body]
{body}
[initial]
angular_velocity = [0, 0, 0]
[time]
end = 1
[integrator]
precision = 30
"""


def body_of(text: str) -> RigidBody:
    """The body of a ``[body]`` table, to 30 digits and more."""
    return prepare(rigidsim.parse(CONFIG.format(body=text))).scene.body


def dimensions_of(name: str) -> dict[str, list[str]]:
    """The dimensions of a shape, as texts, in the schema's order."""
    return {key: DIMENSIONS[key][:count] for key, count in SHAPES[name].dimensions.items()}


def shape_text(name: str, reference: str = "") -> str:
    """The ``[body]`` table of a shape."""
    lines = [f'shape = "{name}"', f"mass = {MASS}"]
    for key, values in dimensions_of(name).items():
        lines.append(f"{key} = [{', '.join(values)}]" if len(values) > 1 else f"{key} = {values[0]}")
    return "\n".join([*lines, f"reference = {reference}"] if reference else lines)


def farthest(found: list[Any], expected: list[Any]) -> Any:
    """Largest difference over the largest expected number."""
    return max(abs(a - b) for a, b in zip(found, expected, strict=True)) / max(abs(e) for e in expected)


def flat(matrix: Any) -> list[Any]:
    """All entries."""
    return [x for row in matrix for x in row]


def steiner(moments: list[Any], mass: Any, arm: list[Any]) -> list[Any]:
    """Entries of diag(moments) + m (r^2 - r r)."""
    square = sum(x * x for x in arm)
    return [
        (moments[i] + mass * square if i == j else 0) - mass * arm[i] * arm[j]
        for i in range(3)
        for j in range(3)
    ]


def shape_checks() -> tuple[list[Check], dict[str, RigidBody]]:
    """Every shape against its formula; and the theorem of perpendicular axes."""
    missing = len(set(SHAPES) ^ set(FORMULAS))
    checks = [Check("shapes of the schema without a row here", missing, 0, 0.0, "1", "exact", "absolute")]
    bodies = {}
    for name, (shown, formula) in FORMULAS.items():
        body = bodies[name] = body_of(shape_text(name))
        lengths = [mpf(x) for values in dimensions_of(name).values() for x in values]
        expected = [mpf(MASS) * i for i in formula(*lengths)]
        checks.append(
            Check(f"{name}: moments", farthest(body.principal_moments, expected), 0, DIGITS, "1",
                  f"{shown}; 30 digits asked for", "absolute")
        )  # fmt: skip
    for name in ("plate", "disk", "ring"):
        x, y, z = bodies[name].principal_moments
        checks.append(
            Check(f"{name}: Iz of Ix + Iy", z / (x + y), 1, DIGITS, "1", "perpendicular axes; 30 digits")
        )
    slack = min(sum(sorted(b.principal_moments)[:2]) - max(b.principal_moments) for b in bodies.values())
    checks.append(Check("most that I1 + I2 falls short of I3", max(-slack, 0), 0, DIGITS, "kg m^2",
                        "I1 + I2 >= I3, equal for plane bodies; 30 digits", "absolute"))  # fmt: skip
    return checks, bodies


def theorem_checks(bodies: dict[str, RigidBody]) -> list[Check]:
    """Parallel axes, composites, the square plate about its corner, particles."""
    mass = mpf(MASS)
    a, b, c = (mpf(x) for x in DIMENSIONS["size"])
    h, length = mpf(DIMENSIONS["height"][0]), mpf(DIMENSIONS["length"][0])
    arms = {
        ("cuboid", '"corner"'): [a / 2, b / 2, c / 2],
        ("plate", '"corner"'): [a / 2, b / 2, mpf(0)],
        ("cone", '"apex"'): [mpf(0), mpf(0), 3 * h / 4],
        ("rod", '"end"'): [mpf(0), mpf(0), length / 2],
        ("torus", "[0.3, -0.7, 1.1]"): [mpf("-0.3"), mpf("0.7"), mpf("-1.1")],
    }
    checks = []
    for (name, reference), arm in arms.items():
        body = body_of(shape_text(name, reference))
        expected = steiner(bodies[name].principal_moments, mass, arm)
        about = reference.strip('"')
        checks.append(
            Check(f"{name} about {about}", farthest(flat(body.inertia), expected), 0, DIGITS, "1",
                  "parallel axes; 30 digits", "absolute")
        )  # fmt: skip
    plate = body_of('shape = "plate"\nmass = 3\nsize = [2, 2]\nreference = "corner"')
    expected = [mpf(12) * n / 12 for n in (1, 7, 8)]  # m a^2 = 12
    half = mpmath.sqrt(mpf(1) / 2)
    axes = [half, half, 0, half, -half, 0]
    turned = [abs(x * y) for x, y in zip(flat(plate.principal_axes[:2]), axes, strict=True)]
    products = [mpf(1) / 2, mpf(1) / 2, 0] * 2
    cone = body_of(shape_text("cone", '"apex"')).principal_moments
    r = mpf(DIMENSIONS["radius"][0])
    apex = [3 * mass * (r * r / 4 + h * h) / 5] * 2 + [3 * mass * r * r / 10]
    first = '{shape = "cuboid", mass = "2.3/2", size = [0.7, 1.1, 0.95], position = [0, 0, 0.475]}'
    lying = '{shape = "cuboid", mass = "2.3/2", size = [0.7, 0.95, 1.1], position = [0, 0, -0.475]'
    halves = body_of(f"parts = [{first}, {lying}, quaternion = [1, 1, 0, 0]}}]")  # 90 deg about x
    whole = flat(body_of(shape_text("cuboid")).inertia)
    particles = [("0.5", "0.4 0 0.1"), ("0.3", "-0.3 0.2 0"), ("0.8", "0 -0.25 -0.1"), ("0.2", "0.1 0.3 0.5")]
    listed = ", ".join(f"{{mass = {m}, position = [{p.replace(' ', ', ')}]}}" for m, p in particles)
    swarm = body_of(f"points = [{listed}]\nreference = [0, 0, 0]")
    twice = 2 * sum(mpf(m) * sum(mpf(x) ** 2 for x in p.split()) for m, p in particles)
    trace = sum(swarm.inertia[i][i] for i in range(3))
    return [
        *checks,
        Check("square plate about its corner: moments", farthest(plate.principal_moments, expected), 0,
              DIGITS, "1", "m a²(1, 7, 8)/12; 30 digits", "absolute"),
        Check("its axes (1,1,0), (1,-1,0) over sqrt 2", farthest(turned, products), 0, DIGITS, "1",
              "eigenvectors; 30 digits", "absolute"),
        Check("cone about its apex", farthest(cone, apex), 0, DIGITS, "1",
              "3m(r²/4+h²)/5, 3m r²/10; 30 digits", "absolute"),
        Check("two half cuboids, one on its side, against the whole", farthest(flat(halves.inertia), whole),
              0, DIGITS, "1", "composite; 30 digits", "absolute"),
        Check("Ixx + Iyy + Izz of particles", trace, twice, DIGITS, "kg m^2", "2 sum m r²; 30 digits"),
    ]  # fmt: skip


def poinsot_checks(full: bool) -> list[Check]:
    """L along the normal of the ellipsoid of inertia at w; parallel to w on principal axes alone."""
    result = simulate(CONFIGS / "square_plate_corner.toml", f"time.samples={4001 if full else 401}",
                      'output.record=["angular_velocity", "quaternion", "angular_momentum"]')  # fmt: skip
    moments = np.array(result.summary["body"]["principal_moments"])
    axes = np.array(result.summary["body"]["principal_axes"])
    turn = matrices(result.values("quaternion"))
    momentum = np.einsum("tji,tj->ti", turn, result.values("angular_momentum")) @ axes.T
    rates = result.values("angular_velocity") @ axes.T
    radius = np.sqrt((moments * rates**2).sum(axis=1))
    x, y, z = (rates * np.sqrt(moments) / radius[:, None]).T  # on the unit sphere: angles of the surface
    belt = np.hypot(x, y)
    along = np.stack([-y, x, 0 * z], axis=1) / np.sqrt(moments)  # tangents of w(longitude, latitude)
    upward = np.stack([-z * x / belt, -z * y / belt, belt], axis=1) / np.sqrt(moments)
    normal = np.cross(along, upward)
    sine = np.linalg.norm(np.cross(normal, momentum), axis=1) / (
        np.linalg.norm(normal, axis=1) * np.linalg.norm(momentum, axis=1)
    )
    limit = 20 * EPSILON["double"] * math.sqrt(result.steps)
    tensor = np.array([[4.0, -3.0, 0.0], [-3.0, 4.0, 0.0], [0.0, 0.0, 8.0]])  # m a^2 = 12
    on_axis = max(sine_between(axis, tensor @ axis) for axis in axes)
    directions = np.random.default_rng(1).normal(size=(20000 if full else 2000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    off = np.arccos(np.abs(directions @ axes.T).max(axis=1))
    away = directions[off > math.radians(5)]
    least = min(sine_between(d, tensor @ d) for d in away)
    bound = math.sin(2 * math.radians(5)) / 2 * 1.0 / 8.0  # smallest difference of (1, 7, 8) is 1
    return [
        Check("sine between L and the ellipsoid's normal at w", float(sine.max()), 0, limit, "1",
              "Poinsot; 20 eps sqrt(steps)", "absolute"),
        Check("sine between L and w on principal axes", on_axis, 0, 8 * EPSILON["double"], "1",
              "L = I w; 8 eps, a product of matrix and axis", "absolute"),
        Check("least sine between L and w, 5 deg or more off them", float(least), 0, bound, "1",
              "never parallel: d sin(a) cos(a) / I_max", "apart"),
    ]  # fmt: skip


def sine_between(a: np.ndarray, b: np.ndarray) -> float:
    """Of the angle between two vectors."""
    return float(np.linalg.norm(np.cross(a, b)) / (np.linalg.norm(a) * np.linalg.norm(b)))


def study(full: bool, out: Path) -> list[Check]:
    """All of it; see the module's text."""
    with mpmath.workdps(60):
        checks, bodies = shape_checks()
        checks += theorem_checks(bodies)
        checks += poinsot_checks(full)
        draw(bodies, out)
    return checks


def solid(name: str) -> np.ndarray:
    """A surface of the shape itself, (3, n, m), centre of mass near the origin."""
    size = {key: [float(x) for x in values] for key, values in dimensions_of(name).items()}
    turn = np.linspace(0, 2 * np.pi, 49)
    arc = np.linspace(0, np.pi, 25)
    round_ring = np.linspace(0, 2 * np.pi, 25)
    if name in ("cuboid", "plate"):
        a, b, c = [x / 2 for x in (*size["size"], 0.02)[:3]]
        corners = np.array([[-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1]]) * [[a], [b]]
        rows = [corners * 0, corners, corners, corners * 0]
        heights = np.array([-c, -c, c, c])
        return np.array([[r[0] for r in rows], [r[1] for r in rows], np.repeat(heights[:, None], 5, axis=1)])
    if name == "cone":
        (r,), (h,) = size["radius"], size["height"]
        profile = ([0, r, 0], [-3 * h / 4, h / 4, h / 4])
    elif name in ("cylinder", "tube"):
        (h,), r = size["height"], size.get("radius", size.get("outer_radius"))[0]
        inner = size.get("inner_radius", [0])[0]
        profile = ([inner, inner, r, r, inner], [-h / 2, h / 2, h / 2, -h / 2, -h / 2])
    elif name in ("ring", "torus"):
        big, small = (
            (size["radius"][0], 0.03)
            if name == "ring"
            else (size["major_radius"][0], size["minor_radius"][0])
        )
        profile = (big + small * np.cos(round_ring), small * np.sin(round_ring))
    elif name == "disk":
        profile = ([0, size["radius"][0]], [0, 0])
    elif name == "rod":
        profile = ([0.04, 0.04], [-size["length"][0] / 2, size["length"][0] / 2])
    else:
        profile = (np.sin(arc), np.cos(arc))
    r, z = (np.asarray(p, dtype=float)[:, None] for p in profile)
    surface = np.array([r * np.cos(turn), r * np.sin(turn), z + 0 * turn])
    if name == "ellipsoid":
        surface *= np.array(size["semi_axes"])[:, None, None]
    return surface


def draw(bodies: dict[str, RigidBody], out: Path) -> None:
    """Every shape in its ellipsoid of inertia, semi-axes 1/sqrt(I), each in its own scale."""
    title = "Ellipsoids of inertia (blue) of twelve bodies (orange): long along the axes of easy rotation"
    figure = new_figure(12, 9.6, title)
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    sphere = np.array([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)])
    for number, (name, body) in enumerate(bodies.items()):
        axes = figure.add_subplot(3, 4, number + 1, projection="3d")
        moments = np.array([float(m) for m in body.principal_moments]) / float(MASS)
        rod = moments.min() == 0
        semi = 1 / np.sqrt(np.where(moments > 0, moments, moments.max()))
        wire = np.array([0.4 * np.cos(u), 0.4 * np.sin(u), 1 - 2 * v / np.pi]) if rod else (
            sphere * (semi / semi.max())[:, None, None])  # fmt: skip
        shape = solid(name)
        shape = shape / np.sqrt((shape**2).sum(axis=0)).max() * 0.7
        axes.plot_surface(*shape, color=ORANGE, alpha=0.9, linewidth=0, rcount=50, ccount=50)
        axes.plot_wireframe(*wire, color=BLUE, linewidth=0.6, alpha=0.75)
        for axis in np.eye(3):
            axes.plot(*np.outer(axis, [-1.2, 1.2]), color=GREY, linewidth=0.8)
            axes.text(*(axis * 1.3), "xyz"[int(axis.argmax())], fontsize=8, color=GREY, ha="center")
        axes.set_box_aspect([1, 1, 1], zoom=1.3)
        axes.set(xlim=(-1, 1), ylim=(-1, 1), zlim=(-1, 1))
        axes.set_axis_off()
        values = ", ".join(f"{m:.3g}" for m in moments)
        axes.set_title(f"{name.replace('_', ' ')}{' (its ellipsoid is open)' if rod else ''}\n"
                       f"I/m = {values} m²", fontsize=9.5, pad=14)  # fmt: skip
    save(figure, out, NAME)


if __name__ == "__main__":
    sys.exit(main(study, NAME))
