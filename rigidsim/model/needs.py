"""What an observable may need: whether a scene has it, which states it takes, what to say without it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rigidsim.model.first_integrals import goryachev_chaplygin_top, kovalevskaya_top
from rigidsim.model.mechanics import Mechanics
from rigidsim.scene.scene import Scene


def _no_states(_: Scene) -> str | None:
    return None


def _never_missing(scene: Scene, formulation: str) -> str | None:
    return None


def _flight_of_a_free_body(scene: Scene) -> str | None:
    return "flight" if scene.free_flight else None


@dataclass(frozen=True)
class Need:
    """One thing that observables may need.

    Attributes:
        met: whether the mechanics of a scene has it.
        states: which states must be carried for it: "attitude", "flight" or None.
        missing: why a scene in this formulation can't have it, told before anything is built; None where that
            is seen only later.
    """

    met: Callable[[Mechanics], bool]
    states: Callable[[Scene], str | None] = _no_states
    missing: Callable[[Scene, str], str | None] = _never_missing


def work_is_needed(m: Mechanics) -> bool:
    """Whether the energy balance is checked by integrating power: where energy isn't conserved and Jacobi's
    constant doesn't stand in for it.
    """
    has_jacobi = m.attitude is not None and m.jacobi is not None
    return _has_energy(m) and not m.conserves_energy and not has_jacobi and m.power is not None


def _has_energy(m: Mechanics) -> bool:
    return m.velocity is not None or not m.scene.free_flight


def _no_attitude(scene: Scene, formulation: str) -> str | None:
    if formulation != "rates":
        return None
    return 'needs the attitude; choose another formulation than "rates", such as "auto"'


def _no_position(scene: Scene, formulation: str) -> str | None:
    if scene.free_flight:
        return None
    return "the scene has no position; give [initial] position or velocity, or leave it out"


def _no_potential(scene: Scene, formulation: str) -> str | None:
    if scene.loads or scene.torque_arm is not None or (scene.free_flight and scene.gravity is not None):
        return None
    return "no load of the scene has a potential that varies; leave it out"


def _no_vertical(scene: Scene, formulation: str) -> str | None:
    if scene.torque_arm is not None:
        return None
    return "the scene has no load that marks a vertical; record angular_momentum instead"


NEEDS: dict[str, Need] = {
    "attitude": Need(lambda m: m.attitude is not None, lambda _: "attitude", _no_attitude),
    "flight": Need(lambda m: m.velocity is not None, lambda _: "flight", _no_position),
    "vertical": Need(lambda m: m.vertical is not None and m.numbers.arm is not None, missing=_no_vertical),
    "potential": Need(lambda m: m.potential_energy is not None, _flight_of_a_free_body, _no_potential),
    "energy": Need(_has_energy, _flight_of_a_free_body),
    "symmetry": Need(lambda m: m.symmetry_direction is not None),
    "work": Need(work_is_needed),
    "jacobi": Need(lambda m: m.attitude is not None and m.jacobi is not None),
    "kovalevskaya": Need(lambda m: kovalevskaya_top(m) is not None),
    "goryachev_chaplygin": Need(lambda m: goryachev_chaplygin_top(m) is not None),
    "attractor": Need(
        lambda m: m.velocity is not None and any(x.attracting_point is not None for x in m.loads)
    ),
}
"""By the names that ``Observable.needs`` uses."""
