"""Roll, pitch and yaw, libration and nadir: against their definitions, and against closed forms."""

from typing import Any

import numpy as np
import pytest
import xarray
from kepler import on_ellipse, turned
from mpmath import mp
from support import EPSILON, config, loaded, run_text, wide

NAMES = 'record = ["quaternion", "roll_pitch_yaw", "libration", "nadir"{}]'
BODY = 'principal_moments = ["0.9", 1, "0.4"]\nmass = 2'
START = 'angular_velocity = ["0.1", "-0.9", "0.3"]\neuler_angles = ["0.4", "0.3", "0.2"]'
GRADIENT = 'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
ORBIT = """orbit = {{semi_major_axis = 1, eccentricity = {e}, inclination = "0.7", ascending_node = "0.5", \
periapsis = "0.3", mean_anomaly = "0.2", node_rate = {node}, periapsis_rate = {periapsis}}}"""
LONG_AXIS = 2  # body z


def exactly(values: np.ndarray) -> list[Any]:
    """80-bit numbers as mpf."""
    return [mp.mpf(float(x)) + mp.mpf(float(x - np.longdouble(float(x)))) for x in np.ravel(values)]


def rotation(q: list[Any]) -> Any:
    """Body to space."""
    w, x, y, z = (a / mp.sqrt(sum(b * b for b in q)) for a in q)
    return mp.matrix(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def unit(vector: Any) -> Any:
    return vector / mp.norm(vector)


def cross(a: Any, b: Any) -> Any:
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def kepler(time: Any, e: Any, node: Any, periapsis: Any) -> tuple[Any, Any]:
    """Direction to the source and normal of ``ORBIT``, space axes."""
    place = on_ellipse(mp, 1, e, mp.mpf("0.2") + time)
    plane = (mp.mpf("0.7"), 1), (mp.mpf("0.5") + node * time, 3)
    place = turned(mp, place, (mp.mpf("0.3") + periapsis * time, 3), *plane)
    return unit(mp.matrix(place)), mp.matrix(turned(mp, [0, 0, 1], *plane))


def defined(matrix: Any, down: Any, normal: Any) -> list[Any]:
    """Roll, pitch, yaw, libration in and out of the plane, nadir, from their definitions alone."""
    y = -normal
    local = [cross(y, down), y, down]  # in space axes
    rows = [[sum(axis[k] * matrix[k, j] for k in range(3)) for j in range(3)] for axis in local]
    roll, pitch = mp.atan2(rows[2][1], rows[2][2]), -mp.asin(rows[2][0])
    yaw = mp.atan2(rows[1][0], rows[0][0])
    long = [row[LONG_AXIS] for row in rows]  # along x, y, z of the local frame
    return [roll, pitch, yaw, mp.atan2(long[0], long[2]), -mp.asin(long[1]), *rows[2]]


def misses(dataset: xarray.Dataset, row: int, down: Any, normal: Any) -> float:
    """Largest difference of what a row has from the definitions, whole turns apart."""
    matrix = rotation(exactly(wide(dataset, "quaternion")[row]))
    expected = defined(matrix, down, normal)
    got: list[Any] = []
    for name in ("roll_pitch_yaw", "libration", "nadir"):
        got += exactly(wide(dataset, name)[row])
    found = [
        mp.fmod(a - b + 9 * mp.pi, 2 * mp.pi) - mp.pi for a, b in zip(got[:5], expected[:5], strict=True)
    ]
    found += [a - b for a, b in zip(got[5:], expected[5:], strict=True)]
    return float(max(abs(x) for x in found))


def ran(loads: Any, **tables: str) -> xarray.Dataset:
    tables = {
        "body": BODY,
        "initial": START,
        "time": "end = 6\nsamples = 4",
        "output": NAMES.format(""),
    } | tables
    return loaded(run_text(config(loads=loads, **tables)))


@pytest.mark.parametrize(
    ("e", "node", "periapsis"),
    [("0", "0", "0"), ("0.3", "-0.2", "0.1")],
    ids=["carried in the orbit's frame", "eccentric, node and periapsis move"],
)
def test_they_are_their_definitions_to_80_bits(e: str, node: str, periapsis: str) -> None:
    """From the recorded quaternion and Kepler's equation, both in 40 digits."""
    load = GRADIENT + ORBIT.format(e=f'"{e}"', node=f'"{node}"', periapsis=f'"{periapsis}"')
    dataset = ran(load, integrator='precision = "extended"')
    assert dataset["roll_pitch_yaw"].dims == ("time", "roll_pitch_yaw_component")
    assert list(dataset["roll_pitch_yaw_component"].values) == ["roll", "pitch", "yaw"]
    assert list(dataset["libration_angle"].values) == ["in_plane", "out_of_plane"]
    with mp.workdps(40):
        motion = [mp.mpf(x) for x in (e, node, periapsis)]
        for row in range(4):
            down, normal = kepler(mp.mpf(2) * row, *motion)
            # the orbit's states and the quaternion keep 80 bits to some 1e2 roundings over so few steps
            assert misses(dataset, row, down, normal) < 100 * EPSILON["extended"]
    assert "number 1; normal of its orbit" in dataset["nadir"].attrs["local_frame"]


def test_in_free_flight_they_count_from_the_path() -> None:
    """Central gravity: down to the point, normal r x v. It is recorded by default: the body turns slowly."""
    start = START.replace("0.9", "0.4") + "\nposition = [10, 1, 2]\nvelocity = [0.3, 3, 1]"
    load = 'kind = "central_gravity"\ngravitational_parameter = 100\nposition = ["0.2", 0, 0]'
    dataset = ran(load, initial=start, output=NAMES.format(', "position", "velocity"'))
    with mp.workdps(40):
        for row in range(4):
            place = mp.matrix(exactly(wide(dataset, "position")[row])) - mp.matrix([0.2, 0, 0])
            velocity = mp.matrix(exactly(wide(dataset, "velocity")[row]))
            assert misses(dataset, row, unit(-place), unit(cross(place, velocity))) < 50 * EPSILON["double"]
    everything = ran(load, initial=start, output="", time="end = 1\nsamples = 2")
    assert {"roll_pitch_yaw", "nadir"} <= set(everything)
    assert "libration" not in everything  # only when named


def polar(time: str, initial: str, record: str = '"roll_pitch_yaw", "nadir"', body: str = BODY) -> str:
    """A satellite at the Earth's unit distance, whose local frame starts along the space axes; n = 1."""
    orbit = 'orbit = {semi_major_axis = 1, inclination = "90 deg", periapsis = "90 deg"}'
    return config(body, initial, GRADIENT + orbit, time, 'euler_sequence = "zyx"', f"record = [{record}]")


def test_a_satellite_at_rest_in_its_orbit_has_none_and_a_small_pitch_swings_at_its_frequency() -> None:
    """n sqrt(3 (I_x - I_z)/I_y), Hughes 1986, ch. 9; a pendulum's frequency falls by (2 a)^2/16."""
    rest = loaded(run_text(polar("end = 20\nsamples = 41", "angular_velocity = [0, -1, 0]")))
    assert np.abs(rest["roll_pitch_yaw"].values).max() < 1e-13
    assert np.abs(rest["nadir"].values - [0, 0, 1]).max() < 1e-13
    small = 1e-4
    start = f"angular_velocity = [0, -1, 0]\neuler_angles = [0, {small}, 0]"  # yaw, pitch, roll
    swing = loaded(run_text(polar("end = 40\nsamples = 401", start)))
    rate = np.sqrt(3 * (0.9 - 0.4) / 1)
    time, angles = swing["time"].values, swing["roll_pitch_yaw"].values
    assert np.abs(angles[:, 1] - small * np.cos(rate * time)).max() < small * (
        small**2 / 4 * rate * 40 + 1e-9
    )
    assert np.abs(angles[:, [0, 2]]).max() < 1e-15
