"""DOP853 compiled by numba as a whole: stages unrolled with literal coefficients, right-hand side inlined.

The strongest classical competitor that needs no Fortran. Coefficients from scipy; step control of Hairer,
Norsett & Wanner, Solving Ordinary Differential Equations I (1993), section II.10 and the code DOP853: error
from the orders 5 and 3, factor 0.9 err^(-1/8) within 1/3 and 6.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numba
import numpy as np
from scipy.integrate._ivp.dop853_coefficients import E3, E5, A, B, C

from experiments.peers.scenes import Scene

TITLES = {"dop853": "numba DOP853"}
_STAGES = 12
_solvers: dict[str, Any] = {}


def knobs(variant: str, scene: Scene) -> list[float]:
    """Relative and absolute tolerances."""
    return [10.0**-n for n in range(4, 16)]


def right_hand_side(scene: Scene) -> Callable[[float, Any, Any], None]:
    """A jitted ``f(t, y, out)`` of rates and quaternion; constants are literals.

    On an orbit the quaternion is that from the body to the frame which turns with the orbit, where the
    attractor stands still: no sine, no cosine (``Scene.from_orbital`` turns the result back).
    """
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


def _combination(weights: Sequence[float]) -> str:
    return " + ".join(f"{float(c)!r} * k{s}[j]" for s, c in enumerate(weights) if c)


def _source() -> str:
    """The integration loop, as numba's text."""
    stages = []
    for s in range(1, _STAGES):
        stages += [
            "        for j in range(7):",
            f"            work[j] = y[j] + h * ({_combination(A[s, :s])})",
            f"        f(t + {float(C[s])!r} * h, work, k{s})",
        ]
    names = ", ".join(f"k{s}" for s in range(_STAGES + 1))
    rows = ", ".join("np.empty(7)" for _ in range(_STAGES + 1))
    return "\n".join(
        [
            "def integrate(start, end, tolerance, h):",
            "    y, new, work = start.copy(), np.empty(7), np.empty(7)",
            f"    {names} = {rows}",
            "    t, rejected = 0.0, False",
            "    f(t, y, k0)",
            "    while t < end:",
            "        last = t + h >= end",
            "        if last:",
            "            h = end - t",
            *stages,
            "        for j in range(7):",
            f"            new[j] = y[j] + h * ({_combination(B)})",
            f"        f(t + h, new, k{_STAGES})",
            "        five, three = 0.0, 0.0",
            "        for j in range(7):",
            "            scale = tolerance * (1.0 + max(abs(y[j]), abs(new[j])))",
            f"            five += (({_combination(E5)}) / scale) ** 2",
            f"            three += (({_combination(E3)}) / scale) ** 2",
            "        both = five + 0.01 * three",
            "        error = h * five / np.sqrt(7.0 * both) if both > 0.0 else 0.0",
            "        factor = min(6.0, max(1.0 / 3.0, 0.9 * error ** -0.125)) if error > 0.0 else 6.0",
            "        if error <= 1.0:",
            "            t = end if last else t + h",
            "            for j in range(7):",
            f"                y[j], k0[j] = new[j], k{_STAGES}[j]",
            "            h *= min(factor, 1.0) if rejected else factor",
            "            rejected = False",
            "        else:",
            "            h *= min(factor, 1.0)",
            "            rejected = True",
            "            if t + h == t:",
            "                break",
            "    return y, t",
        ]
    )


def prepare(scene: Scene, end: float, variant: str, knob: float) -> Callable[[], Sequence[float]]:
    """See ``experiments.peers``; one compilation per scene."""
    if scene.name not in _solvers:
        names: dict[str, Any] = {"np": np, "f": right_hand_side(scene)}
        exec(_source(), names)
        _solvers[scene.name] = numba.njit(error_model="numpy")(names["integrate"])
    integrate, start = _solvers[scene.name], np.array(scene.start)
    integrate(start, 0.125, 1e-6, 0.0625)  # compiles

    def solve() -> Sequence[float]:
        state, reached = integrate(start, end, knob, 0.0625)
        if reached < end:
            raise RuntimeError(f"steps vanished at t = {reached:g} with tolerance {knob:g}")
        return scene.from_orbital(state[3:7].tolist(), end)

    return solve
