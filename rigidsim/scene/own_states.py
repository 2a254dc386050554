"""``[[states]]``: user-defined states, such as controllers, filters, slosh and fuel, by their derivatives.

They are carried by need: recorded, or read by a load, an event or another of them that is carried.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pydantic import Field, StrictStr, field_validator

from rigidsim.scene import units
from rigidsim.scene.exact import ZERO
from rigidsim.scene.expressions.names import BODY_NAMES
from rigidsim.scene.expressions.tree import RESERVED, Expression, states_read
from rigidsim.scene.fields import AnyQuantity, ConfigTable, Formula, VariableName, refuse
from rigidsim.scene.registry import Setting
from rigidsim.scene.units import UnitError
from rigidsim.scene.validation_messages import shown

_NUMBER = ("", "1")
"""Units of a pure number."""


class OwnStateTable(ConfigTable):
    """``[[states]]``: a user-defined state, integrated with the motion and readable in every expression."""

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
    """A user-defined state that is carried; ``why`` says by whom it is needed."""

    name: str
    unit: str | None  # SI; "1" for a number, None if it isn't known
    initial: Any  # mpf
    derivative: Expression  # SI
    why: str = ""

    @property
    def described(self) -> str:
        """What it is, in a reader's terms."""
        start = f"{float(self.initial):.4g}" + ("" if self.unit in (None, "1") else f" {self.unit}")
        return f'state {self.name}: from {start}, changes by "{self.derivative.text}"'


def resolve_states(setting: Setting) -> list[OwnState]:
    """All states of the config, their derivatives parsed.

    Raises:
        ConfigError: an expression that can't be read, or another dimension than the unit's.
    """
    found = []
    for number, table in enumerate(setting.config.states):
        here, start = setting.at("states", number), table.initial
        if start.unit and table.unit is not None:
            try:
                units.conversion(start.unit, table.unit)
            except UnitError as error:
                raise here.fault("initial", f"given a value in {start.unit}; {error}") from None
        rate = None if table.unit is None else "s^-1" if table.unit == "1" else f"{table.unit}/s"
        derivative = here.expression("derivative", table.derivative, rate, read_too=True)
        found.append(OwnState(table.name, table.unit, start.at(setting.context), derivative))
    return found


def carried_states(
    states: Sequence[OwnState], readers: Iterable[tuple[str, Expression]], record: Sequence[str] | None
) -> tuple[OwnState, ...]:
    """Those that something needs.

    Args:
        readers: who reads, for ``plan``, and what.
        record: names of what is recorded; None for all that the scene has.
    """
    slopes = {state.name: state.derivative for state in states}
    why: dict[str, dict[str, None]] = {x: {"recorded": None} for x in slopes if record is None or x in record}
    waiting = [*readers, *((f"state {name}", slopes[name]) for name in why)]
    for who, expression in waiting:
        for name in sorted(states_read(expression) & set(slopes)):
            if who == f"state {name}":
                continue
            if name not in why:
                waiting.append((f"state {name}", slopes[name]))
            why.setdefault(name, {})[f"{who} reads it"] = None
    return tuple(replace(x, why="; ".join(why[x.name])) for x in states if x.name in why)
