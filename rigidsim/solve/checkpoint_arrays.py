"""Checkpoints as plain arrays of numbers, exact in every bit: reading one back runs no code.

A number beyond double is 2^exponent times a sum of float64 parts. Arrays without elements aren't saved.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import heyoka as hy
import mpmath
import numpy as np

from rigidsim.solve.angle_state import pack_angles, unpack_angles
from rigidsim.solve.checkpoint import Checkpoint, Position, Statistics, Undefined
from rigidsim.solve.corrected_stepper import CorrectedStepper, StepBoundary
from rigidsim.solve.events import FoundEvent
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.stepper import Mark
from rigidsim.solve.turns.joined import Continuity

Arrays = dict[str, np.ndarray]
"""Float64 or int64 arrays by name."""

_STEP = 512  # a power of two that every type holds


def pack(values: np.ndarray, precision: Precision, name: str) -> Arrays:
    """Scalars (n,) as exact arrays ``NAME_parts`` (parts, n) and, beyond double, ``NAME_exponents`` (n,)."""
    if precision.narrow:
        return {f"{name}_parts": np.asarray(values, dtype=np.float64)[None, :]}
    exponents = np.zeros(len(values), dtype=np.int64)
    scaled = np.array(values, dtype=precision.scalar)
    up, down = _power(precision, _STEP), _power(precision, -_STEP)
    for i in range(len(scaled)):  # scale to a size whose residuals are no denormal doubles
        while scaled[i] != 0 and abs(scaled[i]) < down:
            scaled[i] = scaled[i] * up
            exponents[i] -= _STEP
    return {f"{name}_exponents": exponents, f"{name}_parts": np.stack(precision.parts(scaled))}


def unpack(arrays: Mapping[str, np.ndarray], precision: Precision, name: str) -> np.ndarray:
    """Scalars restored from packed arrays.

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
    """Float64 numbers in the run's own type; ``astype`` would make multi-precision numbers of 53 bits."""
    if precision.scalar is not hy.real:
        return part.astype(precision.scalar)
    return np.array([hy.real(float(x), precision.bits) for x in part], dtype=hy.real)


def _power(precision: Precision, exponent: int) -> Scalar:
    return precision.number(mpmath.mpf(2) ** exponent)


def pack_checkpoint(
    checkpoint: Checkpoint,
    corrected: CorrectedStepper,
    precision: Precision,
    invariants: Sequence[str],
    recorded: Sequence[str],
) -> Arrays:
    """A checkpoint as arrays.

    Args:
        corrected: what took the steps and effects whose memories it holds.
        invariants, recorded: the system's invariants and recorded variables, in order.
    """
    position, continuity, counted = checkpoint.position, checkpoint.continuity, checkpoint.statistics
    boundary = position.boundary
    mark = boundary.mark
    arrays = pack(np.array(mark.time, dtype=precision.scalar), precision, "time")
    arrays |= pack(mark.state, precision, "state")
    arrays["counts"] = np.array([mark.steps, mark.events, position.next_sample], dtype=np.int64)
    for effect, memory in zip(corrected.effects, boundary.memories, strict=True):
        arrays |= effect.pack(memory)
    arrays |= corrected.stepper.pack(mark.memory)
    arrays["joined_turns"] = continuity.turns
    if continuity.last_angles is not None:
        arrays["joined_angles"] = continuity.last_angles
    if continuity.last_quaternion is not None:
        arrays["joined_quaternion"] = continuity.last_quaternion
    if continuity.last_state is not None:
        arrays["joined_state"] = continuity.last_state
        arrays["joined_time"] = np.array([continuity.last_time])
    arrays["joined_wrapped"] = np.array([continuity.wrapped_from])
    drifts = counted.largest_drift, counted.final_drift
    arrays["watched"] = np.array([_values(found, invariants) for found in drifts])
    arrays["put_back"] = np.array(_values(counted.put_back, invariants))
    if counted.undefined:
        arrays["undefined"] = _pack_undefined(counted.undefined, recorded)
    arrays["singularity"] = np.array([counted.nearest_singularity, counted.singularity_time])
    arrays["steps_seen"] = np.array([counted.smallest_step, counted.largest_step])
    arrays["effort"] = np.array([counted.wall_seconds, counted.cpu_seconds, counted.integration_seconds])
    arrays["sessions"] = np.array([counted.sessions, counted.redone_steps], dtype=np.int64)
    return arrays


def unpack_checkpoint(
    arrays: Mapping[str, np.ndarray],
    corrected: CorrectedStepper,
    precision: Precision,
    invariants: Sequence[str],
    recorded: Sequence[str],
) -> Checkpoint:
    """A checkpoint restored from its arrays.

    Args:
        corrected: what takes the steps of the resumed system, with its effects.
        invariants, recorded: the system's invariants and recorded variables, in order.

    Raises:
        KeyError, ValueError: the checkpoint belongs to another system or precision.
    """
    time, state = unpack(arrays, precision, "time"), unpack(arrays, precision, "state")
    steps, events, next_sample = _numbers(arrays, "counts", 3)
    if time.shape != (2,) or state.shape != corrected.stepper.state.shape:
        raise ValueError("the checkpoint belongs to another system of equations")
    mark = Mark((time[0], time[1]), state, int(events), int(steps), corrected.stepper.unpack(arrays))
    boundary = StepBoundary(mark, tuple(effect.unpack(arrays) for effect in corrected.effects))
    continuity = Continuity(
        np.asarray(arrays.get("joined_turns", np.zeros(3)), dtype=np.int64),
        arrays.get("joined_angles"),
        arrays.get("joined_quaternion"),
        float(arrays.get("joined_time", [math.nan])[0]),
        arrays.get("joined_state"),
        float(arrays.get("joined_wrapped", [math.nan])[0]),
    )
    largest, final = np.reshape(arrays.get("watched", ()), (2, len(invariants)))
    nearest, when = _numbers(arrays, "singularity", 2)
    smallest_step, largest_step = _numbers(arrays, "steps_seen", 2)
    wall, cpu, integration = _numbers(arrays, "effort", 3)
    sessions, redone = _numbers(arrays, "sessions", 2)
    statistics = Statistics(
        largest_drift=_by_name(largest, invariants),
        final_drift=_by_name(final, invariants),
        put_back=_by_name(arrays.get("put_back", ()), invariants),
        nearest_singularity=nearest,
        singularity_time=when,
        smallest_step=smallest_step,
        largest_step=largest_step,
        redone_steps=int(redone),
        sessions=int(sessions),
        wall_seconds=wall,
        cpu_seconds=cpu,
        integration_seconds=integration,
        undefined=_unpack_undefined(arrays.get("undefined"), recorded),
    )
    return Checkpoint(Position(boundary, int(next_sample)), continuity, statistics)


def _numbers(arrays: Mapping[str, np.ndarray], name: str, count: int) -> list[float]:
    found = np.asarray(arrays[name])
    if found.shape != (count,):
        raise ValueError(f"the checkpoint has {name} of shape {found.shape}, not ({count},)")
    return [x.item() for x in found]


def _values(found: Mapping[str, float], names: Sequence[str]) -> list[float]:
    """Values in the order of the names; nan for missing ones."""
    return [found.get(name, math.nan) for name in names]


def _by_name(values: Iterable[float], names: Sequence[str]) -> dict[str, float]:
    """Values by name, without missing ones."""
    pairs = zip(names, map(float, values), strict=False)  # older runs have none of some
    return {name: value for name, value in pairs if not math.isnan(value)}


def _pack_undefined(found: Mapping[str, Undefined], names: Sequence[str]) -> np.ndarray:
    """One row for each name."""
    rows = [found.get(name, Undefined()) for name in names]
    return np.array([[row.count, row.leading, row.since] for row in rows], dtype=np.float64)


def _unpack_undefined(table: np.ndarray | None, names: Sequence[str]) -> dict[str, Undefined]:
    """Variables with undefined samples; older checkpoints hold none."""
    if table is None:
        return {}
    if table.shape != (len(names), 3):
        raise ValueError(f"the checkpoint counts undefined samples of shape {table.shape}")
    rows = zip(names, table.tolist(), strict=True)
    return {name: Undefined(int(n), int(leading), since) for name, (n, leading, since) in rows if n}


def pack_events(found: Sequence[FoundEvent], precision: Precision) -> Arrays:
    """Crossings as arrays."""
    if not found:
        return {}
    arrays = pack(np.array([f.time for f in found], dtype=precision.scalar), precision, "time")
    states = np.concatenate([np.asarray(f.state) for f in found]).astype(precision.scalar)
    arrays |= pack(states, precision, "state")
    arrays["index"] = np.array([f.index for f in found], dtype=np.int64)
    arrays["turns"] = pack_angles([f.angles for f in found])
    return arrays


def unpack_events(arrays: Mapping[str, np.ndarray], precision: Precision, states: int) -> list[FoundEvent]:
    """Crossings restored from packed arrays.

    Args:
        states: number of states.

    Raises:
        ValueError: the arrays don't belong together.
    """
    times = unpack(arrays, precision, "time")
    count = len(times)
    values = unpack(arrays, precision, "state").reshape(count, states)
    index = arrays.get("index", np.zeros(0, dtype=np.int64))
    if index.shape != (count,):
        raise ValueError("events without their kind")
    angles = unpack_angles(arrays.get("turns", np.zeros((count, 0), dtype=np.int64)))
    return [FoundEvent(int(i), t, v, a) for i, t, v, a in zip(index, times, values, angles, strict=True)]
