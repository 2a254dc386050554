"""Why a run broke down at something abrupt in its loads: too narrow for the time, or beyond the range."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from rigidsim.scene.expressions.lines import lines_in
from rigidsim.scene.expressions.tree import Expression, ExpressionError, evaluate, names_used
from rigidsim.scene.scene import Scene
from rigidsim.scene.transitions import narrow_parts, operations
from rigidsim.session.understood import time_words
from rigidsim.solve.problem import InitialValueProblem

_NARROW = 64.0  # spacings of the times: steps are parts of a width, and 32 below a spacing count as collapsed
_NARROWEST = 400  # bits


def why_it_broke(prepared: InitialValueProblem, time: float) -> str:
    """The reason in words, with what to do; empty if the loads show none.

    Args:
        time: of the last good state, s.
    """
    scene, precision = prepared.scene, prepared.precision
    context, spacing = scene.context, float(precision.epsilon)
    for where, part in _parts(scene):
        for line in lines_in(part, context):
            moment, width = line.zero, _width(part, line.zero, context)
            if width is None:
                continue
            near = width < _NARROW * spacing * abs(moment)
            if near and scene.start < moment < scene.end and moment > time - _NARROW * spacing * abs(time):
                return (
                    f'; "{part.text}" ({where}) changes at {time_words(scene).moment(float(moment))} within '
                    f"{float(width):.2g} s, and {precision.name} precision tells times there to "
                    f"{spacing * abs(float(moment)):.2g} s: choose a higher precision, a wider change, or "
                    "count time from an epoch shortly before"
                )
    if not issubclass(precision.scalar, float | np.floating):
        return ""
    most = np.finfo(precision.scalar).maxexp
    for load in scene.loads:
        for where, expression in load.formulas():
            large = _beyond(expression, time, most, context)
            if large:
                return (
                    f'; "{large}" ({where}) exceeds the range of {precision.name} precision there '
                    f"(2^{most}): write it with functions that stay small, such as 1 - tanh(u)^2 in place of "
                    "1/cosh(u)^2, or choose a higher precision"
                )
    return ""


def _parts(scene: Scene) -> Iterator[tuple[str, Expression]]:
    for load in scene.loads:
        for where, expression in load.formulas():
            kinks = (node.operands[0] for node in operations(expression) if node.operator == "sign")
            for part in (*narrow_parts(expression), *(Expression(expression.text, u) for u in kinks)):
                if names_used(part) == {"t"}:
                    yield where, Expression(expression.text[slice(*part.root.span)], part.root)


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
    for node in operations(expression):
        text = expression.text[slice(*node.span)]
        part = Expression(expression.text, node)
        if names_used(part) == {"t"}:
            try:
                value = evaluate(part, {"t": context.mpf(time)}, context)
            except ExpressionError:
                return text
            if context.mag(value) > most:
                return text
    return ""
