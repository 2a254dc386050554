"""Loads: torques and forces against numpy, exact solutions, and the work that they do."""

from typing import Any

import heyoka as hy
import numpy as np
import pytest
from equations import CLOSE, EPS, Random, array, derivative, general_body, matrix, prepared
from scipy.spatial.transform import Rotation
from support import config, run_text


def turning(tensor: np.ndarray, w: np.ndarray, torque: np.ndarray) -> np.ndarray:
    return np.linalg.solve(tensor, np.cross(tensor @ w, w) + torque)


def travel(system: Any, times: list[float]) -> np.ndarray:
    """States in SI at increasing times in seconds, the first one the start, shape (times, states)."""
    start = np.array([float(x) for x in system.initial])
    unit = system.scaling.time
    integrator = hy.taylor_adaptive(
        system.equations, start, time=float(np.ldexp(times[0], -unit)), compact_mode=True
    )
    rows = [start]
    for time in times[1:]:
        integrator.propagate_until(float(np.ldexp(time, -unit)))
        rows.append(integrator.state.copy())
    return np.ldexp(np.array(rows), np.array(system.state_exponents))


def test_rates_are_bounded_by_what_the_gradient_of_a_nearly_round_body_can_give() -> None:
    """Released at rest across a fixed source, it swings through at I3 w^2 = 3 K (I2 - I1)."""
    load = 'kind = "gravity_gradient"\ngravitational_parameter = 1\nposition = [1, 0, 0]'
    system = prepared("principal_moments = [1, 1.02, 1.02]", "angular_velocity = [0, 0, 0]", load).system
    fastest = np.sqrt(3 * 0.02 / 1.02)
    assert fastest <= float(system.rate_bound) <= 2 * fastest


@pytest.mark.parametrize("formulation", ["quaternion", "rates"])
def test_damping_in_proportion_to_inertia(formulation: str) -> None:
    """tau = -c I w: abs(L) = L0 exp(-c t), E = E0 exp(-2 c t), the direction of L stays."""
    c, moments = 0.25, np.array([1.0, 1.75, 2.0])
    load = f'kind = "viscous_torque"\ncoefficients = {array(c * moments)}'
    run = run_text(config(f"principal_moments = {array(moments)}", "angular_velocity = [0.3, 2.0, 0.4]", load,
                          "end = 16", f'formulation = "{formulation}"'))  # fmt: skip
    dataset, steps = run.dataset, run.summary["cost"]["steps"]
    decay = np.exp(-c * dataset["time"].values)
    size, energy = dataset["angular_momentum_norm"].values, dataset["energy"].values
    bound = 50 * EPS * np.sqrt(steps)  # relative to the start: step control is absolute below one
    np.testing.assert_allclose(size / size[0], decay, rtol=0, atol=bound)
    np.testing.assert_allclose(energy / energy[0], decay**2, rtol=0, atol=bound)
    np.testing.assert_allclose(dataset["work"].values, energy - energy[0], rtol=0, atol=bound * energy[0])
    if formulation == "quaternion":
        direction = dataset["angular_momentum"].values / size[0] / decay[:, None]
        np.testing.assert_allclose(direction - direction[0], 0 * direction, atol=bound / decay.min())


@pytest.mark.parametrize("frame", ["body", "space"])
def test_torque_of_expressions(frame: str) -> None:
    random = Random(1300)
    tensor, w, q, time = random.tensor(), random.vector(), random.quaternion(), 2.5
    system = prepared(
        general_body(tensor),
        f"angular_velocity = {array(random.vector())}",
        'kind = "torque"\ncomponents = ["k*sin(t)^2 - wx", "wy*wz + 2", "exp(-t)*wx"]\n'
        + f'frame = "{frame}"',
        parameters="k = 0.75",
        end=10.0,
    ).system
    given = np.array([0.75 * np.sin(time) ** 2 - w[0], w[1] * w[2] + 2, np.exp(-time) * w[0]])
    torque = matrix(q).T @ given if frame == "space" else given
    assert system.states[7:] == ["work", "pace"]
    got = derivative(system, np.concatenate([w, q, [0.0, 0.0]]), time)
    size = np.linalg.norm(np.linalg.inv(tensor)) * (np.linalg.norm(tensor) + 4)
    np.testing.assert_allclose(got[:3], turning(tensor, w, torque), rtol=0, atol=CLOSE * size)
    assert got[7] == pytest.approx(torque @ w, abs=CLOSE * 10)


@pytest.mark.parametrize(("frame", "size", "point"), [("body", 1.0, None), ("space", 1e-4, [0.3, -0.2, 0.5])])
def test_force_of_expressions_in_flight(frame: str, size: float, point: list[float] | None) -> None:
    random = Random(1400)
    tensor, mass = random.tensor(), 2.5
    w, q, x, v = random.vector(size), random.quaternion(), random.vector(40), random.vector(5)
    where = "" if point is None else f"\npoint = {array(point)}"
    system = prepared(
        general_body(tensor, mass),
        f"angular_velocity = {array(random.vector(size))}\nposition = {array(x)}\nvelocity = {array(v)}",
        f'kind = "force"\nframe = "{frame}"\ncomponents = ["-k*x", "vy - 0.1*z", "1 + vz*y"]{where}',
        parameters='k = "1/4"',
    ).system
    given = np.array([-0.25 * x[0], v[1] - 0.1 * x[2], 1 + v[2] * x[1]])
    force, in_body = (given, matrix(q).T @ given) if frame == "space" else (matrix(q) @ given, given)
    torque = np.zeros(3) if point is None else np.cross(point, in_body)
    got = derivative(system, np.concatenate([w, q, x, v, [0.0]]))
    amount = np.linalg.norm(np.linalg.inv(tensor)) * (
        np.linalg.norm(tensor) * size**2 + np.linalg.norm(torque)
    )
    np.testing.assert_allclose(got[:3], turning(tensor, w, torque), rtol=0, atol=CLOSE * amount)
    np.testing.assert_allclose(got[10:13], force / mass, rtol=0, atol=CLOSE * np.linalg.norm(force))
    power = torque @ w + force @ v
    assert got[-1] == pytest.approx(power, abs=CLOSE * np.linalg.norm(force) * 10)


@pytest.mark.parametrize(
    ("formulation", "sequence"), [("quaternion", "zxz"), ("euler_angles", "zyx"), ("rotation_matrix", "xyz")]
)
def test_a_load_reads_the_attitude_and_the_path(formulation: str, sequence: str) -> None:
    random = Random(1500)
    angles, w, x, v = [0.4, 0.7, -0.3], random.vector(), random.vector(), random.vector()
    system = prepared(
        "principal_moments = [1, 2, 2.5]\nmass = 1",
        f"angular_velocity = {array(w)}\neuler_angles = {angles}\n"
        f"position = {array(x)}\nvelocity = {array(v)}",
        'kind = "torque"\ncomponents = ["qw*qx", "sin(phi) - sin(psi)*theta", "x*qw*qz + qy^2"]',
        integrator=f'formulation = "{formulation}"\neuler_sequence = "{sequence}"',
    ).system
    state = travel(system, [0.0])[0]
    rotation = Rotation.from_euler(sequence.upper(), angles)
    qx, qy, qz, qw = rotation.as_quat(canonical=True)
    torque = np.array([qw * qx, np.sin(angles[0]) - np.sin(angles[2]) * angles[1], x[0] * qw * qz + qy**2])
    expected = turning(np.diag([1, 2, 2.5]), w, torque)
    np.testing.assert_allclose(derivative(system, state)[:3], expected, rtol=0, atol=CLOSE)
