"""Motions of bodies with a fluid core by equations of their own, in 113 bits.

With the whole angular momentum M and the core's H in body axes, and R to space,

    M' = M x w + N,    H' = H x w - N_c,    R' = R [w]x,    w = I_m^-1 (M - H),    v = I_c^-1 H.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import heyoka as hy
import mpmath
import numpy as np
from gyrostats import BITS, exact

_CONTEXT = mpmath.MPContext()
_CONTEXT.prec = BITS + 20


@dataclass(frozen=True)
class Core:
    """A core by texts of its numbers; ``axis`` a principal axis of the body, if that isn't z."""

    moment: Any
    flattening: Any = 0
    friction: Any = 0
    rate: Sequence[Any] | None = None
    axis: Any = (0, 0, 1)


def followed(
    inertia: Any,
    core: Core,
    rates: Sequence[Any],
    times: Any,
    load: Callable[[Any, Any, Any], Any] | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rates (n, 3), matrices (n, 3, 3) and rates of the core (n, 3) at times; the start is unturned.

    Args:
        inertia: principal moments, or a tensor (mpmath).
        load: torque on the body in body axes, of (t, w, R).
    """
    mp, number = _CONTEXT, exact
    whole = mp.diag([mp.mpf(str(x)) for x in inertia]) if np.ndim(inertia) == 1 else mp.matrix(inertia)
    p = mp.matrix(list(core.axis))
    greatest = (p.T * whole * p)[0]
    polar, f = mp.mpf(str(core.moment)) * greatest, mp.mpf(str(core.flattening))
    friction = mp.mpf(str(core.friction)) * greatest
    own = polar * (1 - f) * mp.eye(3) + polar * f * p * p.T
    inverse_mantle, inverse_core = (whole - own) ** -1, own**-1
    w0 = mp.matrix([mp.mpf(str(x)) for x in rates])
    v0 = w0 if core.rate is None else mp.matrix([mp.mpf(str(x)) for x in core.rate])
    h0 = own * v0
    m0 = (whole - own) * w0 + h0
    m, h = (list(hy.make_vars(*(f"{name}{i}" for i in range(3)))) for name in "mh")
    r = [list(hy.make_vars(*(f"r{i}{j}" for j in range(3)))) for i in range(3)]

    def times_matrix(matrix: Any, vector: list[Any]) -> list[Any]:
        return [hy.sum([number(matrix[i, j]) * vector[j] for j in range(3)]) for i in range(3)]

    w = times_matrix(inverse_mantle, [x - y for x, y in zip(m, h, strict=True)])
    v = times_matrix(inverse_core, h)
    torque = [0.0, 0.0, 0.0] if load is None else load(hy.time, w, r)
    turns = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    axis = [number(x) for x in p]
    spin = hy.sum([a * x for a, x in zip(axis, v, strict=True)])
    coupling = [
        number(friction) * (v[i] - w[i]) + number(polar * f) * spin * (axis[j] * v[k] - axis[k] * v[j])
        for i, j, k in turns
    ]
    system = [(m[i], m[j] * w[k] - m[k] * w[j] + torque[i]) for i, j, k in turns]
    system += [(h[i], h[j] * w[k] - h[k] * w[j] - coupling[i]) for i, j, k in turns]
    system += [(row[i], row[j] * w[k] - row[k] * w[j]) for row in r for i, j, k in turns]
    initial = [number(x) for x in (*m0, *h0)] + [exact(float(i == j)) for i in range(3) for j in range(3)]
    grid = np.array([exact(x) for x in times])
    engine = hy.taylor_adaptive(system, initial, time=grid[0], fp_type=hy.real, prec=BITS, compact_mode=True)
    states = engine.propagate_grid(grid)[-1]
    found = np.array([[np.longdouble(str(x)) for x in row] for row in states])

    def wide(matrix: Any) -> np.ndarray:
        return np.array([[np.longdouble(mp.nstr(matrix[i, j], 25)) for j in range(3)] for i in range(3)])

    mantle = (found[:, :3] - found[:, 3:6]) @ wide(inverse_mantle).T
    return mantle, found[:, 6:].reshape(-1, 3, 3), found[:, 3:6] @ wide(inverse_core).T
