"""Names of loads in expressions, against Kepler's equation."""

from collections.abc import Callable
from typing import Any

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
    "inclination = 0.9, ascending_node = 0.3, periapsis = 0.5, mean_anomaly = 0.7, node_rate = 1e-4}"
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
B_DOT = [f"-k*{x}" for x in ("dbx", "dby", "dbz")]


def magnet(*moment: str) -> str:
    row = ", ".join(f'"{x}"' for x in moment)
    return f'kind = "magnetic_dipole"\nmoment = [{row}]\nsource_moment = {DIPOLE.tolist()}\n{ORBIT}'


def place(t: Any) -> list[Any]:
    """Of the source, space axes."""
    ellipse = on_ellipse(mpmath.mp, 7e6, 0.02, 0.7 + mpmath.sqrt(MU / mpmath.mpf(7e6) ** 3) * t)
    return turned(mpmath.mp, ellipse, (0.5, 3), (0.9, 1), (0.3 + t / 10000, 3))


def field(t: Any) -> list[Any]:
    """Of the dipole, T, space axes (Jackson, eq. 5.56)."""
    x = place(t)
    far = mpmath.sqrt(mpmath.fdot(x, x))
    along = 3 * mpmath.fdot(DIPOLE.tolist(), x) / far**2
    return [(along * a - d) * 1e-7 / far**3 for a, d in zip(x, DIPOLE.tolist(), strict=True)]


def pointed(u: np.ndarray, far: float, b: np.ndarray, change: np.ndarray) -> np.ndarray:
    return np.array([-2e-6 * u[2], 1e-6 * u[0] * (far / 7e6) ** 2, 2e-6 * u[1]])


def braked(u: np.ndarray, far: float, b: np.ndarray, change: np.ndarray) -> np.ndarray:
    return np.cross(-500 * change, b)


@pytest.mark.parametrize(("loaded", "law"), [(TOWARDS, pointed), (magnet(*B_DOT), braked)])
def test_names_are_what_the_body_sees(loaded: str, law: Callable[..., np.ndarray]) -> None:
    """Where the orbit begins, at ten attitudes and rates, while its plane turns."""
    system = prepared(BODY, START, loads(EARTH, loaded), parameters='k = "500 A m^2 s/T"').system
    begun = np.ldexp([float(x) for x in system.initial], system.state_exponents)
    source = np.array(place(0), dtype=float)
    with mpmath.workdps(40):
        moving = np.array([mpmath.diff(lambda t, n=n: field(t)[n], 0) for n in range(3)], dtype=float)
    far, random, moments = np.linalg.norm(source), Random(3), np.array([0.03, 0.034, 0.01])
    for _ in range(10):
        w, q = random.vector(), random.quaternion()
        u, b = (matrix(q).T @ x for x in (source / far, np.array(field(0), dtype=float)))
        turning = law(u, far, b, matrix(q).T @ moving + np.cross(b, w))
        turning = turning + 3 * MU / far**3 * np.cross(u, moments * u)
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
