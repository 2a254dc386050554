"""heyoka's integrators and compiled functions as types: the part of their interface that is used here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeAlias

import numpy as np

from rigidsim.solve.precision import Scalar

CompiledFunction: TypeAlias = Callable[..., np.ndarray]
"""What ``heyoka.cfunc`` returns: from inputs (k,) or (k, n) to outputs, in the precision of its own."""


class TaylorEngine(Protocol):
    """What ``heyoka.taylor_adaptive`` returns.

    Attributes:
        time, dtime: where it stands, internal units; the second as two numbers whose sum it is.
        state: (states,), a view that can be assigned to; pars: likewise, up to the last that is read.
        order: of the Taylor series; tol: their tolerance.
        tc: (states, order + 1), Taylor coefficients of the latest step that was asked to keep them.
        decomposition: terms that a step's derivatives are made of.
    """

    time: Scalar
    dtime: tuple[Scalar, Scalar]
    state: np.ndarray
    pars: np.ndarray
    order: int
    tol: Scalar
    tc: np.ndarray
    decomposition: list[Any]

    def step(self, max_delta_t: Scalar, *, write_tc: bool = False) -> tuple[Any, Scalar]:
        """One step: its outcome and size."""

    def propagate_until(self, t: Scalar, **options: Any) -> tuple[Any, ...]:
        """Many steps: outcome, smallest and largest step, their count, dense output and the callback."""

    def propagate_grid(self, grid: np.ndarray, **options: Any) -> tuple[Any, ...]:
        """Likewise, with the states at given times in place of dense output, last."""

    def update_d_output(self, t: Scalar) -> np.ndarray:
        """The state at a time within the latest step, in a buffer that is used again."""
