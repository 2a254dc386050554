"""Cones of uncertainty: half-angles by eigenvalues in closed form, in space and in the body, and drawn."""

from collections.abc import Callable

import numpy as np
import pytest
import xarray

pytest.importorskip("rerun")

from rigidsim.look.solids import rotation_matrix
from rigidsim.look.stages.registry import build_picture
from rigidsim.look.stages.uncertainty import CONE, COVARIANCE, AxisUncertainty

Top = Callable[..., xarray.Dataset]
Z = np.array([0.0, 0.0, 1.0])


def with_covariance(dataset: xarray.Dataset, covariance: np.ndarray) -> xarray.Dataset:
    dims = ("time", "space_axis", "other_space_axis")
    return dataset.assign({COVARIANCE: (dims, covariance, {"covariance_of": "attitude"})})


def attitudes(count: int) -> np.ndarray:
    return rotation_matrix(np.random.default_rng(3).standard_normal((count, 4)))


def test_half_angles_are_roots_of_eigenvalues_for_any_covariance_and_axis() -> None:
    rng = np.random.default_rng(8)
    turning, mixed = attitudes(20), rng.standard_normal((20, 3, 3))
    covariance = mixed @ mixed.transpose(0, 2, 1)
    axis = rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    found = AxisUncertainty.of(axis, turning, covariance)
    for attitude, spread, angles in zip(turning, covariance, found.half_angles, strict=True):
        n = attitude @ axis
        crossed = np.array([[0, n[2], -n[1]], [-n[2], 0, n[0]], [n[1], -n[0], 0]])  # d x n = crossed @ d
        moved = np.linalg.eigvalsh(crossed @ spread @ crossed.T)  # the least is that along n, zero
        np.testing.assert_allclose(angles**2, moved[:0:-1], rtol=1e-10)


def test_a_cone_that_stays_in_space_turns_against_the_body_that_carries_it(symmetric_top: Top) -> None:
    top = symmetric_top(count=101)
    sigma = 0.3  # about X of space alone: the axis moves across X, whatever the body does
    picture, subject = build_picture(with_covariance(top, np.tile(np.diag([sigma**2, 0, 0]), (101, 1, 1))))
    (cone,) = [part for part in picture.stages[0].parts if part.path == f"{CONE}/surface"]
    assert subject.attitude is not None
    axis, about = subject.attitude @ Z, np.array([1.0, 0.0, 0.0])
    sideways = np.cross(about, axis)
    in_space = np.einsum("tij,tkj->tki", subject.attitude, cone.values)
    flat = np.cross(axis, sideways)  # across which nothing moves: the cone is a fan
    np.testing.assert_allclose(np.einsum("tki,ti->tk", in_space, flat), 0.0, atol=1e-7)
    moved = np.linalg.norm(np.cross(in_space, axis[:, None]), axis=2)
    angle = np.arctan2(moved, np.einsum("tki,ti->tk", in_space, axis))
    np.testing.assert_allclose(angle.max(axis=1), sigma * np.linalg.norm(sideways, axis=1), rtol=1e-3)
    # it is the cone of this space axis at each time, so in the body it goes round
    first = cone.values[:, int(np.argmax(angle[0]))]
    assert np.ptp(np.arctan2(first[:, 1], first[:, 0])) > 3.0
