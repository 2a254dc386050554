"""Relative equilibria and Cassini states: closed forms, and independent equations that come back."""

from collections.abc import Sequence

import mpmath
import numpy as np
import pytest
import xarray

import rigidsim
from rigidsim import ConfigError
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.scene.scene import Scene, build_scene
from tests.support import cases, run_text

YEAR = 31557600.0
CONFIG = """
name = "start"
[body]
{body}
[initial]
equilibrium = "{name}"
{start}
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = {strength}
[loads.orbit]
{orbit}
{more}
[time]
end = {end}
samples = {samples}
[output]
record = ["quaternion", "angular_velocity"]
"""
MOON = {
    "body": 'preset = "moon"',
    "name": "cassini_2",
    "strength": "3.986004418e14",
    "orbit": 'semi_major_axis = "384400 km"\ninclination = "5.145 deg"\nperiod = "27.2122 day"\n'
    'node_rate = "-19.34 deg/yr"',
}
ELLIPSE = MOON["orbit"].replace("27.2122", "27.554550") + (
    '\neccentricity = 0.0549\nperiapsis = 1.0\nperiapsis_rate = "60.03 deg/yr"'
)
SATELLITE = {
    "body": "principal_moments = [900, 1000, 400]",
    "name": "relative",
    "strength": "3.986004418e14",
    "orbit": "semi_major_axis = 6.9e6\ninclination = 0.9\nascending_node = 0.3\nmean_anomaly = 0.4",
}
RATE = np.sqrt(3.986004418e14 / 6.9e6**3)


def config(given: dict[str, str], **changes: str) -> str:
    usual = {"start": "", "more": "", "end": "1", "samples": "2"}
    return CONFIG.format(**(usual | given | changes))


def scene_of(given: dict[str, str], *overrides: str, **changes: str) -> Scene:
    return build_scene(rigidsim.parse(config(given, **changes), overrides=overrides))


def matrix_of(q: np.ndarray) -> np.ndarray:
    """Rotation matrix, body to space, of a quaternion."""
    w, v = q[0], q[1:]
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]], dtype=q.dtype)
    return np.eye(3, dtype=q.dtype) + 2 * w * cross + 2 * cross @ cross


# --- relative equilibria ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("turn", "stable"), [((1.5, 1.4, 0.1), False), ((2.0, 0.4, 1.2), True)])
def test_the_attitude_nearest_to_the_given_one_and_its_exponents(turn: Sequence[float], stable: bool) -> None:
    """All axes along source, forward or normal. Exponents of DeBra & Delp: of roll and yaw the roots of
    s^4 + n^2 (1 + 3 sx + sx sz) s^2 + 4 n^4 sx sz, with those of pitch, s^2 = 3 n^2 (Iz - Ix) / Iy.
    """
    scene = scene_of(SATELLITE, start=f"euler_angles = {list(turn)}")
    frame = _frame(np.array([float(x) for x in scene.quaternion]))
    assert np.sort(np.abs(frame).ravel()) == pytest.approx([0] * 6 + [1] * 3, abs=1e-15)
    z, x, y = np.array([900.0, 1000.0, 400.0]) @ np.abs(frame)
    sx, sz = (y - z) / x, (y - x) / z
    roots = np.roots([1, 0, 1 + 3 * sx + sx * sz, 0, 4 * sx * sz])
    expected = RATE * np.append(roots, np.roots([1, 0, 3 * (x - z) / y]))
    expected = expected[expected.imag > -1e-9 * RATE]
    found = scene.found_start
    assert found.stable == stable == bool(np.all(np.abs(expected.real) < 1e-9 * RATE))
    for n, values in enumerate([expected.real, expected.imag]):
        told = np.sort([pair[n] for pair in found.exponents])
        np.testing.assert_allclose(told, np.sort(values), rtol=0, atol=1e-13 * RATE)


def _frame(q: np.ndarray) -> np.ndarray:
    """Source, forward and normal (columns) in body axes, by the orbit's elements of the satellite."""
    c, s = np.cos, np.sin
    node, tilt, anomaly = 0.3, 0.9, 0.4
    source = np.array([
        c(node) * c(anomaly) - s(node) * c(tilt) * s(anomaly),
        s(node) * c(anomaly) + c(node) * c(tilt) * s(anomaly),
        s(tilt) * s(anomaly),
    ])  # fmt: skip
    normal = np.array([s(tilt) * s(node), -s(tilt) * c(node), c(tilt)])
    return matrix_of(q).T @ np.array([source, np.cross(normal, source), normal]).T


def test_rotors_of_both_kinds_lean_it_where_independent_torques_balance() -> None:
    """(I w + sum of J s a) x w = 3 n^2 (I c) x c at the start, by numpy; and the body rests for a day."""
    rotors = (
        '\n[[rotors]]\nname = "kept"\naxis = [1, 0.2, 0.1]\nmoment = 0.1\nrate = 0.3\nfixed = true\n'
        '[[rotors]]\nname = "free"\naxis = [0, 0.2, 1]\nmoment = 0.1\nrate = 0.5\n'
    )
    run = run_text(
        config(SATELLITE, more=rotors, end="86400", samples="5").replace('["quat', '["nadir", "quat')
    )
    w, c = run.dataset["angular_velocity"].values, run.dataset["nadir"].values
    inertia, a, b = np.diag([900.0, 1000.0, 400.0]), np.array([1, 0.2, 0.1]), np.array([0, 0.2, 1])
    momentum = inertia @ w[0] + 0.03 * a / np.linalg.norm(a) + 0.05 * b / np.linalg.norm(b)
    torque = np.cross(momentum, w[0]) + 3 * RATE**2 * np.cross(c[0], inertia @ c[0])
    np.testing.assert_allclose(torque, 0, atol=1e-15 * 1000 * RATE**2)
    np.testing.assert_allclose(w, w[:1].repeat(5, axis=0), rtol=0, atol=1e-12 * RATE)
    np.testing.assert_allclose(c, c[:1].repeat(5, axis=0), rtol=0, atol=1e-12)


# --- Cassini states -----------------------------------------------------------------------------------------


def exact(dataset: xarray.Dataset, row: int) -> list[mpmath.mpf]:
    parts = [dataset[part].values[row] for part in parts_in(dataset, "quaternion")]
    return [mpmath.fsum(map(float, values)) for values in zip(*parts, strict=True)]


@pytest.mark.parametrize(
    ("precision", "close"), [("double", 1e-13), pytest.param("50", 1e-46, marks=pytest.mark.campaign)]
)
def test_the_moon_comes_back_after_each_revolution(precision: str, close: float) -> None:
    """In the frame that turns with the node, after 1, 2, ... 8 draconic months: no free libration at all."""
    text = config(MOON, end='"217.6976 day"', samples="9")
    data = run_text(text, f"integrator.precision={precision}").dataset
    with mpmath.workdps(70):
        first = exact(data, 0)
        for row in range(1, 9):
            half = -mpmath.mpf("19.34") * mpmath.pi / 180 / YEAR * row * mpmath.mpf("27.2122") * 86400 / 2
            c, s = mpmath.cos(half), mpmath.sin(half)
            w, x, y, z = first
            turned = [c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w]
            now = exact(data, row)
            sign = mpmath.sign(sum(a * b for a, b in zip(turned, now, strict=True)))
            away = mpmath.norm([a - sign * b for a, b in zip(turned, now, strict=True)])
            assert away < close


@pytest.mark.slow
def test_the_moons_state_is_the_observed_one_with_its_librations() -> None:
    """1.543 deg to the ecliptic (Williams et al. 2014), on a circle and on the Moon's own ellipse: 2 %.

    Free librations of 2.9, 24 and 75 years (Rambaux & Williams 2011, Celest. Mech. Dyn. Astr. 109, 85).
    """
    found = scene_of(MOON).found_start
    periods = [2 * np.pi / i / YEAR for _, i in found.exponents]
    assert periods == pytest.approx([74.6, 24.16, 2.89], rel=0.02)
    assert found.stable
    assert "6.68" in found.described
    assert "1.53" in found.described
    scene = scene_of(MOON, orbit=ELLIPSE)
    pole = matrix_of(np.array([float(x) for x in scene.quaternion]))[:, 2]
    assert np.degrees(np.arccos(pole[2])) == pytest.approx(1.543, rel=0.03)


@pytest.mark.slow
def test_a_triaxial_planet_out_of_step_starts_by_its_mean_moments() -> None:
    """Mars' own moments, and the mean of both: one start."""
    orbit = 'semi_major_axis = "1.523679 au"\ninclination = "1.67 deg"\nnode_rate = "-17.6 arcsec/yr"'
    given = {"name": "cassini_2", "strength": "1.32712440018e20", "orbit": orbit}
    bodies = ('preset = "mars"', "principal_moments = [0.99461983, 0.99461983, 1]")
    own, mean = (scene_of(given | {"body": body}, start='spin_period = "24.622962 h"') for body in bodies)
    pole, other = (matrix_of(np.array([float(x) for x in s.quaternion]))[:, 2] for s in (own, mean))
    np.testing.assert_allclose(pole, other, atol=1e-10)
    assert own.body.principal_moments[0] != own.body.principal_moments[1]


@pytest.mark.slow
def test_mercurys_state_in_three_turns_to_two_revolutions() -> None:
    """2.04(8) arcmin from the orbit's normal (Margot et al. 2012), whose moments the preset has."""
    orbit = 'semi_major_axis = "57909050 km"\neccentricity = 0.20563\ninclination = "8.58 deg"\n'
    orbit += 'period = "87.969257 day"\nnode_rate = "-1.1e-3 deg/yr"'
    given = {
        "body": 'preset = "mercury"',
        "name": "cassini_1",
        "strength": "1.32712440018e20",
        "orbit": orbit,
    }
    scene = scene_of(given, start='spin_period = "58.646 day"')
    pole = matrix_of(np.array([float(x) for x in scene.quaternion]))[:, 2]
    tilt = np.radians(8.58)
    normal = np.array([0.0, -np.sin(tilt), np.cos(tilt)])
    assert 60 * np.degrees(np.arcsin(np.linalg.norm(np.cross(pole, normal)))) == pytest.approx(2.04, rel=0.04)
    assert "3:2" in scene.found_start.described


PLANET = {
    "body": "principal_moments = [0.997, 0.997, 1]",
    "strength": "1",
    "orbit": "semi_major_axis = 1\ninclination = 0.35\nnode_rate = {rate}\nascending_node = 0.7",
    "start": "spin_period = 0.3",
}


@pytest.mark.parametrize("number", cases([1, 2, 3, 4], []))
def test_a_planet_of_two_equal_moments_has_colombos_states(number: int) -> None:
    """cos th sin th 3 n^2 (C - A)/(2 C w) + g sin(th - I) = 0 (Colombo 1966), to first order in the averages;
    and each revolution brings the pole back in the node's frame to the last digit.
    """
    rate = -1e-5
    given = PLANET | {"name": f"cassini_{number}", "orbit": PLANET["orbit"].format(rate=rate)}
    spin = 2 * np.pi / 0.3
    angles = np.linspace(-np.pi, np.pi, 400_001)
    torque = 1.5 * 0.003 / spin
    values = torque * np.cos(angles) * np.sin(angles) + rate * np.sin(angles - 0.35)
    roots = angles[:-1][np.sign(values[:-1]) != np.sign(values[1:])]
    assert len(roots) == 4
    state_3, state_4, state_1, state_2 = roots
    expected = {1: state_1, 2: state_2, 3: state_3, 4: state_4}[number]
    data = run_text(config(given, end=str(20 * np.pi), samples="11")).dataset
    poles = np.array([matrix_of(q)[:, 2] for q in data["quaternion"].values])
    turned = (poles[:, 0] + 1j * poles[:, 1]) * np.exp(-1j * (0.7 + rate * data["time"].values))
    np.testing.assert_allclose(turned, turned[0], rtol=0, atol=2e-13)
    lean = np.arctan2(-turned[0].imag, poles[0, 2]) - (0.35 - expected)
    assert abs((lean + np.pi) % (2 * np.pi) - np.pi) < 2e-3
    # s' = alpha (s . n) s x n + g s x k about the state
    tilt, k = 0.35 - expected, np.array([0.0, 0.0, 1.0])
    pole, normal = (np.array([0.0, -np.sin(x), np.cos(x)]) for x in (tilt, 0.35))
    slope = lambda s: torque * (s @ normal) * np.cross(s, normal) + rate * np.cross(s, k)  # noqa: E731
    basis = [np.array([1.0, 0.0, 0.0]), np.cross(pole, [1.0, 0.0, 0.0])]
    jacobian = [[(slope(pole + 1e-6 * b) - slope(pole - 1e-6 * b)) @ a / 2e-6 for b in basis] for a in basis]
    values = np.linalg.eigvals(np.array(jacobian))
    told = scene_of(given).found_start
    found = [complex(*pair) for pair in told.exponents]
    assert max(x.real for x in found) == pytest.approx(values.real.max(), rel=0.02, abs=1e-12)
    assert max(x.imag for x in found) == pytest.approx(values.imag.max(), rel=0.02, abs=1e-12)
    assert told.stable == (number != 4)


@pytest.mark.parametrize(
    ("given", "changes", "where", "what"),
    [
        (SATELLITE, {"start": "angular_velocity = [0, 0, 1]"}, "angular_velocity", "with equilibrium"),
        (SATELLITE, {"orbit": "semi_major_axis = 7e6\neccentricity = 0.1"}, "equilibrium", "eccentricity is"),
        (SATELLITE, {"orbit": MOON["orbit"]}, "equilibrium", 'choose "cassini_1"'),
        (SATELLITE, {"more": '\n[[loads]]\nkind = "torque"\ncomponents = ["1e-4*sin(t)", "0", "0"]'},
         "equilibrium", "changes relative to the turning frame"),
        (SATELLITE, {"more": '\n[[loads]]\nkind = "torque"\ncomponents = ["9", "9", "9"]'},
         "equilibrium", "none was found"),
        (SATELLITE, {"body": "principal_moments = [1, 1, 1]"}, "equilibrium", "rests in any attitude"),
        (SATELLITE, {"body": 'principal_moments = ["1 + t", 2, 2.5]'}, "equilibrium", "moments vary"),
        (SATELLITE, {"more": '\n[[states]]\nname = "sum"\nderivative = "wy"\n[[loads]]\nkind = "torque"\n'
         'components = ["1e-9*sum", "0", "0"]'}, "equilibrium", "the state sum changes in this equilibrium"),
        (SATELLITE, {"name": "cassini_1"}, "equilibrium", "node is at rest"),
        (MOON, {"name": "cassini_1"}, "equilibrium", "there are cassini_2 (6.6"),
        (MOON, {"start": 'spin_period = "-27 day"'}, "spin_period", "given a negative time"),
        (MOON, {"body": "principal_moments = [1, 1, 1.01]"}, "spin_period", "missing"),
        (MOON, {"body": "principal_moments = [1, 1.5, 1.5]"}, "equilibrium", "no axis has the largest"),
        (MOON, {"orbit": MOON["orbit"].replace("5.145", "0")}, "equilibrium", "isn't inclined"),
        (MOON, {"more": '\n[[loads]]\nkind = "viscous_torque"\ncoefficients = [1, 1, 1]'},
         "equilibrium", "nothing else"),
    ],
)  # fmt: skip
def test_equilibria_that_a_scene_has_not_are_refused(
    given: dict[str, str], changes: dict[str, str], where: str, what: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        scene_of(given, **changes)
    (problem,) = refused.value.problems
    assert problem.where == f"[initial] {where}"
    assert what in problem.what
