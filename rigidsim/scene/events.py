"""``[[events]]``: where expressions of time and the state cross zero."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.names import Names
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import Expression, ExpressionError, names_used, states_read
from rigidsim.scene.schema import EventTable


@dataclass(frozen=True)
class Event:
    """One event of a scene: its direction is any, up or down; with ``stop`` the run ends there."""

    name: str
    expression: Expression
    direction: str
    stop: bool

    @property
    def reads(self) -> frozenset[str]:
        """Names that the expression uses."""
        return names_used(self.expression)

    @property
    def states(self) -> frozenset[str]:
        """States without which the expression has no value."""
        return states_read(self.expression)


def resolve_events(
    tables: Sequence[EventTable], parameters: Mapping[str, ExactNumber], names: Names
) -> tuple[Event, ...]:
    """Read the expressions of ``[[events]]``."""
    found = []
    for number, table in enumerate(tables):
        where = f"[[events]] number {number + 1} expression"
        try:
            expression = parse_expression(table.expression, names, parameters=parameters, jumps=False)
        except ExpressionError as error:
            raise ConfigError(Problem(where, str(error))) from None
        if not names_used(expression):
            raise ConfigError(
                Problem(where, f'given "{table.expression}", which never changes; use {", ".join(names)}')
            )
        found.append(Event(table.name, expression, table.direction, table.action == "stop"))
    return tuple(found)
