"""Which invariants of a scene are projected onto their initial values during a run, and why the rest aren't.

An invariant that follows from others would only make the correction ill-determined, so each set is minimal:
L in space axes stands for its norm, six products of rows for a matrix's orthogonality. Norms are taken
squared, since a root has no gradient where it vanishes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.invariants import WATCHED
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.system import System


@dataclass(frozen=True)
class ProjectedScalar:
    """One scalar equation of a projected invariant, in internal units."""

    name: str  # of the invariant that it belongs to
    expression: Symbolic
    scale: Any  # size that its drift is relative to (mpf)


# invariant: (another one that stands for it if present, why it needn't be projected itself)
_FOLLOWS = {
    "angular_momentum_norm": ("angular_momentum", "its three components are projected"),
    "energy": ("rotational_energy", "its rotational part is projected; nothing turns the flight's velocity"),
}
_ALONE = "it is watched alone: what is projected is a set that keeps the numbers of earlier runs"
_NEVER = {
    "energy_balance": "it checks a work that is integrated with the motion and doesn't act on it",
    **{observable.name: _ALONE for observable in WATCHED},
}


def _squared_rows(m: Mechanics) -> list[Symbolic]:
    r = m.matrix
    return [hy.sum([r[i][k] * r[j][k] for k in range(3)]) for i in range(3) for j in range(i + 1)]


# squares that stand for roots that can vanish: their scalars, and the relative drift in terms of the root's
_SQUARES: dict[str, tuple[Callable[[Mechanics], list[Symbolic]], int]] = {
    "angular_momentum_norm": (lambda m: [hy.sum([x * x for x in m.momentum_body])], 2),
    "quaternion_norm": (lambda m: [hy.sum([x * x for x in m.carried(m.attitude).variables])], 2),
    "vertical_norm": (lambda m: [hy.sum([x * x for x in m.carried(m.vertical)])], 2),
    "orthogonality_defect": (_squared_rows, 1),
}


def conserves(system: System) -> bool:
    """Whether any projected invariant is one of the motion, not just of its numerical representation."""
    return any(not found.numerical and found.name not in _NEVER for found in system.invariants)


def projected_invariants(system: System) -> tuple[list[ProjectedScalar], list[tuple[str, str]]]:
    """Scalars to project, and (invariant, why) for the invariants that are not projected themselves."""
    m = system.mechanics
    context = m.scene.context
    present = {invariant.name for invariant in system.invariants}
    projected: list[ProjectedScalar] = []
    left_out: list[tuple[str, str]] = []
    for invariant in system.invariants:
        name = invariant.name
        scale = context.ldexp(invariant.scale, -invariant.exponents[0])
        stand_in, why = _FOLLOWS.get(name, ("", ""))
        if stand_in in present:
            left_out.append((name, why))
        elif name in _NEVER:
            left_out.append((name, _NEVER[name]))
        elif name in _SQUARES:
            expressions, factor = _SQUARES[name]
            projected += [
                ProjectedScalar(name, expression, factor * scale * scale) for expression in expressions(m)
            ]
        else:
            projected += [ProjectedScalar(name, expression, scale) for expression in invariant.expressions]
    if not projected:
        raise ConfigError(
            Problem(
                "[integrator] hold_invariants",
                f"given true, but the loads leave nothing constant that {system.formulation.name} "
                'carries; set it to false, or choose formulation = "quaternion", whose norm can be projected',
            )
        )
    return projected, left_out
