"""scipy's solve_ivp: DOP853 and LSODA, with the right-hand side in Python and, where numba is, compiled."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from experiments.peers.scenes import Scene

TITLES = {
    "dop853": "scipy DOP853, Python",
    "dop853_compiled": "scipy DOP853, numba",
    "lsoda_compiled": "scipy LSODA, numba",
}
_functions: dict[str, Any] = {}


def knobs(variant: str, scene: Scene) -> list[float]:
    """Relative tolerances (scipy raises what is below 100 eps); absolute ones are the same."""
    return [10.0**-n for n in (4, 6, 8, 10, 12, 13)]


def _plain(scene: Scene) -> Callable[[float, Any], Any]:
    """The equations of ``compiled`` in Python floats, which beat numpy's scalars for seven states."""
    a, b, c = scene.moments
    weight, n = scene.weight, scene.orbit_rate

    def function(t: float, state: Any) -> Any:
        p, q, r, w, x, y, z = state.tolist()
        dp, dq, dr = (b - c) / a * q * r, (c - a) / b * r * p, (a - b) / c * p * q
        if weight:
            dp += weight / a * 2.0 * (y * z + w * x)
            dq -= weight / b * 2.0 * (x * z - w * y)
        if n:
            k = 3 * n * n
            rx = w * w + x * x - y * y - z * z
            ry, rz = 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
            dp += k * (c - b) / a * ry * rz
            dq += k * (a - c) / b * rz * rx
            dr += k * (b - a) / c * rx * ry
        return np.array(
            [
                dp,
                dq,
                dr,
                -0.5 * (x * p + y * q + z * r) + n / 2 * z,
                0.5 * (w * p + y * r - z * q) + n / 2 * y,
                0.5 * (w * q + z * p - x * r) - n / 2 * x,
                0.5 * (w * r + x * q - y * p) - n / 2 * w,
            ]
        )

    return function


def _compiled(scene: Scene) -> Callable[[float, Any], Any]:
    import numba

    from experiments.peers.compiled import right_hand_side

    inner = right_hand_side(scene)

    @numba.njit
    def function(t, state):  # type: ignore[no-untyped-def]
        out = np.empty(7)
        inner(t, state, out)
        return out

    function(0.0, np.array(scene.start))
    return function


def prepare(scene: Scene, end: float, variant: str, knob: float) -> Callable[[], Sequence[float]]:
    """See ``experiments.peers``."""
    method, _, compiled = variant.partition("_")
    key = scene.name + compiled
    if key not in _functions:
        _functions[key] = _compiled(scene) if compiled else _plain(scene)
    function, start = _functions[key], np.array(scene.start)

    def solve() -> Sequence[float]:
        result = solve_ivp(function, (0.0, end), start, method.upper(), t_eval=[end], rtol=knob, atol=knob)
        if not result.success:
            raise RuntimeError(f"scipy {method} at tolerance {knob:g}: {result.message}")
        return scene.from_orbital(result.y[3:7, -1].tolist(), end)

    return solve
