"""Equilibria of two rigid bodies: circular orbits on which one or both show the same side to the other.

In axes that turn at the rate W = w n about the normal n of the orbit, with place x and velocity v of B seen
from A, and the momenta h of the bodies, all along these axes,

    x' = v - W x x,    v' = F / m - W x v,    h' = T - W x h,

everything rests but a first body that spins about an axis of symmetry along n. The distance is given; w, the
attitudes, and how far the orbit is above the equator, are found by Newton's method in the arithmetic of the
scene. Kepler's rate is no equilibrium: the figures attract as well.

A first body that spins, but isn't symmetric about its axis, is replaced by its mean over a turn, which a few
equal turns give exactly, since the potential to degree 4 has no higher harmonics of the turn. The motion then
begins near the equilibrium of that mean.

The exponents are eigenvalues of the equations above, with d' = (change of the rate) + s x d for a body that
is turned by d and spins at s relative to the axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from rigidsim.errors import ensure, required
from rigidsim.model.harmonics import turning
from rigidsim.model.loads.rigid_bodies import Attracting, SecondBody, second_body
from rigidsim.model.loads.tides_on_pairs import sources_of
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import (
    Matrix,
    Vector,
    across,
    apply,
    cross,
    dot,
    minus,
    multiply,
    norm,
    plus,
    transpose,
    working_bits,
)
from rigidsim.scene.bodies.body import RigidBody, inverse_inertia
from rigidsim.scene.scene import Scene
from rigidsim.scene.starts import STARTS, InitialRotation
from rigidsim.solve.equilibria import Newton, NoEquilibrium, Pose, jacobian, listed, once, turned
from rigidsim.store.summary import FoundStart

_SPARE_BITS = 48
_TURNS = 5
"""Equal turns whose mean is the mean over all, for harmonics of the turn to degree 4."""
_STILL = 1e-6
"""Part of the orbit's rate below which a part of an exponent is zero: double zeros lose half of their digits.
"""
_LEVEL = "1e-9"
"""Part of the distance by which the place may be out of the equator of ``[body]``."""


@dataclass(frozen=True)
class _Resting:
    """Rate of the axes (rad/s), place of B (m), and rotation matrices of the bodies."""

    rate: Any
    place: Vector
    turns: tuple[Matrix, Matrix]


@dataclass(frozen=True)
class _Axes:
    """Equations in turning axes, which are along the space axes at the start.

    Attributes:
        spins: of the bodies relative to the axes, rad/s.
        averaged: whether A is its mean over a turn about the normal.
    """

    context: Any
    second: SecondBody
    normal: Vector
    spins: tuple[Vector, Vector]
    averaged: bool

    @property
    def bodies(self) -> tuple[RigidBody, RigidBody]:
        return self.second.first, self.second.body

    def _pulls(self, place: Vector, turns: Sequence[Matrix]) -> tuple[Vector, Vector, Vector]:
        """Force on B and torques on both, in the axes."""
        context, far = self.context, norm(self.context, place)
        line, copies = [x / far for x in place], [turns[0]]
        if self.averaged:
            angles = [2 * context.pi * k / _TURNS for k in range(_TURNS)]
            copies = [multiply(turned(context, [a * x for x in self.normal]), turns[0]) for a in angles]
        found = [[context.zero] * 3 for _ in range(3)]
        for copy in copies:
            both = copy, turns[1]
            seen = Attracting(
                required(self.second.pair),
                line,
                1 / far,
                both,
                context.one,
                context.one,
                lambda x: x,
                exact=True,
            )
            torques = [apply(turn, torque) for turn, torque in zip(both, seen.torques, strict=True)]
            found = [plus(x, y) for x, y in zip(found, (seen.force, *torques), strict=True)]
        force, one, other = ([x / len(copies) for x in vector] for vector in found)
        return force, one, other

    def momentum(self, which: int, turn: Matrix, rate: Vector) -> Vector:
        """R I R^T w."""
        return apply(turn, apply(self.bodies[which].inertia, apply(transpose(turn), rate)))

    def slopes(
        self,
        at: _Resting,
        place: Vector,
        velocity: Vector,
        turns: Sequence[Matrix],
        momenta: Sequence[Vector],
    ) -> list[tuple[Vector, Vector]]:
        """Derivatives of place and velocity, and of each body the change of its rate, and h'."""
        about = [at.rate * x for x in self.normal]
        force, *torques = self._pulls(place, turns)
        mass = self.second.reduced_mass
        found = [
            (minus(velocity, cross(about, place)), minus([x / mass for x in force], cross(about, velocity)))
        ]
        for which, (turn, h, torque) in enumerate(zip(turns, momenta, torques, strict=True)):
            inverse = inverse_inertia(self.context, self.bodies[which])
            rate = apply(turn, apply(inverse, apply(transpose(turn), h)))
            off = minus(minus(rate, about), self.spins[which])
            found.append((off, minus(torque, cross(about, h))))
        return found

    def at_rest(self, at: _Resting, first: bool) -> Vector:
        """What has to vanish, over its size; of A only if it rests, too."""
        about = [at.rate * x for x in self.normal]
        rates = [plus(about, spin) for spin in self.spins]
        momenta = [
            self.momentum(k, turn, rate) for k, (turn, rate) in enumerate(zip(at.turns, rates, strict=True))
        ]
        (_, pulled), *turning_ = self.slopes(at, at.place, cross(about, at.place), at.turns, momenta)
        size = at.rate**2 * norm(self.context, at.place)
        found = [x / size for x in pulled]
        for which, (_, change) in enumerate(turning_):
            heaviest = self.context.maximum(self.bodies[which].principal_moments)
            found += [x / (at.rate**2 * heaviest) for x in change] if which or first else []
        return found

    def linear(self, at: _Resting, bits: int, first: bool) -> Matrix:
        """Matrix of the equations about it, in units of its rate; without A unless it has a part."""
        context, far, about = self.context, norm(self.context, at.place), [at.rate * x for x in self.normal]
        bodies = (0, 1) if first else (1,)
        heaviest = [context.maximum(body.principal_moments) for body in self.bodies]
        resting = [self.momentum(k, at.turns[k], plus(about, self.spins[k])) for k in (0, 1)]

        def moving(x: Vector) -> Vector:
            turns, momenta = list(at.turns), list(resting)
            for n, k in enumerate(bodies):
                turns[k] = multiply(turned(context, x[6 + 6 * n : 9 + 6 * n]), turns[k])
                size = at.rate * heaviest[k]
                momenta[k] = [
                    h + size * y for h, y in zip(momenta[k], x[9 + 6 * n : 12 + 6 * n], strict=True)
                ]
            place = [a + far * b for a, b in zip(at.place, x[:3], strict=True)]
            swift = far * at.rate
            velocity = [a + swift * b for a, b in zip(cross(about, at.place), x[3:6], strict=True)]
            (dx, dv), *others = self.slopes(at, place, velocity, turns, momenta)
            found = [y / swift for y in dx] + [y / (swift * at.rate) for y in dv]
            for n, k in enumerate(bodies):
                off, change = others[k]
                slewed = cross(self.spins[k], x[6 + 6 * n : 9 + 6 * n])
                found += [(a + b) / at.rate for a, b in zip(off, slewed, strict=True)]
                found += [y / (at.rate**2 * heaviest[k]) for y in change]
            return found

        return jacobian(context, moving, 6 + 6 * len(bodies), bits)


def pair_equilibrium(scene: Scene, name: str, *, both: bool) -> InitialRotation:
    """The equilibrium at the distance of B, nearest to the attitudes given.

    Raises:
        ConfigError: there is none, or none was found.
    """
    second = required(second_body(scene))
    return once(name, partial(_found, second=second, name=name, both=both), scene, second.fault)


def _found(scene: Scene, second: SecondBody, name: str, both: bool) -> InitialRotation:
    context, pair, pole = scene.context, second.pair, scene.figure.pole
    ensure(pair is not None, NoEquilibrium('there is no load of kind = "mutual_gravity"'))
    carried = [load.title for load in scene.loads if load.inner_momentum is not None]
    ensure(not carried, NoEquilibrium(f"{', '.join(carried)} carries momentum in [body]"))
    spin = scene.angular_velocity
    still = both or all(x == 0 for x in spin)
    if not still and norm(context, cross(pole, spin)) > context.mpf(_LEVEL) * norm(context, spin):
        raise NoEquilibrium("[body] doesn't turn about its figure axis")
    turn = attitude.rotation_matrix(scene.quaternion)
    normal = apply(turn, pole if dot(pole, spin) >= 0 else [-x for x in pole])
    place, far = second.start.position, norm(context, second.start.position)
    high = abs(dot(place, normal)) / far
    if high > context.mpf(_LEVEL):
        degrees = context.nstr(context.degrees(context.asin(high)), 4)
        raise NoEquilibrium(f"its place is {degrees} deg out of the equator of [body], in which it orbits")
    flat = minus(place, [dot(place, normal) * x for x in normal])
    first = [x / norm(context, flat) for x in flat]
    rate = context.sqrt(required(pair).strength / far**3)
    field = turning(required(pair).figures[0].series, context).values()
    symmetric = all(across(context, x, pole) for x in field)
    turns = [
        _towards(context, body, matrix, first, normal) if moved else matrix
        for body, matrix, moved in (
            (second.first, turn, both),
            (second.body, attitude.rotation_matrix(second.start.quaternion), True),
        )
    ]
    none = [context.zero] * 3
    axes = _Axes(context, second, normal, (none, none), averaged=not (both or symmetric))
    bits = min(context.prec, working_bits(scene.config.integrator.precision) + _SPARE_BITS)

    def moved(at: _Resting, step: Vector) -> _Resting:
        w, up, *rest = step
        height = dot(at.place, normal) / far + up
        there = [
            far * (context.sqrt(1 - height**2) * x + height * y) for x, y in zip(first, normal, strict=True)
        ]
        matrices = [
            multiply(turned(context, rest[3 * n : 3 * n + 3]), m)
            for n, m in enumerate((at.turns[1], at.turns[0])[: 1 + both])
        ]
        one = matrices[1] if both else at.turns[0]
        return _Resting(at.rate * (1 + w), there, (one, matrices[0]))

    begun = _Resting(rate, [far * x for x in first], (turns[0], turns[1]))
    newton = Newton(context, bits, lambda at: axes.at_rest(at, both), moved, 5 + 3 * both)
    at = newton.settled(begun)
    if not both:  # its spin, which has no part in finding the others
        about = [at.rate * x for x in normal]
        axes = replace(axes, spins=(minus(apply(turn, spin), about), none))
    matrix, pace = axes.linear(at, bits, both or symmetric), float(at.rate)
    values = np.linalg.eigvals(np.array(matrix, dtype=float))
    exponents, stable = listed(pace * values, pace * _STILL)
    hours = context.nstr(2 * context.pi / at.rate / 3600, 12)
    mean = (
        "; of [body] the mean over a turn counts, which isn't symmetric about its axis"
        if axes.averaged
        else ""
    )
    mean += "; distant sources aren't part of it" if sources_of(scene) else ""
    found = FoundStart(
        name=name,
        described=f"{name} equilibrium, {context.nstr(at.rate, 18)} rad/s, a turn in {hours} h: "
        f"{'stable' if stable else 'unstable'}{mean}",
        how="by Newton's method on the full equations, of which it is an exact solution"
        if not mean
        else "by Newton's method on the equations without what doesn't rest",
        exponents=exponents,
        stable=stable,
    )
    return _started(scene, axes, at, found, bits, both)


def _started(
    scene: Scene, axes: _Axes, at: _Resting, found: FoundStart, bits: int, both: bool
) -> InitialRotation:
    """The start of both bodies; what is smaller than the bits is the rounding of a zero."""
    context, about = scene.context, [at.rate * x for x in axes.normal]

    def plain(vector: Vector) -> Vector:
        least = context.ldexp(norm(context, vector), 8 - bits)
        return [x if abs(x) > least else context.zero for x in vector]

    poses = [Pose(turn, apply(transpose(turn), about)).start(context, bits, found) for turn in at.turns]
    velocity = cross(about, at.place)
    partner = [plain(at.place), plain(velocity), poses[1].quaternion, required(poses[1].angular_velocity)]
    if both:
        return replace(poses[0], partner=partner)
    return InitialRotation(scene.quaternion, scene.angular_velocity, found=found, partner=partner)


def _towards(context: Any, body: RigidBody, given: Matrix, line: Vector, normal: Vector) -> Matrix:
    """The rotation matrix, nearest to a given one, with the axis of least moment along a line and the one of
    largest along the normal.
    """
    low, _, high = sorted(range(3), key=lambda k: body.principal_moments[k])
    long, polar = body.principal_axes[low], body.principal_axes[high]
    own = [long, cross(polar, long), polar]
    best: tuple[Any, Matrix] | None = None
    for ahead, up in product((1, -1), repeat=2):
        x, z = [ahead * a for a in line], [up * a for a in normal]
        there = [x, cross(z, x), z]
        matrix = multiply(transpose(there), own)
        alike = sum(dot(a, b) for a, b in zip(matrix, given, strict=True))
        if best is None or alike > best[0]:
            best = alike, matrix
    return required(best)[1]


STARTS["synchronous"] = partial(pair_equilibrium, name="synchronous", both=False)
STARTS["doubly_synchronous"] = partial(pair_equilibrium, name="doubly_synchronous", both=True)
