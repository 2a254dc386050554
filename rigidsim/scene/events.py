"""Events of a scene: where an expression of time and the state crosses zero."""

from __future__ import annotations

from dataclasses import dataclass

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import (
    ATTITUDE_NAMES,
    FLIGHT_NAMES,
    RATE_NAMES,
    Expression,
    ExpressionError,
    names_used,
)
from rigidsim.scene.schema import Config


@dataclass(frozen=True)
class Event:
    """One event of a scene.

    Attributes:
        direction: direction of the crossing: "any", "up" or "down".
        stop: whether the run ends there.
    """

    name: str
    expression: Expression
    direction: str
    stop: bool

    @property
    def reads(self) -> frozenset[str]:
        """Names that the expression uses."""
        return names_used(self.expression)


def resolve_events(config: Config, *, free_flight: bool) -> tuple[Event, ...]:
    """Read the expressions of ``[[events]]``.

    Raises:
        ConfigError: an expression can't be read, or never changes.
    """
    names = ("t", *RATE_NAMES, *ATTITUDE_NAMES, *(FLIGHT_NAMES if free_flight else ()))
    found = []
    for number, table in enumerate(config.events):
        where = f"[[events]] number {number + 1} expression"
        try:
            expression = parse_expression(table.expression, names, parameters=config.parameters, jumps=False)
        except ExpressionError as error:
            raise ConfigError(Problem(where, str(error))) from None
        if not names_used(expression):
            raise ConfigError(
                Problem(where, f'given "{table.expression}", which never changes; use {", ".join(names)}')
            )
        found.append(Event(table.name, expression, table.direction, table.action == "stop"))
    return tuple(found)
