"""Radiation pressure and drag on plates, boxes and spheres, against the same motions in another formulation:
momentum in space and rotation matrix in 80 bits, in which a plate's side is a number that events turn.
"""

from __future__ import annotations

import re
from typing import Any

import heyoka as hy
import numpy as np
import pytest
from scipy.special import ellipj, ellipk
from space_motions import Motion, cross, dot
from support import config, matrices, run_text
from support import wide as whole

import rigidsim
from rigidsim import ConfigError
from rigidsim.scene.scene import build_scene

fp = np.longdouble
LIGHT, MU = fp(299792458), fp("3.986004418e14")
MOMENTS = [fp(x) for x in ("0.03", "0.034", "0.01")]
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


# --- the truth ----------------------------------------------------------------------------------------------


def plates(surfaces: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """All in numbers, boxes as plates where their faces are."""
    found = []
    for given in surfaces:
        one: dict[str, Any] = {"specular": fp(0), "diffuse": fp(0), "drag_coefficient": fp("2.2")}
        one |= {key: fp(x) for key, x in given.items() if isinstance(x, str)}
        one["position"] = np.array([fp(x) for x in given.get("position", ("0", "0", "0"))])
        if "size" in given:
            edges = np.array([fp(x) for x in given["size"]])
            for i in range(3):
                for side in (1, -1):
                    n = side * np.eye(3, dtype=fp)[i]
                    face = {"normal": n, "area": edges.prod() / edges[i]}
                    found.append(one | face | {"position": one["position"] + n * edges[i] / 2})
        elif "normal" in given:
            n = np.array([fp(x) for x in given["normal"]])
            n = n / np.sqrt((n * n).sum())
            for side in (1, -1) if given.get("both_sides") else (1,):
                found.append(one | {"normal": side * n})
        else:
            found.append(one)
    return found


def light_on(surface: dict[str, Any], u: Any, lit: Any) -> list[Any]:
    """Force of light of unit pressure from u."""
    s, d = surface["specular"], surface["diffuse"]
    if "radius" in surface:
        size = _PI * surface["radius"] ** 2 * (1 + 4 * d / 9)
        return [-size * x for x in u]
    n, size = surface["normal"], surface["area"] * lit
    c = dot(n, u)
    return [-size * c * ((1 - s) * x + 2.0 * (s * c + d / 3) * y) for x, y in zip(u, n, strict=True)]


def air_on(surface: dict[str, Any], v: Any, met: Any) -> list[Any]:
    """Force of air of unit density, through which it moves with v."""
    half = surface["drag_coefficient"] / 2
    if "radius" in surface:
        return [-half * _PI * surface["radius"] ** 2 * hy.sqrt(dot(v, v)) * x for x in v]
    return [-half * surface["area"] * met * dot(surface["normal"], v) * x for x in v]


_PI = fp("3.14159265358979323846264338327950288")


class Truth(Motion):
    """The body; in flight further states."""

    def __init__(self, surfaces: list[dict[str, Any]], flight: tuple[Any, ...] = (0,) * 6) -> None:
        names = ("x", "y", "z", "u", "v", "w")
        super().__init__(
            MOMENTS, ("0.5", "-0.6", "0.7"), ("1", "0.2", "0.1", "-0.3"),
            **dict(zip(names, flight, strict=True)),
        )  # fmt: skip
        self.x, self.v = ([self.more[name] for name in part] for part in ("xyz", "uvw"))
        self.all = plates(surfaces)
        self.normals: list[Any] = []
        self.looks: list[Any] = []
        self.force, self.torque = [hy.expression(fp(0))] * 3, [hy.expression(fp(0))] * 3

    def add(self, on: Any, vector: list[Any], size: Any) -> None:
        """Forces on all surfaces, body axes, for the unit vector from which they are met."""
        for surface in self.all:
            side = hy.expression(fp(1))
            if "normal" in surface:  # plates back to back share an event
                n = surface["normal"]
                same = [k for k, other in enumerate(self.normals) if abs(abs(dot(n, other)) - 1) < 1e-15]
                if not same:
                    same = [len(self.normals)]
                    self.normals.append(n)
                    self.looks.append(dot(n, vector))
                side = hy.par[same[0]]
                side = side if dot(n, self.normals[same[0]]) > 0 else fp(1) - side
            force = [size * x for x in on(surface, vector, side)]
            turning = cross(surface["position"], force)
            self.force = [a + b for a, b in zip(self.force, force, strict=True)]
            self.torque = [a + b for a, b in zip(self.torque, turning, strict=True)]

    def at(
        self, end: float, speeds: Any = (0.0,) * 6, gradient: Any = (0.0,) * 3
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rotation matrix, rates and further states at the end, by derivatives of these and a torque."""
        torque = [t + g for t, g in zip(self.torque, gradient, strict=True)]
        equations = self.equations(torque, **dict(zip(self.more, speeds, strict=True)))

        def turn(number: int) -> Any:
            def flip(engine: Any, sign: int) -> bool:
                engine.pars[number] = fp(sign > 0)
                return True

            return flip

        events = [hy.t_event(x, fp_type=fp, callback=turn(n)) for n, x in enumerate(self.looks)]
        value = hy.cfunc(self.looks or [self.x[0]], vars=[name for name, _ in equations], fp_type=fp)
        pars = [fp(x) for x in value(self.start) > 0] if self.looks else []
        (row,) = self.followed(equations, [end], pars=pars, t_events=events)
        return row[3:12].reshape(3, 3), self.rates_of(row), row[12:]


def lit(surfaces: list[dict[str, Any]], irradiance: str) -> Truth:
    truth = Truth(surfaces)
    to = np.array([fp("0.6"), fp("-0.5"), fp("0.9")])
    far = np.sqrt((to * to).sum())
    truth.add(light_on, truth.seen(to / far), fp(irradiance) / LIGHT / far**2)
    return truth


def wide(run: rigidsim.Run, name: str) -> np.ndarray:
    return whole(run.dataset, name)[-1]


def apart(run: rigidsim.Run, matrix: np.ndarray) -> float:
    """Angle between the attitude at the end and a rotation matrix, rad."""
    return float(np.sqrt(((matrices(wide(run, "quaternion")) - matrix) ** 2).sum() / 2))


def lit_text(surfaces: list[dict[str, Any]], irradiance: str, end: int, digits: str = "") -> str:
    loads = f'{SUN}{LIGHT_LOAD}irradiance = "{irradiance} W/m^2"'
    return config(
        BODY + tables(surfaces), START, loads, f"end = {end}\nsamples = 2", digits,
        'record = ["quaternion", "angular_velocity"]',
    )  # fmt: skip


# --- radiation pressure -------------------------------------------------------------------------------------


def test_light_on_plates_boxes_and_spheres() -> None:
    matrix, rates, _ = lit(OUTSIDE, "1e7").at(100)
    keys, most = 'precision = "double"\nformulation = "quaternion"', 2e-12
    run = run_text(lit_text(OUTSIDE, "1e7", 100, keys))
    free, _, _ = Truth([]).at(100)
    assert np.abs(free - matrix).max() > 0.1  # the light matters
    assert apart(run, matrix) < most
    assert np.abs(wide(run, "angular_velocity") - rates).max() < most


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


def test_a_windmill_spins_up_as_computed() -> None:
    """Two mirrors turned in opposite senses, light along the axis of largest moment: their forces across it
    are a constant couple 2 (2 P A c^2 n_z) r.
    """
    wings = [
        {"normal": ("0", "0.8", "0.6"), "area": "0.25", "position": ("2", "0", "0"), "specular": "1"},
        {"normal": ("0", "0.8", "-0.6"), "area": "0.25", "position": ("-2", "0", "0"), "specular": "1"},
    ]
    loads = SUN.replace('["0.6 au", "-0.5 au", "0.9 au"]', '[0, "2 au", 0]') + LIGHT_LOAD
    start = "angular_velocity = [0, 0.01, 0]\nquaternion = [1, 0, 0, 0]"
    run = run_text(config(BODY + tables(wings), start, loads, "end = 3600\nsamples = 3"))
    pressure = fp(1361) / LIGHT / 4
    gain = 2 * 2 * pressure * fp("0.25") * fp("0.64") * fp("0.6") * 2 / MOMENTS[1]
    rate = fp("0.01") + gain * 3600
    assert float(abs(wide(run, "angular_velocity")[1] / rate - 1)) < 1e-13
    turned = fp("0.01") * 3600 + gain * fp(3600) ** 2 / 2
    q = wide(run, "quaternion")
    assert float(abs(np.sin(turned / 2 - np.arctan2(q[2], q[0])))) < 1e-13 * float(turned)


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


# --- drag ---------------------------------------------------------------------------------------------------

UNIT = fp(7000000)  # m, of the truth's lengths
FLIGHT = f"{START}\nposition = [4e6, -3e6, 4.6e6]\nvelocity = [3000, 7000, 1956]"
EARTH = (
    'kind = "central_gravity"\nname = "earth"\ngravitational_parameter = 3.986004418e14\nradius = 6378137\n'
    "atmosphere_rate = [0, 1e-5, 7e-5]"
)
AIR = '\n[[loads]]\nkind = "drag"\ndensity = "1e-10 kg/m^3"\naltitude = "400 km"\nscale_height = "60 km"'


def flown(surfaces: list[dict[str, Any]], end: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The flight in the same air; MacCullagh's force, 1e-16 of the point's, is left out."""
    start = tuple(fp(x) / UNIT for x in (4000000, -3000000, 4600000, 3000, 7000, 1956))
    truth = Truth(surfaces, start)
    far = hy.sqrt(dot(truth.x, truth.x))
    rate = [fp(0), fp("1e-5"), fp("7e-5")]
    swept = cross([hy.expression(x) for x in rate], truth.x)
    relative = truth.seen([UNIT * (v - a) for v, a in zip(truth.v, swept, strict=True)])
    density = fp("1e-10") * hy.exp((fp(6778137) - UNIT * far) / fp(60000))
    truth.add(air_on, relative, density)
    strength = MU / UNIT**3
    c = truth.seen([x / far for x in truth.x])
    gradient = cross(c, [i * x for i, x in zip(MOMENTS, c, strict=True)])
    gradient = [3.0 * strength / far**3.0 * x for x in gradient]
    space = [dot(row, truth.force) for row in truth.matrix]
    pulls = [f / (4 * UNIT) - strength * x / far**3.0 for f, x in zip(space, truth.x, strict=True)]
    return truth.at(end, [*truth.v, *pulls], gradient)


def test_drag_in_rotating_air() -> None:
    matrix, rates, flight = flown(OUTSIDE, 100)
    keys, most = 'precision = "extended"\nformulation = "rotation_matrix"', 2e-15
    output = 'record = ["quaternion", "angular_velocity", "position", "velocity", "energy_balance"]'
    text = config(
        BODY + "\nmass = 4" + tables(OUTSIDE), FLIGHT, EARTH + AIR, "end = 100\nsamples = 2", keys, output
    )
    run = run_text(text)
    assert apart(run, matrix) < most
    assert np.abs(wide(run, "angular_velocity") - rates).max() < most
    assert np.abs(wide(run, "position") / UNIT - flight[:3]).max() < most / 100
    assert np.abs(wide(run, "velocity") / UNIT - flight[3:]).max() < most / 100
    assert np.abs(run.dataset["energy_balance_drift"].values).max() < most


@pytest.mark.slow(6)
def test_loads_on_surfaces_are_what_expressions_say() -> None:
    """A ball and a plate in light with shadows and in air, and the same as forces written by hand."""
    sun = (
        'kind = "gravity_gradient"\nname = "sun"\nradius = "695700 km"\ngravitational_parameter = 1.327e20\n'
        'orbit = {semi_major_axis = "149.6e6 km", eccentricity = 0.0167, mean_anomaly = 5}'
    )
    outside = [
        {"normal": ("0", "0", "1"), "area": "2", "position": ("0.1", "0.2", "0"), "specular": "0.25"},
        {"radius": "0.5", "position": ("0", "0.1", "0.3"), "diffuse": "0.9"},
    ]
    light = "1361/299792458*(149597870700/r_sun)^2*shadow_sun"
    plate = f"{light}*2*max(uz_sun, 0)"
    ball = f"{light}*pi*0.25*1.4"
    air = "1e-13*exp((400e3 - altitude)/60e3)*2.2/2"
    speed = "sqrt(vrx^2 + vry^2 + vrz^2)"

    def force(components: list[str], point: str) -> str:
        row = ", ".join(f'"{x}"' for x in components)
        return f'\n[[loads]]\nkind = "force"\nframe = "body"\ncomponents = [{row}]\npoint = {point}'

    where = ["[0.1, 0.2, 0]", "[0, 0.1, 0.3]"]
    by_hand = force(
        [f"-0.75*{plate}*u{x}_sun" + f"-0.5*{plate}*uz_sun" * (x == "z") for x in "xyz"], where[0]
    )
    by_hand += force([f"-{ball}*u{x}_sun" for x in "xyz"], where[1])
    by_hand += force([f"-{air}*2*max(vrz, 0)*vr{x}" for x in "xyz"], where[0])
    by_hand += force([f"-{air}*pi*0.25*{speed}*vr{x}" for x in "xyz"], where[1])
    output = 'record = ["quaternion", "position", "energy_balance"]'
    found = []
    for body, loads in (
        (
            BODY + "\nmass = 4" + tables(outside),
            EARTH + "\n[[loads]]\n" + sun + LIGHT_LOAD + AIR.replace("1e-10", "1e-13"),
        ),
        (BODY + "\nmass = 4", EARTH + "\n[[loads]]\n" + sun + by_hand),
    ):
        run = run_text(config(body, FLIGHT, loads, "end = 1200\nsamples = 2", output=output))
        assert np.abs(run.dataset["energy_balance_drift"].values).max() < 1e-12
        found.append((wide(run, "quaternion"), wide(run, "position")))
    (q, x), (p, y) = found
    assert min(np.abs(q - p).max(), np.abs(q + p).max()) < 1e-11
    assert np.abs(x - y).max() / 7e6 < 1e-13


# --- refusals -----------------------------------------------------------------------------------------------

PLATE = {"normal": ("0", "0", "1"), "area": "1"}
NONSENSE = [
    ([], "", "", "body without surfaces"),
    ([{"specular": "0.5"}], "", "", "none of its forms"),
    ([{"normal": ("0", "0", "0"), "area": "1"}], "", "", "given zero"),
    ([{"normal": ("0", "0", "1")}], "", "", "missing; a plate needs its area"),
    ([{"normal": ("0", "0", "1"), "area": "-1"}], "", "", "a positive area is allowed"),
    ([PLATE | {"specular": "0.7", "diffuse": "0.4"}], "", "", "at most 1"),
    ([PLATE | {"drag_coefficient": "-2"}], "", "", "zero or more is allowed"),
    ([PLATE], 'light = "sun"', 'light = "moon"', "which is no source; sources of this scene: sun"),
    ([PLATE], 'light = "sun"', 'light = "sun"\nirradiance = "1361 W"', "W/m^2"),
    (
        [PLATE],
        'kind = "radiation_pressure"\nlight = "sun"',
        'kind = "drag"\ndensity = 1e-12',
        "central_gravity",
    ),
]


@pytest.mark.parametrize(("surfaces", "old", "new", "said"), NONSENSE)
def test_nonsense_is_refused(surfaces: list[dict[str, Any]], old: str, new: str, said: str) -> None:
    text = config(BODY + tables(surfaces), START, SUN + LIGHT_LOAD.replace(old, new))
    with pytest.raises(ConfigError, match=re.escape(said)):
        build_scene(rigidsim.parse(text))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ('density = 1\nscale_height = "60 km"', "altitude and scale_height are given together"),
        ('density = "1e-12 kg/m^3*exp(-t/(1 s))"\naltitude = 4e5\nscale_height = 6e4', "says how it falls"),
    ],
)
def test_odd_air_is_refused(keys: str, said: str) -> None:
    load = f'{EARTH}\n[[loads]]\nkind = "drag"\n{keys}'
    with pytest.raises(ConfigError, match=re.escape(said)):
        build_scene(rigidsim.parse(config(BODY + "\nmass = 4" + tables([PLATE]), FLIGHT, load)))
