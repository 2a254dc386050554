"""Loads: torques and forces against numpy, exact solutions, and the invariants that they keep or break."""

from __future__ import annotations

from typing import Any

import heyoka as hy
import mpmath
import numpy as np
import pytest
from equations import CLOSE, EPS, Random, array, derivative, general_body, matrix, prepared
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from support import angle_between, cases, law, run_text, wide

from rigidsim import ConfigError

ORBIT_KEYS = (
    "semi_major_axis", "eccentricity", "inclination", "ascending_node", "periapsis", "mean_anomaly",
    "node_rate", "periapsis_rate", "period",
)  # fmt: skip


def gradient(strength: float, orbit: dict[str, float]) -> str:
    elements = ", ".join(f"{k} = {v!r}" for k, v in orbit.items())
    return f'kind = "gravity_gradient"\ngravitational_parameter = {strength!r}\norbit = {{{elements}}}'


def fixed_source(strength: float, position: Any) -> str:
    return (
        f'kind = "gravity_gradient"\ngravitational_parameter = {strength!r}\nposition = {array(position)}\n'
    )


def source_at(orbit: dict[str, float], strength: float, time: float) -> np.ndarray:
    """Position of the attracting body (m, space axes); Kepler's equation by bisection, not by Newton."""
    a, e = orbit["semi_major_axis"], orbit.get("eccentricity", 0.0)
    motion = 2 * np.pi / orbit["period"] if "period" in orbit else np.sqrt(strength / a**3)
    mean = orbit.get("mean_anomaly", 0.0) + motion * time
    anomaly = brentq(lambda x: x - e * np.sin(x) - mean, mean - 1, mean + 1, xtol=1e-15, rtol=4 * EPS)
    flat = a * np.array([np.cos(anomaly) - e, np.sqrt(1 - e * e) * np.sin(anomaly), 0])
    node = orbit.get("ascending_node", 0.0) + orbit.get("node_rate", 0.0) * time
    periapsis = orbit.get("periapsis", 0.0) + orbit.get("periapsis_rate", 0.0) * time
    return Rotation.from_euler("ZXZ", [node, orbit.get("inclination", 0.0), periapsis]).apply(flat)


def gradient_torque(tensor: np.ndarray, r: np.ndarray, position: np.ndarray, strength: float) -> np.ndarray:
    """(3 G M / R^5) rho x I rho, rho = R^T position (MacCullagh), body axes."""
    rho = r.T @ position
    return 3 * strength / np.linalg.norm(rho) ** 5 * np.cross(rho, tensor @ rho)


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


def quaternions(system: Any, states: np.ndarray) -> np.ndarray:
    """Attitudes in space, shape (times, 4); from the frame that turns with a circular orbit where that is
    what is carried.
    """
    carried = states[:, 3:7]
    if "pw" not in system.states:
        return carried
    (load,) = (load for load in system.scene.loads if getattr(load, "orbit", None) is not None)
    half = states[:, [next(i for i, n in enumerate(system.states) if n.startswith(f"{f}_half"))
                      for f in ("cos", "sin")]]  # fmt: skip
    plane = Rotation.from_euler("ZX", [float(load.orbit.ascending_node), float(load.orbit.inclination)])
    along = Rotation.from_euler("Z", 2 * np.arctan2(half[:, 1:], half[:, :1]))
    found = (plane * along * Rotation.from_quat(np.roll(carried, -1, axis=1))).as_quat()
    return np.roll(found, 1, axis=1)


# ---- (a) gravity gradient ---------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", ["circular", "eccentric", "moving", "period"])
def test_gradient_torque_of_a_body_on_an_orbit(shape: str) -> None:
    """Along the motion, from a start that isn't zero, the torque is that of an independent Kepler orbit."""
    random = Random(1000)
    uniform = random.generator.uniform
    strength = float(uniform(0.5, 2))
    orbit = {"semi_major_axis": float(uniform(0.8, 1.5)), "mean_anomaly": float(uniform(-3, 3))}
    orbit |= {"inclination": float(uniform(0, 3)), "ascending_node": float(uniform(-3, 3))}
    if shape != "circular":
        orbit |= {"eccentricity": float(uniform(0.05, 0.7)), "periapsis": float(uniform(-3, 3))}
    if shape == "moving":
        orbit |= {"node_rate": float(uniform(-0.3, 0.3)), "periapsis_rate": float(uniform(-0.3, 0.3))}
    if shape == "period":
        orbit |= {"period": float(uniform(3, 9))}
    tensor = random.tensor()
    start = float(uniform(-20, 20))
    system = prepared(
        general_body(tensor),
        f"angular_velocity = {array(random.vector())}\nquaternion = {array(random.quaternion())}",
        gradient(strength, orbit),
        start=start,
        end=start + 10,
    ).system
    times = [start, *np.sort(start + uniform(0, 10, 6))]
    states = travel(system, times)
    for time, state, q in zip(times, states, quaternions(system, states), strict=True):
        position = source_at(orbit, strength, time)
        torque = gradient_torque(tensor, matrix(q), position, strength)
        expected = turning(tensor, state[:3], torque)
        size = np.linalg.norm(np.linalg.inv(tensor)) * np.linalg.norm(tensor)
        nearest = orbit["semi_major_axis"] * (1 - orbit.get("eccentricity", 0.0))
        size *= state[:3] @ state[:3] + 3 * strength / nearest**3
        # some 200 steps' roundings in the orbit's phase, and those of M + n t near 30 rad, which the
        # orbital rate at pericentre amplifies by up to (1 - e)^-2
        phase = 30 * EPS / (1 - orbit.get("eccentricity", 0.0)) ** 2
        np.testing.assert_allclose(
            derivative(system, state, time)[:3], expected, rtol=0, atol=20 * size * phase
        )


def test_eccentric_anomaly_solves_keplers_equation() -> None:
    """Also near a parabola, where Newton's method from a poor start wanders."""
    for e in (0.0, 0.9, 0.9999):
        for mean in (-6.9, -3.2, -1.0, -1e-3, 0.0, 1e-6, 0.02, 0.3, 3.1, 6.2, 6.3, 12.6):
            orbit = {"semi_major_axis": 1.0, "eccentricity": e, "mean_anomaly": float(mean)}
            scene = prepared("principal_moments = [1, 2, 2.5]", "angular_velocity = [0, 0, 1]",
                             gradient(1.0, orbit)).scene  # fmt: skip
            kepler, context = scene.loads[0].orbit, scene.context
            anomaly = kepler.eccentric_anomaly(context, scene.start)
            residual = anomaly - kepler.eccentricity * context.sin(anomaly) - kepler.mean_anomaly
            assert abs(residual) < 1e-18


# ---- (b) a circular orbit ---------------------------------------------------------------------------------

CIRCULATING = """name = "circulating"
[body]
principal_moments = [1, 1.75, 2]
[initial]
angular_velocity = [0, 0, 3.5]
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {{semi_major_axis = 1, inclination = 0.1}}
[time]
end = {end}
samples = 65
[output]
record = ["quaternion"]
[integrator]
precision = "{precision}"
"""


def circulating_error(end: int) -> tuple[float, float]:
    """Largest error of the attitude against 80 bits, and what the law allows."""
    found = []
    for precision in ("double", "extended"):
        run = run_text(CIRCULATING.format(end=end, precision=precision))
        assert run.status == "finished"
        row = run.summary["invariants"]["jacobi_constant"]
        assert row["largest_drift"] <= row["bound"]
        found.append(wide(run.dataset, "quaternion"))
        if precision == "double":
            allowed = law(EPS, run.summary["cost"]["steps"], 3.5, end)
    return float(angle_between(*found).max()), allowed


@pytest.mark.slow
def test_attitude_on_a_circular_orbit_after_very_long() -> None:
    """n t = 2^15, 114,688 rad in some 236,000 steps: the law gives 3.6e-9 rad, and runs scatter below it. An
    explicit cos(n t) would be wrong by 3e-7 (errors like t^2.5).
    """
    error, allowed = circulating_error(2**15)
    assert error <= allowed < 4e-9


def test_frequency_of_small_pitch_librations() -> None:
    """n sqrt(3 (B - A) / C), A along the radius and C along the normal (Lagrange 1780)."""
    a, b, c = 1.0, 1.75, 2.0
    expected = np.sqrt(3 * (b - a) / c)
    text = """name = "pitch"
[body]
principal_moments = [1, 1.75, 2]
[initial]
angular_velocity = [0, 0, 1.0001]
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {semi_major_axis = 1}
[time]
end = 600
every = 0.01
"""
    dataset = run_text(text).dataset
    rate = dataset["angular_velocity"].values[:, 2] - 1
    time = dataset["time"].values
    i = np.flatnonzero(rate[:-1] * rate[1:] < 0)
    # a straight line through two samples finds the zero of a sine to (spacing * frequency)^3 / 16 = 7e-8 rad;
    # the amplitude of 1e-4 rad changes the frequency by 1e-9
    crossings = time[i] - rate[i] * (time[i + 1] - time[i]) / (rate[i + 1] - rate[i])
    frequency = np.pi * (len(crossings) - 1) / (crossings[-1] - crossings[0])
    assert frequency == pytest.approx(expected, rel=1e-6)


# ---- (c) central gravity ----------------------------------------------------------------------------------


def central_potential(x: Any, r: Any, tensor: Any, mass: float, strength: float) -> Any:
    """-G M m / r - (G M / 2 r^3) (tr I - 3 c . I c), c = R^T x / r, in mpmath."""
    distance = mpmath.norm(x)
    c = r.T * x / distance
    bracket = tensor[0, 0] + tensor[1, 1] + tensor[2, 2] - 3 * (c.T * tensor * c)[0]
    return -strength * mass / distance - strength / (2 * distance**3) * bracket


@pytest.mark.parametrize("seed", range(2))
def test_central_force_and_torque_are_gradients_of_the_potential(seed: int) -> None:
    random = Random(1200 + seed)
    tensor, mass, strength = random.tensor(), 1.7, 3.0
    center = random.vector(0.5)
    w, q, x, v = random.vector(), random.quaternion(), random.vector() + 2, random.vector()
    system = prepared(
        general_body(tensor, mass),
        f"angular_velocity = {array(w)}\nquaternion = {array(q)}\n"
        f"position = {array(x)}\nvelocity = {array(v)}",
        f'kind = "central_gravity"\ngravitational_parameter = {strength}\nposition = {array(center)}',
    ).system
    got = derivative(system, np.concatenate([w, q, x, v]))
    with mpmath.workdps(40):
        step = mpmath.mpf(10) ** -12  # central differences: their error is 1e-24
        shifted = mpmath.matrix(x.tolist()) - mpmath.matrix(center.tolist())
        r, inertia = mpmath.matrix(matrix(q).tolist()), mpmath.matrix(tensor.tolist())

        def potential(shift: list[Any], turn: list[Any]) -> Any:
            a, b, c = turn
            small = mpmath.matrix([[1, -c, b], [c, 1, -a], [-b, a, 1]])  # orthogonal to first order
            return central_potential(shifted + mpmath.matrix(shift), r * small, inertia, mass, strength)

        def slope(axis: int, which: str) -> float:
            move = [step if i == axis else mpmath.mpf(0) for i in range(3)]
            back, rest = [-m for m in move], [mpmath.mpf(0)] * 3
            ahead = (move, rest) if which == "shift" else (rest, move)
            behind = (back, rest) if which == "shift" else (rest, back)
            return float((potential(*ahead) - potential(*behind)) / (2 * step))

        force = np.array([-slope(i, "shift") for i in range(3)])
        torque = np.array([-slope(i, "turn") for i in range(3)])
    # the small turn is off by the second order, which central differences drop
    size = np.linalg.norm(np.linalg.inv(tensor)) * (np.linalg.norm(tensor) + 10 * strength)
    np.testing.assert_allclose(got[:3], turning(tensor, w, torque), rtol=0, atol=CLOSE * size)
    np.testing.assert_allclose(got[7:10], v, rtol=4 * EPS)
    np.testing.assert_allclose(got[10:13], force / mass, rtol=0, atol=CLOSE * 20)


CENTRAL = """name = "central"
[body]
principal_moments = [0.0010, 0.0018, 0.0020]
mass = 1
[initial]
angular_velocity = [0.3, 0.2, 1.5]
euler_angles = [0.3, 1.2, -0.4]
position = [1.5, 0.5, 1]
velocity = [-0.1, 0.85, 0.3]
[[loads]]
kind = "central_gravity"
gravitational_parameter = 1
position = [0.5, 0.5, 1]
[time]
end = 30
"""


@pytest.mark.parametrize("formulation", ["rotation_matrix"])  # others: test_conservation
def test_central_gravity_keeps_energy_and_total_momentum(formulation: str) -> None:
    run = run_text(CENTRAL, f'integrator.formulation="{formulation}"', 'integrator.euler_sequence="zxz"')
    assert run.status == "finished"
    rows = run.summary["invariants"]
    assert {name for name, row in rows.items() if not row["numerical"]} == {
        "energy",
        "total_angular_momentum",
    }
    for name, row in rows.items():
        assert row["bound"] == 50 * EPS * np.sqrt(run.summary["cost"]["steps"])
        assert row["largest_drift"] <= row["bound"], name
    for name in ("angular_momentum", "rotational_energy", "linear_momentum"):  # the body and its path trade
        values = run.dataset[name].values.reshape(len(run.dataset["time"]), -1)
        assert np.ptp(values, axis=0).max() > 1e-3


# ---- (d), (e) torques that do work ------------------------------------------------------------------------


@pytest.mark.parametrize("formulation", ["quaternion", "rates"])
def test_damping_in_proportion_to_inertia(formulation: str) -> None:
    """tau = -c I w: abs(L) = L0 exp(-c t), E = E0 exp(-2 c t), the direction of L stays."""
    c, moments = 0.25, np.array([1.0, 1.75, 2.0])
    text = f"""name = "damped"
[body]
principal_moments = {array(moments)}
[initial]
angular_velocity = [0.3, 2.0, 0.4]
[[loads]]
kind = "viscous_torque"
coefficients = {array(c * moments)}
[time]
end = 16
[integrator]
formulation = "{formulation}"
"""
    run = run_text(text)
    dataset, steps = run.dataset, run.summary["cost"]["steps"]
    names = {name for name, row in run.summary["invariants"].items() if not row["numerical"]}
    assert names == {"energy_balance"} | ({"angular_momentum_across"} if formulation != "rates" else set())
    for name in names:
        row = run.summary["invariants"][name]
        assert row["largest_drift"] <= row["bound"]
    decay = np.exp(-c * dataset["time"].values)
    size, energy = dataset["angular_momentum_norm"].values, dataset["energy"].values
    bound = 50 * EPS * np.sqrt(steps)  # relative to the start: step control is absolute below one
    np.testing.assert_allclose(size / size[0], decay, rtol=0, atol=bound)
    np.testing.assert_allclose(energy / energy[0], decay**2, rtol=0, atol=bound)
    np.testing.assert_allclose(dataset["work"].values, energy - energy[0], rtol=0, atol=bound * energy[0])
    if formulation == "quaternion":
        direction = dataset["angular_momentum"].values / size[0] / decay[:, None]
        np.testing.assert_allclose(
            direction, direction[:1] * np.ones_like(direction), atol=bound / decay.min()
        )


@pytest.mark.parametrize("formulation", ["quaternion", "rates"])
def test_power_of_a_constant_body_torque(formulation: str) -> None:
    """dE/dt = w . tau: about a principal axis in closed form, else by the balance of energy."""
    text = """name = "driven"
[body]
principal_moments = [1, 1.75, 2]
[initial]
angular_velocity = [0.3, 0.2, 1]
[[loads]]
kind = "torque"
components = ["0.1", "-0.05", 0.2]
[time]
end = 20
samples = 2001
"""
    override = f'integrator.formulation="{formulation}"'
    run = run_text(text, override)
    row = run.summary["invariants"]["energy_balance"]
    assert 0 < row["largest_drift"] <= row["bound"]
    dataset = run.dataset
    work, w, time = dataset["work"].values, dataset["angular_velocity"].values, dataset["time"].values
    power = w @ [0.1, -0.05, 0.2]
    assert np.ptp(dataset["energy"].values) > 1
    # the trapezoidal rule leaves h^2 / 12 times the change of the power's slope, at most 2 here
    trapezoid = np.concatenate([[0], np.cumsum((power[1:] + power[:-1]) / 2 * np.diff(time))])
    assert np.abs(work - trapezoid).max() < 1e-4 / 12 * 4
    spin = text.replace("[0.3, 0.2, 1]", "[0, 0, 1]").replace('["0.1", "-0.05", 0.2]', "[0, 0, 0.2]")
    spun = run_text(spin, override).dataset
    np.testing.assert_allclose(spun["angular_velocity"].values[:, 2], 1 + 0.1 * time, rtol=1e-14)
    np.testing.assert_allclose(spun["work"].values, (1 + 0.1 * time) ** 2 - 1, rtol=0, atol=9 * 1e-14)


# ---- (f) expressions --------------------------------------------------------------------------------------


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


def test_force_about_a_fixed_point() -> None:
    """By default it acts at the centre of mass, whose place is given from the fixed point."""
    center, w, q = [0.1, 0.2, 0.3], np.array([0.1, 0.2, 0.3]), Random(1).quaternion()
    body = f"principal_moments = [1, 2, 2.5]\nmass = 1\ncenter_of_mass = {center}"
    load = 'kind = "force"\ncomponents = ["1", "2", "3"]'
    system = prepared(body, "angular_velocity = [0, 0, 1]", load).system
    tensor = np.diag([1, 2, 2.5])
    for text, point in ((load, center), (load + "\npoint = [0, 1, 0]", [0, 1, 0])):
        system = prepared(body, "angular_velocity = [0, 0, 1]", text).system
        expected = turning(tensor, w, np.cross(point, matrix(q).T @ [1, 2, 3]))
        got = derivative(system, np.concatenate([w, q, [0.0]]))
        np.testing.assert_allclose(got[:3], expected, rtol=0, atol=CLOSE * 5)


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


# ---- (g) what loads require -------------------------------------------------------------------------------

FREE, SPIN = "principal_moments = [1, 1.75, 2]\nmass = 1", "angular_velocity = [0.1, 1, 0.05]"
VISCOUS = 'kind = "viscous_torque"\ncoefficients = [0.1, 0.2, 0.3]'
BODY_TORQUE = 'kind = "torque"\ncomponents = ["wy", "sin(t)", 1]'
READERS = {
    "torque": [
        'kind = "torque"\ncomponents = ["1", "0", "0"]\nframe = "space"',
        'kind = "torque"\ncomponents = ["qw*qx", "0", "0"]',
        'kind = "torque"\ncomponents = ["cos(psi)", "0", "0"]',
    ],
    "force": ['kind = "force"\ncomponents = ["1", "0", "0"]\npoint = [1, 0, 0]'],
    "gravity_gradient": [gradient(1.0, {"semi_major_axis": 1.0}), fixed_source(1.0, [1, 2, 3])],
}


@pytest.mark.parametrize("load", [VISCOUS, BODY_TORQUE])
def test_torques_in_body_axes_need_no_attitude(load: str) -> None:
    few = prepared(FREE, SPIN, load, record='["angular_velocity", "energy"]').system
    assert few.states == ["wx", "wy", "wz", "work"]
    assert dict(few.reasons)["work"].startswith("work of the loads")
    assert prepared(FREE, SPIN, load, integrator='formulation = "rates"').system.states == few.states


@pytest.mark.parametrize(
    ("title", "load"), [(title, load) for title, loads in READERS.items() for load in loads]
)
def test_loads_that_read_the_attitude_say_so(title: str, load: str) -> None:
    turned = SPIN + "\neuler_angles = [0, 1, 0]"  # where Euler angles have values
    system = prepared(FREE, turned, load, record='["angular_velocity"]').system
    reasons = dict(system.reasons)
    why = reasons.get("qw qx qy qz") or reasons["pw px py pz"].split(";")[0]
    assert why.split(" (")[0] == f"{title} reads it"  # then the names that expressions read
    with pytest.raises(ConfigError, match=f'given "rates", but {title} reads the attitude; choose "auto"'):
        prepared(FREE, turned, load, integrator='formulation = "rates"')


# ---- (h) exactly the invariants that hold -----------------------------------------------------------------

CIRCLE = {"semi_major_axis": 1.0, "inclination": 0.4}
UPRIGHT = 'kind = "uniform_gravity"\nacceleration = [0, 0, -2]'
SYMMETRIC = "principal_moments = [1, 1, 1.5]\nmass = 1"
TWO = "\n[[loads]]\n"
# body, loads, flight, invariants
SCENES: dict[str, tuple[str, str, bool, set[str]]] = {
    "free": (FREE, "", False, {"angular_momentum", "angular_momentum_norm", "energy"}),
    "circular orbit": (FREE, gradient(1.0, CIRCLE), False, {"jacobi_constant"}),
    "its period overridden": (FREE, gradient(1.0, CIRCLE | {"period": 5.0}), False, {"jacobi_constant"}),
    "symmetric on a circular orbit": (
        SYMMETRIC, gradient(1.0, CIRCLE), False, {"jacobi_constant", "angular_momentum_axial"},
    ),
    "eccentric orbit": (FREE, gradient(1.0, CIRCLE | {"eccentricity": 0.1}), False, {"energy_balance"}),
    "circular orbit, moving periapsis": (
        FREE, gradient(1.0, CIRCLE | {"periapsis": 0.5, "periapsis_rate": 0.2}), False, {"jacobi_constant"},
    ),
    "eccentric orbit, moving periapsis": (
        FREE, gradient(1.0, CIRCLE | {"eccentricity": 0.1, "periapsis_rate": 0.2}), False, {"energy_balance"},
    ),
    "moving node": (FREE, gradient(1.0, CIRCLE | {"node_rate": 0.1}), False, {"energy_balance"}),
    "symmetric on a moving orbit": (
        SYMMETRIC, gradient(1.0, CIRCLE | {"eccentricity": 0.1, "node_rate": 0.1}), False,
        {"energy_balance", "angular_momentum_axial"},
    ),
    "orbit and damping": (FREE, gradient(1.0, CIRCLE) + TWO + VISCOUS, False, {"energy_balance"}),
    "orbit and fixed source": (
        FREE, gradient(1.0, CIRCLE) + TWO + fixed_source(1.0, [1, 1, 1]), False, {"energy_balance"},
    ),
    "two fixed sources": (
        FREE, fixed_source(1.0, [1, 0.5, 0]) + TWO + fixed_source(1.0, [0, 1, 1]), False,
        {"energy", "brun_constant", "bogoyavlensky_constant"},
    ),
    "damped": (FREE, VISCOUS, False, {"energy_balance"}),
    "damped symmetric": (SYMMETRIC, VISCOUS, False, {"energy_balance"}),
    "heavy symmetric": (
        SYMMETRIC + "\ncenter_of_mass = [0, 0, 1]", UPRIGHT, False,
        {"energy", "angular_momentum_vertical", "angular_momentum_axial"},
    ),
    "heavy with damping": (
        SYMMETRIC + "\ncenter_of_mass = [0, 0, 1]", UPRIGHT + TWO + VISCOUS, False, {"energy_balance"},
    ),
    "heavy with a fixed source": (
        SYMMETRIC + "\ncenter_of_mass = [0, 0, 1]", UPRIGHT + TWO + fixed_source(1.0, [1, 0.5, 0]), False,
        {"energy", "angular_momentum_axial"},
    ),
    "heavy, mass off its axis, with a source": (
        SYMMETRIC + "\ncenter_of_mass = [0.3, 0, 1]", UPRIGHT + TWO + fixed_source(1.0, [1, 0.5, 0]), False,
        {"energy"},
    ),
    "central": (
        FREE, 'kind = "central_gravity"\ngravitational_parameter = 1', True,
        {"energy", "total_angular_momentum"},
    ),
    "central, symmetric": (
        SYMMETRIC, 'kind = "central_gravity"\ngravitational_parameter = 1', True,
        {"energy", "total_angular_momentum", "angular_momentum_axial"},
    ),
    "central and gravity": (
        FREE, 'kind = "central_gravity"\ngravitational_parameter = 1' + TWO + UPRIGHT, True,
        {"energy", "total_angular_momentum_axial"},
    ),
    "two centres": (
        FREE, 'kind = "central_gravity"\ngravitational_parameter = 1' + TWO
        + 'kind = "central_gravity"\ngravitational_parameter = 1\nposition = [0, 0, -5]', True,
        {"energy", "total_angular_momentum_axial"},
    ),
    "a push at the centre of mass": (
        SYMMETRIC, 'kind = "force"\ncomponents = ["1", 0, "t"]', True,
        {"energy_balance", "angular_momentum", "angular_momentum_norm", "angular_momentum_axial",
         "rotational_energy"},
    ),
    "a push elsewhere": (
        SYMMETRIC, 'kind = "force"\ncomponents = ["1", 0, "t"]\npoint = [0, 1, 0]', True, {"energy_balance"},
    ),
    "no damping after all": (
        FREE, 'kind = "viscous_torque"\ncoefficients = [0, 0, 0]', False,
        {"energy", "angular_momentum", "angular_momentum_norm"},
    ),
}  # fmt: skip


def candidates(system: Any, states: np.ndarray, times: np.ndarray) -> dict[str, np.ndarray]:
    """All quantities that some scene keeps, in numpy, from the motion."""
    scene = system.scene
    index = {name: i for i, name in enumerate(system.states)}
    w, r = states[:, :3], np.array([matrix(q) for q in quaternions(system, states)])
    tensor = np.array(scene.body.inertia, dtype=float)
    momentum = w @ tensor
    spinning = np.einsum("ni,ni->n", w, momentum) / 2
    in_space = np.einsum("nij,nj->ni", r, momentum)
    center = np.array(scene.body.center_of_mass, dtype=float)
    kinetic, potential = spinning.copy(), 0 * spinning
    found = {"angular_momentum": in_space, "angular_momentum_norm": np.linalg.norm(in_space, axis=1)}
    if tensor[0, 0] == tensor[1, 1]:
        found["angular_momentum_axial"] = momentum[:, 2]
    if scene.gravity is not None and not scene.free_flight:
        found["angular_momentum_vertical"] = in_space[:, 2]
        potential += 2 * np.einsum("nj,j->n", r[:, 2], center)
    if scene.free_flight:
        x, v = (states[:, index[name] : index[name] + 3] for name in ("x", "vx"))
        kinetic += (v**2).sum(axis=1) / 2
        found |= {"rotational_energy": spinning, "linear_momentum": v}
        if scene.gravity is not None:
            potential += 2 * x[:, 2]
    sources = np.zeros((3, 3))
    for load in scene.loads:
        name = type(load).__name__
        if name == "GravityGradient" and load.orbit is None:
            place = np.array(load.placement.rests(), dtype=float)
            sources += 3 * np.outer(place, place) / np.linalg.norm(place) ** 5
        if name == "GravityGradient":
            if load.orbit is None:
                place = np.tile(np.array(load.placement.rests(), dtype=float), (len(times), 1))
            else:
                given = {k: float(getattr(load.orbit, k)) for k in ORBIT_KEYS[:-1]}
                given["period"] = 2 * np.pi / float(load.orbit.mean_motion)
                place = np.array([source_at(given, 1.0, t) for t in times])
            c = np.einsum("nij,ni->nj", r, place / np.linalg.norm(place, axis=1)[:, None])
            tidal = 1.5 / np.linalg.norm(place, axis=1) ** 3 * np.einsum("ni,ij,nj->n", c, tensor, c)
            if load.orbit is None:
                potential += tidal
            else:
                normal = Rotation.from_euler("ZX", [0, 0.4]).apply([0, 0, 1])
                found["jacobi_constant"] = (
                    spinning - float(load.orbit.mean_motion) * in_space @ normal + tidal
                )
        if name == "CentralGravity":
            offset = x - np.array(load.position, dtype=float)
            distance = np.linalg.norm(offset, axis=1)
            c = np.einsum("nij,ni->nj", r, offset / distance[:, None])
            bracket = np.trace(tensor) - 3 * np.einsum("ni,ij,nj->n", c, tensor, c)
            potential += -1 / distance - bracket / (2 * distance**3)
            if "total_angular_momentum" not in found:
                found["total_angular_momentum"] = np.cross(offset, v) + in_space
                if len(scene.loads) > 1 or scene.gravity is not None:
                    found["total_angular_momentum_axial"] = found["total_angular_momentum"][:, 2]
    if sources.any():
        seen = np.einsum("nji,jk,nkl->nil", r, sources, r)
        adjugate = np.linalg.det(tensor) * np.linalg.inv(tensor)
        squared = (in_space**2).sum(axis=1)
        found["brun_constant"] = squared - np.einsum("ij,nji->n", adjugate, seen)
        found["bogoyavlensky_constant"] = (
            np.einsum("ni,ij,nj->n", in_space, sources, in_space)
            - np.trace(sources) * squared
            + np.einsum("ij,njk,nki->n", adjugate, seen, seen)
        )
    found["energy"] = kinetic + potential
    if "work" in index:
        found["energy_balance"] = found["energy"] - states[:, index["work"]]
    return found


@pytest.mark.parametrize("case", cases(SCENES, list(SCENES)[::2]))
def test_exactly_what_is_conserved_is_listed(case: str) -> None:
    """The listed ones stay, all others leave; where a symmetry is broken its invariant goes with it."""
    body, loads, flight, expected = SCENES[case]
    initial = "angular_velocity = [0.4, 0.9, 0.3]\nquaternion = [0.5, 0.1, -0.3, 0.7]"
    if flight:
        initial += "\nposition = [2.5, 0, 0.3]\nvelocity = [0, 0.6, 0.1]"
    system = prepared(body, initial, loads, end=4.0).system
    listed = {i.name for i in system.invariants if not i.numerical}
    assert listed == expected
    assert all(i.why for i in system.invariants)
    times = np.linspace(0, 4, 41)
    states = travel(system, list(times))
    found = candidates(system, states, times)
    bound = 1000 * EPS  # some 30 steps, tens of roundings of numbers of order ten each
    kept, gone = set(), set()
    for name, values in found.items():
        values = values.reshape(len(values), -1)
        size = max(1.0, np.abs(values).max())
        change = np.linalg.norm(values - values[0], axis=1).max() / size
        if change < bound:
            kept.add(name)
        if change > 1e-3:
            gone.add(name)
    assert kept == expected
    assert gone == found.keys() - expected
    # and the expressions that the summary reports are these
    inside = np.ascontiguousarray(np.ldexp(states, -np.array(system.state_exponents)).T)
    for invariant in system.invariants:
        if invariant.numerical:
            continue
        values = hy.cfunc(invariant.expressions, system.variables)(inside)
        values = np.ldexp(values, np.array(invariant.exponents)[:, None])
        ours = found[invariant.name].reshape(len(times), -1).T
        np.testing.assert_allclose(values - values[:, :1], ours - ours[:, :1], rtol=0, atol=10 * bound)
