"""The field of the body from degree 3 on: torque and force against Legendre functions and point masses."""

import re
from pathlib import Path

import numpy as np
import pytest
from equations import CLOSE, Random, array, derivative, general_body, matrix, prepared
from field_truth import gradient, keys, random_field
from support import config, run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare

RADIUS, MU, MASS = 0.7, 2.5, 3.25
LUMPS = (
    'gravity_field = {radius = 0.5, C = {"3,0" = -0.02, "3,1" = 0.013, "3,3" = 0.004, "4,0" = 0.008, '
    '"4,2" = -0.003, "4,4" = 1e-4}, S = {"3,1" = 5.9e-3, "3,2" = -2e-3, "4,1" = 3e-3, "4,3" = 1e-3}}'
)
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


def drifts(run: rigidsim.Run) -> dict[str, float]:
    """Largest relative drifts of the invariants."""
    return {name: row["largest_drift"] for name, row in run.summary["invariants"].items()}


@pytest.mark.parametrize(
    ("place", "kept"),
    [
        pytest.param(
            "position = [2, 0.3, 0.2]", {"energy", "angular_momentum_source"}, marks=pytest.mark.slow
        ),
        ("orbit = {semi_major_axis = 2, inclination = 0.3}", {"energy_balance", "jacobi_constant"}),
        pytest.param(ORBIT, {"energy_balance"}, marks=pytest.mark.slow),
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
    "first degree": (FIELD + '{radius = 1, C = {"1,0" = 0.1}}', "", "degrees from 3 to 200"),
    "both": (FIELD + '{radius = 1, C = {"3,0" = 0.1}, file = "x.gfc"}', "", "exactly one of file, radius"),
}


@pytest.mark.parametrize("which", NONSENSE)
def test_nonsense_is_refused(which: str) -> None:
    given, load, message = NONSENSE[which]
    text = config(
        f"principal_moments = [1, 1.2, 1.5]\nmass = 10\n{given}", START, load or gradient_of(degree=3)
    )
    with pytest.raises(ConfigError, match=re.escape(message)):
        prepare(rigidsim.parse(text))
