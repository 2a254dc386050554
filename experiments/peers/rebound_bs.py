"""REBOUND's Gragg-Bulirsch-Stoer for equations of one's own, with a right-hand side compiled by numba."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numba
import rebound
from numba import carray, types

from experiments.peers.compiled import right_hand_side
from experiments.peers.scenes import Scene

TITLES = {"bs": "REBOUND BS, numba"}
_functions: dict[str, Any] = {}
_VECTOR = types.CPointer(types.double)
_SIGNATURE = types.void(types.voidptr, _VECTOR, _VECTOR, types.double)


def knobs(variant: str, scene: Scene) -> list[float]:
    """Relative and absolute tolerances."""
    return [10.0**-n for n in range(4, 16)]


def prepare(scene: Scene, end: float, variant: str, knob: float) -> Callable[[], Sequence[float]]:
    """See ``experiments.peers``."""
    if scene.name not in _functions:
        inner = right_hand_side(scene)

        @numba.cfunc(_SIGNATURE)
        def derivatives(ode, slope, state, t):  # type: ignore[no-untyped-def]
            inner(t, carray(state, 7), carray(slope, 7))

        _functions[scene.name] = derivatives
    address = _functions[scene.name].address
    pointer = dict(rebound.ODE._fields_)["_derivatives"](address)

    def solve() -> Sequence[float]:
        simulation = rebound.Simulation()
        simulation.integrator = "bs"
        simulation.integrator.eps_rel = knob
        simulation.integrator.eps_abs = knob
        ode = simulation.create_ode(length=7, needs_nbody=False)
        ode._derivatives = pointer
        for i, value in enumerate(scene.start):
            ode.y[i] = value
        simulation.integrate(end)
        return scene.from_orbital([ode.y[i] for i in range(3, 7)], end)

    return solve
