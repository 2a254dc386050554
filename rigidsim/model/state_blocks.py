"""Blocks of states from which a system of equations is assembled."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import heyoka as hy

from rigidsim.model.rotations import Symbolic


@dataclass(frozen=True)
class StateBlock:
    """A group of states that belong together.

    Attributes:
        names: names of the states.
        derivatives: right-hand sides, in the same order.
        initial: initial values (mpf), internal units.
        norms: expressions that stay 1 by construction.
        exponents: binary exponents that bring the states to SI; empty for pure numbers.
        why: why they are carried.
    """

    names: Sequence[str]
    derivatives: Sequence[Symbolic]
    initial: Sequence[Any]
    norms: Sequence[Symbolic] = field(default_factory=list)
    exponents: Sequence[int] = ()
    why: str = ""

    @property
    def variables(self) -> list[Symbolic]:
        """The states as heyoka variables."""
        return list(hy.make_vars(*self.names)) if len(self.names) > 1 else [hy.make_vars(*self.names)]

    @property
    def unit_exponents(self) -> list[int]:
        """Binary exponent of the unit of each state."""
        return list(self.exponents) or [0] * len(self.names)


def joined(blocks: Iterable[StateBlock]) -> StateBlock:
    """Several blocks concatenated in order."""
    found = list(blocks)
    return StateBlock(
        [name for block in found for name in block.names],
        [rate for block in found for rate in block.derivatives],
        [value for block in found for value in block.initial],
        [norm for block in found for norm in block.norms],
        [exponent for block in found for exponent in block.unit_exponents],
    )
