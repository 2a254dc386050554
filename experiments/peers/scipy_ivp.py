"""scipy's solve_ivp: DOP853 and LSODA, with the right-hand side compiled by numba."""

from collections.abc import Callable, Sequence
from typing import Any

import numba
import numpy as np
from scipy.integrate import solve_ivp

from experiments.peers.numba_dop853 import right_hand_side
from experiments.peers.scenes import Scene

TITLES = {
    "dop853": "scipy DOP853, numba",
    "lsoda": "scipy LSODA, numba",
}
_functions: dict[str, Any] = {}


def knobs(variant: str, scene: Scene) -> list[float]:
    """Relative tolerances (scipy raises what is below 100 eps); absolute ones are the same."""
    return [10.0**-n for n in (4, 6, 8, 10, 12, 13)]


def _compiled(scene: Scene) -> Callable[[float, Any], Any]:
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
    if scene.name not in _functions:
        _functions[scene.name] = _compiled(scene)
    function, start = _functions[scene.name], np.array(scene.start)

    def solve() -> Sequence[float]:
        result = solve_ivp(function, (0.0, end), start, variant.upper(), t_eval=[end], rtol=knob, atol=knob)
        if not result.success:
            raise RuntimeError(f"scipy {variant} at tolerance {knob:g}: {result.message}")
        return scene.from_orbital(result.y[3:7, -1].tolist(), end)

    return solve
