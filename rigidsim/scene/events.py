"""``[[events]]``: where expressions of time and the state cross zero."""

from __future__ import annotations

from dataclasses import dataclass

from rigidsim.scene.expressions.tree import Expression, names_used
from rigidsim.scene.registry import Setting


@dataclass(frozen=True)
class Event:
    """One event of a scene: its direction is any, up or down; with ``stop`` the run ends there."""

    name: str
    expression: Expression
    direction: str
    stop: bool


def resolve_events(setting: Setting) -> tuple[Event, ...]:
    """Read the expressions of ``[[events]]``."""
    found = []
    for number, table in enumerate(setting.config.events):
        here = setting.at("events", number)
        expression = here.expression("expression", table.expression, jumps=False)
        if not names_used(expression):
            what = f'given "{table.expression}", which never changes; use {", ".join(setting.names)}'
            raise here.fault("expression", what)
        found.append(Event(table.name, expression, table.direction, table.action == "stop"))
    return tuple(found)
