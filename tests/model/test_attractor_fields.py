"""An attracting body that is no point: ``figure`` and ``gravity_field`` of central_gravity."""

import math
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
from equations import Random, array, derivative, matrix, observed, prepared
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp
from support import cases, config, run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare

MU, RADIUS, J2 = 3.986004418e14, 6378137.0, 1.0826e-3
SPHERE = "principal_moments = [10, 10, 10]\nmass = 100"
FIELD = {
    "C": {(2, 0): -J2, (2, 2): 1.57e-6, (3, 0): 2.5e-6, (3, 1): 2.19e-6, (4, 3): 5.9e-8, (5, 5): 5e-9},
    "S": {(2, 2): -9.04e-7, (3, 1): 2.68e-7, (3, 3): 1.97e-7, (4, 4): 6.5e-9},
}


def flown(keys: str, body: str = SPHERE, start: str = "", end: str = "86400", mu: float = MU) -> str:
    start = start or "position = [7000e3, 0, 0]\nvelocity = [0, 5000, 5600]\nangular_velocity = [0, 0, 0.001]"
    load = f'kind = "central_gravity"\ngravitational_parameter = {mu!r}\n{keys}'
    return config(body, start, load, f"end = {end}\nsamples = 25", name="flown")


def table(extra: str = "pole = [0, 0, 1]", field: dict[str, dict[tuple[int, int], float]] = FIELD) -> str:
    rows = []
    for name, values in field.items():
        inner = ", ".join(f'"{n},{m}" = {value!r}' for (n, m), value in values.items())
        rows.append(f"{name} = {{{inner}}}")
    return f"gravity_field = {{radius = {RADIUS!r}, {', '.join(rows)}, {extra}}}"


@cache
def legendre(n: int, m: int) -> tuple[Polynomial, Polynomial]:
    """P_nm(x) over (1 - x^2)^(m/2), by Rodrigues' formula, and its slope."""
    found = (Polynomial([-1, 0, 1]) ** n).deriv(n + m) / (2**n * math.factorial(n))
    return found, found.deriv()


def attraction(x: np.ndarray) -> np.ndarray:
    """Acceleration by ``FIELD`` in its own axes, by derivatives along radius, latitude and longitude."""
    r, rho = np.linalg.norm(x), np.hypot(x[0], x[1])
    z, flat, longitude = x[2] / r, rho / r, math.atan2(x[1], x[0])
    radial, north, east = -MU / r**2, 0.0, 0.0
    for name, values in FIELD.items():
        for (n, m), value in values.items():
            wave, slope = math.cos(m * longitude), -m * math.sin(m * longitude)
            if name == "S":
                wave, slope = math.sin(m * longitude), m * math.cos(m * longitude)
            p, slant_of_p = (f(z) for f in legendre(n, m))
            size = value * MU / r**2 * (RADIUS / r) ** n
            radial -= size * (n + 1) * flat**m * p * wave
            slant = m * z * flat ** (m - 1) * p if m else 0.0
            north += size * wave * (flat ** (m + 1) * slant_of_p - slant)
            east += size * slope * flat ** (m - 1) * p if m else 0.0
    up = x / r
    eastward = np.array([-x[1], x[0], 0]) / rho
    return radial * up + north * np.cross(up, eastward) + east * eastward


@pytest.mark.parametrize("rate", cases([0.0, 7.292115e-5], [7.292115e-5]))
def test_a_field_in_axes_that_turn_agrees_with_another_integrator_and_formula(rate: float) -> None:
    pole, meridian = np.array([0.3, -0.2, 0.9]), 0.7
    p = pole / np.linalg.norm(pole)
    node = np.cross([0, 0, 1], p) / np.linalg.norm(np.cross([0, 0, 1], p))
    keys = table(f"pole = {array(pole)}, rate = {rate!r}, prime_meridian = {meridian!r}")
    run = run_text(flown(keys, end="8000"))
    assert run.summary["warnings"] == []

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        angle = meridian + rate * t
        x = math.cos(angle) * node + math.sin(angle) * np.cross(p, node)
        axes = np.array([x, np.cross(p, x), p])
        return np.concatenate([y[3:], axes.T @ attraction(axes @ y[:3])])

    start = np.array([7000e3, 0, 0, 0, 5000, 5600])
    found = solve_ivp(rates, (0, 8000), start, method="DOP853", rtol=1e-13, atol=1e-9).y[:3, -1]
    # the other integrator's 1e-13 of each of some hundred steps, along an orbit of 8 rad
    assert np.linalg.norm(run.dataset["position"].values[-1] - found) <= 1e-2 * 7000e3 * 1e-8
    invariants = list(run.summary["invariants"])
    assert ("energy" in invariants) == (rate == 0.0)
    assert ("energy_balance" in invariants) == (rate != 0.0)
    assert "total_angular_momentum_axial" not in invariants


def test_a_zonal_field_keeps_the_energy_and_the_momentum_along_its_pole() -> None:
    zonal = {"C": {(2, 0): -J2, (3, 0): 2.5e-6, (6, 0): -5e-7}}
    run = run_text(flown(table("pole = [0.3, -0.2, 0.9], rate = 7e-5", zonal)))
    found = run.summary["invariants"]
    assert {"energy", "total_angular_momentum_axial"} <= set(found)
    assert max(row["largest_drift"] for row in found.values()) < 3e-14


def test_a_flight_about_an_oblate_body_moves_by_the_gradient_of_its_energy() -> None:
    """Forces and torques by numerical derivatives of -(1/2) grad grad Phi : I + m Phi, in 40 digits."""
    random = Random(4)
    tensor, q, pole = random.tensor(), random.quaternion(), random.vector()
    place, mass, radius, j2 = 3 * random.vector(), 2.0, 0.3, 0.1
    place *= max(1.0, 2 / np.linalg.norm(place))
    keys = f"figure = {{J2 = {j2}, radius = {radius}, pole = {array(pole)}}}"
    start = f"angular_velocity = [0.1, 0, 0]\nquaternion = {array(q)}\n"
    start += f"position = {array(place)}\nvelocity = [0.1, 0.2, 0.3]"
    load = f'kind = "central_gravity"\ngravitational_parameter = 2\n{keys}'
    system = prepared(f"inertia_tensor = {array(tensor)}\nmass = {mass}", start, load).system
    with mpmath.workdps(40):
        p = mpmath.matrix(pole.tolist()) / mpmath.norm(mpmath.matrix(pole.tolist()))
        turn = mpmath.matrix(matrix(q).tolist())

        def phi(x: list[mpmath.mpf]) -> mpmath.mpf:
            r = mpmath.norm(mpmath.matrix(x))
            s = sum(a * b for a, b in zip(x, p, strict=True)) / r
            return -2 / r * (1 - j2 * (radius / r) ** 2 * (3 * s * s - 1) / 2)

        def hessian(x: list[mpmath.mpf], i: int, j: int) -> mpmath.mpf:
            order = [int(i == k) + int(j == k) for k in range(3)]
            return mpmath.diff(lambda *y: phi(list(y)), tuple(x), tuple(order), h=mpmath.mpf(10) ** -9)

        def curved(x: list[mpmath.mpf]) -> dict[tuple[int, int], mpmath.mpf]:
            return {(i, j): hessian(x, i, j) * (2 - (i == j)) for i in range(3) for j in range(i + 1)}

        def energy(x: list[mpmath.mpf], r: mpmath.matrix, second: Any) -> mpmath.mpf:
            inertia = r * mpmath.matrix(tensor.tolist()) * r.T
            return mass * phi(x) - sum(value * inertia[place] for place, value in second.items()) / 2

        x0 = [mpmath.mpf(v) for v in place.tolist()]
        step = mpmath.mpf(10) ** -8
        here = curved(x0)
        force, torque = [], []
        for k in range(3):
            ahead, behind = ([v + sign * step * (i == k) for i, v in enumerate(x0)] for sign in (1, -1))
            change = energy(ahead, turn, curved(ahead)) - energy(behind, turn, curved(behind))
            force.append(float(-change / (2 * step)))
            axis = [mpmath.mpf(i == k) for i in range(3)]
            spin = mpmath.matrix([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
            there, back = (turn * mpmath.expm(sign * step * spin) for sign in (1, -1))
            torque.append(float(-(energy(x0, there, here) - energy(x0, back, here)) / (2 * step)))
        potential = float(energy(x0, turn, here))
    w, v = np.array([0.1, 0, 0]), np.array([0.1, 0.2, 0.3])
    state = np.concatenate([w, q / np.linalg.norm(q), place, v])
    found = derivative(system, state)
    accelerated = np.array(force) / mass
    assert np.abs(found[10:13] - accelerated).max() <= 1e-12 * np.abs(accelerated).max()
    turned = np.linalg.solve(tensor, np.cross(tensor @ w, w) + np.array(torque))
    assert np.abs(found[:3] - turned).max() <= 1e-11 * np.abs(turned).max()
    kinetic = w @ tensor @ w / 2 + mass * v @ v / 2
    energy_found = observed(system, state)["energy"][0]
    assert abs(energy_found - kinetic - potential) <= 1e-12 * abs(potential)


def test_node_and_perigee_drift_at_the_secular_rates() -> None:
    """Of first order in J2 (Kozai 1959): a J2 of 1e-7 leaves what is of second order behind."""
    j2, a, e, inclination = 1e-7, 9000e3, 0.2, 0.9
    swift = math.sqrt(MU / a * (1 + e) / (1 - e))
    start = f"position = [{a * (1 - e)!r}, 0, 0]\nangular_velocity = [0, 0, 1e-3]\n"
    start += f"velocity = [0, {swift * math.cos(inclination)!r}, {swift * math.sin(inclination)!r}]"
    n = math.sqrt(MU / a**3)
    turns = 20
    end = repr(turns * 2 * math.pi / n)
    keys = table("pole = [0, 0, 1]", {"C": {(2, 0): -j2}})
    data = run_text(flown(keys, start=start, end=end)).dataset
    x, v = (data[name].values[-1] for name in ("position", "velocity"))
    momentum = np.cross(x, v)
    towards = np.cross(v, momentum) / MU - x / np.linalg.norm(x)
    node = np.cross([0, 0, 1], momentum)
    node /= np.linalg.norm(node)
    found = math.atan2(node[1], node[0])
    beyond = np.cross(momentum, node) / np.linalg.norm(momentum)
    perigee = math.atan2(towards @ beyond, towards @ node)
    unit = 1.5 * j2 * (RADIUS / (a * (1 - e * e))) ** 2 * turns * 2 * math.pi
    assert found == pytest.approx(-unit * math.cos(inclination), rel=1e-3)
    assert perigee == pytest.approx(unit * (2 - 2.5 * math.sin(inclination) ** 2), rel=1e-3)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ('gravity_field = {radius = 1, C = {"2,0" = 1e-3}}', "pole"),
        ('gravity_field = {radius = 1, C = {"1,0" = 1e-3}, pole = [0, 0, 1]}', "degrees from 2 to 200"),
        ('gravity_field = {radius = 1, C = {"2,2" = 10}, pole = [0, 0, 1]}', "no mass within 2 radii"),
        ('gravity_field = {radius = 8e6, C = {"2,0" = 1e-3}, pole = [0, 0, 1]}', "the series doesn't hold"),
    ],
)
def test_nonsense_is_refused(keys: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        prepare(rigidsim.parse(flown(keys)))
    assert message in str(caught.value)
