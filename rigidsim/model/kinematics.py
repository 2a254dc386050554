"""The state of a scene as expressions, in which loads, observables and equations of motion are written.

One object serves all of them, in internal units; what a scene doesn't carry is None. Its tensor of inertia is
an object, too: what gives I w and w . I w / 2, and solves Euler's equations for w'.

All right-hand sides of the rates come from ``accelerations``. A tensor that varies is another class with the
same members; its ``change`` is dI/dt along the motion.

The tensor that turns is the one in the equations of motion. It differs from the one of the mass distribution,
which a gravity gradient feels, by what turns on a bearing (``rigidsim.scene.scene.Scene.turning_inertia``).

**Euler angles** of a rotation matrix R mean R at the poles of their sequence, too. With f the sine (proper
sequences) or cosine (the others) of the middle angle, R contains sine and cosine of the outer angles a and c
times f. Rounding errors e leave each of them uncertain by e / f, and where f vanishes neither is defined.
What R gives to rounding there is the turn about the axis that both share,

    a + s c,   s = sign(R_ii) for a proper sequence iji, sign(R_ik) for ijk.

So near a pole the last angle is what the first one leaves of this turn, and the error of the first moves R by
no more than e. In the pole itself the first has the value of the start here; what is recorded keeps the one
of the sample before (``rigidsim.solve.turns``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import heyoka as hy

from rigidsim.errors import required
from rigidsim.model.orbits import (
    KernelStates,
    OrbitStates,
    PointMassStates,
    TablePlace,
    orbit_states,
    table_states,
)
from rigidsim.model.rotations import Symbolic, SymbolicMatrix, apply, constant, length, transpose
from rigidsim.model.scaling import Rounder, ScaledNumbers, Scaling
from rigidsim.model.state_blocks import BODY, AttitudeStates, RotatingBody
from rigidsim.model.two_part import as_factor
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Matrix, Vector, cross, diagonal, dot, negligible, working_epsilon
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.expressions.tree import Expression
from rigidsim.scene.orbit_tables import TabulatedOrbit
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.rotations import AXES, is_proper, outer_angles, parity, pole_side, shared_turn
from rigidsim.scene.scene import Scene
from rigidsim.scene.surfaces import Surfaces

_LEVI_CIVITA = {
    (0, 1, 2): 1, (1, 2, 0): 1, (2, 0, 1): 1,
    (0, 2, 1): -1, (2, 1, 0): -1, (1, 0, 2): -1,
}  # fmt: skip
_PAIRS = tuple(dict.fromkeys((min(j, b), max(j, b)) for _, _, b in _LEVI_CIVITA for j in range(3)))
"""Of rates, in the order in which their terms are summed, which bits depend on."""


Term = tuple[Vector, Symbolic]


class Inertia:
    """A tensor of inertia, in internal units and body axes; ``times`` and ``solved`` are what a class of your
    own defines, and ``change`` if it varies.

    Attributes:
        number: rounds an mpf once to the working precision's scalar.
    """

    number: Rounder

    def times(self, vector: list[Symbolic]) -> list[Symbolic]:
        """I v."""
        raise NotImplementedError

    def solved(self, vector: list[Symbolic]) -> list[Symbolic]:
        """I^-1 v."""
        raise NotImplementedError

    def change(self) -> SymbolicMatrix | None:
        """dI/dt along the motion, per internal unit of time; None for a constant tensor."""
        return None

    def energy(self, rates: list[Symbolic], momentum: list[Symbolic]) -> Symbolic:
        """Kinetic energy of rotation w . I w / 2, with ``momentum`` I w."""
        return 0.5 * hy.sum([w * x for w, x in zip(rates, momentum, strict=True)])

    def accelerations(self, states: list[Symbolic], units: Vector, torque: Sequence[Term]) -> list[Symbolic]:
        """Derivatives of the rates' ``states``, each in its own unit, by I w' = (I w) x w - I' w + torque.

        Args:
            torque: terms of the torque on the body, internal units of energy.
        """
        number = self.number
        rates = [s if u == 1 else number(u) * s for s, u in zip(states, units, strict=True)]
        right = [[x] for x in cross(self.times(rates), rates)]
        for vector, expression in torque:
            for row, x in zip(right, vector, strict=True):
                row += [number(x) * expression] if x != 0 else []
        if (change := self.change()) is not None:
            for row, changes in zip(right, change, strict=True):
                row += [-(x * w) for x, w in zip(changes, rates, strict=True) if not absent(x)]
        turning = self.solved([hy.sum(row) for row in right])
        return [x if u == 1 else number(1 / u) * x for x, u in zip(turning, units, strict=True)]


@dataclass(frozen=True)
class MassDistribution:
    """One that changes: its tensor and dI/dt along the motion, body axes, internal units.

    Both are symmetric; an element that is zero for good is the number 0. Where the momentum is carried
    instead of the rates, nobody needs dI/dt: the states are then the rates that a body of the constant tensor
    would have with the same momentum.

    Attributes:
        rate_correction: angular velocity less these rates, 1 / time; None where rates are the states.
        distortion: what the tensor differs by from the constant one; known where the rates are corrected.
    """

    matrix: SymbolicMatrix
    change: SymbolicMatrix | None
    rate_correction: list[Symbolic] | None = None
    distortion: SymbolicMatrix | None = None


@dataclass(frozen=True)
class VaryingInertia(Inertia):
    """The tensor of a ``MassDistribution`` less a constant part, of what turns on bearings."""

    matrix: SymbolicMatrix
    rates: SymbolicMatrix | None
    number: Rounder

    @classmethod
    def of(cls, shape: MassDistribution, numbers: ScaledNumbers, number: Rounder) -> VaryingInertia:
        """The tensor of what turns with the body."""
        less = [
            [x - y for x, y in zip(*rows, strict=True)]
            for rows in zip(numbers.inertia, numbers.turning_inertia, strict=True)
        ]
        matrix = [
            [x - number(y) if y != 0 else x for x, y in zip(*rows, strict=True)]
            for rows in zip(shape.matrix, less, strict=True)
        ]
        return cls(matrix, shape.change, number)

    def times(self, vector: list[Symbolic]) -> list[Symbolic]:
        """See ``Inertia``."""
        return product(self.matrix, vector)

    def solved(self, vector: list[Symbolic]) -> list[Symbolic]:
        """See ``Inertia``: by the adjugate, unless the tensor is diagonal."""
        if all(absent(self.matrix[i][j]) for i in range(3) for j in range(3) if i != j):
            return [x / self.matrix[i][i] for i, x in enumerate(vector)]
        (a, f, e), (_, b, d), (_, _, c) = self.matrix
        adjugate = [
            [b * c - d * d, d * e - c * f, d * f - b * e],
            [d * e - c * f, a * c - e * e, e * f - a * d],
            [d * f - b * e, e * f - a * d, a * b - f * f],
        ]
        volume = hy.sum([hy.expression(x * y) for x, y in zip(self.matrix[0], adjugate[0], strict=True)])
        return [x / volume for x in product(adjugate, vector)]

    def change(self) -> SymbolicMatrix | None:
        """See ``Inertia``."""
        return self.rates


def absent(element: Any) -> bool:
    """Whether an element of a symbolic tensor is zero for good."""
    return isinstance(element, int | float) and element == 0


def product(matrix: SymbolicMatrix, vector: list[Symbolic]) -> list[Symbolic]:
    """M v without the elements that are zero for good."""
    rows = [[x * v for x, v in zip(row, vector, strict=True) if not absent(x)] for row in matrix]
    return [hy.sum(row) if row else hy.expression(0.0) for row in rows]


@dataclass(frozen=True)
class ConstantInertia(Inertia):
    """A constant tensor and its inverse, each element rounded once where it meets a state."""

    matrix: Matrix
    inverse: Matrix
    number: Rounder
    context: Any

    @classmethod
    def of(cls, numbers: ScaledNumbers, number: Rounder, context: Any) -> ConstantInertia:
        """The tensor of what turns with the body."""
        return cls(numbers.turning_inertia, numbers.inverse_inertia, number, context)

    def times(self, vector: list[Symbolic]) -> list[Symbolic]:
        """See ``Inertia``."""
        return self._product(self.matrix, vector)

    def solved(self, vector: list[Symbolic]) -> list[Symbolic]:
        """See ``Inertia``."""
        return self._product(self.inverse, vector)

    def _product(self, matrix: Matrix, vector: list[Symbolic]) -> list[Symbolic]:
        """Elements that are only rounding are left out."""
        least = self._size(matrix) * negligible(self.context)
        products = [[(x, w) for x, w in zip(row, vector, strict=True) if abs(x) > least] for row in matrix]
        return [hy.sum([self.number(x) * w for x, w in row]) for row in products]

    def _size(self, matrix: Matrix) -> Any:
        return self.context.maximum([abs(x) for row in matrix for x in row])

    def accelerations(self, states: list[Symbolic], units: Vector, torque: Sequence[Term]) -> list[Symbolic]:
        """See ``Inertia``: quadratic forms in the rates, so that principal and arbitrary body axes are one
        case; in principal axes the coefficients that vanish are left out (Landau & Lifshitz, Mechanics,
        eq. 36.4-5).
        """
        context, inverse, number = self.context, self.inverse, self.number
        zero, tiny = context.zero, negligible(context)
        largest_inverse = self._size(inverse)
        scale = largest_inverse * self._size(self.matrix)
        result = []
        for i in range(3):
            quadratic = dict.fromkeys(_PAIRS, zero)
            for (axis, a, b), sign in _LEVI_CIVITA.items():
                for j in range(3):
                    if not (inverse[i][axis] and self.matrix[a][j]):
                        continue
                    pair = (min(j, b), max(j, b))
                    term = sign * inverse[i][axis] * self.matrix[a][j] * units[j] * units[b] / units[i]
                    quadratic[pair] += term
            terms = [
                number(c) * (states[j] * states[b])
                for (j, b), c in quadratic.items()
                if abs(c) > tiny * (scale * units[j] * units[b] / units[i])
            ]
            for vector, expression in torque:
                coefficient = dot(inverse[i], vector) / units[i]
                size = largest_inverse * context.maximum(abs(x) for x in vector) / units[i]
                if abs(coefficient) > tiny * size:
                    terms.append(number(coefficient) * expression)
            result.append(hy.sum(terms))
        return result


# --- the state ----------------------------------------------------------------------------------------------

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
    cache: dict[Any, Any] = field(default_factory=dict, init=False, repr=False, compare=False)
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
    def mass_tensor(self) -> SymbolicMatrix:
        """Tensor of the mass distribution, whose elements that are zero for good are the number 0."""
        if self.shape is not None:
            return self.shape.matrix
        return [[self.number(x) if x != 0 else 0.0 for x in row] for row in self.numbers.inertia]

    @cached_property
    def own_momentum(self) -> list[Symbolic]:
        """Angular momentum I w of the body itself, body axes."""
        return self.inertia.times(self.undistorted_rates)

    @staticmethod
    def carried(part: T | None) -> T:
        """The part itself, which the caller knows to be carried (because ``Observable.needs`` says so)."""
        return required(part)

    @property
    def matrix(self) -> SymbolicMatrix:
        """Rotation matrix R, body to space axes."""
        return required(self.attitude).matrix

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

    def scaled(self, value: Any, exponent: int) -> Any:
        """A constant (mpf) times 2^exponent, rounded once."""
        return self.number(self.scene.context.ldexp(value, exponent))

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
    for row, c in zip(m.mass_tensor, direction, strict=True):
        rows += [x * (c * d) for x, d in zip(row, direction, strict=True) if not absent(x)]
    return hy.sum(rows)


def inertia_times(m: Kinematics, direction: list[Symbolic]) -> list[Symbolic]:
    """I c for a direction c in body axes, internal units of inertia."""
    return product(m.mass_tensor, direction)


def along_axes(m: Kinematics, size: Any, exponent: int, parts: Sequence[Symbolic]) -> list[Term]:
    """A vector's components as terms, times a constant (mpf) and a power of two."""
    constant = m.scene.context.ldexp(size, exponent)
    return list(zip(diagonal([constant] * 3), parts, strict=True))


# --- Euler angles -------------------------------------------------------------------------------------------

UNDEFINED = 16.0
"""Rounding errors of an angle's sine and cosine below which both are pure rounding."""

NEAR = 2.0**-6
"""Singular factor below which the outer angles are taken from the turn that they share. Above it each is
taken by itself, with an error of some 64 roundings.
"""


@dataclass(frozen=True)
class Poles:
    """Where the outer Euler angles of a sequence are undefined: the square of a factor vanishes there."""

    sequence: str
    squared_factor: Symbolic


def angles_of_matrix(m: Kinematics, *, differentiable: bool = False) -> list[Symbolic]:
    """Euler angles of the scene's sequence within one turn, rad; where branches that aren't selected must
    have finite derivatives, the middle one, which has a kink in the pole, is constant there.
    """
    sequence, r, context = m.scene.config.integrator.euler_sequence, m.matrix, m.scene.context
    half, whole = (hy.expression(m.number(x)) for x in (context.pi, 2 * context.pi))
    square = squared_factor(m)
    lost, near = hy.lt(square, m.number(_undefined(context))), hy.lt(square, NEAR**2)
    (y, x), (v, u) = outer_angles(sequence, r)
    if differentiable:
        y, x = hy.select(lost, constant(0.0), y), hy.select(lost, constant(1.0), x)
        v, u = hy.select(near, constant(0.0), v), hy.select(near, constant(1.0), u)
        square = hy.select(lost, constant(0.25), square)
    along = pole_side(sequence, r)
    side = hy.select(hy.gt(along, 0.0), constant(1.0), constant(-1.0))
    factor = hy.sqrt(square)
    if is_proper(sequence):
        middle, end = hy.atan2(factor, along), hy.select(hy.gt(along, 0.0), constant(0.0), half)
    else:
        sign = parity(*map(AXES.index, sequence[:2]))
        middle, end = hy.atan2(sign * along, factor), 0.5 * (sign * (side * half))
    if differentiable:
        middle = hy.select(lost, end, middle)
    first = hy.select(lost, hy.expression(m.number(first_at_start(m.scene))), hy.atan2(y, x))
    last = side * (hy.atan2(*shared_turn(sequence, r, side)) - first)
    last = hy.select(hy.gt(last, half), last - whole, hy.select(hy.lt(last, -half), last + whole, last))
    return [first, middle, hy.select(near, last, hy.atan2(v, u))]


def squared_factor(m: Kinematics) -> Symbolic:
    """Square of the factor that vanishes in the poles."""
    y, x = components_of_factor(m)
    return y * y + x * x


def components_of_factor(m: Kinematics) -> list[Symbolic]:
    """Two elements of R that vanish in the poles, and nowhere else together."""
    return list(outer_angles(m.scene.config.integrator.euler_sequence, m.matrix)[1])


def first_at_start(scene: Scene) -> Any:
    """The first angle (mpf) of the start within one turn; in a pole the one given, or all of the turn."""
    context, sequence = scene.context, scene.config.integrator.euler_sequence
    if scene.euler_angles is not None:
        first = scene.euler_angles[0]
        return context.atan2(context.sin(first), context.cos(first))
    return attitude.euler_from_matrix(context, attitude.rotation_matrix(scene.quaternion), sequence)[0]


def starts_near_pole(scene: Scene) -> bool:
    """Whether the motion starts where the outer angles are taken from the turn that they share."""
    return bool(_factor_at_start(scene) < NEAR**2)


def starts_in_pole(scene: Scene) -> bool:
    """Whether the motion starts where the outer angles are undefined."""
    return bool(_factor_at_start(scene) < _undefined(scene.context))


def _factor_at_start(scene: Scene) -> Any:
    """Square of the factor that vanishes in the poles."""
    sequence = scene.config.integrator.euler_sequence
    y, x = outer_angles(sequence, attitude.rotation_matrix(scene.quaternion))[1]
    return y * y + x * x


def _undefined(context: Any) -> Any:
    return (UNDEFINED * working_epsilon(context)) ** 2
