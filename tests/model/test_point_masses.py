"""Point masses that move beside the body: against Kepler's closed form, heyoka's own n-body equations and the
six-degree motion about a fixed point; what each coupling keeps.
"""

import math

import heyoka as hy
import numpy as np
import pytest
import xarray
from support import cases, config, law, run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare

EPS = 2.0**-52
AU, SUN, EARTH, MOON = 149597870700.0, 1.32712440018e20, 3.986004418e14, 4.9028e12
DAY = 86400.0
PLANET = config(
    'principal_moments = ["8.010e37 kg m^2", "8.012e37 kg m^2", "8.0365e37 kg m^2"]\n'
    'mass = "5.97219e24 kg"\n%s',
    'euler_angles = [0, "23.44 deg", 0]\nangular_velocity = [0, 0, "36 deg/day"]\n%s',
    time='end = "40 day"\nsamples = 9',
)
BODIES = (
    f'[[bodies]]\nname = "sun"\ngravitational_parameter = {SUN!r}\n'
    f'[[bodies]]\nname = "earth"\ngravitational_parameter = {EARTH!r}\n'
    'orbit = {about = "sun", semi_major_axis = "1 au", eccentricity = 0.3, inclination = "7 deg", '
    "ascending_node = 0.4, periapsis = 1.1, mean_anomaly = 6.1}\n"
)
THIRD = f"""
[[bodies]]
name = "moon"
gravitational_parameter = {MOON!r}
orbit = {{about = "earth", semi_major_axis = "384400 km", eccentricity = 0.0549, inclination = "5.145 deg"}}
"""


def gradient(name: str) -> str:
    return f'[[loads]]\nkind = "gravity_gradient"\norbit = {{body = "{name}"}}\n'


def planet(coupling: str, *, moon: bool = True) -> str:
    masses = BODIES + (THIRD + gradient("moon") if moon else "") + gradient("sun")
    return PLANET % (f'host = "earth"\ncoupling = "{coupling}"', masses)


@pytest.fixture(scope="module", params=["one_way", "full"])
def planetary(request: pytest.FixtureRequest) -> tuple[str, rigidsim.Run]:
    return request.param, run_text(planet(request.param))


def test_what_each_coupling_keeps(planetary: tuple[str, rigidsim.Run]) -> None:
    coupling, run = planetary
    which = "system" if coupling == "full" else "orbital"
    other = "orbital" if coupling == "full" else "system"
    dataset = run.dataset
    # each step rounds all positions and velocities (Brouwer 1937): a random walk, of some terms for each mass
    bound = 8 * EPS * math.sqrt(run.summary["cost"]["steps"]) * 3
    for name in ("energy", "angular_momentum", "linear_momentum"):
        assert float(np.abs(dataset[f"{which}_{name}_drift"]).max()) < bound
        assert f"{other}_{name}" not in dataset
    assert float(np.abs(dataset.energy_balance_drift).max()) < bound  # the spin takes what torques give it


def test_positions_are_those_of_heyokas_own_equations(planetary: tuple[str, rigidsim.Run]) -> None:
    coupling, run = planetary
    dataset = run.dataset
    assert list(dataset.point_mass.values) == ["sun", "earth", "moon"]
    assert dataset.point_mass_position.dims == ("time", "point_mass", "space_axis")
    places, speeds = dataset.point_mass_position.values, dataset.point_mass_velocity.values
    unit = 2.0**37, 2.0**15  # m and m/s, so that numbers are of order one
    strengths = [s / unit[0] / unit[1] ** 2 for s in (SUN, EARTH, MOON)]
    start = np.concatenate(
        [np.concatenate([x / unit[0], v / unit[1]]) for x, v in zip(places[0], speeds[0], strict=True)]
    )
    engine = hy.taylor_adaptive(hy.model.nbody(3, masses=strengths), start, compact_mode=True)
    engine.propagate_until(40 * DAY * unit[1] / unit[0])
    found = engine.state.reshape(3, 6)[:, :3] * unit[0]
    # rounding of places of an astronomical unit, which velocities carry along for so many days
    rounding = 16 * EPS * AU * math.sqrt(run.summary["cost"]["steps"])
    apart = np.abs(places[-1] - found).max()
    if coupling == "one_way":
        assert apart < rounding
    else:  # the Moon feels the Earth's flattening, by 3/2 (C - A) / (M a^2) = 5e-8 of its fall, t^2/2 of it
        assert 10 * rounding < apart < 1e-6 * 0.5 * EARTH / 384.4e6**2 * (40 * DAY) ** 2


def test_one_mass_is_keplers_closed_form() -> None:
    """The same spin under the same orbit given by its elements: the Sun as the planet sees it."""
    run = run_text(planet("one_way", moon=False)).dataset
    period = 2 * math.pi * math.sqrt(AU**3 / (SUN + EARTH))
    # the planet's orbit about the Sun is, turned by half a turn, the Sun's about the planet
    orbit = (
        f'{{semi_major_axis = "1 au", eccentricity = 0.3, inclination = "7 deg", ascending_node = 0.4, '
        f"periapsis = {1.1 + math.pi!r}, mean_anomaly = 6.1, period = {period!r}}}"
    )
    load = f'[[loads]]\nkind = "gravity_gradient"\ngravitational_parameter = {SUN!r}\norbit = {orbit}\n'
    kepler = run_text(PLANET % ("", load)).dataset
    rounding = law(EPS, 1000, math.radians(36) / DAY, 40 * DAY)
    apart = np.abs(run.quaternion.values - kepler.quaternion.values).max()
    assert apart < 4 * rounding


# --- six degrees of freedom: a long body about a planet, its shape felt in its path ----------------

DUMBBELL = config(
    'principal_moments = ["1e13 kg m^2", "2e14 kg m^2", "2.05e14 kg m^2"]\nmass = "1000 kg"\n%s',
    "angular_velocity = [1e-3, 2e-4, 8e-4]\nquaternion = [0.9, 0.2, -0.1, 0.3]\n%s",
    time='end = "3 h"\nsamples = 13',
)
POSITION, VELOCITY = [9.0e6, 1.0e5, -4.0e5], [-300.0, 6500.0, 900.0]
ATTRACTOR = f'[[bodies]]\nname = "planet"\ngravitational_parameter = {EARTH!r}\nposition = [0, 0, 0]\n'
FLIGHT = f"position = {POSITION}\nvelocity = {VELOCITY}\n"
PULLED = '[[loads]]\nkind = "central_gravity"\norbit = {body = "planet"}\n'
SATELLITE = f'[[bodies]]\nname = "satellite"\ngravitational_parameter = 6.6743e-8\n{FLIGHT}'  # of 1000 kg


@pytest.fixture(scope="module")
def about_a_fixed_point() -> xarray.Dataset:
    load = f'[[loads]]\nkind = "central_gravity"\ngravitational_parameter = {EARTH!r}\n'
    return run_text(DUMBBELL % ("", FLIGHT + load)).dataset


@pytest.mark.parametrize("way", cases(["host", "own flight"], ["host"]))
def test_full_coupling_is_six_degree_central_gravity(way: str, about_a_fixed_point: xarray.Dataset) -> None:
    """The planet is 6e21 times as heavy, so that it stays where it is to all digits."""
    expected = about_a_fixed_point
    body, masses = 'host = "satellite"\n', ATTRACTOR + SATELLITE + gradient("planet")
    if way == "own flight":
        body, masses = "", FLIGHT + ATTRACTOR + PULLED
    full, one_way = (
        run_text(DUMBBELL % (f'{body}coupling = "{coupling}"', masses)).dataset
        for coupling in ("full", "one_way")
    )
    places = [
        x.point_mass_position.sel(point_mass="satellite").values if body else x.position.values
        for x in (full, one_way)
    ]
    rounding = law(EPS, 200, 1.3e-3, 3 * 3600.0)  # relative to the distance, and as an angle
    amplified = 64  # of the orbit's along-track errors and the tumbling's, over the law of free rotation
    apart = [np.abs(place - expected.position.values).max() for place in places]
    assert apart[0] < amplified * rounding * 9e6
    assert np.abs(full.quaternion.values - expected.quaternion.values).max() < amplified * rounding
    for name in ("energy", "angular_momentum", "linear_momentum"):
        assert float(np.abs(full[f"system_{name}_drift"]).max()) < 8 * EPS * math.sqrt(200) * 3
    if body:  # without the forces of its shape it moves elsewhere
        assert apart[1] > 1e3
    else:  # a body that flies by itself feels its own shape in either case
        assert apart[1] < amplified * rounding * 9e6


REFUSED = {"no such host": (
        (PLANET % ('host = "erth"', BODIES + gradient("sun"))),
        '[body] host: given "erth"; did you mean "earth"?; allowed: sun, earth',
    ), "mass": (
        planet("full").replace("5.97219e24", "6.5e24"),
        '[body] mass: given 6.5e+24 kg, but the gravitational parameter of its host "earth"',
    ), "an orbit of its own": (
        planet("one_way").replace(
            'orbit = {body = "sun"}',
            f'orbit = {{semi_major_axis = "1 au"}}\ngravitational_parameter = {SUN!r}',
        ),
        'give orbit = {body = "..."}, which is where that body is',
    ), "the torque of what attracts it, twice": (
        DUMBBELL % ("", FLIGHT + ATTRACTOR + gradient("planet") + PULLED),
        "which has its torque; remove it",
    )}  # fmt: skip


@pytest.mark.parametrize("which", REFUSED)
def test_bodies_that_can_not_be(which: str) -> None:
    text, says = REFUSED[which]
    with pytest.raises(ConfigError) as caught:
        _ = prepare(rigidsim.parse(text)).system.outputs
    assert says in str(caught.value)
