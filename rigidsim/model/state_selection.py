"""Selection of states: what a scene requires, and the reason for each.

It starts from what is recorded and what the loads read, and adds a state only if something needs it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.frames.reference_plane import refuse_without_plane
from rigidsim.model.load import Load
from rigidsim.model.needs import NEEDS
from rigidsim.scene.expressions.tree import ATTITUDE_NAMES, FLIGHT_NAMES
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.scene import Scene

PLANAR = "planar"
"""The formulation of a body that turns about one axis."""


@dataclass(frozen=True)
class Requirements:
    """Which states a scene requires.

    Attributes:
        formulation: "rates", or the one that carries the attitude.
        vertical: whether the vertical is carried as three states of its own (Euler-Poisson equations).
        flight: whether position and velocity are carried.
        record: names asked for, or None for everything that the scene has.
        why: reasons for what is carried: "rates", "attitude", "vertical", "flight".
        left_out: (what, why) for groups that are not carried.
    """

    formulation: str
    vertical: bool
    flight: bool
    record: list[str] | None
    why: Mapping[str, str]
    left_out: Sequence[tuple[str, str]] = ()

    @property
    def canonical(self) -> bool:
        """Whether Euler angles and their momenta are carried, from which the rates follow."""
        return self.formulation == "canonical"

    @property
    def planar(self) -> bool:
        """Whether an angle and its rate are the only states of the rotation."""
        return self.formulation == PLANAR

    def in_plane(self) -> Requirements:
        """The same requirements for a motion that was found to stay in a plane."""
        why = {
            **self.why,
            "attitude": f"{self.why['attitude']}; the body turns about a principal axis, along which every "
            'torque points and stays (formulation = "quaternion" carries the full motion)',
        }
        return replace(self, formulation=PLANAR, vertical=False, why=why)


def choose_requirements(scene: Scene, loads: Sequence[Load] = ()) -> Requirements:
    """Decide which states are carried.

    Args:
        loads: the scene's loads, which declare what they read.

    Raises:
        ConfigError: the formulation or the scene can't provide something that is to be recorded.
    """
    asked = scene.config.integrator.formulation
    record = scene.config.output.record
    _check_recordable(scene, asked, record)
    refuse_without_plane(scene, loads)
    readers = {need: [load.title for load in loads if need in load.reads] for need in ("attitude", "flight")}
    for event in scene.events:
        for need, names in (("attitude", ATTITUDE_NAMES), ("flight", FLIGHT_NAMES)):
            if event.reads & set(names):
                readers[need].append(f"event {event.name}")
    _check_readers(asked, readers)
    why = {"rates": _why_rates(record)}
    left_out: list[tuple[str, str]] = []
    formulation, reason = _attitude(scene, asked, record, readers["attitude"])
    torque = scene.torque_arm is not None
    if reason is None:
        no_reader = "" if torque else " and no load reads it"
        unneeded = "the formulation is rates" if asked == "rates" else "nothing that is recorded needs it"
        left_out.append(("attitude", unneeded + no_reader))
        if torque:
            why["vertical"] = (
                "gravity's torque reads the vertical in body axes; no load reads more of the attitude "
                "(Euler-Poisson equations)"
            )
    else:
        why["attitude"] = reason + ("; gravity's torque reads it" if torque else "")
        if readers["attitude"] and reason != _read_by(readers["attitude"]):
            why["attitude"] += f"; {_read_by(readers['attitude'])}"
    if not scene.free_flight:
        left_out.append(("position and velocity", "[initial] has neither"))
    elif (reason := _flight(scene, record, readers["flight"])) is not None:
        why["flight"] = reason
    else:
        left_out.append(("position and velocity", "neither recorded nor read by a load"))
    return Requirements(formulation, "vertical" in why, "flight" in why, record, why, left_out)


def _attitude(
    scene: Scene, asked: str, record: list[str] | None, readers: list[str]
) -> tuple[str, str | None]:
    """The formulation, and why an attitude is carried (None if it isn't)."""
    recorded = [name for name in record or () if _takes(scene, name, "attitude")]
    if asked == "rates":
        return asked, None
    if asked != "auto":
        return asked, f'[integrator] formulation = "{asked}" asks for it'
    if record is None:
        return "quaternion", "nothing restricts what is recorded"
    if readers:
        return "quaternion", _read_by(readers)
    if recorded:
        return "quaternion", f"{', '.join(recorded)} is recorded"
    return "rates", None


def _read_by(readers: list[str]) -> str:
    return f"{', '.join(readers)} reads it"


def _flight(scene: Scene, record: list[str] | None, readers: list[str]) -> str | None:
    """Why position and velocity are carried; None if they aren't."""
    recorded = [name for name in record or () if _takes(scene, name, "flight")]
    if recorded:
        return f"{', '.join(recorded)} is recorded"
    if readers:
        return f"{', '.join(readers)} reads them"
    return "the body moves, and nothing restricts what is recorded" if record is None else None


def _check_readers(formulation: str, readers: dict[str, list[str]]) -> None:
    if formulation == "rates" and readers["attitude"]:
        raise ConfigError(
            Problem(
                "[integrator] formulation",
                f'given "rates", but {readers["attitude"][0]} reads the attitude; choose "auto"',
            )
        )


def _why_rates(record: list[str] | None) -> str:
    if record is None or "angular_velocity" in record:
        return "Euler's equations; angular_velocity is recorded"
    return "Euler's equations; everything else is a function of the rates"


def _takes(scene: Scene, name: str, states: str) -> bool:
    """Whether recording an observable requires these states."""
    return any(NEEDS[need].states(scene) == states for need in OBSERVABLES[name].needs)


def _check_recordable(scene: Scene, formulation: str, record: list[str] | None) -> None:
    for name in record or ():
        for need in OBSERVABLES[name].needs:
            why = NEEDS[need].missing(scene, formulation)
            if why is not None:
                raise ConfigError(Problem("[output] record", f'given "{name}": {why}'))
    if formulation == "rates" and scene.free_flight and record is None:
        raise ConfigError(
            Problem(
                "[integrator] formulation",
                'given "rates" for a scene with a position; name what to record in [output] record, or '
                'choose "auto"',
            )
        )
