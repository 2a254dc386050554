"""How a run ended, in words: which event ended it, or where and why it broke down."""

import numpy as np

from rigidsim.session.diagnostics import NEAR_SINGULAR
from rigidsim.session.understood import time_words
from rigidsim.solve.assembly import Assembly
from rigidsim.solve.effects.charts import Charts
from rigidsim.solve.events import EventLog
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.sampler import Progress
from rigidsim.solve.status import Status
from rigidsim.store.summary_parts import ChartChanges


def time_reached(prepared: InitialValueProblem, progress: Progress, log: EventLog) -> float:
    """Time of the last sample, or of the event that ended the run, s; the start time before the first
    sample.
    """
    clock = prepared.clock
    if progress.status in (Status.EVENT, Status.IMPOSSIBLE, Status.OUT_OF_RANGE) and log.stop is not None:
        return clock.seconds(log.stop)
    done = progress.next_sample
    return float(clock.labels(done - 1, done)[0]) if done else clock.seconds(clock.start)


def closing_words(prepared: InitialValueProblem, progress: Progress, parts: Assembly) -> str:
    """The status in words: which event ended the run and when, or where and why it broke down."""
    log = parts.log
    text, words = progress.status.message, time_words(prepared.scene)
    if progress.status is Status.EVENT:
        ending = log.ending
        assert ending is not None
        name, when = prepared.system.crossings[ending.index].name, prepared.clock.seconds(ending.time)
        return f"{text}: {name} at {words.moment(when)}"
    if progress.status in (Status.IMPOSSIBLE, Status.OUT_OF_RANGE) and log.stop is not None:
        return f"{text}: {log.why_impossible} at {words.moment(prepared.clock.seconds(log.stop))}"
    if progress.status is Status.UNRESOLVED:
        return f"{text}: {progress.detail} (at {words.moment(progress.time)}, after {progress.steps} steps)"
    if progress.status not in (Status.NON_FINITE, Status.COLLAPSED):
        return text
    text += f"; last good state at {words.moment(progress.time)} after {progress.steps} steps"
    if progress.last_good is None:
        return text
    state = np.array([progress.last_good.state], dtype=prepared.precision.scalar)
    factors = parts.evaluator.singular_factors(state, np.array([parts.stepper.chart]))  # where it stands
    if factors is not None and abs(float(factors[0])) < NEAR_SINGULAR:
        middle = float(state[0][prepared.system.states.index("theta")])
        text += (
            f"; the middle Euler angle theta = {middle:.9g} rad came within {abs(float(factors[0])):.2g} of "
            f"the singularity of {prepared.system.sequence}"
        )
        if progress.status is Status.NON_FINITE and prepared.precision.name == "single":
            # they go with the distance to the power of the order, and some
            text += ", where coefficients of the series exceed the range of single precision (3.4e38)"
        text += ': choose formulation = "quaternion"'
    else:
        largest = prepared.system.states[int(np.argmax(np.abs(state[0].astype(np.float64))))]
        spacing = float(prepared.precision.epsilon) * abs(progress.time)
        text += (
            f"; the largest state there was {largest}. What acts may change there within less than "
            f"{spacing:.2g} s, to which {prepared.precision.name} precision resolves times, or exceed its "
            "range (choose a higher precision, a wider change, or functions that stay small); or a norm may "
            "vanish, and a root of zero has no series (add a small number under the root)"
        )
    return text


def chart_changes(prepared: InitialValueProblem, parts: Assembly) -> ChartChanges | None:
    """How often a run in Euler angles changed charts; None for other formulations."""
    system = prepared.system
    if system.partner is None:
        return None
    charts = parts.corrected.effect(Charts)
    return ChartChanges(
        count=0 if charts is None else charts.changes,
        sequence=system.sequence,
        partner=system.partner.sequence,
    )
