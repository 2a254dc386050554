"""What of a scene is recorded, what of it is conserved, and the drifts that are watched."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.dynamics import Number
from rigidsim.model.integrable import goryachev_chaplygin_top, kovalevskaya_top
from rigidsim.model.loads import CentralGravityModel
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables import OBSERVABLES, Observable, work_is_needed
from rigidsim.model.requirements import Requirements
from rigidsim.model.rotations import Expression


@dataclass(frozen=True)
class Recorded:
    """One variable of the dataset.

    Attributes:
        first, count: its components among ``System.outputs``.
        exponents: binary exponents that bring the components to SI.
        continuity: how samples are joined: "" (as they are), "winding" (angles that are states),
            "unwrap" (angles found from another formulation), "parity" and "nearest" (quaternion signs).
    """

    name: str
    dims: tuple[str, ...]
    units: str
    long_name: str
    frame: str
    first: int
    count: int
    exponents: list[int]
    invariant: bool
    continuity: str = ""


@dataclass(frozen=True)
class Invariant:
    """Something that the motion conserves, and the drift that is watched.

    Attributes:
        why: the reason that it is conserved.
        expressions: its components, in internal units.
        exponents: binary exponents of the components' units.
        scale: what drifts are relative to, SI (mpf); ``scale_name`` says what it is.
        numerical: True for what only the numerical representation has (a quaternion's norm).
    """

    name: str
    why: str
    units: str
    long_name: str
    expressions: list[Expression]
    exponents: list[int]
    scale: Any
    scale_name: str
    numerical: bool = False


def _available(m: Mechanics, observable: Observable) -> bool:
    has = {
        "attitude": m.attitude is not None,
        "vertical": m.vertical is not None and m.numbers.arm is not None,
        "flight": m.velocity is not None,
        "gravity": m.potential_energy is not None,
        "symmetry": m.symmetry_direction is not None,
        "energy": m.velocity is not None or not m.scene.free_flight,
        "work": work_is_needed(m),
        "jacobi": m.attitude is not None and m.jacobi is not None,
        "kovalevskaya": kovalevskaya_top(m) is not None,
        "goryachev_chaplygin": goryachev_chaplygin_top(m) is not None,
        "attractor": m.velocity is not None and any(isinstance(x, CentralGravityModel) for x in m.loads),
    }
    return all(has[need] for need in observable.needs)


def _by_default(m: Mechanics, observable: Observable) -> bool:
    if observable.name == "euler_angles":
        return m.attitude is not None and m.attitude.kind == "euler_angles"
    if observable.name == "rotation_matrix":
        return m.attitude is not None and m.attitude.kind == "rotation_matrix"
    if observable.name == "rotational_energy":
        return m.scene.free_flight
    return True


def recorded_variables(m: Mechanics, requirements: Requirements) -> tuple[list[Recorded], list[Expression]]:
    """The variables of the dataset, and the expressions of all their components.

    Raises:
        ConfigError: something was asked for that the scene hasn't got.
    """
    recorded: list[Recorded] = []
    outputs: list[Expression] = []
    asked = requirements.record
    for observable in OBSERVABLES:
        wanted = _by_default(m, observable) if asked is None else observable.name in asked
        if not wanted:
            continue
        if not _available(m, observable):
            if asked is not None:
                raise ConfigError(
                    Problem(
                        "[output] record", f'given "{observable.name}": this scene has none; leave it out'
                    )
                )
            continue
        components = observable.expressions(m)
        continuity = ""
        if m.attitude is not None and observable.name == "euler_angles":
            continuity = "winding" if m.attitude.kind == "euler_angles" else "unwrap"
        if m.attitude is not None and observable.name == "quaternion":
            signs = {"state": "", "winding": "parity", "nearest": "nearest"}
            continuity = signs[m.attitude.quaternion_sign]
        recorded.append(
            Recorded(
                observable.name,
                observable.dims,
                observable.units,
                observable.long_name,
                observable.frame,
                len(outputs),
                len(components),
                observable.exponents(m),
                observable.conserved(m) is not None,
                continuity,
            )
        )
        outputs += components
    return recorded, outputs


def find_invariants(m: Mechanics, norms: list[Expression]) -> list[Invariant]:
    """All that the scene conserves, with reasons.

    Args:
        norms: expressions that stay 1 by construction (of orbits carried as states).
    """
    found = []
    for observable in OBSERVABLES:
        if observable.drift_scale is None or not _available(m, observable):
            continue
        why = observable.conserved(m)
        if why is None:
            continue
        scale, scale_name = observable.drift_scale(m)
        found.append(
            Invariant(
                observable.name,
                why,
                observable.units,
                observable.long_name,
                observable.expressions(m),
                observable.exponents(m),
                scale,
                scale_name,
            )
        )
    for number, expression in enumerate(norms):
        found.append(
            Invariant(f"orbit_norm_{number + 1}", "it is so by definition", "1",
                      "norm of a cosine and sine that an orbit is carried by", [expression], [0],
                      m.scene.context.one, "1", numerical=True)
        )  # fmt: skip
    if m.attitude is not None and m.attitude.defect is not None:
        name, long_name, expression = m.attitude.defect
        found.append(
            Invariant(name, "it is so by definition", "1", long_name, [expression], [0],
                      m.scene.context.one, "1", numerical=True)
        )  # fmt: skip
    if m.attitude is None and m.vertical is not None:
        norm = hy.sqrt(hy.sum([v * v for v in m.vertical]))
        found.append(
            Invariant("vertical_norm", "it is so by definition", "1", "norm of the vertical in body axes",
                      [norm], [0], m.scene.context.one, "1", numerical=True)
        )  # fmt: skip
    return found


def drift_outputs(invariants: list[Invariant], context: Any, number: Number) -> list[Expression]:
    """(value - initial) / scale; of a vector, the norm of the difference over the scale."""
    drifts = []
    first = 0
    for invariant in invariants:
        inverse = number(context.ldexp(1, invariant.exponents[0]) / invariant.scale)
        differences = [x - hy.par[first + n] for n, x in enumerate(invariant.expressions)]
        first += len(differences)
        if len(differences) == 1:
            drifts.append(inverse * differences[0])
        else:
            drifts.append(inverse * hy.sqrt(hy.sum([d * d for d in differences])))
    return drifts
