"""Events of a scene as expressions of its states."""

from __future__ import annotations

from dataclasses import dataclass

from rigidsim.model.heyoka_expressions import to_heyoka
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.state_names import state_names

_SIGNS = {"any": 0, "up": 1, "down": -1}


@dataclass(frozen=True)
class Crossing:
    """An event as an expression of the states; ``direction`` is -1, 0 (any) or 1."""

    name: str
    expression: Symbolic
    direction: int
    stop: bool


def crossings_of(m: Mechanics) -> list[Crossing]:
    """The events of a scene; their times are single numbers, and so is the time that they read."""
    found = []
    for event in m.scene.events:
        names = state_names(m, event.reads, clocked=False)
        expression = to_heyoka(event.expression, names, m.number, m.scene.context, m.sides)
        found.append(Crossing(event.name, expression, _SIGNS[event.direction], event.stop))
    return found
