"""Decisions about a scene's equations made before any number is rounded: loads, states, units, orbits.

States are those that something needs, beginning with what is recorded and what the loads read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rigidsim.errors import ConfigError, Problem, ensure
from rigidsim.model.averaged.average import Average
from rigidsim.model.formulations.averaged import Averaged
from rigidsim.model.formulations.formulation import (
    REGISTERED,
    Formulation,
    ModelPlan,
    Planar,
    Quaternion,
    Rates,
    Requirements,
    Unsuited,
)
from rigidsim.model.frames import refuse_without_plane
from rigidsim.model.load import Load, loads_of
from rigidsim.model.load_estimate import estimate_drive, orbit_tags
from rigidsim.model.loads.gravity import Attraction, UniformGravity
from rigidsim.model.observables.observable import NEEDS
from rigidsim.model.orbits import places_of
from rigidsim.model.own_states import own_units, refuse_odd_states
from rigidsim.model.placements import refuse_same_sources
from rigidsim.model.scaling import Scaling, choose_scaling, scaled_numbers
from rigidsim.scene.choices import AUTO, variables_named
from rigidsim.scene.expressions.tree import states_read
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.scene import Scene
from rigidsim.scene.surfaces import happens_at_a_moment, surfaces_of

_SAME_BODY = 1e-3  # relative difference of gravitational parameters below which two sources are taken as one


def plan_model(
    scene: Scene,
    extra_loads: Sequence[Load] = (),
    scaling: Scaling | None = None,
    *,
    like: ModelPlan | None = None,
    along: Average | None = None,
) -> ModelPlan:
    """Decide on the least system that a scene needs.

    Args:
        extra_loads: loads given from Python, besides the config's.
        scaling: if already known from another formulation of the same motion, whose loads were checked.
        like: plan of the same scene in plain numbers, whose estimates and checks hold here too.
        along: the average, already chosen, of a motion that this scene is a part of.

    Raises:
        ConfigError: a record that the scene or the formulation can't give, a formulation that doesn't apply,
            or a load that depends on the quaternion's sign.
    """
    if extra_loads:
        scene = replace(scene, loads=(*scene.loads, *(load for load in extra_loads if load.acts())))
    loads: list[Load] = [*UniformGravity.of(scene), *loads_of(scene)]
    if like is None:
        refuse_second_orbits(scene, loads)
        refuse_same_sources(scene.config.loads, scene.config.body.host)
    formulation, requirements = _choose_formulation(scene, loads, along)
    surfaces = surfaces_of(scene)
    if scaling is None and like is not None:
        scaling = choose_scaling(scene, like.scaling.drive)
    elif scaling is None:
        unknown = [x for x in loads if formulation.resolves_rotation and x.amplitude(scene) is None]
        refuse_odd_states(scene)
        scaling = choose_scaling(scene, estimate_drive(scene, unknown, requirements, surfaces))
    if scene.states and not scaling.own:
        known = None if like is None else like.scaling.own
        scaling = replace(scaling, own=own_units(scene, scaling, known))
    if not formulation.carries_rates:
        scaling = replace(scaling, rates=(0, 0, 0))
    tabulated = [(str(number), load.table) for number, load in enumerate(loads_of(scene), start=1)]
    first = surfaces.parameters if formulation.resolves_rotation else 0
    tables = places_of([(tag, x) for tag, x in tabulated if x is not None], formulation.longitude, first)
    piecewise = bool(tables) or any(load.sights for load in scene.loads)
    tags = orbit_tags(scene)
    clocked = formulation.resolves_rotation and not piecewise and happens_at_a_moment(scene)
    numbers = scaled_numbers(scene, scaling)
    return ModelPlan(
        scene, loads, formulation, requirements, scaling, numbers, tags, surfaces, tables, clocked
    )


# --- which states -------------------------------------------------------------------------------------------


def _choose_formulation(
    scene: Scene, loads: Sequence[Load], along: Average | None = None
) -> tuple[Formulation, Requirements]:
    """How the rotation is written, and which states are carried besides."""
    if scene.config.model.reduced:
        averaged = Averaged.along(scene, loads, along)
        return averaged, averaged.requirements(scene)
    requirements = _choose_requirements(scene, loads)
    asked = scene.config.integrator.formulation
    if asked == AUTO:
        if not requirements.attitude:
            return Rates(), requirements
        return Planar.by_gradients(scene, loads) or Quaternion(), requirements
    try:
        return REGISTERED[asked].of(scene, loads), requirements
    except Unsuited as why:
        raise ConfigError(Problem("[integrator] formulation", f'given "{asked}", but {why}')) from None


def _choose_requirements(scene: Scene, loads: Sequence[Load]) -> Requirements:
    """Which states a full motion takes, and why."""
    asked = scene.config.integrator.formulation
    keeps_attitude = variables_named(asked).keeps_attitude
    record = scene.config.output.record
    _check_recordable(scene, asked, record)
    refuse_without_plane(scene, loads)
    readers = {
        need: list(dict.fromkeys(load.title for load in loads if need in load.reads))
        for need in ("attitude", "flight")
    }
    others = [(f"event {event.name}", event.reads) for event in scene.events]
    others += [(f"state {state.name}", states_read(state.derivative)) for state in scene.states]
    for who, states in others:
        for need in states & set(readers):
            readers[need].append(who)
    if readers["attitude"] and not keeps_attitude:
        raise ConfigError(
            Problem(
                "[integrator] formulation",
                f'given "{asked}", but {readers["attitude"][0]} reads the attitude; choose "auto"',
            )
        )
    rates = "everything else is a function of the rates"
    if record is None or "angular_velocity" in record:
        rates = "angular_velocity is recorded"
    why, left_out = {"rates": f"Euler's equations; {rates}"}, []
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
    carried = [state.name for state in scene.states]
    unread = [table.name for _, _, table in scene.config.every_state if table.name not in carried]
    if unread:
        left_out.append((", ".join(unread), "neither recorded nor read by anything that is carried"))
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


def _read_by(readers: list[str], them: str = "it") -> str:
    return f"{', '.join(readers)} read{'s' if len(readers) == 1 else ''} {them}"


def _flight(scene: Scene, record: list[str] | None, readers: list[str]) -> str | None:
    """Why position and velocity are carried; None if they aren't."""
    recorded = [name for name in record or () if _takes(scene, name, "flight")]
    if recorded:
        return f"{', '.join(recorded)} is recorded"
    if readers:
        return _read_by(readers, "them")
    return "the body moves, and nothing restricts what is recorded" if record is None else None


def _takes(scene: Scene, name: str, states: str) -> bool:
    """Whether recording an observable requires these states."""
    needs = OBSERVABLES[name].needs if name in OBSERVABLES else ()  # user-defined states are asked elsewhere
    return any(NEEDS[need].states(scene) == states for need in needs)


def _check_recordable(scene: Scene, formulation: str, record: list[str] | None) -> None:
    for name in record or ():
        for need in OBSERVABLES[name].needs if name in OBSERVABLES else ():
            why = NEEDS[need].missing(scene, formulation)
            ensure(why is None, ConfigError(Problem("[output] record", f'given "{name}": {why}')))
    ensure(
        variables_named(formulation).keeps_attitude or not scene.free_flight or record is not None,
        ConfigError(
            Problem(
                "[integrator] formulation",
                f'given "{formulation}" for a scene with a position; name what to record in [output] '
                'record, or choose "auto"',
            )
        ),
    )


# --- loads that are refused ---------------------------------------------------------------------------------


def refuse_second_orbits(scene: Scene, loads: Sequence[Load]) -> None:
    """Refuse the gradient of a source whose place is integrated already: it would act twice."""
    where, bodies = "[[loads]] gravity_gradient", scene.bodies
    found = [load for load in loads if isinstance(load, Attraction)]
    pulling = [load for load in found if load.pulls]
    attractors = [load.gravitational_parameter for load in pulling if not load.reacts]
    carried = [] if bodies is None else [s for n, s in enumerate(bodies.strengths) if n != bodies.host]

    def known(strength: Any, others: list[Any]) -> bool:
        return any(abs(strength - other) <= _SAME_BODY * other for other in others)

    for load in found:
        if load.pulls:
            continue
        if load.reacts:
            ensure(
                not any(load.placement == other.placement for other in pulling),
                ConfigError(
                    Problem(
                        where, "given with central_gravity of the same body, which has its torque; remove it"
                    )
                ),
            )
        else:
            strength = load.gravitational_parameter
            ensure(
                not known(strength, attractors),
                ConfigError(
                    Problem(
                        where,
                        "given for the point that attracts the body in flight; central_gravity has its "
                        "torque where the body is, and this one would follow another orbit: remove it",
                    )
                ),
            )
            ensure(
                not known(strength, carried),
                ConfigError(
                    Problem(
                        where,
                        "given with the gravitational parameter of one of [[bodies]] and another orbit; "
                        'give orbit = {body = "..."}, which is where that body is',
                    )
                ),
            )
