"""Random scenes of bodies with a gravity field, and of oblate sources: on orbits, at rest, and in flight."""

import math

from experiments.random_scenes import Draw


def gravity_field(draw: Draw) -> None:
    """Degrees 3 to 5, all or zonal, two to thirty radii from the source; in a third of them an oblate one."""
    draw.body(draw.moments(), turned=draw.sometimes(0.3))
    degree = _field(draw)
    draw.start(draw.direction() * draw.decades(-1.5, 0.3))
    axis = draw.decades(0.5, 1.5) * draw.length
    motion = draw.between(0.1, 1) / draw.time
    place = f"position = {[float(x * axis) for x in draw.direction()]}"
    if draw.sometimes(0.7):
        place = (
            f"orbit = {{semi_major_axis = {axis!r}, eccentricity = {draw.between(0, 0.3)!r}, "
            f"inclination = {draw.between(0, 3)!r}, mean_anomaly = {draw.between(0, 6)!r}}}"
        )
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
    draw.start(
        draw.direction() * draw.between(0.3, 3) * far**-1.5,
        position=[far, 0, 0],
        velocity=[0, speed * math.cos(tilt), speed * math.sin(tilt)],
    )
    draw.time_scale = far**1.5
    strength = draw.length**3 / draw.time**2
    draw.load("central_gravity", f"gravitational_parameter = {strength!r}", f"degree = {degree}")


def _field(draw: Draw) -> int:
    """Its degree; harmonics of a thousandth to a tenth of the body's own size."""
    degree = int(draw.random.integers(3, 6))
    size, zonal = draw.decades(-3, -1), draw.sometimes(0.2)
    tables: dict[str, list[str]] = {"C": [], "S": []}
    for n in range(3, degree + 1):
        for m in range(1 if zonal else n + 1):
            scale = size * math.sqrt(math.factorial(n - m) / math.factorial(n + m))
            for table in ("C", "S")[: 1 + (m > 0)]:
                tables[table].append(f'"{n},{m}" = {scale * draw.between(-1, 1)!r}')
    given = ", ".join(f"{name} = {{{', '.join(keys)}}}" for name, keys in tables.items() if keys)
    draw.lines.append(f"gravity_field = {{radius = {draw.length!r}, {given}}}")
    return degree
