"""A Moon as the Earth sees it: the view turns with the direction of the Earth, and poles count from the
ecliptic.
"""

import json
from typing import Any

import numpy as np
import pytest
import xarray
from scipy.spatial.transform import Rotation

from rigidsim.look.stages.registry import build_picture

DAY, YEAR = 86400.0, 3.15576e7
MONTH, NODE = 2 * np.pi / (27.3217 * DAY), -2 * np.pi / (18.6 * YEAR)
INCLINED, OBLIQUITY = np.deg2rad(1.54), np.deg2rad(84381.406 / 3600)
SWING = np.deg2rad(6.3)  # of the Earth's direction in longitude
CONFIG = '[body]\nhost = "moon"\n[ephemeris]\nkernel = "de421"\n'


def moon(years: float = 40.0, config: str = CONFIG) -> tuple[xarray.Dataset, np.ndarray, Rotation]:
    """A dataset in axes of the ICRF, unit vectors to the Earth, and attitudes: an equator inclined to the
    ecliptic whose node goes back, and an Earth that runs before and behind the mean.
    """
    t = np.arange(0, years * YEAR, DAY)
    tilt = Rotation.from_euler("x", OBLIQUITY)
    angles = np.stack([NODE * t, np.full(len(t), INCLINED), (MONTH - NODE) * t], axis=1)
    attitude = tilt * Rotation.from_euler("ZXZ", angles)
    along = MONTH * t + SWING * np.sin(MONTH * t)
    earth = tilt.apply(np.stack([np.cos(along), np.sin(along), 0 * t], axis=1))
    steps = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / DAY
    sun = tilt.apply(np.stack([np.cos(2e-7 * t), np.sin(2e-7 * t), 0 * t], axis=1))
    venus = 0.3 * sun
    sources = [("earth", 3.986e14), ("sun", 1.327e20), ("venus", 3.249e14)]
    told = [{"what": "source", "gravitational_parameter": gm, "kernel": name} for name, gm in sources]
    solid = {"solid": "cuboid", "dimensions": {"size": [1, 1, 1]}, "position": [0, 0, 0]}
    dataset = xarray.Dataset(
        {
            "quaternion": (("time", "quaternion_component"), np.roll(attitude.as_quat(), 1, axis=1)),
            "angular_velocity": (("time", "body_axis"), np.vstack([steps, steps[-1:]])),
            "source_position": (
                ("time", "source", "space_axis"),
                np.stack([3.8e8 * earth, 1.5e11 * sun, 1.5e11 * venus], axis=1),
            ),
        },
        coords={"time": t, "source": [name for name, _ in sources]},
        attrs={
            "axes": "ICRF", "config": config, "surroundings": json.dumps(told),
            "drawing": json.dumps([{**solid, "quaternion": [1, 0, 0, 0], "equivalent": True}]),
            "principal_moments": "[0.99937, 0.9996, 1.0]", "principal_axes": "[[1,0,0],[0,1,0],[0,0,1]]",
        },
    )  # fmt: skip
    return dataset, earth, attitude


@pytest.fixture(scope="module")
def seen() -> tuple[Any, ...]:
    """Forty years, and their picture."""
    dataset, earth, attitude = moon()
    return dataset, earth, attitude, *build_picture(dataset)


@pytest.mark.slow
def test_the_view_turns_with_the_direction_of_the_earth_and_has_north_upwards(seen: tuple[Any, ...]) -> None:
    _, earth, attitude, picture, subject = seen
    face = picture.stages[0]
    assert (face.title, face.looked_from) == ("Seen from the Earth", "eye")
    assert subject.reach == pytest.approx(1737400.0)
    drawn = {part.path: part.values for part in face.parts}
    frame = Rotation.from_quat(drawn["eye"])
    np.testing.assert_allclose(frame.inv().apply(earth) - [1, 0, 0], 0, atol=1e-6)
    # the mean pole is the ecliptic's, to what the last cycle of the node leaves
    upwards = frame.inv().apply(np.tile([0, -np.sin(OBLIQUITY), np.cos(OBLIQUITY)], (len(earth), 1)))
    assert np.abs(upwards - [0, 0, 1]).max() < 5e-3
    # the track is where the Earth stands over the body: in its axes
    track = drawn["body/sub_source/recent"]
    np.testing.assert_allclose(
        track / np.linalg.norm(track, axis=1)[:, None], attitude.inv().apply(earth), atol=1e-12
    )
    # the body's x axis is seen to the east or west of the centre by the swing, and drawn without exaggeration
    seen = (frame.inv() * attitude).apply([1.0, 0.0, 0.0])
    assert np.abs(seen[:, 1]).max() == pytest.approx(np.sin(SWING), rel=2e-3)
    assert np.abs(seen[:, 2]).max() < np.sin(INCLINED) * 1.01
