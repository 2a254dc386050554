"""Radiation pressure and drag on plates, boxes and spheres: forces and torques in numpy, and closed forms."""

import re
from typing import Any

import numpy as np
import pytest
from equations import Random, array, derivative, matrix, prepared
from scipy.special import ellipj, ellipk
from support import config, run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.scene.scene import build_scene

fp = np.longdouble
LIGHT = 299792458.0
MOMENTS = np.array([0.03, 0.034, 0.01])
BODY = "principal_moments = [0.03, 0.034, 0.01]"
START = "angular_velocity = [0.5, -0.6, 0.7]\nquaternion = [1, 0.2, 0.1, -0.3]"
SUN = 'kind = "gravity_gradient"\nname = "sun"\ngravitational_parameter = 1e-3\n'
SUN += 'position = ["0.6 au", "-0.5 au", "0.9 au"]'
LIGHT_LOAD = '\n[[loads]]\nkind = "radiation_pressure"\nlight = "sun"\n'
OUTSIDE = [
    {"normal": ("0.3", "-0.2", "1"), "area": "0.1", "position": ("0.2", "-0.1", "0.3"),
     "specular": "0.6", "diffuse": "0.3"},
    {"normal": ("0", "1", "0"), "area": "0.05", "position": ("0.1", "0.3", "-0.2"), "both_sides": True,
     "specular": "0.2"},
    {"size": ("0.1", "0.2", "0.3"), "position": ("0.02", "0.01", "-0.03"), "diffuse": "0.5"},
    {"radius": "0.15", "position": ("-0.1", "0.05", "0.02"), "specular": "0.1", "diffuse": "0.7"},
]  # fmt: skip


def tables(surfaces: list[dict[str, Any]]) -> str:
    """Their text; the first table of a scene that follows begins with its own head."""
    found = ""
    for surface in surfaces:
        found += "\n[[body.surfaces]]\n"
        for key, value in surface.items():
            row = f"[{', '.join(value)}]" if isinstance(value, tuple) else str(value).lower()
            found += f"{key} = {row}\n"
    return found


# --- forces on surfaces -------------------------------------------------------------------------------------


def faces(surfaces: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """All in numbers, boxes as plates where their faces are, plates of two sides as two."""
    found = []
    for given in surfaces:
        one: dict[str, Any] = {"specular": 0.0, "diffuse": 0.0, "drag_coefficient": 2.2}
        one |= {key: float(x) for key, x in given.items() if isinstance(x, str)}
        one["position"] = np.array([float(x) for x in given.get("position", ("0", "0", "0"))])
        if "size" in given:
            edges = np.array([float(x) for x in given["size"]])
            for n in (*np.eye(3), *-np.eye(3)):
                half = abs(n @ edges) / 2
                face = {"normal": n, "area": edges.prod() / half / 2, "position": one["position"] + half * n}
                found.append(one | face)
        elif "normal" in given:
            n = np.array([float(x) for x in given["normal"]])
            n = n / np.linalg.norm(n)
            found += [one | {"normal": side * n} for side in ((1, -1) if "both_sides" in given else (1,))]
        else:
            found.append(one)
    return found


def light_on(surface: dict[str, Any], u: np.ndarray) -> np.ndarray:
    """Force of light of unit pressure from u."""
    s, d = surface["specular"], surface["diffuse"]
    if "radius" in surface:
        return -np.pi * surface["radius"] ** 2 * (1 + 4 * d / 9) * u
    n = surface["normal"]
    c = max(n @ u, 0.0)
    return -surface["area"] * c * ((1 - s) * u + 2 * (s * c + d / 3) * n)


def air_on(surface: dict[str, Any], v: np.ndarray) -> np.ndarray:
    """Force of air of unit density, through which it moves with v."""
    half = surface["drag_coefficient"] / 2
    if "radius" in surface:
        return -half * np.pi * surface["radius"] ** 2 * np.linalg.norm(v) * v
    return -half * surface["area"] * max(surface["normal"] @ v, 0.0) * v


def pushed(on: Any, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force and torque on all surfaces, body axes."""
    forces = [(surface["position"], on(surface, vector)) for surface in faces(OUTSIDE)]
    return sum(f for _, f in forces), sum(np.cross(x, f) for x, f in forces)


@pytest.mark.slow
@pytest.mark.unoptimised
def test_light_and_air_on_plates_boxes_and_spheres() -> None:
    """In flight through rotating air, at twenty attitudes: what the loads add to the equations."""
    random = Random(8)
    air = 'kind = "drag"\ndensity = "1e-9 kg/m^3"\naltitude = "400 km"\nscale_height = "60 km"\n'
    earth = (
        'kind = "central_gravity"\nname = "earth"\ngravitational_parameter = 3.986004418e14\n'
        "radius = 6378137\natmosphere_rate = [0, 1e-5, 7e-5]\n"
    )
    lit = f'{earth}[[loads]]\n{SUN}{LIGHT_LOAD}irradiance = "1e7 W/m^2"\n'
    place, speed = np.array([4e6, -3e6, 4.6e6]), np.array([3000.0, 7000, 1956])
    start = f"{START}\nposition = {array(place)}\nvelocity = {array(speed)}"
    body = BODY + "\nmass = 4" + tables(OUTSIDE)
    plain = prepared(body, start, earth).system
    pushed_on = prepared(body, start, f"{lit}[[loads]]\n{air}").system
    sun_at = np.array([0.6, -0.5, 0.9])
    moving = speed - np.cross([0, 1e-5, 7e-5], place)
    density = 1e-9 * np.exp((6778137 - np.linalg.norm(place)) / 60e3)
    for _ in range(20):
        q, w = random.quaternion(), random.vector()
        r, state = matrix(q), np.concatenate([w, q, place, speed])
        given = np.concatenate([state, np.zeros(len(pushed_on.states) - 13)])
        added = derivative(pushed_on, given)[:13] - derivative(plain, state)
        force, torque = np.zeros(3), np.zeros(3)
        for on, vector, size in (
            (light_on, sun_at / np.linalg.norm(sun_at), 1e7 / LIGHT / (sun_at @ sun_at)),
            (air_on, moving, density),
        ):
            one, other = pushed(on, r.T @ vector)
            force, torque = force + size * one, torque + size * other
        np.testing.assert_allclose(added[:3] * MOMENTS, torque, rtol=0, atol=1e-12)
        np.testing.assert_allclose(added[10:13] * 4, r @ force, rtol=0, atol=1e-12)


def lit_text(surfaces: list[dict[str, Any]], irradiance: str, end: int, digits: str = "") -> str:
    loads = f'{SUN}{LIGHT_LOAD}irradiance = "{irradiance} W/m^2"'
    return config(
        BODY + tables(surfaces), START, loads, f"end = {end}\nsamples = 2", digits,
        'record = ["quaternion", "angular_velocity"]',
    )  # fmt: skip


def test_symmetric_bodies_feel_no_torque() -> None:
    """A box and a sphere about the centre of mass, and plates through it: no torque and no bit of one."""
    around = [
        {"size": ("0.1", "0.2", "0.3"), "specular": "0.4", "diffuse": "0.3"},
        {"radius": "0.2", "diffuse": "0.9"},
        {"normal": ("1", "2", "3"), "area": "1"},
    ]
    run = run_text(lit_text(around, "1e9", 100))
    free = run_text(lit_text([], "0", 100).replace(LIGHT_LOAD, "").replace('irradiance = "0 W/m^2"', ""))
    assert np.array_equal(run.dataset["quaternion"].values, free.dataset["quaternion"].values)
    assert "work" not in run.dataset  # nor is there anything that works


@pytest.mark.parametrize(("specular", "diffuse"), [("0.75", "0.05"), ("0", "0.9")])
def test_a_sail_behind_its_centre_of_mass_swings_like_a_pendulum(specular: str, diffuse: str) -> None:
    """At an angle a from the light the torque is -P A d (1 - s) sin(a) cos(a): from rest at a0 with
    k^2 = P A d (1 - s) / I sin(a) = sin(a0) sn(k t + K, m), m = sin(a0)^2; scattered light has no arm.
    """
    plate = {
        "normal": ("0", "0", "1"), "area": "200", "position": ("0", "0", "-1.5"), "specular": specular,
        "diffuse": diffuse,
    }  # fmt: skip
    loads = SUN.replace('["0.6 au", "-0.5 au", "0.9 au"]', '[0, 0, "1 au"]') + LIGHT_LOAD
    largest, moment = 0.7, 350.0
    c, s = float(np.cos(largest / 2)), float(np.sin(largest / 2))
    start = f"angular_velocity = [0, 0, 0]\nquaternion = [{c!r}, {s!r}, 0, 0]"
    body = "principal_moments = [350, 350, 680]" + tables([plate])
    run = run_text(config(body, start, loads, "end = 50000\nsamples = 101"))
    rate = np.sqrt(1361 / 299792458 * 200 * 1.5 * (1 - float(specular)) / moment)
    m = np.sin(largest) ** 2
    sn = ellipj(rate * run.dataset["time"].values + ellipk(m), m)[0]
    q = run.dataset["quaternion"].values
    turned = 2 * np.arctan2(q[:, 1], q[:, 0])
    turned = (turned + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(np.sin(turned) - np.sin(largest) * sn).max() < 1e-12
    assert turned.min() < -0.5  # it has swung


# --- refusals -----------------------------------------------------------------------------------------------

PLATE = {"normal": ("0", "0", "1"), "area": "1"}
NONSENSE = [
    ([], "", "", "body without surfaces"),
    ([{"specular": "0.5"}], "", "", "none of its forms"),
    ([{"normal": ("0", "0", "1")}], "", "", "missing area; a plate needs its normal and its area"),
    ([PLATE | {"specular": "0.7", "diffuse": "0.4"}], "", "", "at most 1"),
    ([PLATE], 'light = "sun"', 'light = "moon"', "which is no source; sources of this scene: sun"),
]


@pytest.mark.parametrize(("surfaces", "old", "new", "said"), NONSENSE)
def test_nonsense_is_refused(surfaces: list[dict[str, Any]], old: str, new: str, said: str) -> None:
    text = config(BODY + tables(surfaces), START, SUN + LIGHT_LOAD.replace(old, new))
    with pytest.raises(ConfigError, match=re.escape(said)):
        build_scene(rigidsim.parse(text))
