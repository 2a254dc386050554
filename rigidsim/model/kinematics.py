"""The state of a scene as expressions, in which loads, observables and equations of motion are written.

One object serves all of them, in internal units; what a scene doesn't carry is None.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import heyoka as hy

from rigidsim.model.inertia import ConstantInertia, Inertia, MassDistribution, VaryingInertia, absent, product
from rigidsim.model.orbits.kernel_states import KernelStates
from rigidsim.model.orbits.point_mass_states import PointMassStates
from rigidsim.model.orbits.prescribed import OrbitStates, TablePlace, orbit_states, table_states
from rigidsim.model.rotations import Symbolic, SymbolicMatrix, apply, length, transpose
from rigidsim.model.scaling import Rounder, ScaledNumbers, Scaling
from rigidsim.model.state_blocks import BODY, AttitudeStates, RotatingBody
from rigidsim.model.two_part import as_factor
from rigidsim.scene.arithmetic import Vector, dot, negligible
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import Expression
from rigidsim.scene.orbit_tables.pieces import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.surfaces import Surfaces

T = TypeVar("T")


@dataclass(frozen=True)
class Kinematics:
    """Expressions of the state, in internal units; ``ModelPlan`` says what the last fields are."""

    scene: Scene
    scaling: Scaling
    numbers: ScaledNumbers
    rate_states: list[Symbolic]  # the rates, each in its own unit: three states, unless something slips
    attitude: AttitudeStates | None
    vertical: list[Symbolic] | None  # unit vector against gravity, body axes; None where no torque needs it
    position: list[Symbolic] | None  # states in their own units
    velocity: list[Symbolic] | None
    number: Rounder
    orbit_tags: Mapping[KeplerOrbit, str] = field(default_factory=dict)
    surfaces: Surfaces = field(default_factory=Surfaces)
    tables: Mapping[TabulatedOrbit, TablePlace] = field(default_factory=dict)
    clocked: bool = False
    body: RotatingBody = BODY
    shape: MassDistribution | None = None  # of a body in which mass moves
    _orbits: dict[KeplerOrbit | TabulatedOrbit, OrbitStates] = field(
        default_factory=dict, init=False, repr=False
    )
    made: dict[Any, Any] = field(default_factory=dict, init=False, repr=False, compare=False)
    """Long vectors that several expressions share, by what they are."""

    @cached_property
    def sides(self) -> Mapping[Expression, Symbolic]:
        """For the sign of each surface's argument, the parameter that says on which side the motion is."""
        places = self.surfaces.places
        return {node: hy.par[index] if sign > 0 else -hy.par[index] for node, (index, sign) in places.items()}

    @cached_property
    def rates(self) -> list[Symbolic]:
        """Angular velocity in units of 1/time, body axes."""
        return in_common_unit(self.rate_states, self.numbers.rate_units, self.number)

    @cached_property
    def undistorted_rates(self) -> list[Symbolic]:
        """The same of a body of the constant tensor with the same angular momentum, where that is carried."""
        if self.rate_correction is None:
            return self.rates
        return in_common_unit(self.carried_rates, self.numbers.rate_units, self.number)

    @property
    def rate_correction(self) -> list[Symbolic] | None:
        """See ``MassDistribution``."""
        return None if self.shape is None else self.shape.rate_correction

    @property
    def carried_rates(self) -> list[Symbolic]:
        """The three states of the rates, each in its own unit."""
        return list(hy.make_vars(*self.body.rates)) if self.rate_correction is not None else self.rate_states

    @cached_property
    def inertia(self) -> Inertia:
        """Tensor of what turns with the body, by which torques change the rates; the constant one where the
        momentum is carried.
        """
        if self.shape is not None and self.shape.rate_correction is None:
            return VaryingInertia.of(self.shape, self.numbers, self.number)
        return ConstantInertia.of(self.numbers, self.number, self.scene.context)

    @cached_property
    def own_momentum(self) -> list[Symbolic]:
        """Angular momentum I w of the body itself, body axes."""
        return self.inertia.times(self.undistorted_rates)

    @staticmethod
    def carried(part: T | None) -> T:
        """The part itself, which the caller knows to be carried (because ``Observable.needs`` says so)."""
        assert part is not None
        return part

    @property
    def matrix(self) -> SymbolicMatrix:
        """Rotation matrix R, body to space axes."""
        assert self.attitude is not None
        return self.attitude.matrix

    def seen_from(self, point: Vector) -> tuple[list[Symbolic], Symbolic]:
        """Direction (unit, space axes) from a fixed point (mpf, m) to the body in flight; 1 / distance."""
        offset = self.offset_from(point)
        inverse = 1.0 / length(offset)
        return [x * inverse for x in offset], inverse

    def offset_from(self, point: Vector) -> list[Symbolic]:
        """Vector from a fixed point (mpf, m) to the body in flight, space axes, units of length."""
        offset = []
        for x, a in zip(self.carried(self.position), point, strict=True):
            shift = self.scene.context.ldexp(a, -self.scaling.length)
            offset.append(x - self.number(shift) if shift != 0 else x)
        return offset

    def fixed(self, vector: Vector) -> list[Symbolic]:
        """A constant vector (mpf) as factors of expressions; exact zeros and ones vanish from products."""
        return [as_factor(self.number(x)) for x in vector]

    def seen(self, space: list[Symbolic]) -> list[Symbolic]:
        """A vector of space axes that doesn't depend on how the body turns, in body axes."""
        return apply(transpose(self.matrix), space)

    @property
    def preferred_axis(self) -> Vector | None:
        """Body-axes vector that a uniform field pulls on (mpf); None without one."""
        return self.numbers.arm

    @cached_property
    def symmetry_direction(self) -> Vector | None:
        """Unit axis (mpf, body axes) of the tensor's symmetry; None without one, or where a sphere has none
        that a load prefers. Moments that vary are equal where their expressions are.
        """
        context, body = self.scene.context, self.scene.body
        moments, axes = body.principal_moments, body.principal_axes
        tiny = context.maximum(moments) * negligible(context)

        def equal(i: int, j: int) -> bool:
            if self.shape is not None:
                return bool(self.shape.matrix[i][i] == self.shape.matrix[j][j])
            return bool(abs(moments[i] - moments[j]) <= tiny)

        if equal(0, 1) and equal(0, 2):  # a sphere
            if self.preferred_axis is None:
                return None
            length = context.sqrt(dot(self.preferred_axis, self.preferred_axis))
            return [a / length for a in self.preferred_axis]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            if equal(j, k):
                return axes[i]
        return None

    def orbit(self, orbit: KeplerOrbit) -> OrbitStates:
        """A prescribed orbit, carried by the states that all its loads share."""
        if orbit not in self._orbits:
            context = self.scene.context
            unit = context.ldexp(context.one, self.scaling.time)
            tag = self.orbit_tags.get(orbit, "")
            self._orbits[orbit] = orbit_states(orbit, tag, unit, self.scene.start, context, self.number)
        return self._orbits[orbit]

    @cached_property
    def point_masses(self) -> PointMassStates | None:
        """The point masses besides the body; None if there are none."""
        masses = self.scene.bodies
        if masses is None:
            return None
        return PointMassStates(masses, self.scaling, self.scene.context, self.number)

    @cached_property
    def sky(self) -> KernelStates | None:
        """Bodies of a kernel; None if no load sees any."""
        scene, sights = self.scene, [sight for load in self.scene.loads for sight in load.sights]
        if scene.ephemeris is None or not sights:
            return None
        first = self.surfaces.parameters
        first += sum(place.parameters(orbit) for orbit, place in self.tables.items())
        start, context = scene.start, scene.context
        return KernelStates(scene.ephemeris, sights, self.scaling, start, context, self.number, first)

    def guess(self) -> Any:
        """Of a state of numbers, a number that stands for a formula (see ``probing``); None for others."""
        return None

    @property
    def piecewise(self) -> bool:
        """Whether there are times at which states and parameters are set, and steps end."""
        return bool(self.tables) or self.sky is not None

    def table(self, orbit: TabulatedOrbit) -> OrbitStates:
        """A tabulated orbit, carried by the states that all its loads share."""
        if orbit not in self._orbits:
            place = self.tables.get(orbit) or TablePlace("", 0)
            made = table_states(orbit, place, self.scaling.time, self.scene.start, self.number)
            self._orbits[orbit] = made
        return self._orbits[orbit]


def in_common_unit(states: list[Symbolic], units: list[Any], number: Rounder) -> list[Symbolic]:
    """States times their own units; a unit of one costs nothing."""
    return [s if u == 1 else number(u) * s for s, u in zip(states, units, strict=True)]


def seconds(m: Kinematics, since: Epoch | None = None) -> Symbolic:
    """The scene's time as an expression, s, or that since J2000, if ``since`` is the date of time 0."""
    context = m.scene.context
    unit = context.ldexp(context.one, m.scaling.time)
    time = hy.time if unit == 1 else m.number(unit) * hy.time
    begin = context.zero if since is None else ExactNumber(since.since_j2000()).at(context)
    return time + m.number(begin) if begin != 0 else time


def quadratic_form(m: Kinematics, direction: list[Symbolic]) -> Symbolic:
    """c . I c for a direction c in body axes, internal units of inertia."""
    rows = []
    if m.shape is not None:
        for given, c in zip(m.shape.matrix, direction, strict=True):
            rows += [x * (c * d) for x, d in zip(given, direction, strict=True) if not absent(x)]
        return hy.sum(rows)
    for row, c in zip(m.numbers.inertia, direction, strict=True):
        rows += [m.number(x) * (c * d) for x, d in zip(row, direction, strict=True) if x != 0]
    return hy.sum(rows)


def inertia_times(m: Kinematics, direction: list[Symbolic]) -> list[Symbolic]:
    """I c for a direction c in body axes, internal units of inertia."""
    if m.shape is not None:
        return product(m.shape.matrix, direction)
    inertia = m.numbers.inertia
    return [
        hy.sum([m.number(x) * d for x, d in zip(row, direction, strict=True) if x != 0]) for row in inertia
    ]
