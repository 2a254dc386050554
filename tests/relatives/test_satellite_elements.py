"""A source placed by the body's own elements (``satellite_orbit``), against Kepler's equation."""

import random

import mpmath
import numpy as np
import pytest
from kepler import on_ellipse, turned
from support import EPSILON, config, loaded, run_text, seeds, unoptimised_code

import rigidsim
from rigidsim.scene.parts_of_values import parts_in

GM = "3.986004418e14"
SAMPLES = 5
mp = mpmath.mp.clone()
mp.prec = 160


def satellite(elements, time):
    """Place of a satellite (mpf)."""
    a, e, tilt, node, periapsis, mean, node_rate, periapsis_rate = (mp.mpf(str(x)) for x in elements)
    mean = mean + mp.sqrt(mp.mpf(GM) / a**3) * time
    place = on_ellipse(mp, a, e, mean)
    turns = (periapsis + periapsis_rate * time, 3), (tilt, 1), (node + node_rate * time, 3)
    return turned(mp, place, *turns)


def drawn(draw: random.Random):
    """Elements in SI, and the same as a table of the config."""
    names = [
        "eccentricity",
        "inclination",
        "ascending_node",
        "periapsis",
        "mean_anomaly",
        "node_rate",
        "periapsis_rate",
    ]
    values = [round(draw.uniform(6.8e6, 5e7)), draw.choice([0, round(draw.uniform(0, 0.7), 4)])]
    values.append(draw.choice([0, round(draw.uniform(0, 3), 4)]))
    values += [draw.choice([0, round(draw.uniform(0, 6), 4)]) for _ in range(3)]
    values += [draw.choice([0, round(draw.uniform(-1e-5, 1e-5), 9)]) for _ in range(2)]
    table = "".join(f", {name} = {value:.9f}" for name, value in zip(names, values[1:], strict=True))
    return values, f"semi_major_axis = {values[0]}{table}"


def exact(dataset, name):
    """A variable with all its parts (mpf)."""
    parts = [dataset[part].values for part in parts_in(dataset, name)]
    return [[sum((mp.mpf(float(part[i, j])) for part in parts), mp.zero) for j in range(parts[0].shape[1])]
            for i in range(len(parts[0]))]  # fmt: skip


def as_table(elements, end):
    """A CSV with the same orbit at 41 moments: columns whose names are drawn by what they hold."""
    lines = ["time, semi_major_axis, eccentricity, inclination, ascending_node, periapsis, mean_anomaly"]
    a, e, tilt, node, periapsis, mean, node_rate, periapsis_rate = elements
    motion = (float(GM) / a**3) ** 0.5
    for t in np.linspace(0, end, 41):
        row = t, a, e, tilt, node + node_rate * t, periapsis + periapsis_rate * t, mean + motion * t
        lines.append(", ".join(f"{x:.17g}" for x in row))
    return "\n".join(lines)


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_the_source_is_opposite_to_the_satellite(seed: int) -> None:
    draw = random.Random(seed)
    elements, table = drawn(draw)
    precision = draw.choice(list(EPSILON))
    kind = draw.choice(["gravity_gradient", "magnetic_dipole", "table"])
    end = round(draw.uniform(1, 9) * float(elements[0]) ** 1.5 / float(GM) ** 0.5)
    more = ""
    if kind == "table":
        table, precision = 'table = "it.csv"', draw.choice(["double", "extended"])
        more = f"[tables.\"it.csv\"]\ntext = '''\n{as_table(elements, end)}'''\n"
    load = f'kind = "gravity_gradient"\ngravitational_parameter = {GM}\nsatellite_orbit = {{{table}}}'
    if kind == "magnetic_dipole":
        load = (
            load.replace("gravity_gradient", kind) + "\nmoment = [0, 0, 0.1]\nsource_moment = [0, 0, -7.7e22]"
        )
    text = config(
        body="principal_moments = [10, 14, 19]",
        initial="angular_velocity = [1e-4, -2e-4, 3e-4]\n"
        f"euler_angles = [0.3, {draw.uniform(0.2, 3):.3f}, 1]",
        loads=load,
        time=f"end = {end}\nsamples = {SAMPLES}",
        integrator=f'precision = "{precision}"',
        output='record = ["quaternion", "nadir"]',
        more=more,
    )
    with unoptimised_code():
        dataset = loaded(run_text(text))
    epsilon = EPSILON[precision]
    e, turns = elements[1], 9
    near = 100 * turns * epsilon / (1 - e) ** 2  # rounding of the phase, and of steps
    if kind == "table":
        near += 1e-5 / (1 - e) ** 2 if elements[6] or elements[7] else 1e-11  # interpolated rows of float64
    quaternions, nadir = (exact(dataset, x) for x in ("quaternion", "nadir"))
    for i, time in enumerate(dataset.time.values):
        place = satellite(elements, mp.mpf(float(time)))
        down = [-x / mp.sqrt(mp.fdot(place, place)) for x in place]
        w, x, y, z = quaternions[i]
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        into = [[rows[j][k] for j in range(3)] for k in range(3)]  # space to body axes
        seen = [mp.fdot(row, down) for row in into]
        assert max(abs(a - b) for a, b in zip(seen, nadir[i], strict=True)) < near


def share_seen(sat, sun, radius, sun_radius):
    """Share of the Sun's disc that is seen past a sphere: areas of two circles by their angular radii."""
    sun = sun - sat
    a, b = np.arcsin(sun_radius / np.linalg.norm(sun)), np.arcsin(radius / np.linalg.norm(sat))
    c = np.arccos(np.clip(-(sat @ sun) / np.linalg.norm(sat) / np.linalg.norm(sun), -1, 1))
    if c >= a + b or np.linalg.norm(sun) < np.linalg.norm(sat):
        return 1.0
    if c <= abs(a - b):
        return 0.0 if b >= a else 1 - (b / a) ** 2
    x = (c * c + a * a - b * b) / (2 * c)
    y = np.sqrt(a * a - x * x)
    return 1 - (a * a * np.arccos(x / a) + b * b * np.arccos((c - x) / b) - c * y) / (np.pi * a * a)


@pytest.mark.parametrize("seed", seeds(1, 20))
def test_eclipses_are_where_the_satellite_is(seed: int) -> None:
    """The Sun's light over an orbit, in eighths, against a sum over 16,000 moments."""
    draw = random.Random(seed)
    a, e = draw.uniform(6.9e6, 1e7), draw.uniform(0, 0.01)
    angles = [draw.uniform(0, 6) for _ in range(3)]
    elements = (a, e, draw.uniform(0, 1.5), *angles, 0, 0)
    period = 2 * np.pi * np.sqrt(a**3 / float(GM))
    table = f"semi_major_axis = {a!r}, eccentricity = {e!r}, inclination = {elements[2]!r}, "
    table += f"ascending_node = {angles[0]!r}, periapsis = {angles[1]!r}, mean_anomaly = {angles[2]!r}"
    load = (
        'kind = "gravity_gradient"\nname = "{}"\nradius = {}\ngravitational_parameter = {}\n{}_orbit = {{{}}}'
    )
    sun = "semi_major_axis = 149.6e9, mean_anomaly = 1"
    loads = [
        load.format("earth", 6378e3, GM, "satellite", table),
        load.format("sun", 695700e3, 1.32712440018e20, "", sun).replace("_orbit", "orbit"),
    ]
    state = '[[states]]\nname = "lit"\ninitial = 0\nunit = "s"\nderivative = "shadow_sun"'
    with unoptimised_code():
        dataset = loaded(run_text(config(
            body="principal_moments = [10, 14, 19]", initial="angular_velocity = [0, 0, 1e-3]", loads=loads,
            time=f"end = {period}\nsamples = 9", output='record = ["lit"]', more=state,
        )))  # fmt: skip
    pace = np.sqrt(1.32712440018e20 / 149.6e9**3)
    times = np.linspace(0, period, 16001)
    cn, sn, ci, si, cw, sw = (f(x) for x in (angles[0], elements[2], angles[1]) for f in (np.cos, np.sin))
    p = np.array([cn * cw - sn * sw * ci, sn * cw + cn * sw * ci, sw * si])
    q = np.array([-cn * sw - sn * cw * ci, -sn * sw + cn * cw * ci, cw * si])
    mean = angles[2] + 2 * np.pi * times / period
    anomaly = mean
    for _ in range(30):
        anomaly = mean + e * np.sin(anomaly)
    seen = []
    for t, x in zip(times, anomaly, strict=True):
        sat = a * ((np.cos(x) - e) * p + np.sqrt(1 - e * e) * np.sin(x) * q)
        # the Sun is given as seen from the satellite
        sunwards = 149.6e9 * np.array([np.cos(1 + pace * t), np.sin(1 + pace * t), 0])
        seen.append(share_seen(sat, sat + sunwards, 6378e3, 695700e3))
    lit = np.concatenate([[0], np.cumsum((np.array(seen[1:]) + seen[:-1]) / 2)]) * period / 16000
    # a penumbra of some seconds has slopes near 1/8 1/s: the trapezes are good to a step squared
    assert np.abs(dataset.lit.values - lit[::2000]).max() < 0.02
    assert dataset.lit.values[-1] > 0.5 * period


CENTRE = f'[[loads]]\nkind = "gravity_gradient"\ngravitational_parameter = {GM}\n'
DIPOLE = '[[loads]]\nkind = "magnetic_dipole"\nmoment = [0, 0, 1]\nsource_moment = [0, 0, 1e22]\n'


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (
            CENTRE + "satellite_orbit = {semi_major_axis = 7e6}\norbit = {semi_major_axis = 7e6}",
            "exactly one of",
        ),
        (DIPOLE + "satellite_orbit = {period = 10}\norbit = {period = 10}", "give one of them"),
        (
            CENTRE + "satellite_orbit = {semi_major_axis = 7e6}\nposition = [7e6, 0, 0]",
            "the body's own orbit about",
        ),
        (CENTRE, "orbit is the place of the source as seen from the body"),
        (CENTRE + 'satellite_orbit = {body = "sun"}', "satellite_orbit.body: unknown key"),
        (CENTRE + "satellite_orbit = {eccentricity = 0.1}", "satellite_orbit.semi_major_axis: missing"),
        (
            CENTRE + "satellite_orbit = {semi_major_axis = 7e6, eccentricity = 1}",
            "satellite_orbit.eccentricity",
        ),
        (CENTRE + "satellite_orbit = {semi_major_axis = 7e6, period = -1}", "satellite_orbit.period"),
        (CENTRE + 'satellite_orbit = {table = "no.csv"}', "satellite_orbit.table"),
        (DIPOLE + 'satellite_orbit = {table = "no.csv"}', "satellite_orbit.table"),
        (DIPOLE + "satellite_orbit = {semi_major_axis = 7e6}", "satellite_orbit.period: missing"),
    ],
)
def test_contradictions_name_the_key_that_was_given(lines: str, said: str) -> None:
    with pytest.raises(rigidsim.ConfigError) as caught:
        rigidsim.run(rigidsim.parse(config(more=lines)), out=None)
    assert said in str(caught.value)


def test_a_start_within_a_source_is_refused_where_its_shadow_is_read() -> None:
    load = 'kind = "gravity_gradient"\nname = "{}"\nradius = {}\ngravitational_parameter = {}\n'
    load += "orbit = {{semi_major_axis = {}}}"
    loads = [load.format("earth", 6378e3, GM, 6300e3), load.format("sun", 7e8, 1.327e20, 1.5e11)]
    state = '[[states]]\nname = "lit"\ninitial = 0\nunit = "s"\nderivative = "shadow_sun"'
    with pytest.raises(
        rigidsim.ConfigError, match="number 1 radius: given 6378 km, but the body starts 6300 km"
    ):
        rigidsim.run(rigidsim.parse(config(loads=loads, more=state)), out=None)
