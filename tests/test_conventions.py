"""What docs/conventions.md promises, against scipy and by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rigidsim
from rigidsim.scene import attitude
from rigidsim.scene.fields import EULER_SEQUENCES
from rigidsim.scene.scene import Scene, build_scene

PAGE = (Path(__file__).parents[1] / "docs" / "conventions.md").read_text(encoding="utf-8")
ANGLES = [0.4, 1.1, -2.3]


def scene(initial: str, sequence: str = "zxz") -> Scene:
    return build_scene(
        rigidsim.parse(
            f'name = "c"\nintegrator.euler_sequence = "{sequence}"\nbody.principal_moments = [1, 2, 2.5]\n'
            f"time.end = 1\n[initial]\nangular_velocity = [0, 0, 1]\n{initial}\n"
        )
    )


def matrix(of: Scene) -> np.ndarray:
    return np.array(attitude.rotation_matrix(of.quaternion), dtype=float)


@pytest.mark.parametrize("sequence", EULER_SEQUENCES)
def test_euler_angles_are_intrinsic_and_scipys_capitals(sequence: str) -> None:
    found = matrix(scene(f"euler_angles = {ANGLES}", sequence))
    intrinsic = Rotation.from_euler(sequence.upper(), ANGLES).as_matrix()
    reversed_extrinsic = Rotation.from_euler(sequence[::-1], ANGLES[::-1]).as_matrix()
    np.testing.assert_allclose(found, intrinsic, atol=1e-14)
    np.testing.assert_allclose(found, reversed_extrinsic, atol=1e-14)
    assert f"`{sequence}`" in PAGE


def test_quaternions_are_scalar_first_and_take_body_to_space() -> None:
    """A turn by 90 degrees about Z brings the body's x to Y."""
    found = matrix(scene('quaternion = ["2^-1", 0, 0, "2^-1"]'))
    np.testing.assert_allclose(found @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    given = [0.1, -0.7, 0.3, 0.5]
    expected = Rotation.from_quat(given, scalar_first=True).as_matrix()
    np.testing.assert_allclose(matrix(scene(f"quaternion = {given}")), expected, atol=1e-14)


def test_the_default_sequence_is_the_one_named() -> None:
    assert scene("").config.integrator.euler_sequence == "zxz"
    assert "`zxz` (default)" in PAGE
