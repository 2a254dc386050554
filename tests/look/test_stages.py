"""Each kind of scene gets its stage, and what stands on it is where the dataset says."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import xarray

from rigidsim.look.stages.registry import build_picture

Build = Callable[..., xarray.Dataset]

EARTH = 3.986004418e14
CIRCLE = {
    "semi_major_axis": 6.9e6, "eccentricity": 0.0, "inclination": 0.9, "ascending_node": 0.4,
    "periapsis": 0.0, "mean_anomaly": 0.2, "node_rate": 0.0, "periapsis_rate": 0.0, "mean_motion": 1.1e-3,
}  # fmt: skip


def around(dataset: xarray.Dataset, *things: dict[str, object]) -> xarray.Dataset:
    return dataset.assign_attrs(surroundings=json.dumps(things))


def picture(dataset: xarray.Dataset) -> Any:
    return build_picture(dataset)[0]


def heavy(dataset: xarray.Dataset) -> xarray.Dataset:
    gravity = {"what": "gravity", "acceleration": [0, 0, -9.8]}
    return around(dataset, gravity).assign_attrs(center_of_mass="[0, 0, 0.04]", mass=0.1)


def satellite(dataset: xarray.Dataset) -> xarray.Dataset:
    source = {"what": "source", "gravitational_parameter": EARTH, "orbit": CIRCLE}
    return around(dataset, source)


def orbiting(dataset: xarray.Dataset) -> xarray.Dataset:
    angle = dataset["time"].values / 3
    place = 7e6 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    attractor = {"what": "attractor", "gravitational_parameter": EARTH, "position": [0, 0, 0]}
    return around(dataset.assign(position=(("time", "space_axis"), place)), attractor)


def flying(dataset: xarray.Dataset) -> xarray.Dataset:
    t = dataset["time"].values / 10
    place = np.stack([30 * t, 0 * t, 40 * t - 20 * t**2], axis=1)
    moving = dataset.assign(position=(("time", "space_axis"), place))
    return around(moving, {"what": "gravity", "acceleration": [0, 0, -9.8]})


def earth(dataset: xarray.Dataset) -> xarray.Dataset:
    drawing = [
        {
            "solid": "ellipsoid",
            "dimensions": {"semi_axes": [6.378e6, 6.378e6, 6.357e6]},
            "position": [0, 0, 0],
            "name": "earth",
        }
    ]
    rates = dataset["angular_velocity"] * [1e-6, 1e-6, 1.0]
    return dataset.assign(angular_velocity=rates).assign_attrs(drawing=json.dumps(drawing))


KINDS = {
    "top on a fixed point": heavy,
    "satellite on its orbit": satellite,
    "orbit about an attracting point": orbiting,
    "flight in a uniform gravity": flying,
    "rotation of the Earth in space": earth,
    "free rotation": lambda dataset: dataset,
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_stage_is_that_of_the_scene(symmetric_top: Build, kind: str) -> None:
    assert picture(KINDS[kind](symmetric_top(count=101))).kind == kind


def test_the_ellipsoid_of_energy_touches_the_invariable_plane_at_the_tip(symmetric_top: Build) -> None:
    dataset = symmetric_top(count=101)
    rolling = picture(dataset).stages[1]
    drawn = {part.path: part.values for part in rolling.parts}
    polhode, herpolhode = drawn["body/polhode/recent"], drawn["herpolhode/recent"]
    half_sizes = drawn["body/around/energy_ellipsoid"].max(axis=0)
    np.testing.assert_allclose(((polhode / half_sizes) ** 2).sum(axis=1), 1, rtol=1e-9)
    heights = herpolhode[:, 2]  # L is along Z
    np.testing.assert_allclose(heights, heights[0], rtol=1e-9)
    np.testing.assert_allclose(drawn["around/plane/rim"][:, 2], heights[0], rtol=1e-9)
