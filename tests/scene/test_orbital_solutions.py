"""Tables of orbital solutions as other programs write them: the same orbit from each file, in each frame, and
averaged, against formulas in numpy.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from support import config, seeds

from rigidsim import ConfigError, parse
from rigidsim.scene.scene import build_scene

ROWS, SPACING = 60, 400 * 365.25  # days
HNBODY = "# HNBody\n# made for a test\n0 7 8 9 12 10 11 15\n"
WRITERS: dict[str, Callable[..., str]] = {
    "hnbody": lambda t, e, i, w, n: f"{t!r} 1.0000010 {e!r} {i!r} {w!r} {n!r} {(w - n)!r} 12.5",
    "orbitn": lambda t, e, i, w, n: f"{t!r} 1.0000010 {e!r} {i!r} {(w - n)!r} {n!r} {w!r} 12.5",
    "vplanet": lambda t, e, i, w, n: f"{t / 365.25!r} 1.0000010 {e!r} {i!r} {(w - n)!r} {n!r} 12.5",
    "la2010": lambda t, e, i, w, n: " ".join(
        repr(float(x)).replace("e", "D")
        for x in (
            *(t / 365250, 1.0000010, 0.3, e * np.cos(np.radians(w)), e * np.sin(np.radians(w))),
            *(np.sin(np.radians(i) / 2) * f(np.radians(n)) for f in (np.cos, np.sin)),
        )
    ),
}


def elements(seed: int) -> np.ndarray:
    """Rows of t (days, to the past), e, inclination, longitude of perihelion, node (deg)."""
    draw, t = np.random.default_rng(seed), -SPACING * np.arange(ROWS)
    z, zeta = (
        sum(
            size * draw.uniform(0.3, 1) * np.exp(1j * (rate * t * 4.848e-6 / 365.25 + draw.uniform(0, 6)))
            for rate in draw.uniform(-20, 20, 3)
        )
        for size in (0.02, 0.015)
    )
    tilt = 2 * np.arcsin(np.abs(zeta))
    return np.array([t, np.abs(z), *np.degrees([tilt, np.angle(z), np.angle(zeta)])]).T


def table_of(rows: str, keys: str, more: str = "") -> Any:
    """The orbit of a scene with such a table."""
    text = config(
        "principal_moments = [1, 1.01, 1.02]",
        'angular_velocity = [0, 0, "1 deg/s"]',
        'kind = "gravity_gradient"\ngravitational_parameter = "1.32712440018e20 m^3/s^2"\n'
        f'orbit = {{table = "rows.dat", {keys}}}',
        'start = "-8 kyr"\nend = "-10 kyr"\nsamples = 3',
        more=f"{more}\n[tables.\"rows.dat\"]\ntext = '''\n{rows}\n'''\n",
    )
    return build_scene(parse(text)).loads[0].table


def plane_and_pericentre(seed: int, row: int) -> tuple[np.ndarray, np.ndarray]:
    """Normal of an orbit, and e towards its pericentre, in the axes of its elements."""
    _, e, i, w, n = np.radians(elements(seed)[row]) * [1, 180 / np.pi, 1, 1, 1]
    argument = w - n
    normal = np.array([np.sin(i) * np.sin(n), -np.sin(i) * np.cos(n), np.cos(i)])
    towards = np.array(
        [
            np.cos(n) * np.cos(argument) - np.sin(n) * np.cos(i) * np.sin(argument),
            np.sin(n) * np.cos(argument) + np.cos(n) * np.cos(i) * np.sin(argument),
            np.sin(i) * np.sin(argument),
        ]
    )
    return normal, e * towards


def vectors(table: Any, row: int) -> tuple[np.ndarray, np.ndarray]:
    """The same of a table's row (from the earliest) in space axes."""
    k, h, q, p = (float(table.row(row)[name]) for name in "khqp")
    chi = np.sqrt(1 - p * p - q * q)
    normal = np.array([2 * p * chi, -2 * q * chi, 1 - 2 * (p * p + q * q)])
    along, across = (1 - 2 * p * p, 2 * p * q, -2 * p * chi), (2 * p * q, 1 - 2 * q * q, 2 * q * chi)
    return normal, k * np.array(along) + h * np.array(across)


def turn(axis: int, angle: float) -> np.ndarray:
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    found = np.eye(3)
    i, j = [x for x in range(3) if x != axis]
    sign = -1 if axis == 1 else 1
    found[i, i] = found[j, j] = c
    found[i, j], found[j, i] = -s * sign, s * sign
    return found


TILT = turn(0, 84381.406 / 3600)
HCI = turn(2, 75.594) @ turn(0, 7.155)
FRAMES = {
    "": ("", np.eye(3)),
    'frame = "HCI"': ("", HCI),
    'frame = "HCI" ': ('[frame]\naxes = "ICRF"', TILT @ HCI),
    'frame = "ecliptic J2000"': ('[frame]\naxes = "EME2000"', TILT),
    'frame = "ICRF"': ('[frame]\naxes = "ecliptic J2000"', TILT.T),
    'frame = ["20 deg", "30 deg", "-40 deg"]': ("", turn(2, 20) @ turn(0, 30) @ turn(2, -40)),
}


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("seed", seeds(2, 12))
def test_each_program_s_file_is_the_same_orbit(seed: int, frame: str) -> None:
    more, rotation = FRAMES[frame]
    format = sorted(WRITERS)[seed % len(WRITERS)]
    rows = "\n".join(WRITERS[format](*map(float, row)) for row in elements(seed))
    head = HNBODY if format == "hnbody" else ""
    table = table_of(head + rows, ", ".join(filter(None, [f'format = "{format}"', frame])), more)
    for row in (0, 7, ROWS - 1):
        wanted = plane_and_pericentre(seed, ROWS - 1 - row)
        for found, expected in zip(vectors(table, row), wanted, strict=True):
            np.testing.assert_allclose(found, rotation @ expected, rtol=0, atol=2e-14)
        normal = np.array(table.normal(table.time(row)), dtype=float)
        np.testing.assert_allclose(normal, rotation @ wanted[0], rtol=0, atol=2e-14)
    assert abs(float(table.time(ROWS - 1))) == 0
    assert float(table.row(3)["axis"]) == pytest.approx(1.000001 * 149597870700, rel=1e-15)


def test_osculating_elements_are_averaged_over_a_window() -> None:
    """A ripple of a period of three rows disappears, and a slow wave stays."""
    t = -400.0 * np.arange(200)
    slow, ripple = 0.02 + 0.005 * np.cos(t * 2 * np.pi / 4e4), 0.001 * np.cos(t * 2 * np.pi / 1200)
    names = "time [yr], eccentricity, longitude_of_periapsis"
    pairs = zip(t.tolist(), (slow + ripple).tolist(), strict=True)
    rows = "\n".join([names, *(f"{x!r}, {y!r}, 0" for x, y in pairs)])
    table = table_of(rows, 'semi_major_axis = "1 au", window = "8 kyr"')
    left = len(table.table.times)
    assert 200 - left == 2 * 10
    wanted = slow[::-1][10:-10]
    found = np.array([float(table.row(row)["k"]) for row in range(left)])
    assert np.abs(found - wanted).max() < 3e-4  # what a window takes of the wave itself
    # Hann's window leaves 1 / (pi x (x^2 - 1)) of a ripple, of which x periods are in it
    x = 8000 / 1200
    leaves = 1e-3 / (np.pi * x * (x * x - 1)) * (2 * np.sin(np.pi / 3)) ** 3
    assert np.abs(np.diff(found - wanted, 3)).max() < leaves


REFUSED = {
    'format = "hnbody"': "has no line of 8 numbers",
    'format = "snvec"': "hnbody",
    'frame = "galactic"': "",
    'frame = "ICRF"': "the space axes have no name; give [frame] axes",
    'semi_major_axis = "1 au", window = "100 yr"': "the window takes 1; 3 to",
    'semi_major_axis = "1 au", window = "100 kyr"': "the window takes",
}


@pytest.mark.parametrize("keys", REFUSED)
def test_what_a_table_is_not_is_refused(keys: str) -> None:
    rows = "\n".join(["time [yr], eccentricity", *(f"{-400 * i}, 0.01" for i in range(ROWS))])
    with pytest.raises(ConfigError) as caught:
        table_of(rows, keys)
    assert REFUSED[keys] in str(caught.value)
    with pytest.raises(ConfigError, match="without table; add it, or leave these out"):
        parse(config("principal_moments = [1, 2, 2.5]", "angular_velocity = [1, 0, 0]",
                     'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {semi_major_axis = 1, '
                     'window = "1 yr"}', "end = 1\nsamples = 2"))  # fmt: skip
