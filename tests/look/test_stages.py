"""Each kind of scene gets its stage, and what stands on it is where the dataset says."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import xarray
from scipy.spatial.transform import Rotation

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


def averaged(dataset: xarray.Dataset, axis: str, drawn: xarray.Dataset) -> xarray.Dataset:
    """A pole that goes backwards about Z, 0.4 rad from it, and nothing else; the Sun goes round fast."""
    node = 1.0 - 0.05 * dataset["time"].values
    pole = np.stack([np.sin(0.4) * np.sin(node), -np.sin(0.4) * np.cos(node), np.cos(0.4) + 0 * node], axis=1)
    bare = dataset.drop_vars(["quaternion", "angular_velocity", "angular_momentum", "energy"])
    known = {
        f"{axis}_axis": (("time", "space_axis"), pole),
        "obliquity": (("time", "axis"), np.full((len(node), 1), 0.4), {"units": "rad"}),
        "node_longitude": (("time", "axis"), node[:, None], {"units": "rad"}),
    }
    bare = bare.assign(known).assign_coords(axis=[axis]).assign_attrs(formulation="orbit_averaged")
    sun = {
        "what": "source",
        "gravitational_parameter": 1.32712440018e20,
        "orbit": {**CIRCLE, "mean_motion": 60},
    }
    return around(bare.assign_attrs(drawing=drawn.attrs["drawing"]), sun)


def test_a_globe_without_rotation_points_where_its_axis_does(symmetric_top: Build) -> None:
    top = symmetric_top(count=101)
    dataset = averaged(top, "figure", earth(top))
    for known in (dataset, dataset.drop_vars("figure_axis")):  # by itself, and from its angles
        found = picture(known)
        assert found.kind == "rotation of the Earth in space"
        (stage,) = found.stages
        assert stage.quaternion is not None
        turn = Rotation.from_quat(stage.quaternion).as_matrix()
        np.testing.assert_allclose(turn[:, :, 2], dataset["figure_axis"].values, rtol=0, atol=1e-6)  # float32
        # about its axis it keeps to the node: the first of its axes across stays level
        assert np.abs(turn[:, 2, :2]).min(axis=1).max() < 1e-6
        assert [arrow.name for arrow in stage.arrows] == ["figure_axis"]  # the Sun would jump about
        assert "prime_meridian" not in [line.name for line in stage.lines]
        (ring,) = [line for line in stage.lines if line.name == "precession"]
        assert ring.words == "precession of the pole: once in 2.09 min"  # 2 pi / 0.05 s
        np.testing.assert_allclose(ring.points[:, 2], 1.45 * np.cos(0.4), rtol=1e-12)
        assert any("averaged over" in note for note in found.notes)
        assert any("direction of the Sun isn't shown" in note for note in found.notes)


def test_a_satellite_without_attitude_in_space_is_turned_by_roll_pitch_and_yaw(symmetric_top: Build) -> None:
    dataset = satellite(symmetric_top(count=101)).drop_vars(["quaternion", "angular_momentum"])
    angles = np.deg2rad(np.tile([10.0, 20.0, 30.0], (101, 1)))
    dataset["roll_pitch_yaw"] = (("time", "angle"), angles)
    stage = picture(dataset).stages[0]
    assert stage.quaternion is not None
    shown = Rotation.from_quat(stage.quaternion).as_matrix()
    along = CIRCLE["mean_anomaly"] + CIRCLE["mean_motion"] * dataset["time"].values
    plane = Rotation.from_euler("ZX", [CIRCLE["ascending_node"], CIRCLE["inclination"]])
    down = plane.apply(np.stack([np.cos(along), np.sin(along), 0 * along], axis=1))  # where the source is
    right = np.tile(-plane.apply([0, 0, 1]), (len(down), 1))
    local = np.stack([np.cross(right, down), right, down], axis=2)
    relative = np.einsum("tji,tjk->tik", local, shown)
    # 3-2-1: pitch, yaw and roll from the matrix (Diebel 2006, eq. 290)
    np.testing.assert_allclose(-np.arcsin(relative[:, 2, 0]), np.deg2rad(20), atol=1e-6)
    np.testing.assert_allclose(np.arctan2(relative[:, 1, 0], relative[:, 0, 0]), np.deg2rad(30), atol=1e-6)
    np.testing.assert_allclose(np.arctan2(relative[:, 2, 1], relative[:, 2, 2]), np.deg2rad(10), atol=1e-6)


def test_the_ellipsoid_of_energy_touches_the_invariable_plane_at_the_tip(symmetric_top: Build) -> None:
    dataset = symmetric_top(count=101)
    rolling = picture(dataset).stages[1]
    (shell,) = rolling.shells
    polhode, herpolhode = (t.points for t in rolling.trails)
    np.testing.assert_allclose(((polhode / shell.half_sizes) ** 2).sum(axis=1), 1, rtol=1e-9)
    heights = herpolhode[:, 2]  # L is along Z
    np.testing.assert_allclose(heights, heights[0], rtol=1e-9)
    rim = next(line for line in rolling.lines if line.name == "plane/rim")
    np.testing.assert_allclose(rim.points[:, 2], heights[0], rtol=1e-9)
