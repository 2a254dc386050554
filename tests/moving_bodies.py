"""Motions of bodies whose mass moves or leaves, by equations of their own, in 113 bits.

With M = I w in body axes and R to space,

    M' = M x w + N - mu G w,    R' = R [w]x,    w = M / I.

I' stands nowhere in them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import heyoka as hy
import numpy as np
from gyrostats import BITS, exact


def followed(
    moments: Callable[[Any, dict[str, Any]], Sequence[Any]],
    begun: Sequence[Any],
    rates: Sequence[Any],
    times: Any,
    *,
    states: dict[str, tuple[Any, Callable[[Any, dict[str, Any], Any], Any]]] | None = None,
    torque: Callable[[Any, Any, Any, Any], Sequence[Any]] | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rates (n, 3), matrices (n, 3, 3) and moments (n, 3) at times; 80-bit numbers. The start is unturned.

    Args:
        moments: of time and own states.
        begun: moments at the start.
        states: own states by name: value at the start, derivative of (t, states, w).
        torque: in body axes, of (t, w, R, moments).
    """
    own = {name: hy.make_vars(name) for name in states or {}}
    m = list(hy.make_vars("m0", "m1", "m2"))
    r = [list(hy.make_vars(*(f"r{i}{j}" for j in range(3)))) for i in range(3)]
    tensor = [hy.expression(x) for x in moments(hy.time, own)]
    w = [x / i for x, i in zip(m, tensor, strict=True)]
    given = [0.0] * 3 if torque is None else torque(hy.time, w, r, tensor)
    turns = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    system = [(m[i], m[j] * w[k] - m[k] * w[j] + given[i]) for i, j, k in turns]
    system += [(row[i], row[j] * w[k] - row[k] * w[j]) for row in r for i, j, k in turns]
    initial = [exact(i) * exact(x) for i, x in zip(begun, rates, strict=True)]
    initial += [exact(float(i == j)) for i in range(3) for j in range(3)]
    for name, (start, slope) in (states or {}).items():
        system.append((own[name], hy.expression(slope(hy.time, own, w))))
        initial.append(exact(start))
    grid = np.array([exact(x) for x in times])
    engine = hy.taylor_adaptive(system, initial, time=grid[0], fp_type=hy.real, prec=BITS, compact_mode=True)
    found = engine.propagate_grid(grid)[-1]
    read = hy.cfunc([*w, *tensor], [x for x, _ in system], fp_type=hy.real, prec=BITS, compact_mode=True)
    known = (
        read(np.ascontiguousarray(found.T), time=grid)
        if read.is_time_dependent
        else read(np.ascontiguousarray(found.T))
    )
    narrow = lambda x: np.vectorize(lambda y: np.longdouble(str(y)), otypes=[np.longdouble])(x)  # noqa: E731
    values = narrow(known).T
    return values[:, :3], narrow(found[:, 3:12]).reshape(-1, 3, 3), values[:, 3:]
