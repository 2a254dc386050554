"""``[body] principal_moments`` as expressions: mass that is moved inside the body.

They are functions of time, [[states]] and [parameters]. The body of the scene is the one at the start.
"""

from __future__ import annotations

import re
from typing import Any

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.names import Names, names_of
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import Constant, Expression, ExpressionError, evaluate, names_used
from rigidsim.scene.schema import Config

WHERE = "[body] principal_moments"
LEAST = 1e-9
"""Least part of their sum that a moment which varies may become: 1/I has a pole at zero."""
_LEAST_SINGLE = 2e-4
_JUMPS = re.compile(r"\b(sign|step|pulse|wrap)\s*\(")


def least_part(precision: str | int) -> float:
    """``LEAST`` in a precision that resolves it."""
    return _LEAST_SINGLE if precision == "single" else LEAST


def formulas_of(config: Config, names: Names | None = None) -> list[Expression]:
    """The three moments, parsed where the config has expressions; empty if none is one.

    Raises:
        ConfigError: an expression that can't be read, jumps, or reads what moments can't.
    """
    given = config.body.principal_moments
    if given is None or all(isinstance(x, ExactNumber) for x in given):
        return []
    names = names_of(config) if names is None else names
    allowed = {"t", *(state.name for state in config.states)}
    found: list[Expression] = []
    for axis, text in enumerate(given):
        if isinstance(text, ExactNumber):
            found.append(Constant(text))
            continue
        where = f"{WHERE}[{axis}]"
        try:
            formula = parse_expression(text, names, parameters=config.parameters, unit="kg m^2", where=where)
            others = ", ".join(sorted(names_used(formula) - allowed))
            what = f"it reads {others}; moments may read t, [[states]] and [parameters]"
            ensure(not others, ExpressionError(f"{what}: let a state of [[states]] follow it"))
            what = "it jumps, and mass takes time to move; make the change smooth with tanh"
            ensure(
                not _JUMPS.search(text), ExpressionError(f"{what}, or let a state of [[states]] follow it")
            )
        except ExpressionError as error:
            said = f'given "{text}", which is no number and no expression that is allowed here: {error}'
            raise ConfigError(Problem(where, said)) from None
        found.append(formula)
    return found


def moments_at_start(config: Config, context: Any, start: Any) -> Vector | None:
    """The three moments at the start (mpf, kg m^2); None if all are plain numbers.

    Raises:
        ConfigError: as ``formulas_of``, or one has no finite value there, or is too small to vary.
    """
    values = {"t": start, **{state.name: state.initial.at(context) for state in config.states}}
    moments = []
    for axis, formula in enumerate(found := formulas_of(config)):
        try:
            moments.append(evaluate(formula, values, context))
        except ExpressionError as error:
            raise ConfigError(Problem(f"{WHERE}[{axis}]", f"no finite value at the start: {error}")) from None
    if names_used(*found):
        least = least_part(config.integrator.precision)
        for axis, moment in enumerate(moments):
            what = (
                f"given {context.nstr(moment, 6)} kg m^2 at the start, with moments that vary; each has to "
            )
            fault = Problem(f"{WHERE}[{axis}]", what + f"be more than {least:.1g} of their sum")
            ensure(not 0 <= moment <= least * sum(moments), ConfigError(fault))
    return moments or None
