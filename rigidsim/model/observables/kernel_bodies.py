"""Where the bodies of a kernel are that loads see."""

from __future__ import annotations

from typing import Any

from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import SPACE, Observable, register_all
from rigidsim.model.rotations import Symbolic

_KILOMETRE = 10  # exponent of the power of two nearest to 1000 m


def _positions(m: Mechanics) -> list[Symbolic]:
    sky, context = m.carried(m.sky), m.scene.context
    unit: Any = m.number(context.mpf(1000) / 2**_KILOMETRE)
    return [unit * x for sight in sky.sights for x in sky.seen(sight)]


register_all(
    Observable(
        "source_position", ("source", *SPACE), "m", "positions of the kernel's bodies, from the host",
        _positions, lambda m: [x.exponent + _KILOMETRE for x in m.carried(m.sky).sights for _ in range(3)],
        "space axes", ("kernel",),
    ),
)  # fmt: skip
