"""Loads as mechanics: what each reads, the states it adds, its torque, force and potential, what it keeps.

A load is one small class. Torques and forces are sums of terms, each a constant vector (mpf, worked out
with guard bits) times an expression of the state, so that constants are rounded once, with those of the
inertia tensor already in them. A load of one's own derives from ``LoadModel``; see README.md.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import heyoka as hy

from rigidsim.model.ephemeris import MEAN_DISTANCE, Place, place
from rigidsim.model.rotations import Expression, apply, transpose
from rigidsim.model.split import as_factor
from rigidsim.scene.context import Vector, cross, norm
from rigidsim.scene.loads import CentralGravity, GravityGradient, ViscousTorque

if TYPE_CHECKING:
    from rigidsim.model.mechanics import Mechanics
    from rigidsim.model.orbits import OrbitStates
    from rigidsim.scene.scene import Scene

Term = tuple[Vector, Expression]
"""A constant vector times an expression."""


@dataclass(frozen=True)
class ExtraStates:
    """States that a load brings along (an orbit): names, right-hand sides, initial values (mpf).

    Attributes:
        norms: expressions that stay 1 by construction.
    """

    names: list[str]
    derivatives: list[Expression]
    initial: list[Any]
    norms: list[Expression] = field(default_factory=list)


def seconds(m: Mechanics) -> Expression:
    """The scene's time as an expression, s; heyoka's own is in internal units."""
    context = m.scene.context
    unit = context.ldexp(context.one, m.scaling.time)
    return hy.time if unit == 1 else m.number(unit) * hy.time


class LoadModel:
    """Base of all loads; the defaults are those of a load that does nothing.

    Attributes:
        title: in reasons and messages.
        reads: what it must find among the states: "attitude", "vertical", "flight".
        conservative: whether it has a potential that doesn't depend on time.
        wide: whether its expressions are too many to be unrolled (series of thousands of terms).
    """

    title = "load"
    wide = False
    reads: frozenset[str] = frozenset()
    conservative = False

    def extra_states(self, m: Mechanics) -> ExtraStates | None:
        """States of its own."""
        return None

    def torque(self, m: Mechanics) -> list[Term]:
        """About the reference point, body axes, in internal units of energy."""
        return []

    def force(self, m: Mechanics) -> list[Term]:
        """Acceleration of the centre of mass, space axes, in internal units of speed over time."""
        return []

    def potential(self, m: Mechanics) -> Expression | None:
        """Potential energy in internal units; part of the total energy where ``conservative``, and of the
        Hamiltonian of the canonical formulation in any case.
        """
        return None

    def keeps_axial(self, m: Mechanics, axis: Vector) -> bool:
        """Whether it has no torque about a symmetry axis of the body (mpf, body axes)."""
        return False

    def narrow(self, m: Mechanics) -> list[Expression]:
        """Dimensionless expressions of ``seconds(m)`` and the states around whose zeros the load changes all
        at once, such as (t - t0) / width of a pulse or a switch. Steps chosen by the motion alone would pass
        over it; with them they shorten on the way there.
        """
        return []


class UniformGravityModel(LoadModel):
    """The sum of all uniform fields: a torque com x M R^T g about a fixed point, or free fall."""

    title = "uniform_gravity"
    conservative = True

    def __init__(self, scene: Scene) -> None:
        self._fixed = scene.torque_arm is not None
        self.reads = frozenset({"vertical"} if self._fixed else ())

    def torque(self, m: Mechanics) -> list[Term]:
        """vertical x arm: the weight pulls the centre of mass down."""
        if m.vertical is None or m.numbers.arm is None:
            return []
        one, zero = m.scene.context.one, m.scene.context.zero
        units = [[one if i == j else zero for j in range(3)] for i in range(3)]
        return [(cross(units[a], m.numbers.arm), m.vertical[a]) for a in range(3)]

    def force(self, m: Mechanics) -> list[Term]:
        """Free fall."""
        if m.velocity is None or m.scene.gravity is None:
            return []
        context, scaling = m.scene.context, m.scaling
        pull = [context.ldexp(g, scaling.time - scaling.speed) for g in m.scene.gravity]
        return [(pull, hy.expression(1.0))]

    def potential(self, m: Mechanics) -> Expression | None:
        """M g l above the fixed point, or -M g . x in free flight."""
        context, scene, scaling = m.scene.context, m.scene, m.scaling
        if m.vertical is not None and m.numbers.arm is not None:
            return hy.sum([m.number(a) * v for a, v in zip(m.numbers.arm, m.vertical, strict=True) if a])
        mass = scene.body.mass
        if m.position is None or scene.gravity is None or mass is None:
            return None
        weights = [context.ldexp(-mass * g, scaling.length - scaling.energy) for g in scene.gravity]
        terms = [m.number(k) * x for k, x in zip(weights, m.position, strict=True) if k]
        return hy.sum(terms) if terms else None

    def keeps_axial(self, m: Mechanics, axis: Vector) -> bool:
        """Where the centre of mass lies on the axis."""
        arm = m.numbers.arm
        if arm is None:
            return True
        tiny = m.scene.context.mpf(2) ** (24 - m.scene.context.prec)
        return bool(norm(m.scene.context, cross(arm, axis)) <= norm(m.scene.context, arm) * tiny)


def gradient_terms(
    m: Mechanics, direction: list[Expression], strength: Any, factor: Expression | None = None
) -> list[Term]:
    """Torque 3 strength factor c x (I c) for a unit direction c in body axes (MacCullagh).

    Args:
        strength: constant part (mpf), which becomes one coefficient with the moments.
        factor: what varies of it.
    """
    context = m.scene.context
    inertia = m.numbers.inertia
    one, zero = context.one, context.zero
    units = [[one if i == j else zero for j in range(3)] for i in range(3)]
    columns = transpose(inertia)
    terms: list[Term] = []
    for a in range(3):
        for j in range(a, 3):
            vector = cross(units[a], columns[j])
            if j != a:
                vector = [x + y for x, y in zip(vector, cross(units[j], columns[a]), strict=True)]
            if any(x != 0 for x in vector):
                product = direction[a] * direction[j]
                scaled = [3 * strength * x for x in vector]
                terms.append((scaled, product if factor is None else factor * product))
    return terms


def quadratic_form(m: Mechanics, direction: list[Expression]) -> Expression:
    """c . I c for a direction c in body axes, internal units of inertia."""
    rows = []
    for row, c in zip(m.numbers.inertia, direction, strict=True):
        rows += [m.number(x) * (c * d) for x, d in zip(row, direction, strict=True) if x != 0]
    return hy.sum(rows)


class GravityGradientModel(LoadModel):
    """Torque of a distant body; its direction comes from the states of an orbit, or is fixed in space."""

    title = "gravity_gradient"
    reads = frozenset({"attitude"})

    def __init__(self, spec: GravityGradient, tag: str) -> None:
        self.spec = spec
        self.tag = tag
        self.conservative = spec.position is not None
        self.wide = spec.ephemeris is not None

    def orbit(self, m: Mechanics) -> OrbitStates | None:
        """The orbit's states and direction."""
        from rigidsim.model.orbits import orbit_states

        if self.spec.orbit is None:
            return None
        context = m.scene.context
        unit = context.ldexp(context.one, m.scaling.time)
        return orbit_states(self.spec.orbit, self.tag, unit, m.scene.start, context, m.number)

    def extra_states(self, m: Mechanics) -> ExtraStates | None:
        """Those of the orbit."""
        if m.attitude is not None and m.attitude.orbital is not None:
            return m.attitude.orbital.states
        orbit = self.orbit(m)
        if orbit is None:
            return None
        return ExtraStates(orbit.names, orbit.derivatives, orbit.initial, orbit.norms)

    def _place(self, m: Mechanics) -> Place:
        assert self.spec.ephemeris is not None
        unit = m.number(m.scene.context.ldexp(m.scene.context.one, m.scaling.time))
        return place(self.spec.ephemeris, unit * hy.time)

    def direction(self, m: Mechanics) -> list[Expression]:
        """Unit vector towards the attracting body, body axes."""
        if m.attitude is not None and m.attitude.orbital is not None:
            return m.attitude.orbital.direction
        orbit = self.orbit(m)
        if orbit is not None:
            return apply(transpose(m.matrix), orbit.direction)
        if self.spec.ephemeris is not None:
            return apply(transpose(m.matrix), self._place(m).direction)
        assert self.spec.position is not None
        length = norm(m.scene.context, self.spec.position)
        fixed = [as_factor(m.number(x / length)) for x in self.spec.position]
        return apply(transpose(m.matrix), fixed)

    def strength(self, m: Mechanics) -> tuple[Any, Expression | None]:
        """G M / R^3 in internal units: at a constant distance (mpf), and what it varies by."""
        context = m.scene.context
        orbit = self.orbit(m)
        factor = None if orbit is None else orbit.inverse_distance**3
        if self.spec.ephemeris is not None:
            distance = context.mpf(MEAN_DISTANCE[self.spec.ephemeris])
            factor = self._place(m).inverse_distance ** 3
        elif self.spec.orbit is not None:
            distance = self.spec.orbit.semi_major_axis
        else:
            distance = norm(context, m.carried(self.spec.position))
        value = context.ldexp(self.spec.gravitational_parameter / distance**3, 2 * m.scaling.time)
        return value, factor

    def torque(self, m: Mechanics) -> list[Term]:
        """(3 G M / R^3) c x (I c)."""
        return gradient_terms(m, self.direction(m), *self.strength(m))

    def potential(self, m: Mechanics) -> Expression | None:
        """(3 G M / 2 R^3) c . I c (the part that doesn't depend on the attitude is left out)."""
        strength, factor = self.strength(m)
        potential = as_factor(m.number(3 * strength / 2)) * quadratic_form(m, self.direction(m))
        return potential if factor is None else factor * potential

    def keeps_axial(self, m: Mechanics, axis: Vector) -> bool:
        """c x (I c) has no part along an axis of symmetry."""
        return True


class CentralGravityModel(LoadModel):
    """A point that attracts a free body: U = -GMm/r - (GM/2r^3)(tr I - 3 c . I c), c = R^T r/|r|."""

    title = "central_gravity"
    reads = frozenset({"attitude", "flight"})
    conservative = True

    def __init__(self, spec: CentralGravity) -> None:
        self.spec = spec

    def geometry(self, m: Mechanics) -> tuple[list[Expression], list[Expression], Expression]:
        """Unit direction from the attracting point in space axes and in body axes, and 1/r (1/length)."""
        context = m.scene.context
        assert m.position is not None
        offset = []
        for x, a in zip(m.position, self.spec.position, strict=True):
            shift = context.ldexp(a, -m.scaling.length)
            offset.append(x - m.number(shift) if shift != 0 else x)
        inverse = 1.0 / hy.sqrt(hy.sum([x * x for x in offset]))
        space = [x * inverse for x in offset]
        return space, apply(transpose(m.matrix), space), inverse

    def _strength(self, m: Mechanics, length_power: int, extra: int) -> Any:
        """G M over length^power, times 2^extra."""
        exponent = extra - length_power * m.scaling.length
        return m.scene.context.ldexp(self.spec.gravitational_parameter, exponent)

    def torque(self, m: Mechanics) -> list[Term]:
        """(3 G M / r^3) c x (I c)."""
        _, body, inverse = self.geometry(m)
        return gradient_terms(m, body, self._strength(m, 3, 2 * m.scaling.time), inverse**3)

    def force(self, m: Mechanics) -> list[Term]:
        """-GM r/r^3 - (3GM / 2 M r^4)[(tr I - 5 c . I c) r/|r| + 2 R I c] (physics of MacCullagh)."""
        context, scaling = m.scene.context, m.scaling
        space, body, inverse = self.geometry(m)
        shift = scaling.time - scaling.speed
        point = m.number(self._strength(m, 2, shift)) * inverse**2
        ratio = self._strength(m, 4, shift + scaling.inertia) * 3 / (2 * m.carried(m.scene.body.mass))
        second = m.number(ratio) * inverse**4
        trace = sum(m.numbers.inertia[i][i] for i in range(3))
        radial = point + second * (m.number(trace) - 5.0 * quadratic_form(m, body))
        turned = apply(m.matrix, _inertia_times(m, body))
        one, zero = context.one, context.zero
        terms: list[Term] = []
        for i in range(3):
            axis = [-one if i == j else zero for j in range(3)]
            terms.append((axis, radial * space[i] + 2.0 * second * turned[i]))
        return terms

    def potential(self, m: Mechanics) -> Expression | None:
        """To second degree."""
        scaling = m.scaling
        _, body, inverse = self.geometry(m)
        point = self._strength(m, 1, -scaling.energy) * m.scene.body.mass
        second = self._strength(m, 3, scaling.inertia - scaling.energy) / 2
        trace = sum(m.numbers.inertia[i][i] for i in range(3))
        bracket = m.number(trace) - 3.0 * quadratic_form(m, body)
        return -(m.number(point) * inverse) - m.number(second) * inverse**3 * bracket

    def keeps_axial(self, m: Mechanics, axis: Vector) -> bool:
        """c x (I c) has no part along an axis of symmetry."""
        return True


def _inertia_times(m: Mechanics, direction: list[Expression]) -> list[Expression]:
    rows = []
    for row in m.numbers.inertia:
        terms = [m.number(x) * d for x, d in zip(row, direction, strict=True) if x != 0]
        rows.append(hy.sum(terms) if terms else hy.expression(0.0))
    return rows


class ViscousTorqueModel(LoadModel):
    """-c_i w_i about the body axes."""

    title = "viscous_torque"

    def __init__(self, spec: ViscousTorque) -> None:
        self.spec = spec

    def torque(self, m: Mechanics) -> list[Term]:
        """One term for each axis with damping."""
        context = m.scene.context
        terms: list[Term] = []
        for i, coefficient in enumerate(self.spec.coefficients):
            if coefficient != 0:
                scaled = context.ldexp(coefficient, -m.scaling.momentum)
                vector = [-scaled * m.numbers.rate_units[i] if i == j else context.zero for j in range(3)]
                terms.append((vector, m.rate_states[i]))
        return terms
