"""Evaluation of a scene's expressions at its start, which refuses those without a finite value before
anything runs.
"""

from __future__ import annotations

from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.expressions.names import EULER_NAMES, PROVIDERS
from rigidsim.scene.expressions.tree import (
    Expression,
    ExpressionError,
    evaluate,
    names_used,
)
from rigidsim.scene.scene import Scene

_SINGULAR = 2.0**-30  # rad from a singularity of Euler angles, where no step would be long enough
_TIMES = 8  # of a run's span, at which functions of time alone are tried


def start_values(scene: Scene) -> dict[str, Any]:
    """Values (mpf, SI) at the start of all names that expressions may read."""
    found: dict[str, Any] = {}
    for provider in PROVIDERS:
        found |= provider.at_start(scene)
    return found


def check_start(scene: Scene) -> None:
    """Evaluate the components of loads and the events at the start, and what depends on time alone later."""
    values = start_values(scene)
    problems = _check_branch(scene) or _check_singular(scene, values)
    for expression in scene.formulas():
        problems += _check(expression, values, scene.context)
        problems += _check_span(expression, scene)
    problems = problems or _check_signs(scene, values)
    if problems:
        raise ConfigError(problems)


def _check_branch(scene: Scene) -> list[Problem]:
    """Refuse expressions that read Euler angles if the start is given by the other of an attitude's two
    triples: they use the one whose middle angle is in its range, as found in every formulation.
    """
    read = names_used(*scene.formulas()) & set(EULER_NAMES)
    if scene.euler_angles is None or not read:
        return []
    sequence, middle, pi = scene.config.integrator.euler_sequence, scene.euler_angles[1], scene.context.pi
    low, high, shown = (
        (0, pi, "0 to pi") if sequence[0] == sequence[2] else (-pi / 2, pi / 2, "-pi/2 to pi/2")
    )
    if low <= middle <= high:
        return []
    what = (
        f"given {scene.context.nstr(middle, 8)} rad for the middle angle, while {', '.join(sorted(read))} "
        f"stands in an expression; there {shown} is allowed for {sequence}: give the same attitude so, or "
        "as a quaternion"
    )
    return [Problem("[initial] euler_angles", what)]


def _check_singular(scene: Scene, values: dict[str, Any]) -> list[Problem]:
    """Refuse loads that read Euler angles where these are singular at the start and have no derivatives."""
    reading = [(x.where, names_used(x) & set(EULER_NAMES)) for x in scene.acting_formulas()]
    if not any(names for _, names in reading):
        return []
    context, sequence = scene.context, scene.config.integrator.euler_sequence
    middle = values[EULER_NAMES[1]]
    proper = sequence[0] == sequence[2]
    if abs(context.sin(middle) if proper else context.cos(middle)) > _SINGULAR:
        return []
    why = (
        f"which the start leaves open: the middle angle of the sequence {sequence} is "
        f"{context.nstr(middle, 8)} rad there, where its outer axes coincide; choose another [integrator] "
        "euler_sequence, start elsewhere, or write the load with the quaternion (qw, qx, qy, qz)"
    )
    return [Problem(where, f"reads {', '.join(sorted(names))}, {why}") for where, names in reading if names]


def _check(expression: Expression, values: dict[str, Any], context: Any) -> list[Problem]:
    try:
        evaluate(expression, values, context)
    except ExpressionError as error:
        names = [name for name in values if name in names_used(expression)]
        given = ", ".join(f"{name} = {context.nstr(values[name], 8)}" for name in names)
        return [
            Problem(
                expression.where,
                f"no finite value at the start ({given}); start elsewhere or rewrite it: {error}",
            )
        ]
    return []


def _check_signs(scene: Scene, values: dict[str, Any]) -> list[Problem]:
    """Refuse what is below zero at the start and can't be."""
    found = [(x, evaluate(x, values, scene.context)) for x in scene.never_negative()]
    what = 'given "{}", which is {} at the start; at least 0 is allowed'
    return [
        Problem(x.where, what.format(x.text, scene.context.nstr(value, 6)))
        for x, value in found
        if value is not None and value < 0
    ]


def _check_span(expression: Expression, scene: Scene) -> list[Problem]:
    """Refuse a function of time alone, such as sqrt(-t) or log(2 - t), that has a value at the start and at
    no later time that is tried; the last time at which it has one is found by bisection.
    """
    problems, context = [], scene.context
    for part in _functions_of_time(expression):
        span = scene.end - scene.start
        tried = [_refusal(part, scene.start + span * n / _TIMES, context) for n in range(_TIMES + 1)]
        if tried[0] is not None or None in tried[1:]:
            continue
        last, beyond = scene.start, scene.start + span / _TIMES
        for _ in range(context.prec):
            middle = (last + beyond) / 2
            last, beyond = (middle, beyond) if _refusal(part, middle, context) is None else (last, middle)
        what = f"no finite value after t = {context.nstr(last, 8)} s, while the run goes on to "
        what += f"{context.nstr(scene.end, 8)} s; rewrite it, or end the run before: {tried[1]}"
        problems.append(Problem(expression.where, what))
    return problems


def _refusal(expression: Expression, time: Any, context: Any) -> ExpressionError | None:
    """Why a function of time alone has no value at a time; None if it has one."""
    try:
        evaluate(expression, {"t": time}, context)
    except ExpressionError as error:
        return error
    return None


def _functions_of_time(expression: Expression) -> list[Expression]:
    """The largest parts of an expression that depend on time and on nothing else."""
    found, waiting = [], [expression]
    while waiting:
        node = waiting.pop()
        names = names_used(node)
        if names == {"t"}:
            found.append(node)
        elif names:
            waiting += node.operands
    return found
