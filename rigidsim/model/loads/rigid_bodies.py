"""A second rigid body, and the mutual gravity of both.

The state of ``[body]``, A, stays what it is without a partner: attitude and rates. The partner B adds its
own, and its place and velocity as seen from A's centre of mass in space axes, r = r_B - r_A, which move as
those of the reduced mass m = m_A m_B / (m_A + m_B):

    r'' = F / m,    I_B w_B' = (I_B w_B) x w_B + T_B,    I_A w_A' = (I_A w_A) x w_A + T_A,
    L = R_A I_A w_A + R_B I_B w_B + m r x r',    E = w_A . I_A w_A / 2 + w_B . I_B w_B / 2 + m r'^2 / 2 + U.

The centre of mass of both moves uniformly and is left out. So B is a ``Carrier``, whose momentum belongs to
every total and whose torque on A no total feels.

**The mutual potential** to a total degree n of the moments of both bodies is, with x_A = R_A^T r and
x_B = -R_B^T r,

    U = -G m_A m_B / r + V_A(x_A) + V_B(x_B) + U_QQ,
    V_A = -(G m_A m_B / r) sum over l = 2..n of (R_A / r)^l f_l(x_A / r),    V_B likewise,

where f_l are harmonics of degree l, of degree 2 by the tensor of inertia. First moments vanish about the
centres of mass, so that up to n = 4 both figures meet in one term alone (Giacaglia & Jefferys 1971, Celest.
Mech. 4, 442; Maciejewski 1995, Celest. Mech. 63, 1). With L = (tr I_A) / 3 - I_A, K = (tr I_B) / 3 - I_B,
u = r / |r|, p = R_A^T u, s = R_B^T u, C = R_A^T R_B and M = L C K,

    U_QQ = k W,    k = -(3/4) G / r^5,    W = 35 (p . L p) (s . K s) - 20 p . M s + 2 tr(M C^T).

**Torques and force.** With W_p = 70 (s . K s) L p - 20 M s, W_s = 70 (p . L p) K s - 20 M^T p and
W_C = 4 M - 20 (L p) (K s)^T,

    T_A = x_A x grad V_A + k (p x W_p + sum of columns C_j x W_C,j),
    T_B = x_B x grad V_B + k (s x W_s + sum of rows C_i x W_C,i).

U depends on nothing but the bodies' relative place and attitudes, so that R_A T_A + R_B T_B + r x F = 0. The
force follows from the torques and from the terms U_l of total degree l, which fall as r^-(l+1):

    r F = (sum of (l + 1) U_l) u + u x (R_A T_A + R_B T_B).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import heyoka as hy
from pydantic import Field

from rigidsim.errors import ConfigError, Problem, ensure, required
from rigidsim.model.harmonics import Harmonics, Series, leading
from rigidsim.model.kinematics import ConstantInertia, Kinematics, along_axes, in_common_unit
from rigidsim.model.load import Load, Term
from rigidsim.model.loads.tides_on_pairs import Second, Tides, tides_on
from rigidsim.model.rotations import Symbolic, length, quaternion_kinematics, quaternion_matrix
from rigidsim.model.scaling import exponent
from rigidsim.model.state_blocks import RotatingBody, StateBlock
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import Matrix, Vector, apply, cross, dot, negligible, norm, transpose
from rigidsim.scene.arithmetic import vector as numbers
from rigidsim.scene.bodies.body import Body, Matter, RigidBody, inverse_inertia
from rigidsim.scene.bodies.gravity_field import LEAST
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.point_masses import GRAVITATIONAL_CONSTANT, kepler_reach, start_of_elements
from rigidsim.scene.readable import length_text
from rigidsim.scene.registry import LOADS, LoadFields, Setting, register_load
from rigidsim.scene.scene import Scene, whole_body
from rigidsim.scene.schema import RigidBodyTable
from rigidsim.scene.starts import along_massless
from rigidsim.scene.swept import plain

_TABLE = "rigid_bodies"
_WATCHED = 1.5
"""Sums of the longest half axes within which bodies have to come, as points, for contact to be watched."""
_THIN = 1e-3  # of the longest half axis, least of the others
_BOTH_FIGURES = 4
"""Total degree from which on both figures meet in one term."""


# --- what a body's gravity is made of -----------------------------------------------------------------------


@dataclass(frozen=True)
class Figure:
    """A body's gravity; numbers are mpf.

    Attributes:
        mass: kg.
        radius: to which the harmonics refer, m.
        series: its unnormalized harmonics from degree 2 on.
        second: (tr I) / 3 - I, its traceless moments of second degree, kg m^2.
    """

    mass: Any
    radius: Any
    series: Series
    second: Matrix

    @classmethod
    def of(cls, body: RigidBody, degree: int, context: Any) -> Figure | None:
        """To a degree, from the body's field or shape; None where neither gives degree 3 and more."""
        tensor, mass = body.inertia, body.mass
        third = (tensor[0][0] + tensor[1][1] + tensor[2][2]) / 3
        heaviest = context.maximum(body.principal_moments)
        tiny = negligible(context) * heaviest  # a sphere has none
        second = [[(third if i == j else 0) - tensor[i][j] for j in range(3)] for i in range(3)]
        second = [[x if abs(x) > tiny else 0 * x for x in row] for row in second]
        radius = context.sqrt(heaviest / mass) if body.gravity is None else body.gravity.radius
        unit = mass * radius**2
        series = {
            (2, 0, False): (second[2][2] - (second[0][0] + second[1][1]) / 2) / unit,
            (2, 1, False): second[0][2] / unit,
            (2, 1, True): second[1][2] / unit,
            (2, 2, False): (second[0][0] - second[1][1]) / (4 * unit),
            (2, 2, True): second[0][1] / (2 * unit),
        }
        if degree >= LEAST and body.gravity is not None:
            if degree > body.gravity.degree:
                return None
            series |= body.gravity.to(degree)
        elif degree >= LEAST:
            if body.points is None:
                return None
            series |= _of_points(body, degree, radius, context)
        least = tiny / unit
        return cls(mass, radius, {key: c for key, c in series.items() if abs(c) > least}, second)


def _of_points(body: RigidBody, degree: int, radius: Any, context: Any) -> Series:
    """Unnormalized harmonics from degree 3 on, by their integrals over the body."""
    found: dict[Any, Any] = {}
    for mass, place in body.points or ():
        if (far := norm(context, place)) == 0:
            continue
        seen = Harmonics([x / far for x in place], lambda x: x, context, exact=True)
        for n in range(LEAST, degree + 1):
            size = mass / body.mass * (far / radius) ** n
            for m in range(n + 1):
                for sine in (False, True)[: 1 + (m > 0)]:
                    found[n, m, sine] = found.get((n, m, sine), context.zero) + size * seen[n, m, sine]
    for n, m, sine in found:
        factor = leading(n, m)
        for k in range(n - m + 1, n + m + 1):
            factor /= k
        factor *= 1 if m == 0 else 2
        found[n, m, sine] *= context.mpf(factor.numerator) / factor.denominator
    return found


@dataclass(frozen=True)
class Pair:
    """Mutual gravity of two bodies to a total degree."""

    figures: tuple[Figure, Figure]
    degree: int
    context: Any

    @property
    def masses(self) -> tuple[Any, Any]:
        """Of both, kg."""
        return self.figures[0].mass, self.figures[1].mass

    @property
    def constant(self) -> Any:
        """G, m^3/(kg s^2)."""
        return self.context.mpf(GRAVITATIONAL_CONSTANT)

    @property
    def strength(self) -> Any:
        """G (m_A + m_B), m^3/s^2."""
        return self.constant * (self.masses[0] + self.masses[1])

    @property
    def product(self) -> Any:
        """G m_A m_B, J m."""
        return self.constant * self.masses[0] * self.masses[1]


@dataclass(frozen=True)
class Attracting:
    """Two bodies at a place; numbers are expressions, or mpf if ``exact``.

    Attributes:
        line: unit vector from A to B, space axes.
        inverse: unit of length over the distance.
        turns: rotation matrices, body to space.
        length, energy: units, SI (mpf).
        number: rounds a constant (mpf).
    """

    pair: Pair
    line: list[Any]
    inverse: Any
    turns: tuple[list[list[Any]], list[list[Any]]]
    length: Any
    energy: Any
    number: Callable[[Any], Any]
    exact: bool = False

    def _sum(self, terms: Sequence[Any]) -> Any:
        return sum(terms) if self.exact else hy.sum(list(terms))

    def _along(self, a: Sequence[Any], b: Sequence[Any]) -> Any:
        return self._sum([x * y for x, y in zip(a, b, strict=True)])

    def _moments(self, which: int, matrix: list[list[Any]]) -> list[list[Any]]:
        """A body's traceless moments, over the largest, times a matrix of any number of columns."""
        second, zero = self.pair.figures[which].second, 0 * matrix[0][0]
        scale, least = self._largest(which), negligible(self.pair.context)
        rows = []
        for row in second:
            kept = [(self.number(x / scale), other) for x, other in zip(row, matrix, strict=True)
                    if abs(x) > least * scale]  # fmt: skip
            rows.append([self._sum([x * other[k] for x, other in kept]) if kept else zero
                         for k in range(len(matrix[0]))])  # fmt: skip
        return rows

    def _largest(self, which: int) -> Any:
        return self.pair.context.maximum([abs(x) for row in self.pair.figures[which].second for x in row])

    @cached_property
    def seen(self) -> list[list[Any]]:
        """The line in the axes of each body."""
        return [[self._along(column, self.line) for column in transpose(turn)] for turn in self.turns]

    @cached_property
    def _fields(self) -> list[Harmonics]:
        p, s = self.seen
        return [Harmonics(x, self.number, self.pair.context, exact=self.exact) for x in (p, [-x for x in s])]

    def _size(self, which: int, n: int) -> Any:
        """-G m_A m_B R^n over the unit of length to the power of n + 1."""
        ratio = self.pair.figures[which].radius / self.length
        return -self.pair.product / (self.length * self.energy) * ratio**n

    @cached_property
    def _figures_meet(self) -> tuple[Any, list[Any], list[Any]] | None:
        """U_QQ and what it adds to the torques; None below degree 4, or if one body is a sphere."""
        largest = [self._largest(which) for which in (0, 1)]
        if self.pair.degree < _BOTH_FIGURES or 0 in largest:
            return None
        size = -self.pair.constant * largest[0] * largest[1] * 3 / (4 * self.length**5 * self.energy)
        strength = self.number(size) * self.inverse**5
        (p, s), (a_turn, b_turn) = self.seen, self.turns
        relative = [[self._along(x, y) for y in transpose(b_turn)] for x in transpose(a_turn)]
        lp, ks = ([x for (x,) in self._moments(which, [[x] for x in v])] for which, v in enumerate((p, s)))
        both = self._moments(0, transpose(self._moments(1, transpose(relative))))
        a, b = self._along(p, lp), self._along(s, ks)
        ms, mp = ([self._along(row, v) for row in rows] for rows, v in ((both, s), (transpose(both), p)))
        trace = self._sum([self._along(*rows) for rows in zip(both, relative, strict=True)])
        potential = strength * self._sum([35.0 * (a * b), -20.0 * self._along(p, ms), 2.0 * trace])
        torques = []
        for c, m, v, own, other, other_size, mixed in (
            (transpose(relative), transpose(both), p, lp, ks, b, ms),
            (relative, both, s, ks, lp, a, mp),
        ):
            turned = [self._along(x, other) for x in transpose(c)]
            direct = cross(v, [70.0 * (other_size * x) - 20.0 * y for x, y in zip(own, mixed, strict=True)])
            across = cross(turned, own)
            twisted = [cross(x, y) for x, y in zip(c, m, strict=True)]
            torques.append(
                [
                    strength
                    * self._sum([direct[i], -20.0 * across[i], 4.0 * self._sum([x[i] for x in twisted])])
                    for i in range(3)
                ]
            )
        return potential, *torques

    @cached_property
    def torques(self) -> list[list[Any]]:
        """On A and on B, each in its axes, units of energy."""
        found = []
        for which, (figure, field) in enumerate(zip(self.pair.figures, self._fields, strict=True)):
            size = lambda n, which=which: self._size(which, n)  # noqa: E731
            own = field.turned(figure.series, size, self.inverse, 1)
            if (meeting := self._figures_meet) is not None:
                own = [x + y for x, y in zip(own, meeting[1 + which], strict=True)]
            found.append(own)
        return found

    def _summed(self, weight: Callable[[int], int]) -> Any:
        """The terms of the potential times a weight of each degree."""
        terms = [self.number(weight(0) * self._size(0, 0)) * self.inverse]
        for which, (figure, field) in enumerate(zip(self.pair.figures, self._fields, strict=True)):
            size = lambda n, which=which: weight(n) * self._size(which, n)  # noqa: E731
            terms.append(field.scalar(figure.series, size, self.inverse, 1))
        if (meeting := self._figures_meet) is not None:
            terms.append(float(weight(_BOTH_FIGURES)) * meeting[0])
        return self._sum(terms)

    @property
    def potential(self) -> Any:
        """U, units of energy."""
        return self._summed(lambda n: 1)

    @cached_property
    def force(self) -> list[Any]:
        """On B, space axes, units of energy over the unit of length."""
        turned = [
            [self._along(row, torque) for row in turn]
            for turn, torque in zip(self.turns, self.torques, strict=True)
        ]
        across = cross(self.line, [x + y for x, y in zip(*turned, strict=True)])
        outwards = self._summed(lambda n: n + 1)
        return [self.inverse * (outwards * u + x) for u, x in zip(self.line, across, strict=True)]


# --- the second body ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Start:
    """Where B begins: position and velocity (from A, space axes), quaternion, rates (body axes); mpf, SI."""

    position: Vector
    velocity: Vector
    quaternion: Vector
    rates: Vector


@dataclass(frozen=True)
class SecondStates:
    """The states of B as expressions, internal units.

    Attributes:
        place, velocity: space axes, in the units of ``SecondBody.units``.
        rate_states: the rates in their own unit; ``rates`` are in units of 1/time.
        attracting: the mutual gravity; None without any.
    """

    place: list[Symbolic]
    velocity: list[Symbolic]
    quaternion: list[Symbolic]
    rate_states: list[Symbolic]
    rates: list[Symbolic]
    inertia: ConstantInertia
    attracting: Attracting | None

    @property
    def matrix(self) -> list[list[Symbolic]]:
        """R_B, body to space axes."""
        return quaternion_matrix(self.quaternion)

    @property
    def momentum(self) -> list[Symbolic]:
        """I_B w_B, B's axes."""
        return self.inertia.times(self.rates)


@register_load(table=_TABLE)
@dataclass(frozen=True)
class SecondBody(Load):
    """B; ``pair`` is the mutual gravity, None without any."""

    name: str
    body: RigidBody
    first: RigidBody
    pair: Pair | None
    start: Start
    where: str

    conservative = True
    loose = True  # see ``Load``
    reads = frozenset({"attitude"})

    @property
    def title(self) -> str:  # type: ignore[override]
        return f"rigid body {self.name}"

    @property
    def states(self) -> RotatingBody:
        """Names of its states."""
        return RotatingBody(f"{self.name}_")

    @property
    def reduced_mass(self) -> Any:
        """m_A m_B / (m_A + m_B), kg."""
        one, other = required(self.first.mass), required(self.body.mass)
        return one * other / (one + other)

    def fault(self, key: str, text: str) -> ConfigError:
        """The error that names a key of its table."""
        return ConfigError(Problem(f"{self.where} {key}", text))

    def with_partner(self, partner: Sequence[Vector]) -> SecondBody:
        return replace(self, start=Start(*partner))

    # --- sizes ----------------------------------------------------------------------------------------------

    def reach(self, scene: Scene) -> tuple[Any, Any]:
        """Least and largest distance of both as points, m; of an unbound orbit the distance at the start."""
        context, start = scene.context, self.start
        far = norm(context, start.position)
        if self.pair is None:
            return far, far
        least, most = kepler_reach(context, start.position, start.velocity, self.pair.strength)
        return context.maximum([least, far / 1000]), far if most is None else most

    def units(self, scene: Scene) -> tuple[int, int, int]:
        """Binary exponents of the units of place, velocity and rates, SI."""
        context, start = scene.context, self.start
        least, most = self.reach(scene)
        fastest = norm(context, start.velocity) ** 2
        if self.pair is not None:
            fastest += 2 * self.pair.strength * (1 / least - 1 / norm(context, start.position))
        turning = context.maximum([norm(context, start.rates), self._orbit_rate(scene)])
        return exponent(context, most), exponent(context, context.sqrt(fastest)), exponent(context, turning)

    def _orbit_rate(self, scene: Scene) -> Any:
        """Angular rate at the closest approach, rad/s."""
        start, (least, _) = self.start, self.reach(scene)
        return norm(scene.context, cross(start.position, start.velocity)) / least**2

    def fastest_rate(self, scene: Scene) -> Any:
        return scene.context.maximum([norm(scene.context, self.start.rates), self._orbit_rate(scene)])

    def amplitude(self, scene: Scene) -> Any:
        """(3/2) (G m_B / r^3) (I_max - I_min) of A at the closest approach."""
        if self.pair is None:
            return scene.context.zero
        moments, (least, _) = self.first.principal_moments, self.reach(scene)
        spread = scene.context.maximum(moments) - scene.context.minimum(moments)
        return 3 * self.pair.constant * self.body.mass * spread / (2 * least**3)

    @cached_property
    def semi_axes(self) -> list[Vector]:
        """Of the homogeneous ellipsoids with the moments of A and of B, along their principal axes, m."""
        found = []
        for body in (self.first, self.body):
            half, mass = sum(body.principal_moments) / 2, required(body.mass)
            squares = [5 * (half - x) / mass for x in body.principal_moments]
            thin = max(squares) * _THIN**2  # a rod's
            found.append([(x if x > thin else thin) ** 0.5 for x in squares])
        return found

    def contacts(self, m: Kinematics) -> list[tuple[str, Symbolic]]:
        """The distance over what both ellipsoids reach along the line between the centres, less one; nothing
        where they don't come near.
        """
        seen, (least, _) = self.seen(m), self.reach(m.scene)
        attracting = seen.attracting
        if attracting is None or least > _WATCHED * sum(max(axes) for axes in self.semi_axes):
            return []
        reached = []
        for body, axes, line in zip((self.first, self.body), self.semi_axes, attracting.seen, strict=True):
            squares = []
            for axis, a in zip(body.principal_axes, axes, strict=True):
                inverse = attracting.length / a
                along = hy.sum([m.number(inverse * x) * p for x, p in zip(axis, line, strict=True) if x != 0])
                squares.append(along * along)
            reached.append(1.0 / hy.sqrt(hy.sum(squares)))
        gap = 1.0 / (attracting.inverse * hy.sum(reached)) - 1.0
        return [(f"the ellipsoids with the moments of [body] and {self.name} touch", gap)]

    def refuse_overlap(self, scene: Scene) -> None:
        """Refuse a start at which both ellipsoids overlap along that line."""
        context, place = scene.context, self.start.position
        far, reached = norm(context, place), context.zero
        turns = [attitude.rotation_matrix(q) for q in (scene.quaternion, self.start.quaternion)]
        for body, axes, turn in zip((self.first, self.body), self.semi_axes, turns, strict=True):
            seen = apply(transpose(turn), [x / far for x in place])
            along = [dot(axis, seen) / a for axis, a in zip(body.principal_axes, axes, strict=True)]
            reached += 1 / norm(context, along)
        what = f"given {context.nstr(far, 6)} m from [body], where the ellipsoids with the moments of both "
        what += f"overlap; place it more than {context.nstr(reached, 6)} m away, or turn one of both"
        ensure(far > reached, self.fault("position", what))

    # --- its states -----------------------------------------------------------------------------------------

    def seen(self, m: Kinematics) -> SecondStates:
        """Its states, and what they do to each other."""
        if self not in m.cache:
            m.cache[self] = self._seen(m)
        found: SecondStates = m.cache[self]
        return found

    def __hash__(self) -> int:
        return hash(self.name)

    def _seen(self, m: Kinematics) -> SecondStates:
        context, names, scaling = m.scene.context, self.states, m.scaling
        far, _, turning = self.units(m.scene)
        place, velocity, q, rates = (
            list(hy.make_vars(*x)) for x in (names.position, names.velocity, names.quaternion, names.rates)
        )
        unit = context.ldexp(context.one, turning + scaling.time)
        inertia, inverse = (
            [[context.ldexp(x, shift) for x in row] for row in matrix]
            for matrix, shift in (
                (self.body.inertia, -scaling.inertia),
                (inverse_inertia(context, self.body), scaling.inertia),
            )
        )
        attracting = None
        if self.pair is not None:
            near = 1.0 / length(place)
            attracting = Attracting(
                self.pair, [near * x for x in place], near, (m.matrix, quaternion_matrix(q)),
                context.ldexp(context.one, far), context.ldexp(context.one, scaling.energy), m.number,
            )  # fmt: skip
        turned = in_common_unit(rates, [unit] * 3, m.number)
        tensor = ConstantInertia(inertia, inverse, m.number, context)
        return SecondStates(place, velocity, q, rates, turned, tensor, attracting)

    def extra_states(self, m: Kinematics) -> StateBlock:
        context, names, scaling, start = m.scene.context, self.states, m.scaling, self.start
        self.refuse_overlap(m.scene)
        seen, (far, speed, turning) = self.seen(m), self.units(m.scene)
        ratio = m.scaled(1, speed + scaling.time - far)
        accelerations: list[Any] = [hy.expression(0.0)] * 3
        torque: list[Term] = []
        if (attracting := seen.attracting) is not None:
            size = context.ldexp(1 / self.reduced_mass, scaling.energy - far + scaling.time - speed)
            accelerations = [m.number(size) * x for x in attracting.force]
            torque = along_axes(m, 1, 0, attracting.torques[1])
        if (tides := self._tides(m)) is not None:
            accelerations = [x + y for x, y in zip(accelerations, tides.acceleration, strict=True)]
            torque = [*torque, *tides.torque]
        unit = context.ldexp(context.one, turning + scaling.time)
        derivatives = [ratio * v for v in seen.velocity] + accelerations
        derivatives += quaternion_kinematics(seen.quaternion, seen.rates)
        derivatives += seen.inertia.accelerations(seen.rate_states, [unit] * 3, torque)
        initial = [context.ldexp(x, -far) for x in start.position]
        initial += [context.ldexp(x, -speed) for x in start.velocity]
        initial += [*start.quaternion, *(context.ldexp(x, -turning) for x in start.rates)]
        exponents = [far] * 3 + [speed] * 3 + [0] * 4 + [turning] * 3
        each = [*names.position, *names.velocity, *names.quaternion, *names.rates]
        why = f"{self.title}: place and velocity from [body], attitude and rates"
        return StateBlock(each, derivatives, initial, exponents=exponents, why=why)

    # --- its momentum and energy ----------------------------------------------------------------------------

    def carried_momentum(self, m: Kinematics) -> list[Term]:
        """R_A^T (R_B I_B w_B + m r x r')."""
        seen, (far, speed, _) = self.seen(m), self.units(m.scene)
        size = m.scaled(self.reduced_mass, far + speed - m.scaling.momentum)
        orbital = cross(seen.place, seen.velocity)
        whole = [
            size * x + hy.sum([r * h for r, h in zip(row, seen.momentum, strict=True)])
            for x, row in zip(orbital, seen.matrix, strict=True)
        ]
        return along_axes(m, m.scene.context.one, 0, m.seen(whole))

    def carried_energy(self, m: Kinematics) -> Symbolic:
        seen, (_, speed, _) = self.seen(m), self.units(m.scene)
        half = m.scaled(self.reduced_mass / 2, 2 * speed - m.scaling.energy)
        turning = seen.inertia.energy(seen.rates, seen.momentum)
        return turning + half * hy.sum([v * v for v in seen.velocity])

    def exerted_torque(self, m: Kinematics) -> list[Term]:
        attracting = self.seen(m).attracting
        return [] if attracting is None else along_axes(m, m.scene.context.one, 0, attracting.torques[0])

    def supplied_power(self, m: Kinematics) -> Symbolic | None:
        """Of distant sources on its rotation and on the orbit."""
        tides, seen, (_, speed, _) = self._tides(m), self.seen(m), self.units(m.scene)
        if tides is None:
            return None
        moving = m.scaled(self.reduced_mass, 2 * speed - m.scaling.energy)
        terms = [moving * a * v for a, v in zip(tides.acceleration, seen.velocity, strict=True)]
        for vector, expression in tides.torque:
            pairs = zip(vector, seen.rates, strict=True)
            terms.append(expression * hy.sum([m.number(x) * w for x, w in pairs if x != 0]))
        return hy.sum(terms)

    def _tides(self, m: Kinematics) -> Tides | None:
        key = "tides", self.name
        if key not in m.cache:
            seen, (far, speed, _) = self.seen(m), self.units(m.scene)
            states = Second(self.states, self.body, seen.place, seen.quaternion, seen.matrix, far, speed)
            m.cache[key] = tides_on(states, m)
        found: Tides | None = m.cache[key]
        return found

    def carried_at_start(self, scene: Scene) -> tuple[Vector, Any]:
        start, moving = self.start, cross(self.start.position, self.start.velocity)
        spin = apply(self.body.inertia, start.rates)
        turned = apply(attitude.rotation_matrix(start.quaternion), spin)
        whole = [self.reduced_mass * x + y for x, y in zip(moving, turned, strict=True)]
        energy = self.reduced_mass * dot(start.velocity, start.velocity) + dot(start.rates, spin)
        return apply(transpose(attitude.rotation_matrix(scene.quaternion)), whole), energy / 2

    def pictured(self) -> dict[str, Any]:
        return {"what": "rigid_body", "name": self.name, "drawing": self.body.drawing}

    # --- from the config ------------------------------------------------------------------------------------

    @classmethod
    def resolve(cls, fields: RigidBodyTable, around: Setting) -> SecondBody:
        config, context = around.config, around.context
        _refuse_what_one_body_has(around)
        body = _built(fields, around)
        ensure(around.body.mass is not None, ConfigError(Problem("[body] mass", _NO_MASS)))
        ensure(body.mass is not None, around.fault("mass", _NO_MASS))
        places = [n for n, load in enumerate(config.loads) if isinstance(load, MutualGravityFields)]
        pair = None
        if places:
            degree, figures = config.loads[places[0]].degree, []
            for one, name in ((around.body, "[body]"), (body, f'"{fields.name}"')):
                figure = Figure.of(one, degree, context)
                if figure is None:
                    raise around.at("loads", places[0]).fault(
                        "degree",
                        f"given {degree}, but {name} has no moments of degree {degree}: give it a "
                        "gravity_field to that degree, or as points, an ellipsoid, a cuboid or parts of "
                        "these; degree = 2 takes the tensor of inertia alone",
                    )
                figures.append(figure)
            pair = Pair((figures[0], figures[1]), degree, context)
        made = cls(fields.name, body, around.body, pair, _started(fields, around, pair), around.where(""))
        what = (
            "has a spin about the axis that has no moment of inertia, where a spin means nothing; make that "
        )
        whole = f"{what}component zero"
        ensure(not along_massless(body, made.start.rates), around.fault("angular_velocity", whole))
        return made


_NO_MASS = "missing; two bodies need both masses, which decide how far each moves"
_ALLOWED = ("mutual_gravity", "gravity_gradient", "torque", "viscous_torque")


def _refuse_what_one_body_has(around: Setting) -> None:
    """Refuse what acts on one body where the other one, or the orbit, would feel it as well."""
    config = around.config
    for key in ("core", "elasticity"):
        what = f"given with [[{_TABLE}]], whose bodies are rigid; remove one of them"
        ensure(getattr(config.body, key) is None, ConfigError(Problem(f"[body] {key}", what)))
    what = f"given with [[{_TABLE}]], whose positions are relative to [body]; "
    ensure(not config.initial.flies, ConfigError(Problem("[initial] position", f"{what}remove it")))
    what = f"given with [[{_TABLE}]]; point masses don't attract two bodies yet: remove one of both"
    ensure(not config.bodies, ConfigError(Problem("[[bodies]]", what)))
    what = f"turns about another point than its centre of mass, the centre for [[{_TABLE}]]; remove this key"
    key = "reference" if config.body.center_of_mass is None else "center_of_mass"
    ensure(all(x == 0 for x in around.body.center_of_mass), ConfigError(Problem(f"[body] {key}", what)))
    for number, load in enumerate(config.loads):
        what = f'given "{load.kind}", which would act on [body] alone; '
        what += f"with [[{_TABLE}]] allowed: {', '.join(_ALLOWED)}"
        here = around.at("loads", number)
        ensure(load.kind in _ALLOWED, here.fault("kind", what))
        if isinstance(load, MutualGravityFields):
            continue
        beside = [key for key in LOADS["beside"] if getattr(load, key, None) not in (None, 2)]
        what = f"given with [[{_TABLE}]]; distant sources act on both tensors of inertia alone: remove it"
        if beside:
            raise here.fault(beside[0], what)


def _built(fields: RigidBodyTable, around: Setting) -> RigidBody:
    """The body of a table, whose faults name it."""
    for axis, moment in enumerate(fields.principal_moments or ()):
        what = f'given "{moment}"; a number is allowed, since mass moves in [body] alone'
        ensure(isinstance(moment, ExactNumber), around.fault(f"principal_moments[{axis}]", what))
    given = {key: getattr(fields, key) for key in Matter.model_fields}
    try:
        return whole_body(Body.model_construct(**given), around.config, around.context)
    except ConfigError as error:
        here = around.where("")
        found = [
            Problem(x.where.replace("[body]", here), x.what.replace("[body]", here)) for x in error.problems
        ]
        raise ConfigError(found) from None


def _started(fields: RigidBodyTable, around: Setting, pair: Pair | None) -> Start:
    context = around.context
    what = "missing; give the body's rates, or an equilibrium"
    known = fields.angular_velocity is not None or fields.equilibrium is not None
    ensure(known, around.fault("angular_velocity", what))
    sequence = around.config.integrator.euler_sequence
    given = attitude.given_attitude(context, fields, sequence, around.fault)
    quaternion = [context.one] + [context.zero] * 3 if given is None else given[0]
    place, velocity = numbers(context, fields.position), numbers(context, fields.velocity)
    if fields.orbit is not None:
        what = (
            'given without a load of kind = "mutual_gravity", which moves bodies on orbits; add it, or give '
        )
        if pair is None:
            raise around.fault("orbit", f"{what}position and velocity")
        place, velocity = start_of_elements(fields.orbit, pair.strength, context)
    what = "missing, or zero, the place of [body]; give its position relative to [body], or an orbit"
    ensure(any(x != 0 for x in place), around.fault("position", what))
    return Start(place, velocity, quaternion, numbers(context, fields.angular_velocity))


def second_body(scene: Scene) -> SecondBody | None:
    """The second body of a scene; None without one."""
    return next((load for load in scene.tabled.get(_TABLE, ()) if isinstance(load, SecondBody)), None)


# --- the load -----------------------------------------------------------------------------------------------


class MutualGravityFields(LoadFields):
    """Mutual gravity of all rigid bodies."""

    kind: Literal["mutual_gravity"]
    degree: Literal[2, 3, 4] = Field(2, examples=[4])
    """highest total degree of the moments of both bodies: 2 (their tensors of inertia), 3 or 4"""


@register_load
@dataclass(frozen=True)
class MutualGravity(Load):
    """The potential; force and torques are in the equations of the second body."""

    degree: int
    Fields = MutualGravityFields
    title = "mutual_gravity"
    conservative = True
    wide = True  # unrolled it takes 10 to 60 s to compile, and its steps are hardly faster
    reads = frozenset({"attitude"})

    @classmethod
    def resolve(cls, fields: MutualGravityFields, around: Setting) -> MutualGravity:
        what = (
            f"given without [[{_TABLE}]]; it acts between two bodies: add a second body, or remove this load"
        )
        ensure(around.config.rigid_bodies, around.fault("kind", what))
        kinds = [load.kind for load in around.config.loads[: around.number]]
        ensure(
            fields.kind not in kinds,
            around.fault("kind", "given twice; give one for all bodies"),
        )
        return cls(fields.degree)

    def potential(self, m: Kinematics) -> Symbolic | None:
        second = second_body(m.scene)
        attracting = None if second is None else second.seen(m).attracting
        return None if attracting is None else attracting.potential

    def amplitude(self, scene: Scene) -> Any:
        return scene.context.zero

    def cautions(self, fields: Any, where: str, scene: Scene) -> Iterator[Caution]:
        second = required(second_body(scene))
        (least, _), reach = second.reach(scene), sum(max(axes) for axes in second.semi_axes)
        if plain(least) < plain(reach):
            near, far = (length_text(float(plain(x))) for x in (least, reach))
            text = (
                f"the bodies come to about {near} from each other, less than the sum of their longest half "
            )
            text += f"axes, {far}, where the series of the mutual gravity may diverge; let them stay apart"
            yield Caution(WarningCode.SERIES_DIVERGES, f"{where} degree: {text}")
