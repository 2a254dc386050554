"""Random scenes of bodies with a gravity field, and of oblate sources: on orbits, at rest, and in flight."""

import math
from collections.abc import Iterable

from experiments.random_scenes import Draw, orbit


def gravity_field(draw: Draw) -> None:
    """Degrees 3 to 5, all or zonal, two to thirty radii from the source; in a third of them an oblate one."""
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    degree = _field(draw)
    draw.start(draw.direction() * draw.decades(-1.5, 0.3))
    axis = draw.decades(0.5, 1.5) * draw.length
    motion = draw.between(0.1, 1) / draw.time
    place = f"position = {[float(x * axis) for x in draw.direction()]}"
    if draw.sometimes(0.7):
        place = short_orbit(draw, axis, 0.3)
    lines = [place, f"degree = {degree}"]
    if draw.sometimes(0.3):
        pole = [float(x) for x in draw.direction()]
        radius = 0.3 * axis
        lines.append(f"figure = {{J2 = {draw.decades(-3, -1)!r}, radius = {radius!r}, pole = {pole}}}")
    draw.load("gravity_gradient", f"gravitational_parameter = {motion**2 * axis**3!r}", *lines)


def gravity_field_in_flight(draw: Draw) -> None:
    """Six degrees of freedom, some radii from the attractor."""
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    degree = _field(draw)
    far, tilt = draw.between(3, 20), draw.between(0, 3)
    speed = draw.between(0.9, 1.1) / math.sqrt(far)
    draw.fly(draw.direction() * draw.between(0.3, 3) * far**-1.5, far, speed, tilt, 1.0, f"degree = {degree}")
    draw.time_scale = far**1.5


def _field(draw: Draw) -> int:
    """Its degree; harmonics of a thousandth to a tenth of the body's own size."""
    degree = int(draw.random.integers(3, 6))
    size, zonal = draw.decades(-3, -1), draw.sometimes(0.2)
    orders = [(n, m) for n in range(3, degree + 1) for m in range(1 if zonal else n + 1)]
    draw.lines.append(f"gravity_field = {{radius = {draw.length!r}, {harmonics(draw, size, orders)}}}")
    return degree


def harmonics(draw: Draw, size: float, orders: Iterable[tuple[int, int]]) -> str:
    """``C`` and ``S`` of such a size in the mean."""
    tables: dict[str, list[str]] = {"C": [], "S": []}
    for n, m in orders:
        scale = size * math.sqrt(math.factorial(n - m) / math.factorial(n + m))
        for table in ("C", "S")[: 1 + (m > 0)]:
            tables[table].append(f'"{n},{m}" = {scale * draw.between(-1, 1)!r}')
    return ", ".join(f"{name} = {{{', '.join(keys)}}}" for name, keys in tables.items() if keys)


def short_orbit(draw: Draw, axis: float, widest: float, turn: float = 6) -> str:
    """An orbit with an eccentricity up to the widest, inclined, and a mean anomaly up to a turn."""
    eccentricity, inclination = draw.between(0, widest), draw.between(0, 3)
    anomaly = draw.between(0, turn)
    return orbit(axis, eccentricity=eccentricity, inclination=inclination, mean_anomaly=anomaly)
