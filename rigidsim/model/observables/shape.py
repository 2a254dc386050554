"""What is recorded of a body whose tensor varies: its moments where mass moves, or its distortion."""

from __future__ import annotations

from typing import Any

import heyoka as hy

from rigidsim.model.loads.elasticity import Elasticity
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import (
    BODY,
    NEEDS,
    Need,
    Observable,
    only_when_named,
    register_all,
)


def _moments(m: Mechanics) -> list[Any]:
    shape = m.carried(m.shape)
    return [hy.expression(shape.matrix[i][i]) for i in range(3)]


def _distortion(m: Mechanics) -> list[Any]:
    tensor = m.carried(m.carried(m.shape).distortion)
    return [hy.expression(tensor[i][j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def _tidal_power(m: Mechanics) -> list[Any]:
    return [load.power(m) for load in m.loads if isinstance(load, Elasticity)]


NEEDS["moved_mass"] = Need(lambda m: m.shape is not None and m.slip is None)
NEEDS["distorted"] = Need(lambda m: m.slip is not None)
NEEDS["tides"] = Need(
    lambda m: any(isinstance(x, Elasticity) and x.raising for x in m.loads),
    missing=lambda scene, _: (
        None
        if any(isinstance(x, Elasticity) and x.raising for x in scene.loads)
        else "needs tides: [body] elasticity, and a gravity_gradient that raises them"
    ),
)

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
    Observable(
        "tidal_power", (), "W", "power that tides put into the distortion: its mean is dissipated",
        _tidal_power, lambda m: [m.scaling.energy - m.scaling.time], "", ("tides",),
        by_default=only_when_named,
    ),
)  # fmt: skip
