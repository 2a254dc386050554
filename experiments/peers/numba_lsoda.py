"""numbalsoda: DOP853 (modern Fortran) and LSODA (C++) with a right-hand side compiled by numba."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numba
import numpy as np
from numbalsoda import dop853, lsoda, lsoda_sig

from experiments.peers.compiled import right_hand_side
from experiments.peers.scenes import Scene

TITLES = {"dop853": "numbalsoda DOP853", "lsoda": "numbalsoda LSODA"}
_SOLVERS = {"dop853": dop853, "lsoda": lsoda}
_functions: dict[str, Any] = {}  # by scene; kept, since only their addresses are handed over


def knobs(variant: str, scene: Scene) -> list[float]:
    """Relative tolerances; absolute ones are the same, all states being of order one."""
    tightest = 15 if variant == "dop853" else 13
    return [10.0**-n for n in range(4, tightest + 1)]


def prepare(scene: Scene, end: float, variant: str, knob: float) -> Callable[[], Sequence[float]]:
    """See ``experiments.peers``."""
    if scene.name not in _functions:
        function = right_hand_side(scene)

        @numba.cfunc(lsoda_sig)
        def derivatives(t, y, dy, _):  # type: ignore[no-untyped-def]
            function(t, y, dy)

        _functions[scene.name] = derivatives
    address = _functions[scene.name].address
    start, times = np.array(scene.start), np.array([0.0, end])
    solver = _SOLVERS[variant]

    solver(address, start, np.array([0.0, 0.125]), rtol=knob, atol=knob, mxstep=100)  # compiles

    def solve() -> Sequence[float]:
        states, success = solver(address, start, times, rtol=knob, atol=knob, mxstep=2**30)
        if not success:
            raise RuntimeError(f"numbalsoda {variant} failed at tolerance {knob:g}")
        return scene.from_orbital(states[-1, 3:7].tolist(), end)

    return solve
