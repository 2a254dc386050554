"""Surfaces of a satellite as pictures show them, and where it points to: the wind, the Sun."""

from pathlib import Path

import numpy as np
import pytest
import xarray
from scipy.spatial.transform import Rotation

import rigidsim
from rigidsim.look.figures.catalogue import figure
from rigidsim.look.stages.registry import build_picture

CONFIGS = Path(__file__).parents[2] / "configs"


def short(name: str, end: float) -> xarray.Dataset:
    """A ready scene over its first seconds."""
    overrides = [f"time.end={end}", "output.estimate=false"]
    return rigidsim.run(rigidsim.load(CONFIGS / f"{name}.toml", overrides=overrides), out=None).dataset


@pytest.fixture(scope="module")
def shuttlecock() -> xarray.Dataset:
    return short("aerostable_cubesat", 1200.0)


@pytest.mark.slow
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
    air = next(part for part in picture.stages[0].parts if part.path == "body/air")
    in_space = attitude.apply(air.values)
    assert np.einsum("ti,ti->t", in_space, relative) == pytest.approx(1.6 * np.linalg.norm(relative, axis=1))
