"""Averaged motions that start near a hyperbolic Cassini state, where the distance from the full motion grows
exponentially.
"""

import math

import numpy as np

from experiments.random_scenes import Draw, orbit

HYPERBOLIC = "hyperbolic averages"
_TURN = 2 * math.pi
_MOST_TURNED, _LEAST_SPAN = 8e4, 120.0
"""Largest angle that the body turns through, rad, so that the truth is cheap; and least span, in radians of
the orbit, since a run hardly longer than the windows is followed to its end.
"""


def hyperbolic_average(draw: Draw) -> None:
    """An oblate body that spins fast, on an orbit whose node goes back nearly as fast as its axis precesses.

    The horizon is in units of the e-folding time at the state, which the draw's scale of time is.
    """
    while True:
        oblate, spin = draw.decades(-1.5, -0.5), draw.decades(1.2, 2)
        eccentricity = draw.between(0, 0.4) * draw.sometimes(0.8)
        tilt = draw.between(0.05, 0.7)
        precession = 1.5 * oblate / spin * (1 - eccentricity**2) ** -1.5
        # below this rate of the node there are four states, one of them hyperbolic (Colombo 1966)
        most = precession / (math.sin(tilt) ** (2 / 3) + math.cos(tilt) ** (2 / 3)) ** 1.5
        node_rate = -most * draw.decades(-0.6, -0.003)
        found = hyperbolic_state(precession, node_rate, tilt)
        if found is None:
            continue
        axis, rate = found
        # the horizon is drawn afterwards, from 1.5 to 8 of these
        if 8 / rate * spin < _MOST_TURNED and 1.5 / rate > _LEAST_SPAN:
            break
    axis = axis + draw.decades(-5, -0.7) * draw.direction()
    axis /= np.linalg.norm(axis)
    node = draw.between(0, 6)
    x, y = (
        math.cos(node) * axis[0] - math.sin(node) * axis[1],
        math.sin(node) * axis[0] + math.cos(node) * axis[1],
    )
    quaternion = np.array([1 + axis[2], -y, x, 0.0])  # the smallest rotation from the third axis
    other = 1 - oblate * (1 if draw.sometimes(0.6) else draw.between(0.6, 1))
    draw.body([1 - oblate, other, 1])
    wobble = 0.0 if draw.sometimes(0.6) else draw.decades(-4, -1.5)
    draw.start([spin * wobble, 0, spin])
    draw.lines[-1] = f"quaternion = {[float(q) for q in quaternion / np.linalg.norm(quaternion)]}"
    distance = 1e3 * draw.length
    elements = {"period": _TURN * draw.time, "eccentricity": eccentricity, "inclination": tilt}
    elements |= {"ascending_node": node, "periapsis": draw.between(0, 6), "mean_anomaly": draw.between(0, 6)}
    strength = f"gravitational_parameter = {distance**3 / draw.time**2!r}"
    draw.load("gravity_gradient", strength, orbit(distance, **elements, node_rate=node_rate / draw.time))
    level = "spin_averaged" if draw.sometimes(0.5) else "orbit_averaged"
    draw.more += ["[model]", f'level = "{level}"']
    draw.more += [f"short_period = {str(draw.sometimes(0.5)).lower()}"]
    draw.time_scale = 1 / rate


def hyperbolic_state(precession: float, node_rate: float, tilt: float) -> tuple[np.ndarray, float] | None:
    """The hyperbolic Cassini state (3,) with the ascending node along x, and its rate of growth; None if
    there is none.

    In the plane of the orbit's normal n and the pole k that n goes round with rate g, the axis s stands still
    in the frame of the node if precession (n . s) (s x n) = g k x s (Colombo 1966).
    """
    normal, pole = np.array([0.0, -math.sin(tilt), math.cos(tilt)]), np.array([0.0, 0.0, 1.0])

    def rate(s: np.ndarray) -> np.ndarray:
        return precession * (normal @ s) * np.cross(s, normal) - node_rate * np.cross(pole, s)

    angles = np.linspace(-math.pi, math.pi, 4001)
    aside = np.array([rate(np.array([0.0, math.sin(a), math.cos(a)]))[0] for a in angles])
    for n in np.flatnonzero(aside[:-1] * aside[1:] < 0):
        low, high = angles[n], angles[n + 1]
        for _ in range(50):
            middle = (low + high) / 2
            there = rate(np.array([0.0, math.sin(middle), math.cos(middle)]))[0]
            low, high = (middle, high) if there * aside[n] > 0 else (low, middle)
        s = np.array([0.0, math.sin(low), math.cos(low)])
        across = [np.array([1.0, 0.0, 0.0]), np.array([0.0, math.cos(low), -math.sin(low)])]
        small = 1e-6
        slopes = [(rate(s + small * b) - rate(s - small * b)) / (2 * small) for b in across]
        stretched = -np.linalg.det([[slope @ a for slope in slopes] for a in across])
        if stretched > 0:
            return s, math.sqrt(stretched)
    return None
