"""What is recorded of parts of some scenes: rotors, a varying tensor, a fluid core, bodies of a kernel."""

from __future__ import annotations

import json
from typing import Any

import heyoka as hy

from rigidsim.model.loads.elasticity import Elasticity
from rigidsim.model.loads.fluid_core import STATES, core_of
from rigidsim.model.loads.rotor import rotors_of
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.mechanical import kept_energy_scale
from rigidsim.model.observables.observable import (
    BODY,
    ENERGY,
    NEEDS,
    SPACE,
    Need,
    Observable,
    only_when_named,
    register_all,
    same_unit,
    unless,
)
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.scene import Scene

_KILOMETRE = 10  # exponent of the power of two nearest to 1000 m


def _drawn(m: Mechanics) -> dict[str, str]:
    pictures = [rotor.pictured() for rotor in rotors_of(m.scene)]
    keys = {"rotor_axes": "axis", "rotor_moments": "moment", "rotor_drives": "drive"}
    return {name: json.dumps([one[key] for one in pictures]) for name, key in keys.items()}


def _kept(m: Mechanics) -> str | None:
    if m.energy_stored_by_drives is None or not m.conserves_energy:
        return None
    return "a fixed rate costs its motor the work J s a . (w - w0), which it lends the body"


def _distortion(m: Mechanics) -> list[Any]:
    tensor = m.carried(m.carried(m.shape).distortion)
    return [hy.expression(tensor[i][j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def _positions(m: Mechanics) -> list[Symbolic]:
    sky, context = m.carried(m.sky), m.scene.context
    unit: Any = m.number(context.mpf(1000) / 2**_KILOMETRE)
    return [unit * x for sight in sky.sights for x in sky.seen(sight)]


def _raises_tides(scene: Scene) -> bool:
    return any(isinstance(load, Elasticity) and load.raising for load in scene.loads)


NEEDS |= {
    "moved_mass": Need(lambda m: m.shape is not None and m.rate_correction is None),
    "distorted": Need(lambda m: m.rate_correction is not None),
    "tides": Need(
        lambda m: _raises_tides(m.scene),
        missing=unless(
            _raises_tides, "needs tides: [body] elasticity, and a gravity_gradient that raises them"
        ),
    ),
    "core": Need(
        lambda m: core_of(m.scene) is not None,
        missing=unless(
            core_of,
            "the body has no fluid core, or one of moment 0; give it one by [body] core, or leave this out",
        ),
    ),
}  # fmt: skip

register_all(
    Observable(
        "rotor_rate", ("rotor",), "rad s-1", "rates of the rotors about their axes, relative to the body",
        lambda m: [rotor.relative_rate(m) for rotor in rotors_of(m.scene)],
        lambda m: [-m.scaling.time] * len(rotors_of(m.scene)), "body axes", ("rotors",), attributes=_drawn,
    ),
    Observable(
        "body_energy", (), "J", "energy of the body with the rotors at fixed rates locked",
        lambda m: [m.kept_energy], same_unit(ENERGY, 1), "", ("energy", "fixed_rotors"),
        _kept, kept_energy_scale,
    ),
    Observable(
        "principal_moments", BODY, "kg m2", "principal moments of inertia",
        lambda m: [hy.expression(m.carried(m.shape).matrix[i][i]) for i in range(3)],
        same_unit(lambda m: m.scaling.inertia, 3), "body axes", ("moved_mass",),
    ),
    Observable(
        "inertia_distortion", ("tensor_component",), "kg m2",
        "what tides and spin add to the inertia tensor", _distortion,
        same_unit(lambda m: m.scaling.inertia, 6), "body axes", ("distorted",),
    ),
    Observable(
        "tidal_power", (), "W", "power that tides put into the distortion: its mean is dissipated",
        lambda m: [load.power(m) for load in m.loads if isinstance(load, Elasticity)],
        same_unit(lambda m: m.scaling.energy - m.scaling.time, 1), "", ("tides",), by_default=only_when_named,
    ),
    Observable(
        "core_angular_velocity", BODY, "rad s-1", "angular velocity of the fluid core",
        lambda m: list(hy.make_vars(*STATES)),
        same_unit(lambda m: m.carried(core_of(m.scene)).unit(m) - m.scaling.time, 3), "body axes", ("core",),
    ),
    Observable(
        "source_position", ("source", *SPACE), "m", "positions of the kernel's bodies, from the host",
        _positions, lambda m: [x.exponent + _KILOMETRE for x in m.carried(m.sky).sights for _ in range(3)],
        "space axes", ("kernel",),
    ),
)  # fmt: skip
