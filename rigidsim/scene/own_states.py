"""``[[states]]``: states of one's own, such as controllers, filters, slosh and fuel, by their derivatives.

They are carried by need: recorded, or read by a load, an event or another of them that is carried.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import Field, StrictStr, field_validator

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene import units
from rigidsim.scene.exact import ZERO, ExactNumber, Quantity
from rigidsim.scene.expressions.names import BODY_NAMES, Names
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import RESERVED, Expression, ExpressionError, states_read
from rigidsim.scene.fields import AnyQuantity, ConfigTable, Formula, VariableName, refuse
from rigidsim.scene.units import UnitError
from rigidsim.scene.validation_messages import shown

_NUMBER = ("", "1")
"""Units of a pure number."""


class OwnStateTable(ConfigTable):
    """``[[states]]``: a state of one's own, integrated with the motion and readable in every expression."""

    name: VariableName = Field(examples=["integral"])
    """its name in expressions, and of its variable in the dataset"""
    initial: AnyQuantity = Field(ZERO, json_schema_extra={"x-unit-key": "unit"})
    """value at the start, SI or with its unit"""
    unit: StrictStr | None = Field(None, examples=["rad", "N m s"])
    """its SI unit, "1" for a number: labels the dataset, and is checked in its derivative and where it
    is read
    """
    derivative: Formula = Field(examples=["wz", "(2*k*qz - torque)/(2 s)"])
    """its rate of change in SI: an expression of t, the state, [[states]] and [parameters]"""

    @field_validator("name")
    @classmethod
    def _free(cls, value: str) -> str:
        if value in BODY_NAMES or value in RESERVED:
            raise refuse(f'given "{value}", which expressions use already; rename it')
        return value

    @field_validator("unit")
    @classmethod
    def _in_si(cls, value: str | None) -> str | None:
        if value is None:
            return None
        if value in _NUMBER:
            return "1"
        try:
            factor, pi_power = units.to_si(value)
        except UnitError as error:
            raise refuse(f"given {shown(value)}: {error}") from None
        if factor != 1 or pi_power:
            found = units.powers(value)
            instead = units.unit_text(found) if found else "rad"
            raise refuse(f'given "{value}"; states are in SI: "{instead}" is allowed')
        return value


@dataclass(frozen=True)
class OwnState:
    """A state of one's own that is carried; ``why`` says by whom it is needed."""

    name: str
    unit: str | None  # SI; "1" for a number, None if it isn't known
    initial: Any  # mpf
    derivative: Expression  # SI
    where: str  # its derivative's place in the config
    why: str = ""

    @property
    def told(self) -> str:
        """What it is, in a reader's terms."""
        start = f"{float(self.initial):.4g}" + ("" if self.unit in (None, "1") else f" {self.unit}")
        return f'state {self.name}: from {start}, changes by "{self.derivative.text}"'


def resolve_states(
    tables: Sequence[OwnStateTable], parameters: Mapping[str, ExactNumber], names: Names, context: Any
) -> list[OwnState]:
    """All states of the config, their derivatives parsed.

    Raises:
        ConfigError: an expression that can't be read, or another dimension than the unit's.
    """
    found = []
    for number, table in enumerate(tables, start=1):
        where = f"[[states]] number {number} derivative"
        _check_initial(table, number)
        rate = None if table.unit is None else "s^-1" if table.unit == "1" else f"{table.unit}/s"
        try:
            derivative = parse_expression(
                table.derivative, names, parameters=parameters, unit=rate, read_too=True
            )
        except ExpressionError as error:
            raise ConfigError(Problem(where, str(error))) from None
        found.append(OwnState(table.name, table.unit, table.initial.at(context), derivative, where))
    return found


def carried_states(
    states: Sequence[OwnState], readers: Iterable[tuple[str, Expression]], record: Sequence[str] | None
) -> tuple[OwnState, ...]:
    """Those that something needs.

    Args:
        readers: who reads, for ``plan``, and what.
        record: names of what is recorded; None for all that the scene has.
    """
    known = {state.name: state for state in states}
    why: dict[str, list[str]] = {name: ["recorded"] for name in known if record is None or name in record}
    waiting = [(who, name) for who, expression in readers for name in sorted(states_read(expression))]
    waiting += [(f"state {name}", read) for name in why for read in _others(known[name])]
    while waiting:
        who, name = waiting.pop(0)
        if name not in known:
            continue
        if name not in why:
            waiting += [(f"state {name}", read) for read in _others(known[name])]
        reasons = why.setdefault(name, [])
        if (reason := f"{who} reads it") not in reasons:
            reasons.append(reason)
    return tuple(
        OwnState(x.name, x.unit, x.initial, x.derivative, x.where, "; ".join(why[x.name]))
        for x in states
        if x.name in why
    )


def _others(state: OwnState) -> list[str]:
    return sorted(states_read(state.derivative) - {state.name})


def _check_initial(table: OwnStateTable, number: int) -> None:
    """Refuse an initial value with a unit of another dimension, or an angle for a number."""
    given = table.initial
    if not isinstance(given, Quantity) or table.unit is None:
        return
    try:
        units.conversion(given.unit, table.unit)
    except UnitError as error:
        what = f"given a value in {given.unit}; {error}"
        raise ConfigError(Problem(f"[[states]] number {number} initial", what)) from None
