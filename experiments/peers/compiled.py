"""The right-hand side of each scene, compiled by numba: rates and quaternion, seven states.

On an orbit the quaternion is that from the body to the frame which turns with the orbit, where the attractor
stands still: no sine, no cosine, no further state (``Scene.from_orbital`` turns the result back).
"""

from collections.abc import Callable
from typing import Any

import numba

from experiments.peers.scenes import Scene


def right_hand_side(scene: Scene) -> Callable[[float, Any, Any], None]:
    """A jitted ``f(t, y, out)``; what a scene doesn't have isn't computed, and constants are literals."""
    a, b, c = scene.moments
    ka, kb, kc = (b - c) / a, (c - a) / b, (a - b) / c
    ha, hb = scene.weight / a, scene.weight / b
    n = scene.orbit_rate
    ga, gb, gc = 3 * n * n * (c - b) / a, 3 * n * n * (a - c) / b, 3 * n * n * (b - a) / c
    half = n / 2
    heavy, orbiting = scene.weight != 0, n != 0

    @numba.njit(error_model="numpy")
    def function(t: float, y: Any, out: Any) -> None:
        p, q, r, w, x, yy, z = y[0], y[1], y[2], y[3], y[4], y[5], y[6]
        dp, dq, dr = ka * q * r, kb * r * p, kc * p * q
        if heavy:
            dp += ha * 2.0 * (yy * z + w * x)
            dq -= hb * 2.0 * (x * z - w * yy)
        if orbiting:
            rx = w * w + x * x - yy * yy - z * z
            ry, rz = 2.0 * (x * yy - w * z), 2.0 * (x * z + w * yy)
            dp += ga * ry * rz
            dq += gb * rz * rx
            dr += gc * rx * ry
        out[0], out[1], out[2] = dp, dq, dr
        out[3] = -0.5 * (x * p + yy * q + z * r)
        out[4] = 0.5 * (w * p + yy * r - z * q)
        out[5] = 0.5 * (w * q + z * p - x * r)
        out[6] = 0.5 * (w * r + x * q - yy * p)
        if orbiting:
            out[3] += half * z
            out[4] += half * yy
            out[5] -= half * x
            out[6] -= half * w

    return function
