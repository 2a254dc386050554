"""Random scenes in which loads tell what they know (shadows, air, sources on tables and among point masses),
and in which a jet leaves while the moments fall.
"""

import math

import numpy as np

from experiments.coverage.carried import state
from experiments.random_scenes import Draw, across, orbit


def _strings(values: list[str]) -> str:
    return f"components = {values}".replace("'", '"')


def _orbit(draw: Draw, axis: float, motion: float, inclination: float, eccentricity: float) -> str:
    node, anomaly = draw.between(0, 6), draw.between(0, 6)
    return orbit(
        axis, eccentricity=eccentricity, inclination=inclination, ascending_node=node, mean_anomaly=anomaly,
        period=2 * math.pi / motion,
    )  # fmt: skip


def _sun(draw: Draw, axis: float, motion: float) -> None:
    """Slow, far and large in the sky, in two thirds of them; else a point, whose shadow jumps."""
    far = axis * draw.between(30, 300)
    lines = ['name = "sun"', f"gravitational_parameter = {(motion / 10) ** 2 * far**3!r}"]
    if draw.sometimes(0.67):
        lines.append(f"radius = {far * draw.decades(-2.3, -0.8)!r}")
    draw.load("gravity_gradient", *lines, _orbit(draw, far, motion / 50, draw.between(0, 0.4), 0.02))


def _sunlight(draw: Draw) -> None:
    """A pressure on a side, and what a panel has collected, which a law reads."""
    draw.parameters += [
        f"p = {draw.mass * draw.length**2 / draw.time**2 * draw.decades(-3, -0.7)!r}",
        f"n = {1 / draw.time!r}",
    ]
    law = ["p*shadow_sun*uz_sun", "0", "-p*shadow_sun*ux_sun"]
    if draw.sometimes(0.5):
        state(draw, "collected", "n*(shadow_sun*max(-uz_sun, 0) - collected/10)")
        law[1] = "p*collected*uy_sun"
    draw.load("torque", _strings(law))


def shadow(draw: Draw) -> None:
    """Sunlight on a satellite that passes a planet's shadow, smooth or with a jump; a third in flight."""
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    axis, motion = draw.decades(1.5, 3), draw.between(0.1, 0.4)
    rates = draw.direction() * draw.between(0.1, 2)
    radius = draw.between(0.2, 0.8) * axis * draw.length
    strength = motion**2 * axis**3 * draw.length**3 / draw.time**2
    planet = ['name = "planet"', f"radius = {radius!r}", f"gravitational_parameter = {strength!r}"]
    if draw.sometimes(0.33):
        speed, tilt = motion * axis * draw.between(0.95, 1.05), draw.between(0, 0.5)
        draw.start(rates, position=[axis, 0, 0], velocity=across(speed, tilt))
        draw.load("central_gravity", *planet)
    else:
        draw.start(rates)
        tilt, eccentricity = draw.between(0, 0.4), draw.between(0, 0.1)
        around = _orbit(draw, axis * draw.length, motion / draw.time, tilt, eccentricity)
        draw.load("gravity_gradient", *planet, around)
    _sun(draw, axis * draw.length, motion / draw.time)
    _sunlight(draw)


def air(draw: Draw) -> None:
    """A flight through air that turns and thins out: drag off the centre of mass, and a fin's torque."""
    draw.body(draw.moments())
    axis, motion = draw.decades(1.5, 3), draw.between(0.05, 0.4)
    speed, tilt = motion * axis * draw.between(0.98, 1.1), draw.between(0, 3)
    rates = draw.direction() * draw.between(0.1, 2)
    draw.start(rates, position=[axis, 0, 0], velocity=across(speed, tilt))
    low, unit = draw.between(0.5, 0.95) * axis * draw.length, draw.length / draw.time
    draw.load(
        "central_gravity",
        f"gravitational_parameter = {motion**2 * axis**3 * draw.length**3 / draw.time**2!r}",
        f"radius = {low!r}",
        f"atmosphere_rate = [0, 0, {draw.between(0, 0.1) * motion / draw.time!r}]",
    )
    draw.parameters += [
        f"high = {axis * draw.length - low!r}",
        f"thins = {axis * draw.length * draw.between(0.03, 0.3)!r}",
        f"c = {draw.mass / draw.time * draw.decades(-6, -3)!r}",
        f"k = {draw.mass * draw.length**2 / draw.time**2 * draw.decades(-3, -1)!r}",
        f"v = {speed * unit!r}",
    ]
    thick = "exp((high - altitude)/thins)"
    size = "*sqrt(vrx^2 + vry^2 + vrz^2)/v"
    point = [float(x) * 0.3 * draw.length for x in draw.direction()]
    force = [f"-c*{thick}{size}*vr{axis}" for axis in "xyz"]
    draw.load("force", _strings(force), 'frame = "body"', f"point = {point}")
    draw.load("torque", _strings(["0", f"k*{thick}*vrz/v", f"-k*{thick}*vry/v"]))


_TABLE = '[tables."source.csv"]'


def table(draw: Draw) -> None:
    """A law that reads where the source on a tabulated orbit is; the rows are written with the end."""
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    draw.start(draw.direction() * draw.between(0.1, 2))
    axis, motion = 1e3 * draw.length, draw.between(0.05, 0.3) / draw.time
    draw.load(
        "gravity_gradient",
        'name = "sun"',
        f"gravitational_parameter = {motion**2 * axis**3!r}",
        'orbit = {table = "source.csv"}',
    )
    draw.parameters += [
        f"k = {draw.mass * draw.length**2 / draw.time**2 * draw.decades(-3, -0.5)!r}",
        f"n = {1 / draw.time!r}",
        f"far = {axis!r}",
    ]
    law = ["-k*uy_sun - k*wx/n/3", "k*ux_sun*(far/r_sun)^2", "k*uz_sun*qx*qw"]
    if draw.sometimes(0.5):
        state(draw, "seen", "n*(uy_sun - seen)")
        law[0] = "-k*seen - k*wx/n/3"
    draw.load("torque", _strings(law))


def write_table(draw: Draw, end: float) -> None:
    """Elements that oscillate, with 8 to 60 rows until the end, and as many before the start."""
    rows = int(draw.random.integers(8, 61))
    times = np.linspace(-end, end, 2 * rows - 1)
    axis = next(float(line.split(" = ")[1]) for line in draw.parameters if line.startswith("far = "))
    (strength,) = (float(x.split(" = ")[1]) for x in draw.more if x.startswith("gravitational_parameter"))
    slow = draw.between(0.5, 2) / end
    sway = np.sin(slow * times + draw.between(0, 6))
    turned = slow * times + draw.between(0, 6)
    eccentricity = draw.between(0.02, 0.3) * (1 + 0.2 * sway)
    inclination = draw.between(0.1, 1) * (1 + 0.1 * np.cos(slow * times))
    head = "time, semi_major_axis, eccentricity, inclination, ascending_node, periapsis"
    columns = [times, np.full(len(times), axis), eccentricity, inclination, turned, -turned / 2]
    if end / rows * math.sqrt(strength / axis**3) < 0.5:  # so often that the anomaly can be told, too
        head += ", mean_anomaly"
        columns.append(math.sqrt(strength / axis**3) * times - turned / 2)
    lines = [", ".join(repr(float(x)) for x in row) for row in zip(*columns, strict=True)]
    draw.more += [_TABLE, "\n".join(["text = '''", head, *lines, "'''"])]


def moving_bodies(draw: Draw) -> None:
    """A law that reads where a moon and the Sun are, both integrated with the planet that is the body's host;
    in a third of them the moon is before the Sun at times.
    """
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    draw.lines.append('host = "planet"')
    draw.start(draw.direction() * draw.between(0.1, 2))
    axis, motion = 1e3 * draw.length, draw.between(0.05, 0.3) / draw.time
    far = axis * draw.between(20, 100)
    strengths = {"planet": motion**2 * axis**3, "moon": motion**2 * axis**3 * draw.decades(-2, -0.5)}
    strengths["sun"] = (motion / 12) ** 2 * far**3
    places = {
        "moon": (axis, draw.between(0, 0.3), draw.between(0, 0.4)),
        "sun": (far, draw.between(0, 0.1), 0.0),
    }
    for name, strength in strengths.items():
        draw.more += ["[[bodies]]", f'name = "{name}"', f"gravitational_parameter = {strength!r}"]
        if name in places:
            about, eccentricity, inclination = places[name]
            draw.more.append(
                f'orbit = {{about = "planet", semi_major_axis = {about!r}, eccentricity = {eccentricity!r}, '
                f"inclination = {inclination!r}, mean_anomaly = {draw.between(0, 6)!r}}}"
            )
    shaded = draw.sometimes(0.33)
    sizes = {"moon": axis * draw.between(0.1, 0.4), "sun": far * draw.decades(-2, -0.8)} if shaded else {}
    for name in places:
        lines = [f'name = "{name}"', f'orbit = {{body = "{name}"}}']
        lines += [f"radius = {sizes[name]!r}"] if shaded else []
        draw.load("gravity_gradient", *lines)
    draw.parameters += [
        f"k = {draw.mass * draw.length**2 / draw.time**2 * draw.decades(-3, -0.5)!r}",
        f"n = {1 / draw.time!r}",
        f"far = {axis!r}",
    ]
    light = "*shadow_sun" if shaded else ""
    law = ["-k*uy_moon - k*wx/n/3", "k*ux_moon*(far/r_moon)^2", f"k*uz_sun{light}"]
    draw.load("torque", _strings(law))


def jet(draw: Draw) -> None:
    """Mass burns off, and takes its momentum along: all second moments of mass fall, each by its own share,
    with time or with a state whose rate follows the motion.
    """
    seconds, size = draw.random.uniform(0.2, 1.0, 3), draw.mass * draw.length**2
    lasting = draw.random.uniform(0.25, 0.9, 3)
    rocket = draw.sometimes(0.4)
    if rocket:
        seconds[1], lasting[1] = seconds[0], lasting[0]
    draw.body(seconds.sum() - seconds)
    draw.start(draw.direction() * draw.between(0.2, 2))
    draw.parameters += [f"tau = {draw.time * draw.decades(0.7, 2)!r}", f"n = {1 / draw.time!r}"]
    burns = draw.sometimes(0.5)
    left = "left" if burns else "exp(-t/tau)"
    if burns:
        state(draw, "left", "-left*(1 + 0.3*sin(wx/n)^2)/tau", 1.0)
    parts = [
        f"{s * size * f!r} + {s * size * (1 - f)!r}*{left}"
        for s, f in zip(map(float, seconds), map(float, lasting), strict=True)
    ]
    varying = [" + ".join(parts[j] for j in range(3) if j != k) for k in range(3)]
    (place,) = (k for k, line in enumerate(draw.lines) if line.startswith("principal_moments"))
    draw.lines[place] = f"principal_moments = {varying}".replace("'", '"')
    way = np.array([0.0, 0.0, -1.0]) if rocket else draw.direction()
    lines = [f"exit_point = {[float(x) for x in way * draw.between(0.3, 1.5) * draw.length]}"]
    if draw.sometimes(0.5):
        lines.append(f"exit_radius = {draw.between(0.05, 0.4) * draw.length!r}")
    draw.load("mass_loss", f'rate = "{draw.mass * draw.between(0.1, 0.6)!r}*{left}/tau"', *lines)
