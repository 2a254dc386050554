"""Resonant angle between the body's rotation and its source's orbit, for motions averaged over both."""

from __future__ import annotations

from collections.abc import Mapping

from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import Angle, continuous_angles
from rigidsim.scene.registry import register_observable


def _angles(m: Mechanics) -> list[Angle]:
    return [Angle(*m.carried(m.commensurable_angle))]


def _absent(m: Mechanics) -> str | None:
    if m.commensurable_angle is not None:
        return None
    return 'is of [model] level = "orbit_averaged" where the body keeps pace with its source; leave it out'


def _told(m: Mechanics) -> Mapping[str, str]:
    return {
        "convention": "about the angular momentum, at the pericentre: from the direction of the pericentre "
        "to the axis of least moment; 0 or pi where that points at the source there"
    }


register_observable(
    continuous_angles(
        "resonant_angle",
        (),
        "angle that the rotation keeps with the orbit",
        _angles,
        needs=("attitude",),
        by_default=lambda m: m.commensurable_angle is not None,
        attributes=_told,
        absent=_absent,
    )
)
