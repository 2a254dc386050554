"""Motions of rigid bodies by their angular momentum and rotation matrix in space axes, in 80 bits:
L' = R torque, R' = R [w]x, w = I^-1 R^T L.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import heyoka as hy
import numpy as np
from support import matrices

LONG = np.longdouble


def cross(a: Any, b: Any) -> list[Any]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


class Motion:
    """A body as variables of equations: ``momentum`` over the first moment, ``matrix``, ``rates``.

    Args:
        moments, rates, quaternion: numbers or texts; the start.
        more: further states by name, with their initial values.
    """

    def __init__(
        self, moments: Sequence[Any], rates: Sequence[Any], quaternion: Sequence[Any], **more: Any
    ) -> None:
        self.moments = np.array([LONG(x) for x in moments])
        self.momentum = list(hy.make_vars("lx", "ly", "lz"))
        self.matrix = [list(hy.make_vars(*(f"r{i}{j}" for j in range(3)))) for i in range(3)]
        self.more = {name: hy.make_vars(name) for name in more}
        seen = self.seen(self.momentum)
        self.rates = [self.moments[0] * x / i for x, i in zip(seen, self.moments, strict=True)]
        begun = matrices(np.array([LONG(x) for x in quaternion]))
        momentum = begun @ (self.moments * np.array([LONG(x) for x in rates])) / self.moments[0]
        self.start = np.array([*momentum, *begun.ravel(), *(LONG(x) for x in more.values())])

    def seen(self, vector: Any) -> list[Any]:
        """A vector of space axes in body axes."""
        return [dot([row[j] for row in self.matrix], vector) for j in range(3)]

    def equations(self, torque: Sequence[Any], **derivatives: Any) -> list[Any]:
        """By the torque in body axes and the derivatives of the further states."""
        found = [
            (x, dot(r, torque) / self.moments[0]) for x, r in zip(self.momentum, self.matrix, strict=True)
        ]
        for row in self.matrix:
            found += zip(row, cross(row, self.rates), strict=True)
        return found + [(self.more[name], hy.expression(value)) for name, value in derivatives.items()]

    def engine(self, equations: list[Any], **more: Any) -> Any:
        return hy.taylor_adaptive(equations, self.start, fp_type=LONG, compact_mode=True, **more)

    def followed(self, equations: list[Any], times: Sequence[Any], **more: Any) -> np.ndarray:
        """States (n, states) at times."""
        engine, rows = self.engine(equations, **more), []
        for time in times:
            outcome = engine.propagate_until(LONG(time))[0]
            assert outcome == hy.taylor_outcome.time_limit
            rows.append(engine.state.copy())
        return np.array(rows)

    def rates_of(self, row: np.ndarray) -> np.ndarray:
        """Angular velocity, body axes, of a row of states."""
        found: np.ndarray = (row[3:12].reshape(3, 3).T @ row[:3]) * self.moments[0] / self.moments
        return found
