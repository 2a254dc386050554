"""Averaged precession over thousands of years along a table, mostly into the past, with a Moon and tides."""

import math

import numpy as np

from experiments.random_scenes import Draw

_YEAR, _SPIN, _AU, _TABLE = 31557600.0, 7.292115e-5, 1.496e11, '[tables."orbit.csv"]'


def precession(draw: Draw) -> None:
    """A planet that turns like the Earth; the horizon is in years, negative into the past."""
    draw.time, draw.time_scale = _YEAR, -1.0 if draw.sometimes(0.7) else 1.0
    flat, tilt = 8e37 * (1 - draw.decades(-3, -2)), draw.between(0.1, 1.4)
    draw.lines += [f"principal_moments = [{flat!r}, {flat!r}, 8e37]", "mass = 6e24", "[initial]"]
    draw.lines += [f"angular_velocity = [0, 0, {_SPIN * draw.between(0.97, 1.03)!r}]"]
    draw.lines += [f"euler_angles = [{draw.between(0, 6)}, {tilt}, 0]"]
    sun, moon = 1.3e20 * draw.decades(-0.5, 0.7), 4.9e12 * draw.decades(-0.5, 0.5)
    place = f'orbit = {{table = "orbit.csv", semi_major_axis = {_AU}}}'
    draw.load("gravity_gradient", 'name = "sun"', f"gravitational_parameter = {sun!r}", place)
    tidal = draw.sometimes(0.7)
    if tidal:
        place = 'orbit = {plane_of = "sun", node = "averaged", semi_major_axis = 3.8e8, '
        place += f"inclination = {draw.between(0, 0.2)}, eccentricity = {draw.between(0, 0.1)}}}"
        draw.load("gravity_gradient", 'name = "moon"', f"gravitational_parameter = {moon!r}", place)
        model = draw.random.choice(["linear", "constant_lag"])
        draw.more += ["[tides]", f'model = "{model}"', 'raised_by = ["moon"]']
        draw.more += [f"dissipation = {draw.decades(-1, 1.5)!r}"]
        draw.more += [f"obliquity = {str(draw.sometimes(0.5)).lower()}"]
    order = 1 if tidal or draw.sometimes(0.5) else 2
    draw.more += ["[model]", 'level = "orbit_averaged"', f"order = {order}", 'start = "mean"']


def write_orbit(draw: Draw, end: float) -> None:
    """Elements as sums of lines, with 12 to 80 rows at equal or random distances, beyond both ends."""
    rows = int(draw.random.integers(12, 81))
    times = np.linspace(-0.3, 1.3, rows) * end
    if draw.sometimes(0.4):
        times += draw.random.uniform(-0.3, 0.3, rows) * end / rows
    turns = np.exp(1j * (np.outer(times, draw.random.uniform(-4, 4, 8) / end) + draw.random.uniform(0, 6, 8)))
    eccentric, plane = turns[:, :4].sum(axis=1) * 0.02, turns[:, 4:].sum(axis=1) * draw.between(0, 0.02)
    columns = times, abs(eccentric), 2 * np.arcsin(abs(plane)), np.angle(plane), np.angle(eccentric)
    lines = [", ".join(repr(float(x)) for x in row) for row in zip(*columns, strict=True)]
    head = "time, eccentricity, inclination, ascending_node, longitude_of_periapsis"
    draw.more += [_TABLE, "\n".join(["text = '''", head, *lines[:: int(math.copysign(1, end))], "'''"])]
