"""Checkpoints as plain arrays of numbers, exact in every bit: reading one back runs no code.

A number beyond double is 2^exponent times a sum of float64 parts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import heyoka as hy
import mpmath
import numpy as np

from rigidsim.solve.evaluate import Memory
from rigidsim.solve.events import Found
from rigidsim.solve.harvest import Checkpoint
from rigidsim.solve.precision import Precision
from rigidsim.solve.rhythm import Place
from rigidsim.solve.stepper import Mark

Arrays = dict[str, np.ndarray]
"""Names to float64 or int64 arrays."""

_STEP = 512  # a power of two that every type holds
_MEMORIES = "rhythm_"


def pack(values: np.ndarray, precision: Precision, name: str) -> Arrays:
    """Exact arrays ``NAME_parts`` (parts, n) and, beyond double, ``NAME_exponents`` (n,) of scalars (n,)."""
    if precision.narrow:
        return {f"{name}_parts": np.asarray(values, dtype=np.float64)[None, :]}
    exponents = np.zeros(len(values), dtype=np.int64)
    scaled = np.array(values, dtype=precision.scalar)
    up, down = _power(precision, _STEP), _power(precision, -_STEP)
    for i in range(len(scaled)):  # to a size whose residuals are no denormal doubles
        while scaled[i] != 0 and abs(scaled[i]) < down:
            scaled[i] = scaled[i] * up
            exponents[i] -= _STEP
    return {f"{name}_exponents": exponents, f"{name}_parts": np.stack(precision.parts(scaled))}


def unpack(arrays: Mapping[str, np.ndarray], precision: Precision, name: str) -> np.ndarray:
    """The scalars that were packed.

    Raises:
        ValueError: arrays of another shape or precision.
    """
    if f"{name}_parts" not in arrays:
        return precision.zeros((0,))
    parts = np.asarray(arrays[f"{name}_parts"], dtype=np.float64)
    if parts.ndim != 2 or len(parts) != precision.part_count:
        raise ValueError(f"{name} has parts of shape {parts.shape}")
    if precision.narrow:
        return parts[0].astype(precision.scalar)
    total = _lifted(parts[0], precision)
    for part in parts[1:]:
        total = total + _lifted(part, precision)
    exponents = np.asarray(arrays[f"{name}_exponents"])
    if exponents.shape != total.shape:
        raise ValueError(f"{name} has exponents of shape {exponents.shape}")
    down = _power(precision, -_STEP)
    for i, exponent in enumerate(exponents):
        for _ in range(-int(exponent) // _STEP):
            total[i] = total[i] * down
    return total


def _lifted(part: np.ndarray, precision: Precision) -> np.ndarray:
    """float64 numbers in the run's own type; ``astype`` makes multi-precision numbers of 53 bits."""
    if precision.scalar is not hy.real:
        return part.astype(precision.scalar)
    return np.array([hy.real(float(x), precision.bits) for x in part], dtype=hy.real)


def _power(precision: Precision, exponent: int) -> Any:
    return precision.number(mpmath.mpf(2) ** exponent)


def pack_checkpoint(checkpoint: Checkpoint, memory: Memory, precision: Precision) -> Arrays:
    """The integration's and the evaluation's state as arrays."""
    mark = checkpoint.place.mark
    arrays = pack(np.array(mark.time, dtype=precision.scalar), precision, "time")
    arrays |= pack(mark.state, precision, "state")
    arrays["counts"] = np.array([mark.steps, mark.events, checkpoint.next_sample], dtype=np.int64)
    for name, array in checkpoint.place.memories.items():
        plain = array.dtype in (np.float64, np.int64)
        arrays |= {_MEMORIES + name: array} if plain else pack(array, precision, _MEMORIES + name)
    arrays["joined_turns"] = memory.turns
    if memory.last_angles is not None:
        arrays["joined_angles"] = memory.last_angles
    if memory.last_quaternion is not None:
        arrays["joined_quaternion"] = memory.last_quaternion
    return arrays


def unpack_checkpoint(
    arrays: Mapping[str, np.ndarray], precision: Precision, memories: Mapping[str, np.ndarray], states: int
) -> tuple[Checkpoint, Memory]:
    """What was packed.

    Args:
        memories: of the rhythm that goes on, for names and shapes.
        states: number of them.

    Raises:
        ValueError: it belongs to another system or precision.
    """
    time, state = unpack(arrays, precision, "time"), unpack(arrays, precision, "state")
    counts = arrays.get("counts", np.zeros(0, dtype=np.int64))
    if time.shape != (2,) or state.shape != (states,) or counts.shape != (3,):
        raise ValueError("the checkpoint belongs to another system of equations")
    found = {}
    for name, like in memories.items():
        if like.dtype in (np.float64, np.int64):
            values = arrays.get(_MEMORIES + name, np.zeros(like.shape, dtype=like.dtype))
        else:
            values = unpack(arrays, precision, _MEMORIES + name)
        if values.shape != like.shape:
            raise ValueError(f"the checkpoint has {name} of shape {values.shape}, not {like.shape}")
        found[name] = values.astype(like.dtype)
    mark = Mark((time[0], time[1]), state, int(counts[1]), int(counts[0]))
    memory = Memory(
        np.asarray(arrays.get("joined_turns", np.zeros(3)), dtype=np.int64),
        arrays.get("joined_angles"),
        arrays.get("joined_quaternion"),
    )
    return Checkpoint(Place(mark, found), int(counts[2])), memory


def pack_events(found: Sequence[Found], precision: Precision) -> Arrays:
    """Crossings as arrays."""
    if not found:
        return {}
    arrays = pack(np.array([f.time for f in found], dtype=precision.scalar), precision, "time")
    states = np.concatenate([np.asarray(f.state) for f in found]).astype(precision.scalar)
    arrays |= pack(states, precision, "state")
    arrays["index"] = np.array([f.index for f in found], dtype=np.int64)
    arrays["turns"] = np.array([f.turns for f in found], dtype=np.int64).reshape(len(found), -1)
    return arrays


def unpack_events(arrays: Mapping[str, np.ndarray], precision: Precision, states: int) -> list[Found]:
    """What was packed.

    Raises:
        ValueError: the arrays don't belong together.
    """
    times = unpack(arrays, precision, "time")
    count = len(times)
    values = unpack(arrays, precision, "state").reshape(count, states)
    index = arrays.get("index", np.zeros(0, dtype=np.int64))
    if index.shape != (count,):
        raise ValueError("events without their kind")
    turns = arrays.get("turns", np.zeros((count, 0), dtype=np.int64))
    return [
        Found(int(i), t, v, u.astype(np.int64))
        for i, t, v, u in zip(index, times, values, turns, strict=True)
    ]
