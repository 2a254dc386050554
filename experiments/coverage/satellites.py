"""Random satellites: surfaces in sunlight and in air, eddy currents, attractors with a field."""

import math

from experiments.coverage.fields import harmonics, short_orbit
from experiments.random_scenes import Draw

_AU, _LIGHT = 149597870700.0, 299792458.0


def surfaces(draw: Draw) -> None:
    """One to four of them, of about the body's size, off its centre of mass."""
    for _ in range(int(draw.random.integers(1, 5))):
        kind = draw.random.choice(["plate", "plate", "box", "sphere"])
        place = [float(x) * draw.between(0.1, 0.7) * draw.length for x in draw.direction()]
        lines = [f"position = {place}"]
        if kind == "plate":
            lines += [
                f"normal = {[float(x) for x in draw.direction()]}",
                f"area = {draw.between(0.1, 1) * draw.length**2!r}",
                f"both_sides = {str(draw.sometimes(0.5)).lower()}",
            ]
        elif kind == "box":
            lines.append(f"size = {[draw.between(0.1, 1) * draw.length for _ in range(3)]}")
        else:
            lines.append(f"radius = {draw.between(0.1, 0.5) * draw.length!r}")
        specular = draw.between(0, 1)
        lines += [f"specular = {specular!r}", f"diffuse = {draw.between(0, 0.99 - specular * 0.99)!r}"]
        draw.more += ["[[body.surfaces]]", *lines]


def light(draw: Draw) -> None:
    """A Sun at rest or on an orbit, some of whose sides a tumbling body turns away."""
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    draw.start(draw.direction() * draw.decades(-1.5, 0.3))
    surfaces(draw)
    far, motion = 1e3 * draw.length, draw.between(0.01, 0.2) / draw.time
    place = f"position = {[float(x * far) for x in draw.direction()]}"
    if draw.sometimes(0.6):
        place = short_orbit(draw, far, 0.3)
    strength = f"gravitational_parameter = {motion**2 * far**3!r}"
    draw.load("gravity_gradient", 'name = "sun"', strength, place)
    pressure = draw.mass / draw.length / draw.time**2 * draw.decades(-3, -0.7)
    irradiance = pressure * _LIGHT * (far / _AU) ** 2
    draw.load("radiation_pressure", 'light = "sun"', f"irradiance = {irradiance!r}")


def _flight(draw: Draw, far: float, *lines: str) -> float:
    """A start some lengths from the attractor; returns the speed in units."""
    rates = draw.decades(-0.5, 1)
    speed, tilt = draw.between(0.97, 1.1) / math.sqrt(far), draw.between(0, 3)
    draw.fly(draw.direction() * rates * far**-1.5, far, speed, tilt, 1.0, *lines)
    draw.time_scale = far**1.5
    return speed


def plates_in_air(draw: Draw) -> None:
    """A flight through air that turns and thins out; about an oblate body in half of them."""
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    far = draw.decades(1.5, 2.5)
    low = draw.between(0.5, 0.9) * far * draw.length
    lines = [
        f"radius = {low!r}",
        f"atmosphere_rate = [0, 0, {draw.between(0, 0.1) * far**-1.5 / draw.time!r}]",
    ]
    if draw.sometimes(0.5):
        lines.append(_figure(draw, low))
    speed = _flight(draw, far, *lines)
    surfaces(draw)
    # a torque of so much of what turns it within an orbit
    density = draw.mass / draw.length**3 * far**-3 / speed**2 * draw.decades(-3, 0)
    draw.load(
        "drag",
        f"density = {density!r}",
        f"altitude = {far * draw.length - low!r}",
        f"scale_height = {far * draw.length * draw.between(0.03, 0.3)!r}",
    )


def eddy_currents(draw: Draw) -> None:
    """A conductor in a uniform field, or along an orbit about a dipole, half of them with a gradient."""
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    draw.start(draw.direction() * draw.decades(-1, 0.3))
    size = draw.mass * draw.length**2 / draw.time * draw.decades(-4, -0.5)  # of M B^2, with some 1 T
    conductor = f"magnetic_tensor = {[size * draw.between(0.2, 1) for _ in range(3)]}"
    field = [f"field = {[float(x) for x in draw.direction()]}"]
    if draw.sometimes(0.6):
        far, motion = 1e3 * draw.length, draw.between(0.02, 0.4) / draw.time
        orbit = [f"gravitational_parameter = {motion**2 * far**3!r}", short_orbit(draw, far, 0.4)]
        field = [f"source_moment = {[float(x) * 1e7 * far**3 for x in draw.direction()]}", *orbit]
        if draw.sometimes(0.5):
            draw.load("gravity_gradient", *orbit)
    draw.load("eddy_currents", conductor, *field)


def attractor(draw: Draw) -> None:
    """A flight about a body that is oblate, or has a field that rests or turns, or both."""
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    far = draw.decades(1.5, 2.5)
    radius = draw.between(0.3, 0.8) * far * draw.length
    figure = draw.sometimes(0.5)
    lines = [_figure(draw, radius)] if figure else []
    if not figure or draw.sometimes(0.3):
        lines.append(f"gravity_field = {_field(draw, radius, far, zonal=not figure)}")
    _flight(draw, far, *lines)


def _figure(draw: Draw, radius: float) -> str:
    pole = [float(x) for x in draw.direction()]
    return f"figure = {{J2 = {draw.decades(-4, -1.5)!r}, radius = {radius!r}, pole = {pole}}}"


def _field(draw: Draw, radius: float, far: float, *, zonal: bool) -> str:
    """Degrees 2 (without its zonal part beside a figure) to 4."""
    size = draw.decades(-4, -2)
    orders = [(n, m) for n in range(2, 5) for m in range(n + 1) if zonal or (n, m) != (2, 0)]
    given = harmonics(draw, size, orders)
    rate = draw.between(0.1, 3) * far**-1.5 / draw.time if draw.sometimes(0.6) else 0.0
    pole = [float(x) for x in draw.direction()]
    turning = f"pole = {pole}, rate = {rate!r}, prime_meridian = {draw.between(0, 6)!r}"
    return f"{{radius = {radius!r}, {given}, {turning}}}"
