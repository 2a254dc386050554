"""Attitudes in the scene's arithmetic: every Euler sequence, both ways, in and out of its singularity."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support import run_text

from rigidsim import parse
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.fields import EULER_SEQUENCES
from rigidsim.solve.problem import prepare

CONTEXT = context_for(50)
LAST = CONTEXT.mpf(2) ** (16 - CONTEXT.prec)  # some tens of roundings of the context
CLOSE = 50 * np.finfo(float).eps  # scipy multiplies three rotations in double

turns = st.floats(-3.1, 3.1)
components = st.integers(-(10**6), 10**6)
quaternions = st.tuples(components, components, components, components).filter(any)


def unit(q: tuple[int, ...]) -> list:
    return attitude.unit_quaternion(CONTEXT, [CONTEXT.mpf(x) for x in q])


def numbers(matrix: list) -> np.ndarray:
    return np.array(matrix, dtype=float)


def difference(a: list, b: list) -> float:
    return max(abs(x - y) for r, s in zip(a, b, strict=True) for x, y in zip(r, s, strict=True))


@pytest.mark.parametrize("sequence", EULER_SEQUENCES)
@given(angles=st.tuples(turns, turns, turns))
def test_quaternion_from_euler_is_intrinsic(sequence: str, angles: tuple[float, float, float]) -> None:
    q = attitude.quaternion_from_euler(CONTEXT, [CONTEXT.mpf(a) for a in angles], sequence)
    expected = Rotation.from_euler(sequence.upper(), angles)  # capitals: scipy's intrinsic sequences
    np.testing.assert_allclose(numbers(attitude.rotation_matrix(q)), expected.as_matrix(), rtol=0, atol=CLOSE)
    x, y, z, w = expected.as_quat()
    assert abs(abs(float(q[0]) * w + float(q[1]) * x + float(q[2]) * y + float(q[3]) * z) - 1) <= CLOSE


@given(quaternions)
def test_quaternion_from_matrix_inverts(q: tuple[int, ...]) -> None:
    start = unit(q)
    found = attitude.quaternion_from_matrix(CONTEXT, attitude.rotation_matrix(start))
    same = max(abs(a - b) for a, b in zip(start, found, strict=True))
    opposite = max(abs(a + b) for a, b in zip(start, found, strict=True))
    assert min(same, opposite) <= LAST
    assert found[0] >= 0


@pytest.mark.parametrize("axis", range(4))
def test_quaternion_from_matrix_at_half_turns(axis: int) -> None:
    """Where w = 0 a formula that divides by it fails."""
    q = [CONTEXT.mpf(n == axis) for n in range(4)]
    found = attitude.quaternion_from_matrix(CONTEXT, attitude.rotation_matrix(q))
    assert [abs(x) for x in found] == q


@pytest.mark.parametrize("sequence", EULER_SEQUENCES)
@given(first=turns, middle=st.floats(0.01, 1.55), last=turns, flipped=st.booleans())
def test_euler_from_matrix_inverts(
    sequence: str, first: float, middle: float, last: float, flipped: bool
) -> None:
    proper = sequence[0] == sequence[2]
    middle = (np.pi - middle if proper else -middle) if flipped else middle
    angles = [CONTEXT.mpf(a) for a in (first, middle, last)]
    r = attitude.rotation_matrix(attitude.quaternion_from_euler(CONTEXT, angles, sequence))
    found = attitude.euler_from_matrix(CONTEXT, r, sequence)
    # the outer angles are worse known than R by 1/sin (1/cos) of the middle one, here at most 100
    assert max(abs(a - b) for a, b in zip(angles, found, strict=True)) <= 100 * LAST


@pytest.mark.parametrize("sequence", EULER_SEQUENCES)
@given(quaternions)
def test_any_attitude_has_angles_that_mean_it(sequence: str, q: tuple[int, ...]) -> None:
    r = attitude.rotation_matrix(unit(q))
    angles = attitude.euler_from_matrix(CONTEXT, r, sequence)
    back = attitude.rotation_matrix(attitude.quaternion_from_euler(CONTEXT, angles, sequence))
    # next to a singularity, up to 2^(8 - prec), the outer angles share one number
    assert difference(r, back) <= LAST


@pytest.mark.parametrize("sequence", EULER_SEQUENCES)
@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize(("first", "last"), [(0.0, 0.0), (0.3, 0.4), (-2.0, 3.0), (3.0, 3.0)])
def test_in_the_singularity_the_last_angle_is_zero(
    sequence: str, end: int, first: float, last: float
) -> None:
    """Only the sum or the difference of the outer angles is defined; it goes to the first."""
    proper = sequence[0] == sequence[2]
    middle = [CONTEXT.zero, CONTEXT.pi][end] if proper else [1, -1][end] * CONTEXT.pi / 2
    angles = [CONTEXT.mpf(first), middle, CONTEXT.mpf(last)]
    r = attitude.rotation_matrix(attitude.quaternion_from_euler(CONTEXT, angles, sequence))
    found = attitude.euler_from_matrix(CONTEXT, r, sequence)
    assert found[2] == 0
    assert abs(found[1] - middle) <= LAST
    back = attitude.rotation_matrix(attitude.quaternion_from_euler(CONTEXT, found, sequence))
    assert difference(r, back) <= LAST


# ---- in a scene -------------------------------------------------------------------------------------------


def scene(initial: str, sequence: str = "zxz", precision: str = "50"):
    return prepare(
        parse(f"""
name = "attitude"
[body]
principal_moments = [1, 2, 2.5]
[initial]
{initial}
[time]
end = 1
[integrator]
precision = {precision}
euler_sequence = "{sequence}"
""")
    ).scene


def test_a_quaternion_is_normalised_in_the_scenes_precision() -> None:
    found = scene("angular_velocity = [1, 0, 0]\nquaternion = [1, 1, 1, 0]").quaternion
    third = 1 / CONTEXT.sqrt(3)
    assert max(abs(a - b) for a, b in zip(found, [third, third, third, 0], strict=True)) <= LAST


def test_sixty_degrees_have_an_exact_sine() -> None:
    found = scene('angular_velocity = [1, 0, 0]\neuler_angles = ["60 deg", 0, 0]')
    expected = [CONTEXT.sqrt(3) / 2, 0, 0, CONTEXT.mpf(1) / 2]
    assert max(abs(a - b) for a, b in zip(found.quaternion, expected, strict=True)) <= LAST
    assert abs(found.euler_angles[0] - CONTEXT.pi / 3) <= LAST


def test_angular_momentum_is_given_in_space_axes() -> None:
    """The body is turned by 90 degrees about z: its x axis points along Y."""
    found = scene('angular_momentum = [0, 3, 0]\neuler_angles = ["90 deg", 0, 0]')
    assert max(abs(a - b) for a, b in zip(found.angular_velocity, [3, 0, 0], strict=True)) <= LAST


RIGHT = [0, 90, 180, -90, 270, 360]


@pytest.mark.parametrize("sequence", ["zxz", "zyx"])
def test_multiples_of_a_right_angle_leave_nothing_beside_zero(sequence: str) -> None:
    context = context_for("single")
    for angles in itertools.product(RIGHT, repeat=3):
        turns = [context.radians(context.mpf(angle)) for angle in angles]
        q = attitude.quaternion_from_euler(context, turns, sequence)
        exact = Rotation.from_euler(sequence.upper(), angles, degrees=True).as_matrix().round()
        assert [[int(x) for x in row] for row in exact] == [
            [x if x == 0 else context.nint(x) for x in row] for row in attitude.rotation_matrix(q)
        ]
        smallest = min(abs(x) for x in q if x != 0)
        assert smallest > 0.4  # half a turn's halves: 1/2, sqrt(1/2) or 1


def test_tiny_angles_that_are_meant_are_kept() -> None:
    tiny = CONTEXT.mpf(10) ** -200
    zero = CONTEXT.zero
    assert attitude.quaternion_from_euler(CONTEXT, [tiny, zero, zero], "zxz")[3] == CONTEXT.sin(tiny / 2)
    off = CONTEXT.pi / 2 + CONTEXT.mpf(10) ** -45  # of some 88 digits
    cosine = attitude.rotation_matrix(attitude.quaternion_from_euler(CONTEXT, [off, zero, zero], "zxz"))[0][0]
    assert abs(cosine / CONTEXT.cos(off) - 1) < CONTEXT.mpf(10) ** -35


@pytest.mark.parametrize(
    ("formulation", "sequence", "sign"), [("euler_angles", "zxz", -1), ("canonical", "zyx", 1)]
)
def test_recorded_quaternions_begin_with_the_one_given(formulation: str, sequence: str, sign: int) -> None:
    given = [0.3 * sign, -0.5 * sign, 0.2 * sign, 0.75 * sign]
    text = (
        'name = "signs"\n[body]\nprincipal_moments = [1, 2, 2.5]\n'
        "[initial]\nangular_velocity = [0.1, 1, 0.05]\n"
        f"quaternion = {given}\n[time]\nend = 12\nsamples = 49\n"
        f'[integrator]\neuler_sequence = "{sequence}"\n[output]\nrecord = ["quaternion"]\n'
    )
    carried, other = (
        run_text(text, f'integrator.formulation="{how}"').dataset.quaternion.values
        for how in ("quaternion", formulation)
    )
    unit_of_it = np.array(given) / np.linalg.norm(given)
    np.testing.assert_allclose(other[0], unit_of_it, rtol=0, atol=1e-15)
    np.testing.assert_allclose(other, carried, rtol=0, atol=1e-12)  # and goes on with its sign
