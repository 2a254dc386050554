"""Whether something abrupt happens at a time that has to be known to more digits than one number holds.

A double tells times around 5000 s to 1e-12 s. A pulse that begins and ends at times rounded so, or a smooth
spike whose argument (t - 5000.3)/0.01 is worked out from such a time, gives another impulse than the one that
was written, and the body turns on at a wrong rate.
"""

from __future__ import annotations

from typing import Any

from rigidsim.scene.expressions.lines import LineInTime, lines_in
from rigidsim.scene.expressions.tree import Expression, ExpressionError, Operation, evaluate, names_used
from rigidsim.scene.scene import Scene
from rigidsim.scene.transitions import narrow_parts

_LATE = 64
"""Ratio of a time to the width of what happens then from which a rounded time counts: below it the error, a
part in 2^46 of the impulse in double precision, is no more than that of some steps.
"""


def happens_at_a_moment(scene: Scene) -> bool:
    """Whether a load switches at a time, or changes late and within a short while."""
    for load in scene.loads:
        for _, expression in load.formulas():
            if any(_within(line, scene) for line in _of_switches(expression, scene.context)):
                return True
            if any(_late(part, scene) for part in narrow_parts(expression)):
                return True
    return False


def acts_at_moments_alone(scene: Scene) -> bool:
    """Whether loads depend on time by nothing but its distance from moments, which no rounding of the time
    itself disturbs.
    """
    for load in scene.loads:
        formulas = list(load.formulas())
        lines = [line for _, expression in formulas for line in lines_in(expression, scene.context)]
        if not formulas or any(line.offset == 0 for line in lines):
            return False
    return True


def _of_switches(expression: Expression, context: Any) -> list[LineInTime]:
    """Lines in the arguments of signs, which don't pass through zero at t = 0."""
    found, waiting = [], [expression.root]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Operation):
            waiting += node.operands
            if node.operator == "sign":
                found += lines_in(Expression(expression.text, node.operands[0]), context)
    return [line for line in found if line.offset != 0]


def _within(line: LineInTime, scene: Scene) -> bool:
    return bool(scene.start < line.zero < scene.end)


def _late(part: Expression, scene: Scene) -> bool:
    """Whether a part that turns a function on or off does so within a small share of the time until then."""
    context = scene.context
    for line in lines_in(part, context):
        if line.offset == 0 or not _within(line, scene):
            continue
        if names_used(part) != {"t"}:
            if abs(line.offset) > _LATE:
                return True
            continue
        after = line.zero * (1 + context.one / _LATE)
        try:
            there, beside = (evaluate(part, {"t": then}, context) for then in (line.zero, after))
        except ExpressionError:  # a pole
            return True
        if abs(beside - there) > max(abs(there), 1):
            return True
    return False
