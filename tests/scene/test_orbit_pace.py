"""An orbit's pace: by its anomalistic period, its sidereal period, or the rate of its longitude."""

import random
from typing import Any

import mpmath
import pytest

import rigidsim.model.loads  # noqa: F401  (kinds of loads)
from rigidsim import ConfigError, parse
from rigidsim.scene.scene import build_scene

SCENE = """
name = "pace"
body.principal_moments = [1, 1.3, 1.9]
initial = {{angular_velocity = [0.01, 0.02, 1], quaternion = [1, 0.2, 0.1, 0.3]}}
integrator.precision = "{precision}"
time = {{end = 10, samples = 5}}
loads = [{{kind = "gravity_gradient", gravitational_parameter = 1, orbit = {{{orbit}}}}}]
"""
DAY = 86400


def orbit_of(keys: str, precision: str = "quadruple") -> Any:
    text = SCENE.format(
        precision=precision, orbit=f"semi_major_axis = 1, eccentricity = 0.1, inclination = 0.3, {keys}"
    )
    (load,) = build_scene(parse(text)).loads
    return load.orbit  # type: ignore[attr-defined,no-any-return]


def test_64_random_paces_are_exact() -> None:
    """M' = l' - W' - w' with l' = 2 pi / T or as given, in 60 digits: days and degrees as written."""
    generator = random.Random(15)
    with mpmath.workdps(60):
        turn = 2 * mpmath.pi
        for number in range(64):
            period, node, periapsis = (generator.randint(1, 10**12) for _ in range(3))
            node -= 10**12
            rates = f'node_rate = "{node}e-16 deg/day", periapsis_rate = "{periapsis}e-16 deg/day", '
            drift = mpmath.mpf(node + periapsis) / 10**16 * turn / 360 / DAY
            by_period = f'sidereal_period = "{period}e-11 day"', turn / (mpmath.mpf(period) / 10**11 * DAY)
            by_rate = (
                f'longitude_rate = "{period}e-11 deg/day"',
                mpmath.mpf(period) / 10**11 * turn / 360 / DAY,
            )
            keys, longitude = (by_period, by_rate)[number % 2]
            found = mpmath.mpf(orbit_of(rates + keys).mean_motion)
            assert abs(found - (longitude - drift)) < mpmath.mpf(10) ** -55 * longitude
            anomalistic = mpmath.mpf(orbit_of(rates + f'period = "{period}e-11 day"').mean_motion)
            assert abs(anomalistic - by_period[1]) < mpmath.mpf(10) ** -55 * anomalistic


def test_a_table_takes_them_for_its_mean_longitude() -> None:
    rows = "\n".join(f"{10 * i}, {0.1 + 0.001 * i}, {0.2 + 0.01 * i}" for i in range(12))
    table = f'[tables."t.csv"]\ntext = """\ntime, eccentricity, ascending_node\n{rows}\n"""\n'
    keys = 'table = "t.csv", semi_major_axis = 1, inclination = 0.3, mean_anomaly = 0.5'
    for pace in ("period = 5", "sidereal_period = 5", 'longitude_rate = "2 pi/5"'):
        scene = build_scene(parse(SCENE.format(precision="quadruple", orbit=f"{keys}, {pace}") + table))
        (load,) = scene.loads
        orbit, context = load.table, scene.context  # type: ignore[attr-defined]
        assert abs(orbit.mean_motion - 2 * context.pi / 5) < 1e-40
        assert abs(orbit.starting_longitude(context.zero) - context.mpf("0.7")) < 1e-40  # anomaly and node


def test_a_wrong_pace_is_refused() -> None:
    with pytest.raises(ConfigError, match="given period and longitude_rate; give one of them"):
        orbit_of('period = 5e3, longitude_rate = "1 deg/s"')
    for key in ("period", "sidereal_period", "longitude_rate"):
        with pytest.raises(ConfigError, match=rf"orbit\.{key}: given -5; a positive (time|rate) is allowed"):
            orbit_of(f"{key} = -5")
    with pytest.raises(ConfigError, match=r"leaves the mean anomaly -0\.5 rad/s; a positive rate is allowed"):
        orbit_of("longitude_rate = 0.5, node_rate = 1")
