"""Which states of a motion have tangents: those that depend on a key, and that something recorded follows."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import heyoka as hy

from rigidsim.model.parametrised import Parametrised
from rigidsim.model.rotations import Symbolic

Row = dict[int, Symbolic]
"""Derivatives of an expression that aren't zero everywhere, by the number of the variable."""


def jacobian_rows(expressions: Sequence[Symbolic], by: Sequence[Symbolic]) -> list[Row]:
    """Derivatives by some variables, a row for each expression."""
    if not by:
        return [{} for _ in expressions]
    found = hy.diff_tensors([hy.expression(x) for x in expressions], diff_args=list(by), diff_order=1)
    zero = hy.expression(0.0)
    return [{i: d for i, d in enumerate(row) if d != zero} for row in found.jacobian]


def moving_states(
    made: Parametrised, jacobian: Sequence[Row], forcing: Sequence[Row], set_anew: Collection[str] = ()
) -> list[int]:
    """Indices of states that depend on a key, and that others or what is recorded depend on.

    Args:
        jacobian: of equations, then outputs, by the states. forcing: the same by the coefficients.
        set_anew: names of states that don't follow from their equations alone, and have no tangents.
    """
    names = made.states
    slopes = made.coefficients.initial_slopes
    moved = {i for i in range(len(names)) if forcing[i] or any(x != 0 for x in slopes[i])}
    while more := {i for i in range(len(names)) if i not in moved and moved & jacobian[i].keys()}:
        moved |= more
    wanted = {i for row in range(len(names), len(jacobian)) for i in jacobian[row]}
    while more := {i for row in wanted for i in jacobian[row] if i not in wanted}:
        wanted |= more
    return sorted(i for i in moved & wanted if names[i] not in set_anew)
