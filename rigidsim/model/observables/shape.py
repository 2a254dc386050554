"""What is recorded of a body whose tensor varies: its moments where mass moves, or its distortion."""

from __future__ import annotations

from typing import Any

import heyoka as hy

from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import BODY, NEEDS, Need, Observable, register_all


def _moments(m: Mechanics) -> list[Any]:
    shape = m.carried(m.shape)
    return [hy.expression(shape.matrix[i][i]) for i in range(3)]


def _distortion(m: Mechanics) -> list[Any]:
    tensor = m.carried(m.carried(m.shape).distortion)
    return [hy.expression(tensor[i][j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


NEEDS["moved_mass"] = Need(lambda m: m.shape is not None and m.slip is None)
NEEDS["distorted"] = Need(lambda m: m.slip is not None)

register_all(
    Observable(
        "principal_moments", BODY, "kg m2", "principal moments of inertia", _moments,
        lambda m: [m.scaling.inertia] * 3, "body axes", ("moved_mass",),
    ),
    Observable(
        "inertia_distortion", ("tensor_component",), "kg m2",
        "what tides and spin add to the inertia tensor", _distortion,
        lambda m: [m.scaling.inertia] * 6, "body axes", ("distorted",),
    ),
)  # fmt: skip
