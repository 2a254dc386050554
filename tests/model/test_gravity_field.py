"""The field of the body from degree 3 on: torque and force against Legendre functions and point masses."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np
import pytest
from equations import CLOSE, Random, array, derivative, general_body, matrix, prepared
from field_truth import gradient, keys, lumpy, moments_of, pulled, random_field, tensor_of
from gyrostats import exact, followed
from support import config, matrices, run_text, wide

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare

RADIUS, MU, MASS = 0.7, 2.5, 3.25
LUMPS = (
    'gravity_field = {radius = 0.5, C = {"3,0" = -0.02, "3,1" = 0.013, "3,3" = 0.004, "4,0" = 0.008, '
    '"4,2" = -0.003, "4,4" = 1e-4}, S = {"3,1" = 5.9e-3, "3,2" = -2e-3, "4,1" = 3e-3, "4,3" = 1e-3}}'
)
LUMPY = {
    (3, 0): ("-0.02", "0"), (3, 1): ("0.013", "5.9e-3"), (3, 2): ("0", "-2e-3"), (3, 3): ("0.004", "0"),
    (4, 0): ("0.008", "0"), (4, 1): ("0", "3e-3"), (4, 2): ("-0.003", "0"), (4, 3): ("0", "1e-3"),
    (4, 4): ("1e-4", "0"),
}  # fmt: skip
BODY = f"principal_moments = [1, 1.2, 1.5]\nmass = 10\n{LUMPS}"
START = "angular_velocity = [0.1, 0.4, 0.5]\neuler_angles = [0.3, 0.7, 0.2]"
ORBIT = "orbit = {semi_major_axis = 2, eccentricity = 0.2, inclination = 0.3}"


def gradient_of(place: str = ORBIT, degree: int = 4, strength: float = 2.0) -> str:
    return f'kind = "gravity_gradient"\ngravitational_parameter = {strength}\n{place}\ndegree = {degree}'


def expected(tensor: np.ndarray, field: dict, c: np.ndarray) -> np.ndarray:
    """Torque by a source at c (body axes): MacCullagh's, and -G M m x cross grad Phi."""
    r = np.linalg.norm(c)
    return 3 * MU / r**5 * np.cross(c, tensor @ c) - MU * MASS * np.cross(c, gradient(field, RADIUS, c))


@pytest.mark.parametrize("degree", [3, 7])
def test_the_torque_is_that_of_the_differentiated_series_in_any_body_axes(degree: int) -> None:
    random = Random(degree)
    for number in range(3):
        tensor, field = random.tensor(), random_field(random.generator, degree)
        place, q, w = random.vector(2), random.quaternion(), random.vector()
        if number == 2:  # over the body's pole
            q, place = np.array([1.0, 0, 0, 0]), np.array([0, 0, -1.5])
        load = gradient_of(f"position = {array(place)}", degree, MU)
        body = f"{general_body(tensor, MASS)}\n{keys(field, RADIUS)}".replace(
            "center_of_mass = [0, 0, 0]", ""
        )
        system = prepared(body, f"angular_velocity = {array(w)}\nquaternion = {array(q)}", load).system
        found = tensor @ derivative(system, np.array([*w, *q]))[:3] + np.cross(w, tensor @ w)
        torque = expected(tensor, field, matrix(q).T @ place)
        if number == 2:
            # the series in longitudes has none over the pole
            torque = expected(tensor, field, place + np.array([1e-9, 0, 0]))
            assert np.allclose(found, torque, atol=1e-7 * np.abs(torque).max())
            continue
        assert np.abs(found - torque).max() < 20 * CLOSE * np.abs(torque).max()


def test_the_force_in_flight_is_that_of_the_differentiated_series() -> None:
    degree = 5
    random = Random(10 + degree)
    tensor, field = random.tensor(), random_field(random.generator, degree)
    q, w, x, v = random.quaternion(), random.vector(), np.array([1.2, -0.8, 0.9]), random.vector()
    body = f"{general_body(tensor, MASS)}\n{keys(field, RADIUS)}"
    start = f"angular_velocity = {array(w)}\nquaternion = {array(q)}\n"
    start += f"position = {array(x)}\nvelocity = {array(v)}"

    def motion(degree: int) -> np.ndarray:
        load = f'kind = "central_gravity"\ngravitational_parameter = {MU}\ndegree = {degree}'
        return derivative(prepared(body, start, load).system, np.array([*w, *q, *x, *v]))

    beyond = motion(degree) - motion(2)
    r = matrix(q)
    pull = gradient(field, RADIUS, r.T @ -x)
    # the source feels G M m grad Phi, and the body the opposite
    assert np.abs(beyond[-3:] + MU * r @ pull).max() < 20 * CLOSE * np.abs(motion(2)[-3:]).max()
    torque = -MU * MASS * np.cross(r.T @ -x, pull)
    assert np.abs(tensor @ beyond[:3] - torque).max() < 20 * CLOSE * np.abs(tensor @ motion(2)[:3]).max()


def test_degrees_converge_to_a_body_of_point_masses() -> None:
    """Torque and force by Newton's law; each degree leaves less by about the ratio of the radii."""
    random = Random(3)
    masses, places = lumpy(random.generator)
    tensor, total = tensor_of(masses, places), float(masses.sum())
    field = moments_of(masses, places, 1.0, 8)
    source = np.array([5.0, -3.0, 4.0])
    force, torque = pulled(masses, places, source)
    body = f"inertia_tensor = {array(tensor)}\nmass = {total!r}\n{keys(field, 1.0)}"
    left = []
    for degree in range(2, 9):
        load = f'kind = "central_gravity"\ngravitational_parameter = 1\ndegree = {degree}\n'
        load += f"position = {array(source)}"
        start = "angular_velocity = [0, 0, 0]\nposition = [0, 0, 0]\nvelocity = [0, 0, 0]"
        system = prepared(body, start, load).system
        found = derivative(system, np.array([0.0] * 3 + [1.0] + [0.0] * 9))
        off = np.abs(tensor @ found[:3] - torque).max() / np.abs(torque).max()
        left.append((off, np.abs(total * found[-3:] - force).max() / np.abs(force).max()))
    torques, forces = np.array(left).T
    ratio = np.linalg.norm(places, axis=1).max() / np.linalg.norm(source)
    assert torques[0] > 0.02
    assert torques[-1] < torques[0] * (1.5 * ratio) ** 6
    assert forces[-1] < forces[0] * (1.5 * ratio) ** 6
    assert np.all(np.diff(np.log(torques)) < 0.3)


def drifts(run: rigidsim.Run) -> dict[str, float]:
    """Largest relative drifts of the invariants."""
    return {name: row["largest_drift"] for name, row in run.summary["invariants"].items()}


@pytest.mark.parametrize(
    ("place", "kept"),
    [
        ("position = [2, 0.3, 0.2]", {"energy", "angular_momentum_source"}),
        ("orbit = {semi_major_axis = 2, inclination = 0.3}", {"energy_balance", "jacobi_constant"}),
        (ORBIT, {"energy_balance"}),
        ("", {"energy", "total_angular_momentum"}),
    ],
)
def test_what_is_conserved_is_found_and_nothing_else(place: str, kept: set[str]) -> None:
    start, load = START, gradient_of(place)
    if not place:
        start += "\nposition = [2, 0, 0.1]\nvelocity = [0, 0.9, 0.3]"
        load = load.replace("gravity_gradient", "central_gravity")
    found = drifts(run_text(config(BODY, start, load, "end = 200\nsamples = 41")))
    assert {name for name in found if "norm" not in name} == kept
    assert max(found.values()) < 2e-14


def test_point_masses_feel_the_force_of_the_field() -> None:
    """Two bodies of the same size, one of them lumpy: energy, momentum and angular momentum of both stay."""
    g = 6.6743e-11
    masses = "".join(
        f'[[bodies]]\nname = "{name}"\ngravitational_parameter = {strength}\nposition = {place}\n'
        f"velocity = {velocity}\n"
        for name, strength, place, velocity in (
            ("lumpy", 10 * g, "[2, 0, 0]", "[0, 1.1e-5, 2e-6]"),
            ("point", 8 * g, "[-0.5, 0.1, 0.2]", "[0, -1.375e-5, -2.5e-6]"),
        )
    )
    start = "angular_velocity = [1e-5, 4e-6, 5e-6]\neuler_angles = [0.3, 0.7, 0.2]"
    load = 'kind = "gravity_gradient"\norbit = {body = "point"}\ndegree = 4'
    body = f'{BODY}\nhost = "lumpy"\ncoupling = "full"'
    text = config(body, start, load, "end = 2e6\nsamples = 21", more=masses)
    run = run_text(text)
    found = drifts(run)
    assert {"system_energy", "system_angular_momentum", "system_linear_momentum"} <= set(found)
    assert max(found.values()) < 4e-14
    other = run_text(text.replace("degree = 4", "degree = 2"))
    assert np.abs(run.dataset.point_mass_position - other.dataset.point_mass_position).max() > 1e-3


def series_torque(t: Any, w: Any, r: Any) -> list[Any]:
    """c x dU/dc of the potential written out (Rodrigues' formula), by a source on a circle of radius 2."""
    number, distance, strength, mass, radius = exact, exact("2"), exact("2"), exact("10"), exact("0.5")
    motion = (strength / distance**3) ** number("0.5")
    c = [r[0][k] * hy.cos(motion * hy.time) + r[1][k] * hy.sin(motion * hy.time) for k in range(3)]
    x, y, z = seen = list(hy.make_vars("x", "y", "z"))
    moments = zip(("1", "1.2", "1.5"), seen, strict=True)
    potential = sum(number(i) * a * a for i, a in moments) * (number("1.5") * strength / distance**3)
    for (n, m), (cosine, sine) in LUMPY.items():
        turns = [hy.expression(1.0), hy.expression(0.0)]  # (x + i y)^m
        for _ in range(m):
            turns = [turns[0] * x - turns[1] * y, turns[0] * y + turns[1] * x]
        zonal = hy.expression(0.0)
        for k in range((n - m) // 2 + 1):
            top = (-1) ** k * math.factorial(2 * n - 2 * k)
            below = math.factorial(k) * math.factorial(n - k) * math.factorial(n - 2 * k - m) * 2**n
            zonal += number(str(top)) / number(str(below)) * math.prod([z] * (n - 2 * k - m))
        both = number(cosine) * turns[0] + number(sine) * turns[1]
        potential -= strength * mass * radius**n / distance ** (n + 1) * both * zonal
    slope = [hy.subs(hy.diff(potential, v), dict(zip(seen, c, strict=True))) for v in seen]
    return [c[j] * slope[k] - c[k] * slope[j] for j, k in ((1, 2), (2, 0), (0, 1))]


@pytest.mark.parametrize(
    ("precision", "formulation", "most"),
    [("double", "auto", 2e-13), ("extended", "rotation_matrix", 1e-16)],
)
def test_motions_are_those_of_the_series_written_out(precision: str, formulation: str, most: float) -> None:
    """Carried in the frame of the circle, or in space."""
    text = config(
        BODY, "angular_velocity = [0.1, 0.2, 1.0]", gradient_of("orbit = {semi_major_axis = 2}"),
        "end = 20\nsamples = 3", f'precision = "{precision}"\nformulation = "{formulation}"',
    )  # fmt: skip
    data = run_text(text).dataset
    moments, rates = ("1", "1.2", "1.5"), ("0.1", "0.2", "1.0")
    truth = followed(moments, (), rates, np.eye(3), data["time"].values, series_torque)
    assert np.abs(matrices(wide(data, "quaternion")) - truth[1]).max() < most
    assert np.abs(wide(data, "angular_velocity") - truth[0]).max() < most


def test_a_field_symmetric_to_the_orbit_keeps_the_motion_in_its_plane() -> None:
    body = "principal_moments = [1, 1.2, 1.5]\nmass = 10\ngravity_field = {radius = 0.5, "
    start = "angular_velocity = [0, 0, 0.9]"
    load = gradient_of("orbit = {semi_major_axis = 2, eccentricity = 0.2}")
    even = 'C = {"3,1" = 0.01, "3,3" = 0.003, "4,2" = 0.002}, S = {"3,1" = 0.01, "4,4" = 1e-4}}'
    odd = 'C = {"4,1" = 0.01}}'
    time = "end = 50\nsamples = 51"
    for field, carried in ((even, "angle"), (odd, "qw")):
        assert carried in prepare(rigidsim.parse(config(body + field, start, load, time))).system.states
    plane, full = (
        run_text(config(body + even, start, load, time), f'integrator.formulation="{x}"').dataset
        for x in ("planar", "quaternion")
    )
    assert np.abs(plane.quaternion.values - full.quaternion.values).max() < 1e-12


def test_momentum_about_an_axis_of_symmetry_is_kept_by_a_zonal_field_alone() -> None:
    body = "principal_moments = [1, 1, 1.5]\nmass = 10\ngravity_field = "
    body += '{radius = 0.5, C = {"4,0" = 0.02, "3,0" = 0.01'
    for more, kept in (("}}", True), (', "3,1" = 1e-3}}', False)):
        run = run_text(config(body + more, START, gradient_of(), "end = 20\nsamples = 11"))
        assert ("angular_momentum_axial" in drifts(run)) is kept


def test_the_moons_axis_librates_about_a_direction_an_arcminute_off() -> None:
    """The torque of degree 3 on a body that looks at its source is balanced by the gradient's at

    (m R^2 / (B - A)) (R / r) (45 S33 - 1.5 S31) / 3,    and librates with n sqrt(3 (B - A) / C) nearly.
    """
    path = Path(__file__).parents[2] / "configs" / "moon_mean_axis.toml"
    scene = prepare(rigidsim.load(path)).scene
    a, b, _ = (float(x) for x in scene.body.principal_moments)
    mass, radius, distance = float(scene.body.mass), 1.738e6, 3.844e8
    off = mass * radius**2 / (b - a) * radius / distance * (45 * -2.485526e-7 - 1.5 * 5.9008e-6) / 3
    # half a libration later it is as far on the other side
    text = path.read_text().replace('end = "6 yr"\nevery = "2 day"', 'end = "1.5 yr"\nevery = "2 day"')
    angles = run_text(text).dataset.libration.values[:, 0]
    assert angles.min() == pytest.approx(2 * off, rel=5e-3)


# --- what is refused ----------------------------------------------------------------------------------------

FIELD = "gravity_field = "
NONSENSE = {
    "degree without a field": ("", gradient_of(), "has no gravity_field; give it, or leave degree out"),
    "beyond its end": (LUMPS, gradient_of(degree=5), "ends at degree 4"),
    "first degree": (FIELD + '{radius = 1, C = {"1,0" = 0.1}}', "", "the centre of mass is the origin"),
    "second degree": (FIELD + '{radius = 1, C = {"2,0" = 0.1}}', "", "the inertia tensor says it"),
    "order beyond degree": (FIELD + '{radius = 1, C = {"3,4" = 0.1}}', "", "the order is at most the degree"),
    "no such key": (
        FIELD + '{radius = 1, C = {"J3" = 0.1}}',
        "",
        'degree and order are allowed, such as "3,0"',
    ),
    "both": (FIELD + '{radius = 1, C = {"3,0" = 0.1}, file = "x.gfc"}', "", "either file, or radius"),
}


@pytest.mark.parametrize("which", NONSENSE)
def test_nonsense_is_refused(which: str) -> None:
    given, load, message = NONSENSE[which]
    text = config(
        f"principal_moments = [1, 1.2, 1.5]\nmass = 10\n{given}", START, load or gradient_of(degree=3)
    )
    with pytest.raises(ConfigError, match=re.escape(message)):
        prepare(rigidsim.parse(text))


def test_a_field_takes_a_mass_and_a_centre() -> None:
    for body, message in (
        (f"principal_moments = [1, 1.2, 1.5]\n{LUMPS}", "mass is missing"),
        (f"{BODY}\ncenter_of_mass = [0, 0, 0.1]", "another point than its centre of mass"),
    ):
        with pytest.raises(ConfigError, match=message):
            prepare(rigidsim.parse(config(body, START, gradient_of())))


def test_no_average_takes_the_field() -> None:
    text = config(BODY, "angular_velocity = [0, 0, 50]", gradient_of())
    with pytest.raises(ConfigError, match="has no average, which the gradient alone has"):
        prepare(rigidsim.parse(text, overrides=['model.level="spin_averaged"']))


def test_a_field_that_no_load_feels_is_warned_of() -> None:
    time = "end = 1\nsamples = 2"
    unfelt = run_text(config(BODY, START, gradient_of().replace("degree = 4", ""), time))
    assert any("gravity_field has no effect" in text for text in unfelt.summary["warnings"])
    assert not run_text(config(BODY, START, gradient_of(degree=2), time)).summary["warnings"]
