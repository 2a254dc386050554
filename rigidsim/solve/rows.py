"""Evaluation of compiled functions at rows of states, with bits that don't depend on how many there are."""

from __future__ import annotations

import numpy as np

from rigidsim.solve.engine import CompiledFunction

_GROUP = 64  # rows; a multiple of every SIMD width


def evaluate_rows(
    function: CompiledFunction,
    states: np.ndarray,
    constants: np.ndarray | None = None,
    times: np.ndarray | None = None,
) -> np.ndarray:
    """Evaluate a compiled function at each row of states.

    In single and double precision heyoka takes rows several at a time and the rest one by one, which differs
    in the last bit. Rows are padded to whole groups there, so that a row's bits don't depend on the block
    that it came in.

    Args:
        states: (n, states).
        constants: the function's parameters, (k,) for all rows or (k, n).
        times: (n,), internal units, where the function may depend on them.

    Returns:
        (outputs, n).
    """
    count = len(states)
    group = _GROUP if states.dtype in (np.float32, np.float64) else 1
    padded = -(-count // group) * group
    # compiled expressions without parameters don't accept an array of them
    arguments = {}
    if times is not None and getattr(function, "is_time_dependent", False):
        arguments["time"] = _padded(np.asarray(times, dtype=states.dtype), padded)
    if constants is not None:
        table = np.repeat(constants[:, None], padded, axis=1) if constants.ndim == 1 else constants
        arguments["pars"] = _padded(table, padded)
    return np.asarray(function(_padded(states.T, padded), **arguments))[:, :count]


def _padded(values: np.ndarray, count: int) -> np.ndarray:
    """An array, contiguous, whose last axis is filled up to a length with its last value."""
    given = values.shape[-1]
    if given == count:
        return np.ascontiguousarray(values)
    filled = np.empty((*values.shape[:-1], count), dtype=values.dtype)
    filled[..., :given] = values
    filled[..., given:] = values[..., -1:]
    return filled
