"""Starts by pole, obliquity and period: against their definitions in mpmath, and against the observables."""

import mpmath
import numpy as np
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st

import rigidsim
from rigidsim import ConfigError
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.scene.scene import build_scene
from tests.support import cases, run_text

DIGITS = 50
CONFIG = """
name = "start"
[body]
principal_moments = [1, 2, 2.5]
[initial]
{start}
[frame]
{frame}
[time]
end = 1
samples = 2
[integrator]
precision = {precision}
[output]
record = ["right_ascension", "declination", "prime_meridian", "obliquity", "angular_velocity"]
"""
ORBIT = """
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = 1e-3
orbit = {semi_major_axis = 10, inclination = 0.4, ascending_node = 1.1, node_rate = -1e-3}
"""
DECLINATIONS = st.integers(-89_999_999, 89_999_999).map(lambda n: n / 1_000_000)  # deg
ANGLES = st.integers(-179_999_999, 179_999_999).map(lambda n: n / 1_000_000)  # deg


def config(start: str, frame: str = "", precision: str = str(DIGITS)) -> str:
    if "spin_period" not in start and "angular" not in start:
        start += "\nangular_velocity = [0, 0, 1]"
    return CONFIG.format(start=start, frame=frame, precision=precision)


def column(q: list[mpmath.mpf], k: int) -> list[mpmath.mpf]:
    """Body axis k (0, 1, 2) in space axes, by the rotation q v q*."""
    w, a = q[0], q[1:]
    v = [mpmath.mpf(i == k) for i in range(3)]
    cross = lambda p, r: [p[(i + 1) % 3] * r[(i + 2) % 3] - p[(i + 2) % 3] * r[(i + 1) % 3] for i in range(3)]  # noqa: E731
    t = [2 * x for x in cross(a, v)]
    return [v[i] + w * t[i] + cross(a, t)[i] for i in range(3)]


def to_equator(v: list[mpmath.mpf], axes: str) -> list[mpmath.mpf]:
    """Ecliptic to equatorial components of J2000, by the obliquity of IAU 2006."""
    if axes != "ecliptic J2000":
        return v
    tilt = mpmath.mpf("84381.406") / 3600 * mpmath.pi / 180
    c, s = mpmath.cos(tilt), mpmath.sin(tilt)
    return [v[0], c * v[1] - s * v[2], s * v[1] + c * v[2]]


def apart(angle: mpmath.mpf, degrees: float) -> mpmath.mpf:
    """Distance of an angle (rad) from one in degrees, on the circle."""
    difference = angle - mpmath.mpf(repr(degrees)) * mpmath.pi / 180
    return abs(difference - 2 * mpmath.pi * mpmath.nint(difference / (2 * mpmath.pi)))


@given(
    ANGLES,
    DECLINATIONS,
    ANGLES,
    st.sampled_from("xyz"),
    st.sampled_from(["ICRF", "EME2000", "ecliptic J2000"]),
)
@settings(max_examples=25, deadline=None)
def test_a_pole_and_a_prime_meridian_are_where_they_were_given(
    ascension: float, declination: float, turn: float, axis: str, axes: str
) -> None:
    """From the node's definition: the equator rises through that of J2000 along Z x pole."""
    start = f'pole = ["{ascension} deg", "{declination} deg"]\nprime_meridian = "{turn} deg"'
    scene = build_scene(rigidsim.parse(config(start, f'axes = "{axes}"\nfigure_axis = "{axis}"')))
    with mpmath.workdps(DIGITS + 20):
        q = [mpmath.make_mpf(x._mpf_) for x in scene.quaternion]
        k = "xyz".index(axis)
        pole, first = (to_equator(column(q, n), axes) for n in (k, (k + 1) % 3))
        size = mpmath.hypot(pole[0], pole[1])
        node = [-pole[1] / size, pole[0] / size, 0]
        ahead = [-pole[2] * node[1], pole[2] * node[0], size]  # pole x node
        along, across = (mpmath.fdot(first, v) for v in (node, ahead))
        least = mpmath.mpf(10) ** -DIGITS
        assert apart(mpmath.atan2(pole[1], pole[0]), ascension) < least / size
        assert apart(mpmath.atan2(pole[2], size), declination) < least
        assert apart(mpmath.atan2(across, along), turn) < least / size


def first_sample(dataset: xarray.Dataset, name: str, place: int = 0) -> mpmath.mpf:
    return mpmath.fsum(float(np.ravel(dataset[part].values[0])[place]) for part in parts_in(dataset, name))


@pytest.mark.parametrize(
    "precision", cases(['"single"', '"double"', '"extended"', "50", "100"], ['"double"', "50"])
)
@pytest.mark.parametrize("axis", cases("xyz", "y"))
def test_start_and_observables_agree_to_the_last_digits(precision: str, axis: str) -> None:
    """A body that starts by its pole is recorded with it; so by its obliquity on a moving orbital plane."""
    frame = f'axes = "ecliptic J2000"\nreference = "orbit"\nfigure_axis = "{axis}"'
    pole = 'pole = ["-42.32 deg", "52.89 deg"]\nprime_meridian = "176.63 deg"\nspin_period = "-25 h"'
    node = 'obliquity = "27.1 deg"\nnode_longitude = "-100.3 deg"\nprime_meridian = "31.7 deg"'
    epsilon = {'"single"': 2.0**-23, '"double"': 2.0**-52, '"extended"': 2.0**-63}.get(precision)
    expected = (
        {"right_ascension": -42.32, "declination": 52.89, "prime_meridian": 176.63},
        {"obliquity": 27.1, "node_longitude": -100.3, "prime_meridian": 31.7},
    )
    with mpmath.workdps(130):
        close = 40 * (mpmath.mpf(epsilon) if epsilon else mpmath.mpf(10) ** -int(precision))
        for start, values in zip((pole, node), expected, strict=True):
            text = config(start, frame, precision) + ORBIT
            dataset = run_text(text.replace('"obliquity", ', '"obliquity", "node_longitude", ')).dataset
            for name, degrees in values.items():
                assert apart(first_sample(dataset, name), degrees) < close, name
            if "spin_period" in start:
                spin = first_sample(dataset, "angular_velocity", "xyz".index(axis))
                assert abs(spin * 25 * 3600 / (2 * mpmath.pi) + 1) < close


@pytest.mark.parametrize(
    ("start", "frame", "where", "what"),
    [
        ("pole = [1, 0.5]", "", "pole", "set [frame] axes"),
        ('pole = [1, "91 deg"]', 'axes = "ICRF"', "pole", "declination of 91.0 deg; -90 to 90 deg"),
        ("pole = [1, 0.5]\nquaternion = [1, 0, 0, 0]", 'axes = "ICRF"', "pole", "given with quaternion"),
        ("prime_meridian = 1", 'axes = "ICRF"', "prime_meridian", "given without pole or obliquity"),
        ("obliquity = 1", "", "node_longitude", "missing; obliquity needs it"),
        ("node_longitude = 1", "", "node_longitude", "given without obliquity"),
        ('obliquity = "-1 deg"\nnode_longitude = 1', "", "obliquity", "given -1.0 deg; 0 to 180 deg"),
        ("spin_period = 0", "", "spin_period", "given 0; any other time"),
        ("spin_period = 1\nangular_velocity = [1, 0, 0]", "", "spin_period", "given with angular_velocity"),
    ],
)
def test_starts_that_contradict_themselves_are_refused(start: str, frame: str, where: str, what: str) -> None:
    with pytest.raises(ConfigError) as refused:
        build_scene(rigidsim.parse(config(start, frame)))
    (problem,) = refused.value.problems
    assert problem.where == f"[initial] {where}"
    assert what in problem.what
