"""What is recorded of a fluid core: its rate."""

from __future__ import annotations

from typing import Any

import heyoka as hy

from rigidsim.model.loads.fluid_core import STATES, core_of
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import BODY, NEEDS, Need, Observable, register_all
from rigidsim.scene.scene import Scene


def _rates(m: Mechanics) -> list[Any]:
    return list(hy.make_vars(*STATES))


def _units(m: Mechanics) -> list[int]:
    core = m.carried(core_of(m.scene))
    return [core.unit(m) - m.scaling.time] * 3


def _coreless(scene: Scene, _: str) -> str | None:
    return (
        None
        if core_of(scene)
        else "the body has no fluid core, or one of moment 0; give it one by [body] core, or leave this out"
    )


NEEDS["core"] = Need(lambda m: core_of(m.scene) is not None, missing=_coreless)

register_all(
    Observable(
        "core_angular_velocity", BODY, "rad s-1", "angular velocity of the fluid core", _rates, _units,
        "body axes", ("core",),
    ),
)  # fmt: skip
