"""What a scene requires: which states are carried, and the reason for each.

Starts from what is recorded and what the loads read, and adds a state only when something needs it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.loads import LoadModel
from rigidsim.scene.load_tables import ATTITUDE_NAMES, FLIGHT_NAMES
from rigidsim.scene.scene import Scene

ATTITUDE_RECORDS = ("quaternion", "euler_angles", "rotation_matrix", "angular_momentum")
FLIGHT_RECORDS = ("position", "velocity", "linear_momentum")


@dataclass(frozen=True)
class Requirements:
    """The plan of a system of equations.

    Attributes:
        formulation: "rates", or the one that carries the attitude.
        vertical: whether the vertical is carried as three states of its own (Euler-Poisson equations).
        flight: whether position and velocity are carried.
        record: names asked for, or None for everything that the scene has.
        reasons: (states, why) for each group.
        left_out: (what, why) for groups that are not carried.
    """

    formulation: str
    vertical: bool
    flight: bool
    record: list[str] | None
    reasons: list[tuple[str, str]] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)


def choose_requirements(scene: Scene, loads: Sequence[LoadModel] = ()) -> Requirements:
    """Decide what is carried.

    Args:
        loads: of the scene; they say what they read.

    Raises:
        ConfigError: something recorded can't be had in the formulation or the scene.
    """
    asked = scene.config.integrator.formulation
    record = scene.config.output.record
    _check_recordable(scene, asked, record)
    readers = {need: [load.title for load in loads if need in load.reads] for need in ("attitude", "flight")}
    for event in scene.events:
        for need, names in (("attitude", ATTITUDE_NAMES), ("flight", FLIGHT_NAMES)):
            if event.reads & set(names):
                readers[need].append(f"event {event.name}")
    _check_readers(asked, readers)
    reasons = [] if asked == "canonical" else [("wx wy wz", _why_rates(scene, record))]
    left_out: list[tuple[str, str]] = []
    wants_attitude = [name for name in record or () if name in ATTITUDE_RECORDS]
    if asked != "auto":
        formulation = asked
        why_attitude = f'[integrator] formulation = "{asked}" asks for it'
    elif record is None:
        formulation, why_attitude = "quaternion", "nothing restricts what is recorded"
    elif readers["attitude"]:
        formulation, why_attitude = "quaternion", f"{', '.join(readers['attitude'])} reads it"
    elif wants_attitude:
        formulation, why_attitude = "quaternion", f"{', '.join(wants_attitude)} is recorded"
    else:
        formulation, why_attitude = "rates", ""
    torque = scene.torque_arm is not None
    vertical = False
    if formulation == "rates":
        why = "the formulation is rates" if asked == "rates" else "nothing that is recorded needs it"
        left_out.append(("attitude", why + (" and no load reads it" if not torque else "")))
        if torque:
            vertical = True
            reasons.append(
                ("gx gy gz", "gravity's torque reads the vertical in body axes; no load reads more of the "
                 "attitude (Euler-Poisson equations)")
            )  # fmt: skip
    else:
        states = {
            "quaternion": "qw qx qy qz",
            "euler_angles": "phi theta psi",
            "canonical": "phi theta psi p_phi p_theta p_psi",
        }
        also = "; gravity's torque reads it" if torque else ""
        if readers["attitude"] and "reads it" not in why_attitude:
            also += f"; {', '.join(readers['attitude'])} reads it"
        reasons.append((states.get(formulation, "r11 ... r33"), why_attitude + also))
    flight = False
    if scene.free_flight:
        needs = [name for name in record or () if name in (*FLIGHT_RECORDS, "energy", "potential_energy")]
        flight = record is None or bool(needs) or bool(readers["flight"])
        if flight:
            why = (
                f"{', '.join(needs)} is recorded"
                if needs
                else f"{', '.join(readers['flight'])} reads them"
                if readers["flight"]
                else "the body moves, and nothing restricts what is recorded"
            )
            reasons.append(("x y z vx vy vz", why))
        else:
            left_out.append(("position and velocity", "neither recorded nor read by a load"))
    else:
        left_out.append(("position and velocity", "[initial] has neither"))
    return Requirements(formulation, vertical, flight, record, reasons, left_out)


def _check_readers(formulation: str, readers: dict[str, list[str]]) -> None:
    if formulation == "rates" and readers["attitude"]:
        raise ConfigError(
            Problem(
                "[integrator] formulation",
                f'given "rates", but {readers["attitude"][0]} reads the attitude; choose "auto"',
            )
        )


def _why_rates(scene: Scene, record: list[str] | None) -> str:
    if record is None or "angular_velocity" in record:
        return "Euler's equations; angular_velocity is recorded"
    return "Euler's equations; everything else is a function of the rates"


def _check_recordable(scene: Scene, formulation: str, record: list[str] | None) -> None:
    for name in record or ():
        why = None
        if name in ATTITUDE_RECORDS and formulation == "rates":
            why = 'needs the attitude; choose another formulation than "rates", such as "auto"'
        elif name in FLIGHT_RECORDS and not scene.free_flight:
            why = "the scene has no position; give [initial] position or velocity, or leave it out"
        elif (
            name == "potential_energy"
            and not scene.loads
            and scene.torque_arm is None
            and not (scene.free_flight and scene.gravity is not None)
        ):
            why = "no load of the scene has a potential that varies; leave it out"
        elif name == "angular_momentum_vertical" and scene.torque_arm is None:
            why = "the scene has no load that marks a vertical; record angular_momentum instead"
        if why:
            raise ConfigError(Problem("[output] record", f'given "{name}": {why}'))
    if formulation == "rates" and scene.free_flight and record is None:
        raise ConfigError(
            Problem(
                "[integrator] formulation",
                'given "rates" for a scene with a position; name what to record in [output] record, or '
                'choose "auto"',
            )
        )
