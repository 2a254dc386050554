"""Averages over the rotation and over orbits: closed forms against sums, and what forbids them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from equations import EPS, Random, matrix
from scipy.integrate import solve_ivp
from support import config

from rigidsim.errors import ConfigError
from rigidsim.model.averaged.free_motion import FreeMotion, free_motion
from rigidsim.model.averaged.orbit_terms import Ellipse, OrbitPlace, nutation, plane_vectors, second_order
from rigidsim.model.averaged.spectrum import body_spectrum
from rigidsim.scene.arithmetic import context_for, dot
from rigidsim.scene.bodies.body import RigidBody
from rigidsim.scene.config import parse
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.solve.problem import InitialValueProblem, prepare

CONTEXT = context_for("double")
MOMENTS = np.array([1.0, 2.0, 2.5])
MOMENTA = {
    "about the largest": [0.3, 0.5, 1.5],
    "about the least, backwards": [-1.5, -0.4, 0.3],
    "nearly principal": [1e-9, 0.0, 1.0],
    "near the separatrix": [0.2, 0.9, 0.1],
}


def body(moments: np.ndarray) -> RigidBody:
    zero, values = CONTEXT.zero, [CONTEXT.mpf(float(x)) for x in moments]
    axes = [[CONTEXT.mpf(i == j) for j in range(3)] for i in range(3)]
    tensor = [[values[i] if i == j else zero for j in range(3)] for i in range(3)]
    return RigidBody(None, [zero] * 3, tensor, values, axes, "test")


def motion_of(momentum: list[float], moments: np.ndarray = MOMENTS) -> FreeMotion:
    return free_motion(CONTEXT, body(moments), [CONTEXT.mpf(x) for x in momentum])


def euler(momentum: np.ndarray, moments: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Attitudes (n, 3, 3), body axes to a frame whose z axis is along the momentum, integrated."""
    size = float(np.linalg.norm(momentum))
    z = momentum / size
    x = np.cross([0.3, 1.0, 0.2], z)
    x /= np.linalg.norm(x)
    start = np.array([x, np.cross(z, x), z])

    def rate(_: float, flat: np.ndarray) -> np.ndarray:
        attitude = flat.reshape(3, 3)
        w = size * attitude[2] / moments
        skew = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.asarray((attitude @ skew).ravel())

    found = solve_ivp(rate, (0, times[-1]), start.ravel(), t_eval=times, rtol=1e-11, atol=1e-13)
    return np.asarray(found.y.T.reshape(-1, 3, 3))


@pytest.mark.parametrize("momentum", MOMENTA.values(), ids=MOMENTA)
def test_the_tensor_turns_as_its_harmonics_say(momentum: list[float]) -> None:
    motion = motion_of(momentum)
    spectrum = body_spectrum(motion)
    times = np.linspace(0, 7, 6)
    principal = np.array([[float(x) for x in axis] for axis in motion.axes]).T
    attitudes = euler(np.array(momentum), MOMENTS, times)
    phases = spectrum.phases(attitudes[0] @ principal)
    axial = spectrum.harmonics[0, 0].real
    mean = np.diag([-axial / 2, -axial / 2, axial]) + np.eye(3) * MOMENTS.sum() / 3
    # the mean tensor is elliptic integrals' in one place and a sum over 256 points in the other
    assert 1.5 * axial == pytest.approx(float(motion.excess), abs=100 * EPS)
    for time, attitude in zip(times, attitudes, strict=True):
        angles = [p + r * time for p, r in zip(phases, spectrum.rates, strict=True)]
        oscillating, integral = spectrum.tensors(*angles)
        true = attitude @ np.diag(MOMENTS) @ attitude.T
        # what the integrator's tolerance, 1e-11 a step, leaves over some hundred steps
        np.testing.assert_allclose(mean + oscillating, true, atol=1e-9)
        step = 1e-4
        later = spectrum.tensors(*(a + r * step for a, r in zip(angles, spectrum.rates, strict=True)))[1]
        before = spectrum.tensors(*(a - r * step for a, r in zip(angles, spectrum.rates, strict=True)))[1]
        # central differences of a function with rates of order one: step^2 / 6 times 2^3 and more
        np.testing.assert_allclose((later - before) / (2 * step), oscillating, atol=1e-6)
        assert np.abs(integral).max() < 10


def orbit(eccentricity: str) -> KeplerOrbit:
    m = CONTEXT.mpf
    values = [m(eccentricity), m("0.4"), m("0.7"), m("1.1"), m("0.2")]
    return KeplerOrbit(m(1), *values, m(0), m(0), m(2))


S = np.array([0.1, 0.5, math.sqrt(1 - 0.26)])


def source(eccentricity: str, time: float) -> tuple[np.ndarray, OrbitPlace]:
    """(a/r)^3 r r^T, and the place."""
    elements = orbit(eccentricity)
    anomaly = elements.eccentric_anomaly(CONTEXT, CONTEXT.mpf(time))
    cosine, sine = CONTEXT.cos, CONTEXT.sin
    angles = elements.inclination, elements.ascending_node, elements.periapsis
    tilt, node, periapsis = ((cosine(x), sine(x)) for x in angles)
    place = OrbitPlace(cosine(anomaly), sine(anomaly), *plane_vectors(tilt, node, periapsis))
    e, c, s = float(eccentricity), float(place.cosine), float(place.sine)
    along, across = (np.array([float(x) for x in v]) for v in (place.pericentre, place.across))
    vector = (c - e) * along + math.sqrt(1 - e * e) * s * across
    return np.outer(vector, vector) / np.linalg.norm(vector) ** 5, place


def nod(eccentricity: str, time: float, s: np.ndarray = S) -> np.ndarray:
    place = source(eccentricity, time)[1]
    vector = [CONTEXT.mpf(float(x)) for x in s]
    ellipse = Ellipse.of(CONTEXT, orbit(eccentricity))
    size = CONTEXT.mpf(3) / (2 * ellipse.motion * ellipse.root**3)
    found = nutation(CONTEXT, ellipse, place, size, vector, lambda x: x)
    return np.array([float(x) for x in found])


def rate(eccentricity: str, time: float, s: np.ndarray = S) -> np.ndarray:
    """s' less its mean, for k = 3."""
    mean = float(Ellipse.of(CONTEXT, orbit(eccentricity)).secular_factor)
    normal = np.array([float(x) for x in orbit(eccentricity).normal(CONTEXT)])
    whole = 3 * np.cross(source(eccentricity, time)[0] @ s, s)
    return np.asarray(whole + 3 * mean * (normal @ s) * np.cross(normal, s))


@pytest.mark.parametrize("eccentricity", ["0", "0.3", "0.6"])
def test_second_order_is_the_mean_of_the_torque_on_the_nutation(eccentricity: str) -> None:
    """<DF u>, summed over a turn by differences, against grad K x s."""
    step, total = 1e-6, np.zeros(3)
    turn = np.linspace(0, np.pi, 200, endpoint=False)
    for time in turn:
        u = nod(eccentricity, time)
        change = rate(eccentricity, time, S + step * u) - rate(eccentricity, time, S - step * u)
        total += change / (2 * step) / len(turn)
    normal = np.array([float(x) for x in orbit(eccentricity).normal(CONTEXT)])
    place = source(eccentricity, 0.0)[1]
    p, t = (np.array([float(x) for x in v]) for v in (place.pericentre, place.across))
    x, y, z = S @ p, S @ t, S @ normal
    steady, across = (c / 2 for c in second_order(float(eccentricity)))  # n = 2
    gradient = (
        9
        / 4
        * (
            (steady * (x * x - y * y) + across * (x * x + y * y)) * normal
            + 2 * z * (steady * (x * p - y * t) + across * (x * p + y * t))
        )
    )
    # what differences of a quadratic function round, and the part of u along s, which is of third order
    np.testing.assert_allclose(total, np.cross(gradient, S), atol=1e-7)
    # a sum over 4096 points of an analytic function, and the closed form that tables take
    assert -2 * across == pytest.approx(float(Ellipse.of(CONTEXT, orbit(eccentricity)).across), rel=1e-12)


# --- which scenes have averages ---------------------------------------------------------------------------

BODY = "principal_moments = [1, 1.1, 1.3]"
START = 'angular_velocity = [0, 0, 100]\neuler_angles = [0.3, "20 deg", 0]'
GRADIENT = 'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
KEPLER = GRADIENT + "orbit = {semi_major_axis = 1, eccentricity = 0.1}"


def averaged(
    start: str = START,
    loads: str = KEPLER,
    *,
    level: str = "orbit_averaged",
    inertia: str = BODY,
    integrator: str = "",
    output: str = "",
    more: str = "",
) -> InitialValueProblem:
    model = f'[model]\nlevel = "{level}"\n{more}'
    return prepare(parse(config(inertia, start, loads, "end = 10\nsamples = 11", integrator, output, model)))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"start": START.replace("0, 0, 100", "0, 100, 0")}, "intermediate axis"),
        ({"start": START.replace("100", "0")}, "starts at rest"),
        ({"loads": ""}, "no torque acts"),
        ({"inertia": "principal_moments = [1, 1, 1]"}, "moments are all the same"),
        ({"loads": KEPLER + '\n[[loads]]\nkind = "viscous_torque"\ncoefficients = [1, 1, 1]'}, "no gravity"),
        ({"integrator": 'formulation = "quaternion"'}, 'formulation = "quaternion"'),
        ({"integrator": "accuracy = 1e-6"}, "accuracy is the attitude's"),
        ({"integrator": "hold_invariants = true"}, "hold_invariants = true"),
        ({"output": "lyapunov = true"}, "lyapunov"),
        ({"more": '[[events]]\nname = "up"\nexpression = "wz"'}, "[[events]]"),
        ({"loads": GRADIENT + 'ephemeris = "sun"'}, 'choose "spin_averaged"'),
        ({"loads": KEPLER[:-1] + ', inclination = 1, node_rate = "0.2 rad/s"}'}, "node and periapsis move"),
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_what_has_no_average_is_refused_with_the_reason(given: dict[str, str], said: str) -> None:
    with pytest.raises(ConfigError, match=r"\[model\] level: given \"orbit_averaged\", but ") as found:
        averaged(**given)  # type: ignore[arg-type]
    assert said in str(found.value)
    assert "choose" in str(found.value)


@pytest.mark.parametrize("name", ["quaternion", "angular_velocity", "rotation_angle", "polar_motion"])
def test_what_needs_every_rotation_is_refused_with_the_remedy(name: str) -> None:
    with pytest.raises(ConfigError, match=f'given "{name}": needs every rotation.*choose level = "full"'):
        averaged(output=f'record = ["{name}"]')


def test_a_tumbling_bodys_figure_axis_points_nowhere() -> None:
    tumbling = START.replace("0, 0, 100", "60, 20, 80")
    with pytest.raises(ConfigError, match="figure axis points nowhere on average; record momentum_axis"):
        averaged(tumbling, output='record = ["figure_axis"]')
    names = {r.name for r in averaged(tumbling).system.recorded}
    assert names == {"angular_momentum", "angular_momentum_norm", "energy"}


def test_the_right_hand_side_is_the_averaged_torque() -> None:
    """Ward 1974, with the orbit's factor and the mean tensor, in a frame where nothing is special."""
    random = Random(3)
    q = random.quaternion()
    start = f"angular_velocity = [0, 0, 1e4]\nquaternion = {q.tolist()}"
    elements = 'semi_major_axis = 2, eccentricity = 0.4, inclination = "50 deg", ascending_node = 1.2'
    system = averaged(start, GRADIENT + f"orbit = {{{elements}}}").system
    from equations import derivative

    s = matrix(q)[:, 2]
    tilt, node = math.radians(50), 1.2
    normal = np.array([math.sin(tilt) * math.sin(node), -math.sin(tilt) * math.cos(node), math.cos(tilt)])
    size = 1.5 / 8 * (1.3 - 1.05) / (1.3 * 1e4) * (1 - 0.16) ** -1.5
    # second order: k / n of it, 1e-5
    expected = -size * (normal @ s) * np.cross(normal, s)
    np.testing.assert_allclose(derivative(system, s), expected, atol=3e-5 * size)
    assert dot(list(derivative(system, s)), list(s)) == pytest.approx(0, abs=EPS * size)
