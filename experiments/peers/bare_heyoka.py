"""heyoka with no rigidsim around it: rates and quaternion, as its documentation would have one write them."""

from collections.abc import Callable, Sequence
from typing import Any

import heyoka as hy
import numpy as np

from experiments.peers.scenes import Scene

TITLES = {
    "double": "bare heyoka, double",
    "orbital": "bare heyoka, attitude in the orbital frame",
    "explicit": "bare heyoka, cos(n t) explicit",
    "extended": "bare heyoka, 80 bit",
}
_integrators: dict[tuple[str, str, float], Any] = {}
_starts: dict[tuple[str, str, float], Any] = {}


def knobs(variant: str, scene: Scene) -> list[float]:
    """Tolerances; each precision down to its epsilon."""
    if variant in ("orbital", "explicit") and not scene.orbit_rate:
        return []
    if variant == "extended":
        return [1e-15, 1e-16, 1e-17, 1e-18, 2.0**-63]
    return [10.0**-n for n in range(3, 16)] + [2.0**-52]


def system(scene: Scene, orbit: str = "double", number: Any = float) -> tuple[list[Any], list[float]]:
    """Equations and initial values; the orbit's direction is carried as two states unless asked otherwise.

    Args:
        number: scalar type of the coefficients, whose quotients are rounded in it.
    """
    a, b, c = map(number, scene.moments)
    wx, wy, wz, w, x, y, z, cosine, sine = hy.make_vars(
        "wx", "wy", "wz", "qw", "qx", "qy", "qz", "cosine", "sine"
    )
    rates = [(b - c) / a * wy * wz, (c - a) / b * wz * wx, (a - b) / c * wx * wy]
    start, carried, turn = scene.start, [], [0.0, 0.0, 0.0, 0.0]
    if scene.weight:
        up_x, up_y = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x)
        rates[0] = rates[0] + scene.weight / a * up_y
        rates[1] = rates[1] - scene.weight / b * up_x
    if scene.orbit_rate:
        n = scene.orbit_rate
        if orbit == "explicit":
            cosine, sine = hy.cos(n * hy.time), hy.sin(n * hy.time)
        elif orbit == "orbital":
            cosine, sine = 1.0, 0.0
            turn = [n / 2 * z, n / 2 * y, -n / 2 * x, -n / 2 * w]
        else:
            carried = [(cosine, -n * sine), (sine, n * cosine)]
            start = [*start, 1.0, 0.0]
        r = [
            cosine * hy.sum([w**2, x**2, -(y**2), -(z**2)]) + sine * (2.0 * (x * y + w * z)),
            cosine * (2.0 * (x * y - w * z)) + sine * hy.sum([w**2, -(x**2), y**2, -(z**2)]),
            cosine * (2.0 * (x * z + w * y)) + sine * (2.0 * (y * z - w * x)),
        ]
        k = 3 * n * n
        rates[0] = rates[0] + k * (c - b) / a * (r[1] * r[2])
        rates[1] = rates[1] + k * (a - c) / b * (r[2] * r[0])
        rates[2] = rates[2] + k * (b - a) / c * (r[0] * r[1])
    equations = [
        *zip((wx, wy, wz), rates, strict=True),
        (w, 0.5 * hy.sum([-(x * wx), -(y * wy), -(z * wz)]) + turn[0]),
        (x, 0.5 * hy.sum([w * wx, y * wz, -(z * wy)]) + turn[1]),
        (y, 0.5 * hy.sum([w * wy, z * wx, -(x * wz)]) + turn[2]),
        (z, 0.5 * hy.sum([w * wz, x * wy, -(y * wx)]) + turn[3]),
        *carried,
    ]
    return equations, start


def prepare(scene: Scene, end: float, variant: str, knob: float) -> Callable[[], Sequence[float]]:
    """See ``experiments.peers``; the same integrator is put back to the start each time."""
    key = scene.name, variant, knob
    scalar: Any = np.longdouble if variant == "extended" else np.float64
    if key not in _integrators:
        equations, values = system(scene, variant, scalar)
        state = np.array(values, dtype=scalar)
        _integrators[key] = hy.taylor_adaptive(equations, state, fp_type=scalar, tol=scalar(knob))
        _starts[key] = state.copy()
    integrator, start = _integrators[key], _starts[key]

    def solve() -> Sequence[float]:
        integrator.time = scalar(0)
        integrator.state[:] = start
        integrator.propagate_until(scalar(end))
        quaternion = [float(q) for q in integrator.state[3:7]]
        return scene.from_orbital(quaternion, end) if variant == "orbital" else quaternion

    return solve


def reference(scene: Scene, end: float) -> list[list[float]]:
    """The final quaternion in 128-bit arithmetic, each component as doubles that add up to it."""
    equations, values = system(scene, number=hy.real128)
    start = np.array([hy.real128(v) for v in values], dtype=hy.real128)
    integrator = hy.taylor_adaptive(
        equations, start, fp_type=hy.real128, tol=hy.real128("1e-32"), compact_mode=True
    )
    integrator.propagate_until(hy.real128(end))
    parts = []
    for component in integrator.state[3:7]:
        rest, doubles = component, []
        for _ in range(3):
            doubles.append(float(rest))
            rest = rest - hy.real128(doubles[-1])
        parts.append(doubles)
    return parts
