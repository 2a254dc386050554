"""Types of heyoka's integrators and compiled functions: the part of their interface used here."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from rigidsim.solve.precision import Scalar


class CompiledFunction(Protocol):
    """Function returned by ``heyoka.cfunc``.

    Attributes:
        llvm_states: the compiled modules (in compact mode one for all), which print what they were compiled
            for.
    """

    llvm_states: Any

    def __call__(self, *inputs: Any, **options: Any) -> np.ndarray:
        """From inputs (k,) or (k, n) to outputs, in its own precision."""


class TaylorEngine(Protocol):
    """Integrator returned by ``heyoka.taylor_adaptive``.

    Attributes:
        time, dtime: current time, internal units; the second as two numbers whose sum it is.
        state, pars: (states,) and parameters up to the last that is read; views that can be assigned to.
        order, tol: order and tolerance of the Taylor series.
        tc: (states, order + 1), Taylor coefficients of the latest step that was asked to keep them.
        decomposition: terms of which a step's derivatives consist.
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
        """Take one step: its outcome and size."""

    def propagate_until(self, t: Scalar, **options: Any) -> tuple[Any, ...]:
        """Take many steps: outcome, smallest and largest step, their count, dense output and the callback."""

    def propagate_grid(self, grid: np.ndarray, **options: Any) -> tuple[Any, ...]:
        """Take many steps; the last item is the states at given times instead of dense output."""

    def update_d_output(self, t: Scalar) -> np.ndarray:
        """State at a time within the latest step, in a buffer that is reused."""
