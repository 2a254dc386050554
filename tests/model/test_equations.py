"""The symbolic equations and observables, evaluated, against mechanics written a second time in numpy."""

from typing import Any

import mpmath
import numpy as np
import pytest
from equations import (
    CLOSE,
    EPS,
    GRAVITY,
    Random,
    array,
    derivative,
    general_body,
    matrix,
    observed,
    prepared,
    skew,
)
from scipy.spatial.transform import Rotation
from support import config

import rigidsim
from rigidsim.scene.fields import EULER_SEQUENCES


@pytest.mark.parametrize("formulation", ["quaternion", "rotation_matrix", "euler_angles", "rates"])
def test_gravity_about_a_fixed_point(formulation: str) -> None:
    """I w' = (I w) x w + com x (M R^T g), and of the vertical alone g' = g x w (Euler-Poisson)."""
    random = Random(100)
    tensor, center, mass = random.tensor(), random.vector(), 1.7
    pull = random.vector(9.0)
    system = prepared(
        general_body(tensor, mass, center),
        f"angular_velocity = {array(random.vector())}\nquaternion = {array(random.quaternion())}",
        GRAVITY + f"acceleration = {array(pull)}",
        integrator=f'formulation = "{formulation}"',
    ).system
    w, q = random.vector(), random.quaternion()
    r = matrix(q)
    up = -r.T @ pull / np.linalg.norm(pull)
    attitude = {
        "quaternion": q,
        "rotation_matrix": r.ravel(),
        "euler_angles": Rotation.from_matrix(r).as_euler("ZXZ"),
        "rates": up,
    }[formulation]
    got = derivative(system, np.concatenate([w, attitude]))
    torque = np.cross(center, mass * r.T @ pull)
    expected = np.linalg.solve(tensor, np.cross(tensor @ w, w) + torque)
    amplification = np.linalg.norm(np.linalg.inv(tensor)) * (np.linalg.norm(tensor) + 20)
    np.testing.assert_allclose(got[:3], expected, rtol=0, atol=CLOSE * amplification)
    if formulation == "rates":
        np.testing.assert_allclose(got[3:], np.cross(up, w), rtol=0, atol=CLOSE)


def turn(axis: str, angle: Any) -> Any:
    """Elementary rotation in mpmath, written out by hand."""
    c, s = mpmath.cos(angle), mpmath.sin(angle)
    rows = {
        "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }
    return mpmath.matrix(rows[axis])


@pytest.mark.parametrize("sequence", EULER_SEQUENCES[::3])
def test_euler_kinematics(sequence: str) -> None:
    """d/dt R(angles) = R [w]x, the derivative taken along the angles' rates at forty digits."""
    random = Random(7)
    system = prepared(
        "principal_moments = [1, 2, 2.5]",
        "angular_velocity = [0.1, 1, 0.05]\neuler_angles = [0.3, 0.7, -0.4]",
        integrator=f'formulation = "euler_angles"\neuler_sequence = "{sequence}"',
    ).system
    for _ in range(5):
        w = random.vector()
        angles = np.array([random.vector(3)[0], random.generator.uniform(0.3, 1.2), random.vector(3)[0]])
        rates = derivative(system, np.concatenate([w, angles]))[3:]
        with mpmath.workdps(40):
            step = mpmath.mpf(10) ** -12  # central difference: error h^2/6 = 2e-25, roundings 1e-28

            def attitude(t: Any, angles: np.ndarray = angles, rates: np.ndarray = rates) -> Any:
                a, b, c = (mpmath.mpf(x) + t * mpmath.mpf(v) for x, v in zip(angles, rates, strict=True))
                return turn(sequence[0], a) * turn(sequence[1], b) * turn(sequence[2], c)

            change = (attitude(step) - attitude(-step)) / (2 * step)
            expected = attitude(0) * mpmath.matrix(skew(w).tolist())
            # the rates' own rounding, times 1/sin or 1/cos of the middle angle, at most 3.4
            assert mpmath.mnorm(change - expected, mpmath.inf) <= 4 * CLOSE


@pytest.mark.parametrize("size", [1.0, 1e-5])
def test_observables_of_a_heavy_body(size: float) -> None:
    random = Random(400)
    tensor, center, mass, pull = random.tensor(), random.vector(), 1.7, random.vector(9 * size**2)
    system = prepared(
        general_body(tensor, mass, center),
        f"angular_velocity = {array(random.vector(size))}",
        GRAVITY + f"acceleration = {array(pull)}",
    ).system
    w, q = random.vector(size), random.quaternion()
    got, r = observed(system, np.concatenate([w, q])), matrix(q)
    momentum, up = r @ tensor @ w, -pull / np.linalg.norm(pull)
    potential = -mass * pull @ r @ center
    scale = np.linalg.norm(tensor) * size
    np.testing.assert_array_equal(got["angular_velocity"], w)
    np.testing.assert_array_equal(got["quaternion"], q)
    np.testing.assert_allclose(got["angular_momentum"], momentum, rtol=0, atol=CLOSE * scale)
    np.testing.assert_allclose(
        got["angular_momentum_norm"], np.linalg.norm(momentum), rtol=0, atol=CLOSE * scale
    )
    np.testing.assert_allclose(got["angular_momentum_vertical"], momentum @ up, rtol=0, atol=CLOSE * scale)
    energy_scale = scale * size + mass * np.linalg.norm(pull)
    np.testing.assert_allclose(got["potential_energy"], potential, rtol=0, atol=CLOSE * energy_scale)
    np.testing.assert_allclose(
        got["energy"], w @ tensor @ w / 2 + potential, rtol=0, atol=CLOSE * energy_scale
    )


def test_observables_of_a_body_in_flight() -> None:
    random = Random(500)
    tensor, mass, pull = random.tensor(), 3.3, random.vector(9)
    names = '["linear_momentum", "energy", "rotational_energy", "potential_energy", "position", "velocity"]'
    system = prepared(
        general_body(tensor, mass),
        f"angular_velocity = [1, 2, 3]\nposition = {array(random.vector(50))}\nvelocity = [1, 2, 3]",
        GRAVITY + f"acceleration = {array(pull)}",
        record=names,
    ).system
    w, x, v = random.vector(), random.vector(50), random.vector(5)
    got = observed(system, np.concatenate([w, x, v]))
    rotation, potential = w @ tensor @ w / 2, -mass * pull @ x
    scale = rotation + mass * v @ v / 2 + mass * np.linalg.norm(pull) * np.linalg.norm(x)
    np.testing.assert_array_equal(got["position"], x)
    np.testing.assert_array_equal(got["velocity"], v)
    np.testing.assert_allclose(got["linear_momentum"], mass * v, rtol=4 * EPS)
    np.testing.assert_allclose(got["rotational_energy"], rotation, rtol=CLOSE)
    np.testing.assert_allclose(got["potential_energy"], potential, rtol=0, atol=CLOSE * scale)
    total = rotation + mass * v @ v / 2 + potential
    np.testing.assert_allclose(got["energy"], total, rtol=0, atol=CLOSE * scale)


@pytest.mark.parametrize(
    ("formulation", "sequence"),
    [("quaternion", "zxz"), ("quaternion", "yzx"), ("quaternion", "xzy"), ("rotation_matrix", "zyx")],
)
def test_euler_angles_from_another_formulation(sequence: str, formulation: str) -> None:
    random = Random(23)
    system = prepared(
        "principal_moments = [1, 2, 2.5]",
        "angular_velocity = [0.1, 1, 0.05]",
        record='["euler_angles"]',
        integrator=f'formulation = "{formulation}"\neuler_sequence = "{sequence}"',
    ).system
    for _ in range(10):
        q = random.quaternion()
        attitude = q if formulation == "quaternion" else matrix(q).ravel()
        got = observed(system, np.concatenate([[0.1, 1, 0.05], attitude]))["euler_angles"]
        expected = Rotation.from_matrix(matrix(q)).as_euler(sequence.upper())
        middle = abs(np.sin(expected[1]) if sequence[0] == sequence[2] else np.cos(expected[1]))
        np.testing.assert_allclose(got, expected, rtol=0, atol=CLOSE / middle)


@pytest.mark.parametrize("sequence", EULER_SEQUENCES[1::3])
def test_quaternion_and_matrix_from_euler_angles(sequence: str) -> None:
    random = Random(29)
    system = prepared(
        "principal_moments = [1, 2, 2.5]",
        "angular_velocity = [0.1, 1, 0.05]\neuler_angles = [0.3, 0.7, -0.4]",
        record='["quaternion", "rotation_matrix", "euler_angles"]',
        integrator=f'formulation = "euler_angles"\neuler_sequence = "{sequence}"',
    ).system
    for _ in range(5):
        angles = random.vector(3)
        got = observed(system, np.concatenate([[0.1, 1, 0.05], angles]))
        expected = Rotation.from_euler(sequence.upper(), angles)
        np.testing.assert_array_equal(got["euler_angles"], angles)
        np.testing.assert_allclose(
            got["rotation_matrix"].reshape(3, 3), expected.as_matrix(), rtol=0, atol=CLOSE
        )
        q = np.roll(expected.as_quat(), 1)
        assert abs(abs(got["quaternion"] @ q) - 1) <= CLOSE


def test_quaternion_from_the_matrix_formulation() -> None:
    """Each of the four branches, near half turns, where a division by w would lose all digits."""
    system = prepared(
        "principal_moments = [1, 2, 2.5]",
        "angular_velocity = [0.1, 1, 0.05]",
        record='["quaternion"]',
        integrator='formulation = "rotation_matrix"',
    ).system
    near, half = np.pi - 1e-9, [np.pi, 0, 0]
    turns = [[0, 0, 0], *(near * np.eye(3)).tolist(), half, [0.3, -2.0, 1.1], [1e-9, 2e-9, 3e-9]]
    for rotation in map(Rotation.from_rotvec, turns):
        state = np.concatenate([[0.1, 1, 0.05], rotation.as_matrix().ravel()])
        got, q = observed(system, state)["quaternion"], np.roll(rotation.as_quat(), 1)
        np.testing.assert_allclose(got * np.sign(got @ q), q, rtol=0, atol=CLOSE)


FREE = "principal_moments = [1, 2, 2.5]\nmass = 1"
HEAVY = "principal_moments = [1, 1, 0.3]\nmass = 1\ncenter_of_mass = [0, 0, 1]"
SPIN = "angular_velocity = [0.1, 1, 0.05]\neuler_angles = [0.1, 0.5, 0.2]"
FLIGHT = SPIN + "\nposition = [1, 2, 3]\nvelocity = [4, 5, 6]"
RATES, QUATERNION, VERTICAL = "wx wy wz", "qw qx qy qz", "gx gy gz"
ANGLES, NINE, PATH = "phi theta psi", "r11 r12 r13 r21 r22 r23 r31 r32 r33", "x y z vx vy vz"
VISCOUS = 'kind = "viscous_torque"\ncoefficients = [0.1, 0.2, 0.3]\n'
SPACE = 'kind = "torque"\ncomponents = ["1", "0", "0"]\nframe = "space"\n'

# body, initial, loads, record, formulation: the states in groups
NEEDS = {
    "rates alone": (FREE, SPIN, "", ["angular_velocity"], "auto", [RATES]),
    "damped rates": (FREE, SPIN, VISCOUS, ["angular_velocity"], "auto", [RATES, "work"]),
    "a torque that reads the attitude": (
        FREE,
        SPIN,
        SPACE,
        ["angular_velocity"],
        "auto",
        [RATES, QUATERNION],
    ),
    "everything": (FREE, SPIN, "", [], "auto", [RATES, QUATERNION]),
    "heavy top's energies": (
        HEAVY,
        SPIN,
        GRAVITY,
        ["energy", "potential_energy", "angular_momentum_vertical"],
        "auto",
        [RATES, VERTICAL],
    ),
    "gravity without an arm": (FREE, SPIN, GRAVITY, ["angular_velocity"], "auto", [RATES]),
    "flight in a matrix": (FREE, FLIGHT, GRAVITY, [], "rotation_matrix", [RATES, NINE, PATH]),
    "path alone": (FREE, FLIGHT, GRAVITY, ["position"], "auto", [RATES, PATH]),
}


@pytest.mark.parametrize("case", NEEDS)
def test_only_what_is_needed_is_carried_and_each_has_a_reason(case: str) -> None:
    body, initial, loads, record, formulation, groups = NEEDS[case]
    output = f"record = {record}".replace("'", '"') if record else ""
    text = config(body, initial, loads, integrator=f'formulation = "{formulation}"', output=output)
    plan = rigidsim.plan(rigidsim.parse(text), pilot_seconds=0.01).as_dict()
    assert plan["states"] == " ".join(groups).split()
    shown = [group.replace(NINE, "r11 ... r33") for group in groups]
    assert list(dict.fromkeys(row["states"] for row in plan["reasons"])) == shown
    assert all(row["why"] for row in plan["reasons"])
    left_out = {row["what"] for row in plan["left_out"]}
    assert ("position and velocity" in left_out) == (PATH not in groups)
    assert ("attitude" in left_out) == (not {QUATERNION, ANGLES, NINE} & set(groups))
