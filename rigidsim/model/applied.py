"""Torques and forces that a user gives as expressions of time and the state."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Any

import heyoka as hy

from rigidsim.model.formula import to_heyoka
from rigidsim.model.loads import LoadModel, Term
from rigidsim.model.rotations import Expression, apply, euler_from_matrix, transpose
from rigidsim.scene.context import Vector, cross
from rigidsim.scene.load_tables import ATTITUDE_NAMES, FLIGHT_NAMES, RATE_NAMES
from rigidsim.scene.loads import Applied
from rigidsim.scene.narrow import narrow_parts

if TYPE_CHECKING:
    from rigidsim.model.mechanics import Mechanics
    from rigidsim.scene.scene import Scene


def _unit(m: Mechanics, axis: int, size: Any) -> Vector:
    return [size if i == axis else m.scene.context.zero for i in range(3)]


class AppliedModel(LoadModel):
    """A torque or a force given by expressions; its work is integrated, since it need have no potential."""

    def __init__(self, spec: Applied, scene: Scene) -> None:
        self.spec = spec
        self.title = spec.kind
        reads = set()
        pushes = spec.kind == "force" and scene.free_flight
        arm = spec.point if spec.point is not None else scene.body.center_of_mass
        turns = spec.kind == "torque" or any(x != 0 for x in arm)
        crosses = (turns and spec.frame == "space") or (pushes and spec.frame == "body")
        if crosses or spec.reads & set(ATTITUDE_NAMES):
            reads.add("attitude")
        if pushes or spec.reads & set(FLIGHT_NAMES):
            reads.add("flight")
        self.reads = frozenset(reads)

    def _components(self, m: Mechanics) -> list[Expression]:
        variables = state_names(m, self.spec.reads)
        context = m.scene.context
        return [to_heyoka(c, variables, m.number, context) for c in self.spec.components]

    def _in_body(self, m: Mechanics) -> list[Expression]:
        found = self._components(m)
        return apply(transpose(m.matrix), found) if self.spec.frame == "space" else found

    def torque(self, m: Mechanics) -> list[Term]:
        """The torque, or arm x force."""
        context = m.scene.context
        size = context.ldexp(context.one, -m.scaling.energy)
        if self.spec.kind == "torque":
            return [(_unit(m, i, size), x) for i, x in enumerate(self._in_body(m))]
        arm = self.spec.point if self.spec.point is not None else m.scene.body.center_of_mass
        if all(x == 0 for x in arm):
            return []
        return [(cross(arm, _unit(m, i, size)), x) for i, x in enumerate(self._in_body(m))]

    def force(self, m: Mechanics) -> list[Term]:
        """Of a freely flying body, over its mass."""
        if self.spec.kind == "torque" or m.velocity is None:
            return []
        context = m.scene.context
        found = self._components(m)
        if self.spec.frame == "body":
            found = apply(m.matrix, found)
        size = context.ldexp(1 / m.carried(m.scene.body.mass), m.scaling.time - m.scaling.speed)
        return [(_unit(m, i, size), x) for i, x in enumerate(found)]

    def narrow(self, m: Mechanics) -> list[Expression]:
        """Arguments of pulses and switches in the components."""
        variables = state_names(m, self.spec.reads)
        parts = {part.root: part for c in self.spec.components for part in narrow_parts(c)}
        return [to_heyoka(part, variables, m.number, m.scene.context) for part in parts.values()]


def state_names(m: Mechanics, names: Collection[str]) -> dict[str, Expression]:
    """Expressions in SI units of the names that a user's expression reads.

    Raises:
        KeyError: a name that the scene doesn't carry.
    """
    context, scaling = m.scene.context, m.scaling

    def si(expression: Expression, exponent: int) -> Expression:
        return expression if exponent == 0 else m.number(context.ldexp(context.one, exponent)) * expression

    found: dict[str, Expression] = {"t": si(hy.time, scaling.time)}
    for name, state, e in zip(RATE_NAMES, m.rate_states, scaling.rates, strict=True):
        found[name] = si(state, e - scaling.time)
    if m.attitude is not None and set(names) & set(ATTITUDE_NAMES):
        found |= zip(ATTITUDE_NAMES[:4], m.attitude.quaternion, strict=True)
        sequence = m.scene.config.integrator.euler_sequence
        if m.attitude.kind == "euler_angles" and m.attitude.sequence == sequence:
            angles = list(hy.make_vars(*m.attitude.names))
        else:
            angles = euler_from_matrix(sequence, m.matrix)
        found |= zip(ATTITUDE_NAMES[4:], angles, strict=True)
    if m.position is not None and m.velocity is not None:
        found |= {n: si(x, scaling.length) for n, x in zip(FLIGHT_NAMES[:3], m.position, strict=True)}
        found |= {n: si(v, scaling.speed) for n, v in zip(FLIGHT_NAMES[3:], m.velocity, strict=True)}
    return {name: found[name] for name in names}
