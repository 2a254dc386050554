"""Selection of the formulation and of states: what a scene requires, and the reason for each.

It starts from what is recorded and what the loads read, and adds a state only if something needs it.
"""

from __future__ import annotations

from collections.abc import Sequence

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.averaged.average import Average
from rigidsim.model.formulations.averaged import Averaged
from rigidsim.model.formulations.formulation import REGISTERED, Formulation, Requirements, Unsuited
from rigidsim.model.formulations.planar import Planar
from rigidsim.model.formulations.quaternion import Quaternion
from rigidsim.model.formulations.rates import Rates
from rigidsim.model.frames.reference_plane import refuse_without_plane
from rigidsim.model.load import Load
from rigidsim.model.needs import NEEDS
from rigidsim.scene.expressions.tree import ATTITUDE_NAMES, FLIGHT_NAMES
from rigidsim.scene.formulations import AUTO, variables_named
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.scene import Scene


def choose_formulation(
    scene: Scene, loads: Sequence[Load], along: Average | None = None
) -> tuple[Formulation, Requirements]:
    """Decide how the rotation is written, and which states are carried besides.

    Args:
        loads: the scene's loads, which declare what they read.
        along: the average, already chosen, of a motion that this scene is a part of.

    Raises:
        ConfigError: the formulation or the scene can't provide something that is to be recorded, or the
            formulation that is asked for doesn't apply.
    """
    if scene.config.model.reduced:
        averaged = Averaged.along(scene, loads, along)
        return averaged, averaged.requirements(scene)
    requirements = choose_requirements(scene, loads)
    asked = scene.config.integrator.formulation
    if asked == AUTO:
        if not requirements.attitude:
            return Rates(), requirements
        return Planar.by_gradients(scene, loads) or Quaternion.of(scene, loads), requirements
    try:
        return REGISTERED[asked].of(scene, loads), requirements
    except Unsuited as why:
        raise ConfigError(Problem("[integrator] formulation", f'given "{asked}", but {why}')) from None


def choose_requirements(scene: Scene, loads: Sequence[Load]) -> Requirements:
    """Which states a full motion takes, and why."""
    asked = scene.config.integrator.formulation
    keeps_attitude = variables_named(asked).keeps_attitude
    record = scene.config.output.record
    _check_recordable(scene, asked, record)
    refuse_without_plane(scene, loads)
    readers = {need: [load.title for load in loads if need in load.reads] for need in ("attitude", "flight")}
    for event in scene.events:
        for need, names in (("attitude", ATTITUDE_NAMES), ("flight", FLIGHT_NAMES)):
            if event.reads & set(names):
                readers[need].append(f"event {event.name}")
    if readers["attitude"] and not keeps_attitude:
        what = f'given "{asked}", but {readers["attitude"][0]} reads the attitude; choose "auto"'
        raise ConfigError(Problem("[integrator] formulation", what))
    why = {"rates": _why_rates(record)}
    left_out: list[tuple[str, str]] = []
    reason = _attitude(scene, asked, record, readers["attitude"]) if keeps_attitude else None
    torque = scene.torque_arm is not None
    if reason is None:
        no_reader = "" if torque else " and no load reads it"
        unneeded = "nothing that is recorded needs it" if keeps_attitude else f"the formulation is {asked}"
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
    return Requirements("attitude" in why, "vertical" in why, "flight" in why, record, why, left_out)


def _attitude(scene: Scene, asked: str, record: list[str] | None, readers: list[str]) -> str | None:
    """Why an attitude is carried; None if it isn't."""
    if asked != AUTO:
        return f'[integrator] formulation = "{asked}" asks for it'
    if record is None:
        return "nothing restricts what is recorded"
    if readers:
        return _read_by(readers)
    recorded = [name for name in record if _takes(scene, name, "attitude")]
    return f"{', '.join(recorded)} is recorded" if recorded else None


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
    if not variables_named(formulation).keeps_attitude and scene.free_flight and record is None:
        what = f'given "{formulation}" for a scene with a position; name what to record in [output] record, '
        raise ConfigError(Problem("[integrator] formulation", what + 'or choose "auto"'))
