"""Random scenes under the bodies of a kernel, and of bodies that tides and their spin distort."""

import math

from experiments.coverage.fields import short_orbit
from experiments.random_scenes import Draw

_G = 6.67430e-11
_DISTANCES = {  # m, in the mean, from the hosts
    "moon": {"earth": 3.844e8, "sun": 1.496e11},
    "earth": {"moon": 3.844e8, "sun": 1.496e11},
    "mars": {"sun": 2.279e11, "jupiter": 7.0e11},
    "mercury": {"sun": 5.79e10},
}


def kernel(draw: Draw) -> None:
    """One or two bodies of DE421, strong enough to turn the body within weeks; blocks of 4 to 32 days."""
    draw.time = 86400 * draw.decades(0, 1)
    host = str(draw.random.choice(list(_DISTANCES)))
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    draw.lines.append(f'host = "{host}"')
    if draw.sometimes(0.3):
        draw.lines.append(f"core = {{moment = 0.02, flattening = {draw.decades(-4, -1)!r}}}")
    draw.start(draw.direction() * draw.between(0.3, 1.5))
    draw.more.append('[ephemeris]\nkernel = "de421"')
    for body, distance in _DISTANCES[host].items():
        if body != "sun" or host in ("mars", "mercury") or draw.sometimes(0.6):
            strength = (draw.decades(-1.5, -0.3) / draw.time) ** 2 * distance**3
            draw.load(
                "gravity_gradient", f'source = "{body}"', f"gravitational_parameter = {float(strength)!r}"
            )


def elastic(draw: Draw) -> None:
    """Distortions of 1e-8 to 1e-2 of the moments, delayed in two thirds, under a source in three quarters."""
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    spin, motion = draw.between(0.3, 1.5) / draw.time, draw.between(0.1, 0.6) / draw.time
    love, size = draw.between(0.01, 1.2), draw.decades(-8, -2) * draw.mass * draw.length**2
    radius = (3 * _G * size / (love * (spin**2 + 3 * motion**2))) ** 0.2
    keys = [f"love_number = {love!r}", f"radius = {radius!r}"]
    if draw.sometimes(0.66):
        keys.append(f"delay = {draw.decades(-3, -1.2) * draw.time!r}")
    if draw.sometimes(0.5):
        keys.append(f"mean_rate = {spin * draw.between(0, 1)!r}")
    draw.lines.append(f"elasticity = {{{', '.join(keys)}}}")
    draw.start(draw.direction() * spin * draw.time)
    if draw.sometimes(0.75):
        axis = 1e3 * draw.length
        around = short_orbit(draw, axis, 0.3, 2 * math.pi)
        draw.load("gravity_gradient", f"gravitational_parameter = {motion**2 * axis**3!r}", around)
