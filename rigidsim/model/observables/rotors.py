"""What is recorded of rotors: their rates, and what a fixed rate leaves of the energy."""

from __future__ import annotations

import json

from rigidsim.model.loads.rotor import rotors_of
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.mechanical import kept_energy_scale
from rigidsim.model.observables.observable import ENERGY, Observable, register_all, same_unit


def _drawn(m: Mechanics) -> dict[str, str]:
    told = [rotor.pictured() for rotor in rotors_of(m.scene)]
    keys = {"rotor_axes": "axis", "rotor_moments": "moment", "rotor_drives": "drive"}
    return {name: json.dumps([one[key] for one in told]) for name, key in keys.items()}


def _kept(m: Mechanics) -> str | None:
    if m.lent_energy is None or not m.conserves_energy:
        return None
    return "a fixed rate costs its motor the work J s a . (w - w0), which it lends the body"


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
)  # fmt: skip
