"""Outputs of a system: variables that are recorded, quantities that are conserved, their watched drifts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import heyoka as hy

import rigidsim.model.invariants  # noqa: F401  (enters what it defines into the registry)
from rigidsim.errors import ConfigError, Problem
from rigidsim.model.euler_poles import Poles
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.observables.observable import Observable
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.scene.own_states import OwnState
from rigidsim.scene.registry import OBSERVABLES


@dataclass(frozen=True)
class Recorded:
    """One recorded variable of the dataset.

    Samples are joined as ``continuity`` says: "" (as they are), "wrapped" (angles that are states), "unwrap"
    (angles that are functions of the state), "parity" and "nearest" (quaternion signs).
    """

    name: str
    dims: tuple[str, ...]
    units: str
    long_name: str
    frame: str
    first: int  # position of its components in ``System.outputs``
    count: int
    exponents: list[int]  # binary, that bring the components to SI
    invariant: bool
    continuity: str = ""
    squared_sizes: list[Symbolic] = field(default_factory=list)  # vanish where angles are undefined
    poles: Poles | None = None  # for Euler angles that are functions of the state
    attributes: Mapping[str, str] = field(default_factory=dict)  # besides units, long name and frame


@dataclass(frozen=True)
class Invariant:
    """A quantity that the motion conserves, and the drift that is watched."""

    name: str
    why: str  # it is conserved
    units: str
    long_name: str
    expressions: list[Symbolic]  # its components, in internal units
    exponents: list[int]  # binary, of the components' units
    scale: Any  # what drifts are relative to, SI (mpf)
    scale_name: str
    numerical: bool = False  # of the numerical representation alone (a quaternion's norm)


def recorded_variables(m: Mechanics, record: Sequence[str] | None) -> tuple[list[Recorded], list[Symbolic]]:
    """The variables of the dataset, and all their components; what a scene lacks is refused."""
    recorded: list[Recorded] = []
    outputs: list[Symbolic] = []
    for observable in [*OBSERVABLES.values(), *(_of_state(m, state) for state in m.scene.states)]:
        wanted = observable.by_default(m) if record is None else observable.name in record
        if not wanted:
            continue
        if not observable.available(m):
            if record is not None:
                why = observable.absent(m) if observable.needed(m) else None
                raise ConfigError(
                    Problem(
                        "[output] record",
                        f'given "{observable.name}": {why or "this scene has none"}; leave it out',
                    )
                )
            continue
        components = observable.expressions(m)
        x, count = observable, len(components)
        sizes = [] if x.angles is None else [angle.squared_size for angle in x.angles(m)]
        variable = Recorded(
            x.name, x.dims, x.units, x.long_name, x.frame, len(outputs), count, x.unit_exponents(m, count),
            x.conserved(m) is not None, x.continuity(m), sizes, x.poles(m), x.attributes(m),
        )  # fmt: skip
        recorded.append(variable)
        outputs += components
    return recorded, outputs


def _of_state(m: Mechanics, state: OwnState) -> Observable:
    """The recorded variable of a user-defined state, which default records have."""
    unit = m.scaling.own.get(state.name, 0)
    return Observable(
        state.name, (), state.unit or "1", f"{state.name}, a state of [[states]]",
        lambda _: [hy.make_vars(state.name)], lambda _: [unit],
        attributes=lambda _: {"given_by": "[[states]]"},
    )  # fmt: skip


_UNIT = "1 by definition: any drift is rounding"
_WATCHED = {"orthogonality_defect": "0 by definition: any drift is rounding"}


def find_invariants(m: Mechanics, norms: list[Symbolic]) -> list[Invariant]:
    """All invariants of the scene; ``norms`` of orbits that are states stay 1 by construction."""
    found = []
    for observable in OBSERVABLES.values():
        if observable.drift_scale is None or not observable.available(m):
            continue
        why = observable.conserved(m)
        if why is None:
            continue
        scale, scale_name = observable.drift_scale(m)
        expressions, x = observable.expressions(m), observable
        exponents = x.unit_exponents(m, len(expressions))
        found.append(Invariant(x.name, why, x.units, x.long_name, expressions, exponents, scale, scale_name))
    one = m.scene.context.one
    watched: list[tuple[str, str, str, Symbolic]] = [
        (f"orbit_norm_{number}", _UNIT, "norm of a cosine and sine that an orbit is carried by", expression)
        for number, expression in enumerate(norms, 1)
    ]
    if m.attitude is not None and m.attitude.defect is not None:
        name, long_name, expression = m.attitude.defect
        watched.append((name, _WATCHED.get(name, _UNIT), long_name, expression))
    if m.attitude is None and m.vertical is not None:
        norm = hy.sqrt(hy.sum([v * v for v in m.vertical]))
        watched.append(("vertical_norm", _UNIT, "norm of the vertical in body axes", norm))
    for name, why, long_name, expression in watched:
        found.append(Invariant(name, why, "1", long_name, [expression], [0], one, "1", numerical=True))
    return found


def drift_outputs(invariants: list[Invariant], context: Any, number: Rounder) -> list[Symbolic]:
    """Relative drifts (value - initial) / scale; for a vector, the norm of the difference over the scale."""
    drifts = []
    first = 0
    for invariant in invariants:
        inverse = number(context.ldexp(1, invariant.exponents[0]) / invariant.scale)
        differences = [x - hy.par[first + n] for n, x in enumerate(invariant.expressions)]
        first += len(differences)
        single = len(differences) == 1
        size = differences[0] if single else hy.sqrt(hy.sum([d * d for d in differences]))
        drifts.append(inverse * size)
    return drifts
