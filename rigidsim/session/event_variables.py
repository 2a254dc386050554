"""Events as variables of the dataset: for each event its times and everything recorded, at full precision."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.session.variables import LYAPUNOV_NAMES, dataset_variables, dates_of, recorded_variables
from rigidsim.solve.evaluate import Evaluator, RecordedParts
from rigidsim.solve.events import EventLog, samples_at
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.store.summary_parts import EventTimes
from rigidsim.store.variables import LABELS, OF_THE_RUN, Extra, Variable


def event_variables(
    prepared: InitialValueProblem, log: EventLog, evaluator: Evaluator, last: float
) -> list[Extra]:
    """``NAME_time``, dates and ``NAME_<variable>`` along a dimension ``NAME``, with residuals beyond double.

    Args:
        last: time of the run's last sample, internal units; steps and crossings may lie past it.
    """
    extras: list[Extra] = []
    variables, dates = recorded_variables(prepared), dates_of(prepared)
    if dates is not None:
        variables[1:1] = dates.variables
    for index, crossing in enumerate(prepared.system.crossings):
        found = log.occurrences(index, last)
        count = len(found)
        values: RecordedParts = {}
        times = prepared.clock.internal(0, 0)
        if found:
            block = samples_at(found, prepared.precision)
            values, times = evaluator.evaluate_apart(block), block.times
        exponent = prepared.clock.exponent
        values["time"] = [np.ldexp(part, exponent) for part in prepared.precision.parts(times)]
        while len(values["time"]) < prepared.clock.part_count:  # found by the engine: no label to be off
            values["time"].append(np.zeros(len(times)))
        if dates is not None:
            values |= dates.of_times([_exactly(row) for row in zip(*values["time"], strict=True)])
        for variable in variables:
            empty = [np.zeros((0, int(np.prod(variable.shape))))] * variable.parts
            wrapped = "angle" in variable.attributes
            more = dict.fromkeys(("turns", "angle"), "within one turn") if wrapped else {}
            extras += _extras(crossing.name, variable, values.get(variable.name, empty), count, more)
    return extras


def refuse_taken_names(prepared: InitialValueProblem) -> None:
    """Refuse a run whose dataset would use one name twice."""
    taken = {name for variable in dataset_variables(prepared) for name in variable.part_names()}
    taken |= {*LABELS, *OF_THE_RUN, *LYAPUNOV_NAMES, "checkpoint", "events"}
    dates, variables = dates_of(prepared), recorded_variables(prepared)
    if dates is not None:
        variables += dates.variables
    for crossing in prepared.system.crossings:
        names = [f"{crossing.name}_{name}" for variable in variables for name in variable.part_names()]
        double = next((name for name in (crossing.name, *names) if name in taken), None)
        if double is not None:
            events = [table.name for table in prepared.scene.config.events]
            problem = Problem(
                f"[[events]] number {events.index(crossing.name) + 1} name",
                f'given "{crossing.name}", by which the dataset would need the name "{double}" twice; choose '
                "another",
            )
            raise ConfigError(problem, prepared.experiment.source)
        taken.update((crossing.name, *names))


def _exactly(parts: tuple[np.ndarray, ...]) -> Fraction:
    return sum((Fraction(float(part)) for part in parts), Fraction(0))


def _extras(
    event: str, variable: Variable, parts: list[np.ndarray], count: int, more: dict[str, str]
) -> list[Extra]:
    dims = (event, *variable.dims)
    return [
        Extra(
            f"{event}_{name}",
            dims,
            values.reshape(count, *variable.shape),
            {**variable.part_attributes(part), **more, "event": event},
        )
        for part, (name, values) in enumerate(zip(variable.part_names(), parts, strict=True))
    ]


def event_times(prepared: InitialValueProblem, log: EventLog, last: float) -> dict[str, EventTimes]:
    """First and last times of each event that was found."""
    clock, times = prepared.clock, {}
    for index, crossing in enumerate(prepared.system.crossings):
        found = log.occurrences(index, last)
        if found:
            early = tuple(clock.seconds(event.time) for event in found[: EventTimes.EARLY])
            latest = clock.seconds(found[-1].time)
            times[crossing.name] = EventTimes(first=early[0], last=latest, early=early)
    return times


def event_counts(prepared: InitialValueProblem, log: EventLog, last: float) -> dict[str, int]:
    """How often each event was found."""
    return {
        crossing.name: len(log.occurrences(index, last))
        for index, crossing in enumerate(prepared.system.crossings)
    }
