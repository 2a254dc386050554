"""Random pairs of rigid bodies under mutual gravity: any figures, regular and moderately eccentric orbits."""

import math

import numpy as np

from experiments.random_scenes import Draw

_G = 6.6743e-11  # m^3/(kg s^2)


def pair(draw: Draw) -> None:
    """Near the synchronous state, or turning in any way; to degree 2, 3 or 4; half of them into the past."""
    draw.time = math.sqrt(draw.length**3 / (_G * draw.mass))
    degree = int(draw.random.integers(2, 5))
    share, small = draw.decades(-3, 0), draw.between(0.3, 1)
    draw.lines += _figure(draw, degree, draw.mass, draw.length)
    other = _figure(draw, degree, share * draw.mass, small * draw.length)
    regular = draw.sometimes(0.5)
    eccentricity = draw.between(0, 0.05 if regular else 0.3)
    near = draw.between(2, 6) * (1 + small)
    speed = math.sqrt((1 + share) / near * (1 + eccentricity))
    draw.time_scale = (near / (1 - eccentricity)) ** 1.5 / math.sqrt(1 + share)
    rate = speed / near
    if regular:
        tilts = [draw.decades(-4, -1) * draw.direction() for _ in range(4)]
        turned = [[1.0, *tilts[0]], [1.0, *tilts[1]]]
        rates = [rate * draw.between(1, 8) * np.array([0, 0, 1]) + rate * tilts[2]]
        rates.append(rate * np.array([0, 0, 1]) + rate * tilts[3])
    else:
        turned = [draw.random.standard_normal(4) for _ in range(2)]
        rates = [rate * draw.between(0.1, 4) * draw.direction() for _ in range(2)]
    starts = [
        [f"angular_velocity = {[float(w / draw.time) for w in spin]}", f"quaternion = {list(map(float, q))}"]
        for spin, q in zip(rates, turned, strict=True)
    ]
    draw.lines += ["[initial]", *starts[0]]
    draw.more += ["[[rigid_bodies]]", 'name = "second"', *other, *starts[1]]
    draw.more += [
        f"position = {[near * draw.length, 0.0, 0.0]}",
        f"velocity = {[0.0, speed * draw.length / draw.time, 0.0]}",
    ]
    draw.load("mutual_gravity", f"degree = {degree}")
    if draw.sometimes(0.5):
        draw.time_scale *= -1


def _figure(draw: Draw, degree: int, mass: float, size: float) -> list[str]:
    """An ellipsoid, points, or moments alone where no more than these is asked for."""
    kind = draw.random.choice(["ellipsoid", "points", "moments"][: 2 + (degree == 2)])
    if kind == "points":
        count = int(draw.random.integers(4, 7))
        masses = mass * draw.random.dirichlet(np.full(count, 3.0))
        places = size * draw.random.uniform(-0.5, 0.5, (count, 3))
        each = [
            f"{{mass = {float(m)!r}, position = {list(map(float, x))}}}"
            for m, x in zip(masses, places, strict=True)
        ]
        return [f"points = [{', '.join(each)}]"]
    axes = np.sort(draw.random.uniform(0.5, 1.0, 3))[::-1] * size
    if kind == "ellipsoid":
        return ['shape = "ellipsoid"', f"semi_axes = {list(map(float, axes))}", f"mass = {mass!r}"]
    moments = mass / 5 * (np.sum(axes**2) - axes**2)
    return [f"principal_moments = {list(map(float, moments))}", f"mass = {mass!r}"]
