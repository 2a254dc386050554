"""Surfaces of a satellite as pictures show them, and where it points to: the wind, the Sun."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray
from scipy.spatial.transform import Rotation

import rigidsim
from rigidsim.look.figures.catalogue import available, figure
from rigidsim.look.solids import body_meshes
from rigidsim.look.stages.registry import build_picture

CONFIGS = Path(__file__).parents[2] / "configs"
BLUE, ORANGE, GREY = (70, 118, 190), (200, 96, 62), (92, 94, 100)


def short(name: str, end: float) -> xarray.Dataset:
    """A ready scene over its first seconds."""
    overrides = [f"time.end={end}", "output.estimate=false"]
    return rigidsim.run(rigidsim.load(CONFIGS / f"{name}.toml", overrides=overrides), out=None).dataset


@pytest.fixture(scope="module")
def shuttlecock() -> xarray.Dataset:
    return short("aerostable_cubesat", 1200.0)


def test_plates_lie_where_the_config_puts_them_with_two_sides(shuttlecock: xarray.Dataset) -> None:
    box, *panels = body_meshes(shuttlecock.attrs["drawing"])
    assert np.ptp(box.vertices, axis=0) == pytest.approx([0.34, 0.10, 0.10])
    places = [[-0.3, y, z] for y, z in ((0, 0.125), (0, -0.125), (0.125, 0), (-0.125, 0))]
    normals = np.array([[0.5, y, z] for y, z in ((0, 0.866), (0, -0.866), (0.866, 0), (-0.866, 0))])
    for mesh, place, normal in zip(panels, places, normals, strict=True):
        assert mesh.vertices.mean(axis=0) == pytest.approx(place)
        for color, way in ((BLUE, normal), (ORANGE, -normal)):
            side = (mesh.colors == color).all(axis=1)
            assert (mesh.normals[side] @ way > 0.999).all()
            a, b, c = mesh.vertices[side].reshape(-1, 3, 3).transpose(1, 0, 2)
            area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
            assert area == pytest.approx(0.03, rel=1e-6)  # 300 cm^2


def test_the_angle_to_the_wind_is_that_of_the_velocity_in_turning_air(shuttlecock: xarray.Dataset) -> None:
    attitude = Rotation.from_quat(np.roll(shuttlecock["quaternion"].values, -1, axis=1))
    place, velocity = shuttlecock["position"].values, shuttlecock["velocity"].values
    relative = velocity - np.cross([0, 0, 7.292115e-5], place)
    along = np.einsum("ti,ti->t", attitude.apply([1, 0, 0]), relative)
    expected = np.degrees(np.arccos(along / np.linalg.norm(relative, axis=1)))
    (axes,) = figure(shuttlecock, "pointing").axes
    assert axes.get_title(loc="left") == "Angle between the body's x axis and the oncoming air"
    assert axes.lines[0].get_ydata() == pytest.approx(expected, abs=1e-5)  # arccos near zero
    assert expected[0] > 45
    picture, _ = build_picture(shuttlecock)
    air = next(arrow for arrow in picture.stages[0].arrows if arrow.name == "air")
    in_space = attitude.apply(air.vectors)
    assert np.einsum("ti,ti->t", in_space, relative) == pytest.approx(1.6 * np.linalg.norm(relative, axis=1))


def test_a_sail_is_shown_on_its_whole_orbit_about_a_sun_that_can_be_seen() -> None:
    dataset = short("sun_pointing_sail", 7200.0)
    assert "pointing" in available(dataset)
    picture, _ = build_picture(dataset)
    local, orbit = picture.stages
    assert not local.solids  # the Sun is no horizon
    (whole,) = [line.points for line in orbit.lines if line.name == "revolution"]
    far = np.linalg.norm(whole, axis=1)
    assert far.min() / far.max() == pytest.approx((1 - 0.0167) / (1 + 0.0167), rel=1e-4)
    (sun,) = orbit.solids
    assert sun.mesh.reach() >= 0.05
