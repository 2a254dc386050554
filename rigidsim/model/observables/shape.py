"""What is recorded of a body in which mass moves: its moments."""

from __future__ import annotations

from typing import Any

import heyoka as hy

from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import BODY, NEEDS, Need, Observable, register_all


def _moments(m: Mechanics) -> list[Any]:
    shape = m.carried(m.shape)
    return [hy.expression(shape.matrix[i][i]) for i in range(3)]


NEEDS["moved_mass"] = Need(lambda m: m.shape is not None)

register_all(
    Observable(
        "principal_moments", BODY, "kg m2", "principal moments of inertia", _moments,
        lambda m: [m.scaling.inertia] * 3, "body axes", ("moved_mass",),
    ),
)  # fmt: skip
