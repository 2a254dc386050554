"""Events as variables of the dataset: for each event its times and everything recorded, at full precision."""

from __future__ import annotations

import numpy as np

from rigidsim.prepare import Prepared
from rigidsim.solve.evaluate import Evaluator
from rigidsim.solve.events import EventLog
from rigidsim.store.variables import Extra, Variable


def event_variables(prepared: Prepared, log: EventLog, evaluator: Evaluator, last: float) -> list[Extra]:
    """``NAME_time`` and ``NAME_<variable>`` along a dimension ``NAME``, with residuals beyond double.

    Args:
        last: time of the run's last sample, internal units; steps, and crossings, go past it.
    """
    extras: list[Extra] = []
    variables = [v for v in prepared.variables() if not v.name.endswith(("_drift", "_put_back"))]
    for index, crossing in enumerate(prepared.system.crossings):
        found = [f for f in log.found if f.index == index and float(f.time) <= last]
        count = len(found)
        scalar = prepared.precision.scalar
        times = np.array([f.time for f in found], dtype=scalar)
        width = len(prepared.system.states)
        states = np.array([f.state for f in found], dtype=scalar).reshape(count, width)
        turns = np.array([f.turns for f in found], dtype=np.int64)
        turns = turns.reshape(count, log.turns.size)
        values = evaluator.evaluate_apart(states, turns) if count else {}
        exponent = prepared.clock.exponent
        values["time"] = [np.ldexp(part, exponent) for part in prepared.precision.parts(times)]
        for variable in variables:
            empty = [np.zeros((0, int(np.prod(variable.shape))))] * variable.parts
            extras += _extras(crossing.name, variable, values.get(variable.name, empty), count)
    return extras


def _extras(event: str, variable: Variable, parts: list[np.ndarray], count: int) -> list[Extra]:
    dims = (event, *variable.dims)
    return [
        Extra(
            f"{event}_{name}",
            dims,
            values.reshape(count, *variable.shape),
            {**variable.part_attributes(part), "event": event},
        )
        for part, (name, values) in enumerate(zip(variable.part_names(), parts, strict=True))
    ]


def event_counts(prepared: Prepared, log: EventLog, last: float) -> dict[str, int]:
    """How often each event was found."""
    return {
        crossing.name: sum(f.index == index and float(f.time) <= last for f in log.found)
        for index, crossing in enumerate(prepared.system.crossings)
    }
