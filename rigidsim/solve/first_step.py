"""What is refused because no step leads away from the start: derivatives there that aren't finite."""

from __future__ import annotations

import math
from typing import Any

import heyoka as hy
import mpmath
import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.system import System
from rigidsim.scene.expressions.tree import evaluate, names_used
from rigidsim.scene.scene import Scene, start_values
from rigidsim.scene.surfaces import root_parts
from rigidsim.solve.compiled import compiled_function
from rigidsim.solve.precision import Precision

_ROUGH = 1e-2
"""Tolerance of the trial: low orders show whether there is a series."""


def refuse_non_finite_start(system: System, precision: Precision) -> None:
    """Evaluate the equations once: a load from Python may have no finite value at the start."""
    outputs, sides = [right for _, right in system.equations], _sides(system, precision)
    if count := system.parameters:
        outputs.append(hy.par[count - 1])
    rhs = compiled_function(outputs, system.variables, compact_mode=True, **precision.options)
    values = rhs(precision.array(system.initial), time=_start(system, precision), **sides)
    lost = [n for n, v in zip(system.states, values, strict=False) if not math.isfinite(float(v))]
    if lost and system.partner is not None:  # a chart's own singularity is no fault of a load
        refuse_non_finite_start(system.partner, precision)
    elif lost:
        what = (
            f"the derivatives of {', '.join(lost)} aren't finite at the start; start elsewhere, or give "
            "the loads from Python finite torques and forces there"
        )
        raise ConfigError(Problem("loads", what))


def refuse_roots_of_zero(system: System, precision: Precision) -> None:
    """Refuse expressions that have values at the start, but no finite derivatives: sqrt(s) where s = 0.

    Raises:
        ConfigError: names them, with what they read there.
    """
    problems = _roots_of_zero(system.scene)
    charts = [system] if system.partner is None else [system, system.partner]
    if problems and not any(_begins(chart, precision) for chart in charts):
        raise ConfigError(problems)


def _roots_of_zero(scene: Scene) -> list[Problem]:
    """Expressions with a root that vanishes at the start."""
    formulas = [(x, parts) for x in scene.formulas() if (parts := root_parts(x))]
    if not formulas:
        return []
    values, context, problems = start_values(scene), scene.context, []
    for expression, parts in formulas:
        lost = [part for part in parts if evaluate(part, values, context) == 0]
        if lost:
            read = sorted(set().union(*map(names_used, lost)))
            given = ", ".join(f"{name} = {context.nstr(values[name], 8)}" for name in read)
            what = (
                f'"{expression.text}" has no finite derivative at the start ({given}), where its sqrt, '
                "fractional power, asin or acos is at the end of its range, and no series leads on; start "
                "elsewhere, write abs(u) for the norm of a single component u, or add a small number under "
                "the root"
            )
            problems.append(Problem(expression.where, what))
    return problems


def _begins(system: System, precision: Precision) -> bool:
    """Whether the equations, and what events follow, have a series at the start."""
    followed = [(hy.make_vars(f"followed_{n}"), x.expression) for n, x in enumerate(system.crossings)]
    initial = [*system.initial, *[mpmath.mpf(0) for _ in followed]]
    options = {**precision.options, **_sides(system, precision), "time": _start(system, precision)}
    engine = hy.taylor_adaptive(
        [*system.equations, *followed],
        precision.array(initial),
        tol=precision.number(mpmath.mpf(_ROUGH)),
        compact_mode=True,
        **options,
    )
    outcome, _ = engine.step()
    return bool(outcome != hy.taylor_outcome.err_nf_state)


def _sides(system: System, precision: Precision) -> dict[str, Any]:
    """Parameters of the equations: on whichever side of surfaces, and at the start's own time."""
    if system.pieces is not None:
        pieces = system.pieces.parameters(0)
        sides = [mpmath.mpf(1)] * system.first_of_pieces
        return {"pars": np.concatenate([precision.array(sides), pieces]) if sides else pieces}
    if count := system.parameters:
        return {"pars": precision.array([mpmath.mpf(n < count - system.clocked) for n in range(count)])}
    return {}


def _start(system: System, precision: Precision) -> Any:
    return precision.number(system.start)
