"""Attitudes of a start: every Euler sequence, both ways, in and out of its singularity, in any precision."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import config, loaded, run_text

from rigidsim import parse
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.fields import EULER_SEQUENCES
from rigidsim.scene.scene import build_scene

CONTEXT = context_for(50)
LAST = CONTEXT.mpf(2) ** (16 - CONTEXT.prec)  # some tens of roundings of the context
CLOSE = 50 * np.finfo(float).eps  # scipy multiplies three rotations in double


def built(initial: str, sequence: str = "zxz", precision: str = "50"):
    integrator = f'precision = {precision}\neuler_sequence = "{sequence}"'
    return build_scene(
        parse(config(initial=f"angular_velocity = [0, 1, 0]\n{initial}", integrator=integrator))
    )


def matrix(q: list) -> np.ndarray:
    w, x, y, z = (float(component) for component in q)
    return Rotation.from_quat([x, y, z, w]).as_matrix()


def angles_of(sequence: str, random: np.random.Generator) -> np.ndarray:
    """Angles within the range that a sequence gives back."""
    middle = random.uniform(0.01, 1.55) * random.choice([-1, 1])
    proper = sequence[0] == sequence[2]
    first, last = random.uniform(-3.1, 3.1, 2)
    return np.array([first, middle % np.pi if proper else middle, last])


@pytest.mark.parametrize("sequence", EULER_SEQUENCES)
def test_angles_are_intrinsic_and_come_back(sequence: str) -> None:
    """Against scipy; there and back to the last bits of the scene's arithmetic."""
    random = np.random.default_rng(7)
    for _ in range(10):
        angles = angles_of(sequence, random)
        found = built(f"euler_angles = {angles.tolist()}", sequence)
        expected = Rotation.from_euler(sequence.upper(), angles)  # capitals: scipy's intrinsic sequences
        np.testing.assert_allclose(matrix(found.quaternion), expected.as_matrix(), rtol=0, atol=CLOSE)
        turned = attitude.rotation_matrix(found.quaternion)
        back = attitude.euler_from_matrix(CONTEXT, turned, sequence)
        # the outer angles are worse known by 1/sin (1/cos) of the middle one, here at most 100
        assert max(abs(x - y) for x, y in zip(back, found.euler_angles, strict=True)) <= 100 * LAST
        again = attitude.quaternion_from_matrix(CONTEXT, turned)
        sign = 1 if found.quaternion[0] >= 0 else -1
        assert max(abs(x - sign * y) for x, y in zip(again, found.quaternion, strict=True)) <= LAST


@pytest.mark.parametrize("sequence", EULER_SEQUENCES)
def test_in_the_singularity_the_last_angle_is_zero(sequence: str) -> None:
    """Only the sum or the difference of the outer angles is defined; it goes to the first."""
    ends = ("0", "pi") if sequence[0] == sequence[2] else ("pi/2", "-pi/2")
    for end, (first, last) in itertools.product(ends, [(0.0, 0.0), (-2.0, 3.0), (3.0, 3.0)]):
        given = built(f'euler_angles = [{first}, "{end}", {last}]', sequence)
        turned = attitude.rotation_matrix(given.quaternion)
        found = attitude.euler_from_matrix(CONTEXT, turned, sequence)
        assert found[2] == 0
        back = attitude.rotation_matrix(attitude.quaternion_from_euler(CONTEXT, found, sequence))
        assert (
            max(abs(x - y) for r, s in zip(turned, back, strict=True) for x, y in zip(r, s, strict=True))
            <= LAST
        )


def test_angular_momentum_is_given_in_space_axes() -> None:
    """The body is turned by 90 degrees about z: its x axis points along Y."""
    text = config(initial='angular_momentum = [0, 3, 0]\neuler_angles = ["90 deg", 0, 0]')
    assert loaded(run_text(text))["angular_velocity"].values[0].tolist() == [3, 0, 0]
