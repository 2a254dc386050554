"""How a run ended, in words: which event ended it, or where and why it broke down."""

from typing import Any

import numpy as np

from rigidsim.scene.expressions.tree import (
    Expression,
    ExpressionError,
    evaluate,
    lines_in,
    names_used,
    operations,
)
from rigidsim.scene.scene import Scene
from rigidsim.scene.transitions import narrow_parts, root_parts
from rigidsim.session.diagnostics import NEAR_SINGULAR
from rigidsim.session.understood import time_words
from rigidsim.solve.assembly import Assembly
from rigidsim.solve.effects.charts import Charts
from rigidsim.solve.events import EventLog
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.sampler import Progress
from rigidsim.solve.status import Status
from rigidsim.store.summary_parts import ChartChanges

_NARROW = 64.0  # spacings of the times: steps are parts of a width, and 32 below a spacing count as collapsed
_NARROWEST = 400  # bits


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
    state = np.array([progress.last_good.mark.state], dtype=prepared.precision.scalar)
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
        reason = _why_it_broke(prepared, progress.time)
        if reason:
            return text + reason
        m = prepared.system.mechanics
        states = any(root_parts(state.derivative) for state in prepared.scene.states)
        if states or any(load.roots(m) for load in m.loads):
            text += (
                "; a root of zero has no series: if one vanished there, such as a norm, write "
                "abs(u) for the component u that moves, or add a small number under the root"
            )
        largest = int(np.argmax(np.abs(state[0].astype(np.float64))))
        text += f"; the largest state there was {prepared.system.states[largest]}"
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


def _why_it_broke(prepared: InitialValueProblem, time: float) -> str:
    """Why a run broke down after a time (s), with what to do; empty if the loads show no reason."""
    scene, precision = prepared.scene, prepared.precision
    context, spacing = scene.context, float(precision.epsilon)
    for part in _parts(scene):
        for line in lines_in(part, context):
            moment, width = line.zero, _width(part, line.zero, context)
            if width is None:
                continue
            near = width < _NARROW * spacing * abs(moment)
            way = scene.samples.direction
            ahead = way * (moment - time) > -_NARROW * spacing * abs(time)
            if near and ahead and way * scene.start < way * moment < way * scene.end:
                when = time_words(scene).moment(float(moment))
                return (
                    f'; "{part.text}" ({part.where}) changes at {when} within '
                    f"{float(width):.2g} s, and {precision.name} precision resolves times there to "
                    f"{spacing * abs(float(moment)):.2g} s: choose a higher precision, a wider change, or "
                    "count time from an epoch shortly before"
                )
    if not issubclass(precision.scalar, float | np.floating):
        return ""
    most = np.finfo(precision.scalar).maxexp
    for expression in scene.acting_formulas():
        large = _beyond(expression, time, most, context)
        if large:
            return (
                f'; "{large}" ({expression.where}) exceeds the range of {precision.name} precision there '
                f"(2^{most}): write it with functions that stay small, such as 1 - tanh(u)^2 in place of "
                "1/cosh(u)^2, or choose a higher precision"
            )
    return ""


def _parts(scene: Scene) -> list[Expression]:
    formulas = scene.acting_formulas()
    kinks = [node.operands[0] for x in formulas for node in operations(x) if node.operator == "sign"]
    return [part for part in (*narrow_parts(*formulas), *kinks) if names_used(part) == {"t"}]


def _width(part: Expression, moment: Any, context: Any) -> Any | None:
    """The time within which a part changes by its own size, or by one if it vanishes; None if it can't be
    told.
    """
    try:
        here = evaluate(part, {"t": moment}, context)
        size = abs(here) or context.one
        for bits in range(_NARROWEST):
            width = context.ldexp(abs(moment), -bits)
            if abs(evaluate(part, {"t": moment + width}, context) - here) <= size:
                return width
    except ExpressionError:
        pass
    return None


def _beyond(expression: Expression, time: float, most: int, context: Any) -> str:
    """The text of a part that depends on time alone and has a value of at least 2^most."""
    for part in operations(expression):
        if names_used(part) == {"t"}:
            try:
                value = evaluate(part, {"t": context.mpf(time)}, context)
            except ExpressionError:
                return part.text
            if context.mag(value) > most:
                return part.text
    return ""
