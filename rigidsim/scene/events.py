"""Events of a scene: where an expression of time and the state crosses zero."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from pydantic import Field, StrictStr

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import (
    ATTITUDE_NAMES,
    FLIGHT_NAMES,
    RATE_NAMES,
    Expression,
    ExpressionError,
    names_used,
)
from rigidsim.scene.fields import ConfigTable, VariableName


class EventTable(ConfigTable):
    """``[[events]]``: where an expression of time and the state crosses zero."""

    name: VariableName = Field(examples=["flip"])
    """prefix of the dataset's variables: NAME_time, NAME_quaternion, ..."""
    expression: StrictStr = Field(examples=["wy", "theta - pi/2"])
    """expression of t, the states (wx wy wz, qw qx qy qz, phi theta psi, x y z, vx vy vz) and [parameters],
    in SI; the event is its crossing of zero
    """
    direction: Literal["any", "up", "down"] = "any"
    """direction of the crossing"""
    action: Literal["record", "stop"] = "record"
    """record the event, or stop the run at it"""


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


def resolve_events(
    tables: Sequence[EventTable], parameters: Mapping[str, ExactNumber], *, free_flight: bool
) -> tuple[Event, ...]:
    """Read the expressions of ``[[events]]``."""
    names = ("t", *RATE_NAMES, *ATTITUDE_NAMES, *(FLIGHT_NAMES if free_flight else ()))
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
