"""Parts of an expression that may change abruptly, which a step must not pass over.

A pulse such as ``exp(-((t-50)/0.01)^2)`` or a switch such as ``tanh((t-5)/0.001)`` is flat almost everywhere:
its Taylor series show nothing of what comes, and a step chosen by them passes over it. The change
happens where the function's argument is of order one, and the argument itself isn't flat: see
``rigidsim.model.step_limiter``. A root of something that touches zero, such as a vanishing norm, likewise
continues smoothly along the wrong branch.

What happens abruptly at a time has to be known to more digits than one number holds: a double gives times
around 5000 s to 1e-12 s, and a pulse between times rounded so, or a spike whose argument (t - 5000.3)/0.01 is
worked out from such a time, gives another impulse than the one that was written.
"""

from __future__ import annotations

from typing import Any

from rigidsim.scene.expressions.tree import (
    Constant,
    Expression,
    ExpressionError,
    LineInTime,
    bounds,
    constant,
    evaluate,
    lines_in,
    names_used,
    operations,
    placed,
    rational_value,
)
from rigidsim.scene.scene import Scene

WIDE = 4.0
"""Bound within which an argument can't run through a function's whole transition."""
_FLAT = frozenset({"exp", "sinh", "cosh", "tanh", "erf", "sigmoid", "atan"})
"""Functions that become flat towards an end."""
_STEEP_POWER = 8  # higher ones vanish to an order near the Taylor method's
_LATE = 64
"""Ratio of a time to the width of what happens then from which a rounded time counts: below it the error, a
part in 2^46 of the impulse in double precision, is no more than the rounding of some steps.
"""


def narrow_parts(*expressions: Expression) -> list[Expression]:
    """Arguments of flat functions, denominators, bases of negative or high powers, if they leave ``WIDE``."""
    found: dict[Expression, None] = {}
    for node in (node for expression in expressions for node in operations(expression)):
        part: Expression | None = None
        if node.operator in _FLAT:
            part = node.operands[0]
        elif node.operator == "quotient":
            part = node.operands[1]
        elif node.operator == "power":
            base, power = node.operands
            low, high = bounds(power, always=False)
            if max(-low, high) > _STEEP_POWER and isinstance(power, Constant):
                part = placed(power * base, base.place)  # flat to a part in n of the base
            elif not isinstance(power, Constant) or power.value.sign < 0:
                part = base
        if part is not None and not isinstance(part, Constant):
            low, high = bounds(part, always=False)
            if max(-low, high) > WIDE:
                found[part] = None
    return list(found)


def root_parts(*expressions: Expression) -> list[Expression]:
    """Radicands that may touch zero, where the root has a kink; not those that are positive by their form."""
    found: dict[Expression, None] = {}
    for node in (node for expression in expressions for node in operations(expression)):
        part: Expression | None = None
        if node.operator == "sqrt":
            part = node.operands[0]
        elif node.operator == "power":
            base, power = node.operands
            exponent = rational_value(power)
            part = base if exponent is None or exponent.denominator != 1 else None
        elif node.operator in ("asin", "acos"):
            (x,) = node.operands
            part = placed(1 - x ** constant(2), x.place)
        if part is not None and not isinstance(part, Constant) and not bounds(part)[0] > 0:
            found[part] = None
    return list(found)


def happens_at_a_moment(scene: Scene) -> bool:
    """Whether a load or a state switches at a time, or changes late and within a short while."""
    acting = scene.acting_formulas()
    switching = (_within(line, scene) for x in acting for line in _of_switches(x, scene.context))
    return any(switching) or any(_late(part, scene) for part in narrow_parts(*acting))


def acts_at_moments_alone(scene: Scene) -> bool:
    """Whether loads depend on time by distances from moments alone, which no rounding of time disturbs."""
    each = [load.formulas() for load in scene.loads]
    each += [[state.derivative] for state in scene.states if "t" in names_used(state.derivative)]
    for formulas in each:
        lines = [line for expression in formulas for line in lines_in(expression, scene.context)]
        if not formulas or any(line.offset == 0 for line in lines):
            return False
    return True


def _of_switches(expression: Expression, context: Any) -> list[LineInTime]:
    """Lines in the arguments of signs, which don't pass through zero at t = 0."""
    found = []
    for node in operations(expression):
        if node.operator == "sign":
            found += lines_in(node.operands[0], context)
    return [line for line in found if line.offset != 0]


def _within(line: LineInTime, scene: Scene) -> bool:
    return bool(min(scene.start, scene.end) < line.zero < max(scene.start, scene.end))


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
