"""Names of loads in expressions, against Kepler's equation."""

from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from equations import CLOSE, Random, derivative, matrix, prepared
from kepler import on_ellipse, turned
from support import config, run_text

from rigidsim import ConfigError

BODY = "principal_moments = [0.03, 0.034, 0.01]"
START = "angular_velocity = [0.5, -0.6, 0.7]\nquaternion = [1, 0.2, 0.1, -0.3]"
MU = 3.986004418e14
ORBIT = (
    f"gravitational_parameter = {MU:.10g}\norbit = {{semi_major_axis = 7e6, eccentricity = 0.02, "
    "inclination = 0.9, ascending_node = 0.3, periapsis = 0.5, mean_anomaly = 0.7}"
)
DIPOLE = np.array([1e22, -2e22, -7.7e22])
EARTH = f'kind = "gravity_gradient"\nname = "earth"\nradius = "6378 km"\n{ORBIT}'
SUN_ORBIT = 'orbit = {semi_major_axis = "149.6e6 km", eccentricity = 0.0167, mean_anomaly = 5}'
SUN = f'kind = "gravity_gradient"\nname = "sun"\ngravitational_parameter = 1.327e20\n{SUN_ORBIT}'


def loads(*tables: str) -> str:
    return "\n[[loads]]\n".join(tables)


def torque(*components: str) -> str:
    return 'kind = "torque"\ncomponents = [' + ", ".join(f'"{x}"' for x in components) + "]"


# --- directions, distances and the magnetic field -----------------------------------------------------------

TOWARDS = torque("-2e-6*uz_earth", "1e-6*ux_earth*(r_earth/(7e6 m))^2", "2e-6*uy_earth")
PAIRS = (("wz*by", "wy*bz"), ("wx*bz", "wz*bx"), ("wy*bx", "wx*by"))
B_DOT = [f"-k*({a} - {b})" for a, b in PAIRS]


def magnet(*moment: str) -> str:
    row = ", ".join(f'"{x}"' for x in moment)
    return f'kind = "magnetic_dipole"\nmoment = [{row}]\nsource_moment = {DIPOLE.tolist()}\n{ORBIT}'


def pointed(w: np.ndarray, u: np.ndarray, far: float, field: np.ndarray) -> np.ndarray:
    return np.array([-2e-6 * u[2], 1e-6 * u[0] * (far / 7e6) ** 2, 2e-6 * u[1]])


def braked(w: np.ndarray, u: np.ndarray, far: float, field: np.ndarray) -> np.ndarray:
    """A moment against db/dt = b x w of a field at rest."""
    return np.cross(-500 * np.cross(field, w), field)


@pytest.mark.parametrize(("loaded", "law"), [(TOWARDS, pointed), (magnet(*B_DOT), braked)])
def test_names_are_what_the_body_sees(loaded: str, law: Callable[..., np.ndarray]) -> None:
    """Where the orbit begins, at ten attitudes and rates; the field of a dipole is Jackson's, eq. 5.56."""
    system = prepared(BODY, START, loads(EARTH, loaded), parameters='k = "500 A m^2 s/T"').system
    begun = np.ldexp([float(x) for x in system.initial], system.state_exponents)
    place = turned(mpmath.mp, on_ellipse(mpmath.mp, 7e6, 0.02, 0.7), (0.5, 3), (0.9, 1), (0.3, 3))
    source = np.array([float(x) for x in place])
    far, random, moments = np.linalg.norm(source), Random(3), np.array([0.03, 0.034, 0.01])
    field = 1e-7 / far**3 * (3 * (DIPOLE @ source) * source / far**2 - DIPOLE)
    for _ in range(10):
        w, q = random.vector(), random.quaternion()
        u = matrix(q).T @ source / far
        turning = law(w, u, far, matrix(q).T @ field) + 3 * MU / far**3 * np.cross(u, moments * u)
        expected = (turning - np.cross(w, moments * w)) / moments
        found = derivative(system, np.concatenate([w, q, begun[7:]]))[:3]
        np.testing.assert_allclose(found, expected, rtol=0, atol=10 * CLOSE)


# --- what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (loads(EARTH, torque("ux_sun", "0", "0")), "ux_NAME, uy_NAME, uz_NAME, r_NAME with a load"),
        (
            loads(EARTH, torque("1e-9*bx", "0", "0")),
            "bx, by, bz and dbx, dby, dbz with the field of a magnetic_dipole",
        ),
        (loads(EARTH, torque("1e-9*shadow_earth", "0", "0")), "another one whose source has a radius"),
        (loads(EARTH, EARTH), 'two loads are named "earth"'),
        (
            loads(EARTH, f'{SUN}\n[[events]]\nname = "a"\nexpression = "shadow_sun - 0.5"'),
            '"shadow_sun" jumps',
        ),
    ],
)
def test_what_makes_no_sense_is_refused(given: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        run_text(config(BODY, START, given, "end = 1\nsamples = 2"))
    assert message in str(caught.value)
