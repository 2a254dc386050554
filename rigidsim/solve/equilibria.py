"""Starts in an equilibrium, found by the scene's own equations, each once in a process for one config and
precision: relative equilibria and Cassini states. Importing this enters them into ``rigidsim.scene.starts``.

They are found with a scene's motion from any attitude and rates, in arithmetic of any width, Newton's method
with central differences, for few unknowns that may be degenerate, and exponents by which motions near a zero
go on.

The equations are a run's, with the attitude in space axes. They are compiled once for each width and
evaluated or integrated from where the caller says; what surrounds the rotation (orbits) begins where the
scene has it. Numbers go in and out as mpf.

**Relative equilibria**: a body at rest in the frame that turns with a circular orbit.

With the orbit's rate n and normal o the body turns at w = n o, and its equations leave w' = 0 in body axes at
24 attitudes under the gradient alone: each principal axis along the source's direction, the orbit's normal,
or forward (Lagrange 1780; Hughes, Spacecraft Attitude Dynamics, 1986, ch. 9). With other loads that rest in
the turning frame, or momentum in the body, Newton's method leads from one of these to the nearby zero.

With the least axis towards the source and the largest along the normal the dynamic potential is least, and
the equilibrium is stable (Lagrange); others may be held by gyroscopic torques alone (DeBra and Delp 1961, J.
Astronaut. Sci. 8, 14). The exponents are eigenvalues of

    d' = v + d x w,    v' = (df/dd) d + (df/dw) v

for a turn d and a change v of the rates, both along body axes, and w' = f(attitude, w).

**Cassini states**: motions that are the same after each revolution, in the frame that turns with the node.

Averaged equations say where the state is (``averaged_states``). The full equations have a motion near it
that is periodic in the node's frame: with the orbit at the same place after T, Newton's method finds the pose
that comes back, turned with the node (and, for A = B, about the figure axis by any angle). It has no free
libration. T is one revolution from pericentre to pericentre, two for a half-odd number of turns; if apsides
turn on an eccentric orbit, so many revolutions as they need to come back, on an orbit whose apsides turn at
the nearest such rate, and for slow ones with the apsides at rest. Eigenvalues of the map over T are exp(x T)
with the exponents x of the stability, whose imaginary part is known but for multiples of 2 pi / T.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import permutations, product
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError
from rigidsim.model.load import Load, loads_of
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import (
    Matrix,
    Vector,
    apply,
    cross,
    dot,
    multiply,
    negligible,
    norm,
    parallel,
    transpose,
    working_bits,
)
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.starts import ATTITUDES, STARTS, InitialRotation, refusal, spin_rate
from rigidsim.scene.swept import SweptContext, Untraceable
from rigidsim.solve.from_states import AnyStart
from rigidsim.solve.precision import Precision, precision_of
from rigidsim.store.summary import FoundStart

Function = Callable[[Vector], Vector]
_SPARE_BITS = 48
"""Bits beyond the run's own: what a nearly singular Jacobian loses, and some to round once."""
_STEPS = 200_000
_ROUNDS = 40
_PATIENCE = 4
"""Rounds without gain: where some directions count far less than others, they lead on all the same."""
_POOR = 0.1  # part of a residual that a step with a good Jacobian doesn't leave
_STILL = 1e-9


class NoEquilibrium(Exception):
    """Why a scene has none, or none is found; goes on from ``given "name", but``."""


@dataclass(frozen=True)
class Pose:
    """Rotation matrix, body to space axes, and angular velocity (body axes, rad/s); mpf."""

    matrix: Matrix
    rates: Vector

    def moved(self, context: Any, turn: Vector, change: Vector) -> Pose:
        """The pose turned by a rotation vector (body axes) and with other rates."""
        rates = [w + x for w, x in zip(self.rates, change, strict=True)]
        return Pose(multiply(self.matrix, turned(context, turn)), rates)

    def start(self, context: Any, bits: int, found: FoundStart) -> InitialRotation:
        """The start that it is, found in so many bits: what is smaller is the rounding of a zero."""
        quaternion = attitude.quaternion_from_matrix(context, self.matrix)
        size, least = norm(context, self.rates), context.ldexp(1, 8 - bits)
        plain = [x if abs(x) > least else context.zero for x in quaternion]
        rates = [w if abs(w) > least * size else context.zero for w in self.rates]
        return InitialRotation(attitude.unit_quaternion(context, plain), rates, found=found)


def turned(context: Any, vector: Vector) -> Matrix:
    """Rotation matrix (mpf) of a rotation vector."""
    angle = context.sqrt(sum(x * x for x in vector))
    half = context.sin(angle / 2) / angle if angle else context.mpf(0.5)
    return attitude.rotation_matrix([context.cos(angle / 2), *(half * x for x in vector)])


def widths(scene: Scene) -> list[Precision]:
    """Arithmetics in which an equilibrium is found one after the other, the last beyond the run's own."""
    bits = working_bits(scene.config.integrator.precision) + _SPARE_BITS
    found = [precision_of("double"), precision_of("quadruple")]
    if bits > found[-1].bits:
        found.append(Precision(f"{bits} bits", bits, hy.real, cheap=False, compact=True))
    return found


class PoseMotion(AnyStart):
    """The motion of a scene in one arithmetic; what else is in it, such as rotors, starts near a pose."""

    def __init__(self, scene: Scene, precision: Precision, pose: Pose | None = None) -> None:
        model = scene.config.model.model_copy(update={"level": "full", "short_period": False})
        scene = replace(scene, config=scene.config.model_copy(update={"model": model}))
        if pose is not None:
            quaternion = attitude.quaternion_from_matrix(scene.context, pose.matrix)
            scene = replace(scene, quaternion=quaternion, angular_velocity=pose.rates)
        super().__init__(scene, precision, compact=True)
        self.context = scene.context

    @cached_property
    def _exponents(self) -> list[int]:
        return [self._system.state_exponents[place] for place in self._places[4:]]

    def _state(self, pose: Pose) -> np.ndarray:
        context, values = self.context, list(self._system.initial)
        quaternion = attitude.quaternion_from_matrix(context, pose.matrix)
        scaled = [context.ldexp(w, -e) for w, e in zip(pose.rates, self._exponents, strict=True)]
        for place, value in zip(self._places, [*quaternion, *scaled], strict=True):
            values[place] = value
        return self.precision.array(values)

    def _exact(self, values: Iterable[Any]) -> Vector:
        return [self.context.make_mpf(self.precision.exact(x)._mpf_) for x in values]

    def acceleration(self, pose: Pose) -> tuple[Vector, dict[str, Any]]:
        """Derivatives at the start: of the rates (body axes, rad/s^2), and by name of other states, in
        internal units.
        """
        time, names = self._system.scaling.time, self._system.states
        options = {"time": self._start} if self._derivatives.is_time_dependent else {}
        slopes = self._exact(np.asarray(self._derivatives(self._state(pose), **options)))
        rates = [
            self.context.ldexp(slopes[place], e - time)
            for place, e in zip(self._places[4:], self._exponents, strict=True)
        ]
        return rates, {name: slopes[names.index(name)] for name in self.others}

    def after(self, pose: Pose, seconds: Any) -> Pose:
        """The pose so many seconds (mpf) after the start. Raises ``NoEquilibrium``."""
        engine, context = self._engine, self.context
        engine.time = self._start
        engine.state[:] = self._state(pose)
        until = self._exact_start + context.ldexp(seconds, -self._system.scaling.time)
        outcome, *_ = engine.propagate_until(self.precision.number(until), max_steps=_STEPS)
        if outcome != hy.taylor_outcome.time_limit:
            raise NoEquilibrium("the motion near it ends")
        state = self._exact([engine.state[place] for place in self._places])
        rates = [context.ldexp(w, e) for w, e in zip(state[4:], self._exponents, strict=True)]
        quaternion = attitude.unit_quaternion(context, state[:4])
        return Pose(attitude.rotation_matrix(quaternion), rates)


# --- Newton's method ---------------------------------------------------------------------------------------


def jacobian(context: Any, function: Function, count: int, bits: int) -> Matrix:
    """Jacobian (rows of outputs) at zero of a function known to so many bits, to two thirds of them."""
    step = context.ldexp(1, -(bits // 3))
    columns = []
    for i in range(count):
        ahead, behind = (
            function([sign * step if j == i else context.zero for j in range(count)]) for sign in (1, -1)
        )
        columns.append([(a - b) / (2 * step) for a, b in zip(ahead, behind, strict=True)])
    return [list(row) for row in zip(*columns, strict=True)]


def shortest(context: Any, matrix: Matrix, values: Vector, bits: int) -> Vector:
    """The shortest x with matrix x = -values, as far as there is one (Moore and Penrose).

    Directions whose singular value, relative to the largest, is below half of so many bits are left alone:
    they lead from one of many equilibria to the next.
    """
    count = len(matrix[0])
    a = context.matrix(matrix)
    sizes, vectors = context.eigsy(a.T * a)
    right = a.T * context.matrix(values)
    least = max(sizes[k] for k in range(count)) * context.ldexp(1, -bits)
    found = [context.zero] * count
    for k in range(count):
        if sizes[k] > least:
            part = sum(vectors[i, k] * right[i] for i in range(count)) / sizes[k]
            found = [x - part * vectors[i, k] for i, x in enumerate(found)]
    return found


@dataclass(frozen=True)
class Newton:
    """Newton's method for a residual of so many bits, which keeps its Jacobian while steps gain by it.

    Attributes:
        residual: of a point.
        moved: the point that a step leads to.
        unknowns: their number.
    """

    context: Any
    bits: int
    residual: Callable[[Any], Vector]
    moved: Callable[[Any, Vector], Any]
    unknowns: int

    @property
    def uncertainty(self) -> Any:
        """Of eigenvalues of a Jacobian whose elements are about 1, at a point that is nearly the zero."""
        return max(self.context.ldexp(16, -(2 * self.bits // 3)), self.context.mpf(_STILL))

    def slope(self, at: Any) -> Matrix:
        """Jacobian at a point."""
        return jacobian(
            self.context, lambda step: self.residual(self.moved(at, step)), self.unknowns, self.bits
        )

    def settled(self, at: Any, slope: Matrix | None = None) -> Any:
        """Follow steps from a point until they gain no more: a zero, as far as the residual's bits show.

        Args:
            slope: the Jacobian near the point, if it is known.

        Raises:
            NoEquilibrium: steps make the residual no smaller while it is still large.
        """
        context = self.context
        best, least, size, worse = at, context.inf, context.inf, 0
        for _ in range(_ROUNDS):
            here, before = self.residual(at), size
            size = norm(context, here)
            if size < least:
                best, least, worse = at, size, 0
            elif (worse := worse + 1) >= _PATIENCE:
                break
            if size <= context.ldexp(1, 16 - self.bits):
                break
            if slope is None or (before < context.inf and size > _POOR * before):
                slope = self.slope(at)
            at = self.moved(at, shortest(context, slope, here, self.bits))
        if least > context.ldexp(1, -self.bits // 2):
            raise NoEquilibrium("near it nothing is at rest")
        return best


# --- what becomes of small displacements ------------------------------------------------------------------


def exponents_of(
    context: Any, matrix: Matrix, still: Any, period: Any | None = None, nutation: Any | None = None
) -> tuple[tuple[tuple[float, float], ...], bool]:
    """Exponents (1/s) of a linear system's matrix, or of its map over a period (s), as of ``FoundStart``, and
    whether none grows.

    Args:
        still: uncertainty of the exponents, 1/s, below which a part of one is zero.
        nutation: angle (rad) of a fast nutation over the period, many turns of it, which is left out.
    """
    values, _ = context.eig(context.matrix(matrix))
    values = list(values)
    for angle in () if nutation is None else (nutation, -nutation):
        turned = context.expj(angle)
        values.remove(min(values, key=lambda value: abs(value - turned)))
    if period is not None:
        values = [context.log(value) / period for value in values]
    return listed(values, still)


def listed(values: Iterable[Any], still: Any) -> tuple[tuple[tuple[float, float], ...], bool]:
    """Exponents as ``exponents_of`` gives them."""
    found = []
    for value in values:
        real, imaginary = (0.0 if abs(x) <= still else float(x) for x in (value.real, value.imag))
        if imaginary >= 0:
            found.append((real, imaginary))
    found.sort(key=lambda pair: (pair[1], pair[0]))
    return tuple(found), all(real <= 0 for real, _ in found)


# --- relative equilibria ------------------------------------------------------------------------------------

_STILL_RATE = 1e-9
"""Part of the orbit's rate below which a part of an exponent is zero: equal ones lose half of theirs."""
_AT = 1e-9  # rad from one of the 24 attitudes
_FAR = 1.0  # rad from the attitude that Newton's method begins at
_LATER = "0.3819660112501051"  # of a revolution, at which loads that rest in the frame are the same
_RESTS = "1e-12"  # part of the orbit's rate squared, or rate of a state, that counts as rest
_NAMES = ("the axis of least moment", "the middle axis", "the axis of largest moment")


def relative_equilibrium(scene: Scene) -> InitialRotation:
    """The relative equilibrium nearest to the attitude given, or without one the stable one.

    Raises:
        NoEquilibrium: the scene has none, or none was found.
    """
    context, orbit, precision = scene.context, _orbit(scene), widths(scene)[-1]
    frame = _frame(orbit, context, scene.start)
    rates = [orbit.mean_motion * x for x in frame[2]]
    begun, order = _nearest(scene, frame)

    def pose(matrix: Matrix) -> Pose:
        return Pose(matrix, apply(transpose(matrix), rates))

    def residual(at: Pose) -> Vector:
        return [x / orbit.mean_motion**2 for x in here.acceleration(at)[0]]

    def moved(at: Pose, turn: Vector) -> Pose:
        return pose(at.moved(context, turn, [context.zero] * 3).matrix)

    found, size = pose(begun), context.inf
    for _ in range(_ROUNDS):  # momenta of rotors in the equations depend on the rates that they begin with
        here, before = PoseMotion(scene, precision, found), size
        if not here.plain:
            raise NoEquilibrium("a load has a kink or jump, or happens at a moment")
        size = norm(context, residual(found))
        if size <= context.ldexp(1, 24 - precision.bits) or size >= before:
            break
        try:
            found = Newton(context, precision.bits, residual, moved, 3).settled(found)
        except NoEquilibrium:
            what = "none was found near that attitude; give another one to begin at"
            raise NoEquilibrium(what) from None
    w, *vector = attitude.quaternion_from_matrix(context, multiply(transpose(begun), found.matrix))
    away = 2 * context.atan2(norm(context, vector), abs(w))
    degrees = context.nstr(context.degrees(away), 4)
    if away > _FAR:
        what = (
            f"the nearest one is {degrees} deg from where the gradient alone has one: the other loads are too"
        )
        raise NoEquilibrium(f"{what} strong")
    _refuse_passing(scene, precision, orbit, found, here)
    matrix = _linear(context, here, found, precision.bits)
    exponents, stable = exponents_of(context, matrix, orbit.mean_motion * context.mpf(_STILL_RATE))
    first, _, last = (_NAMES[k] for k in order)
    near, said = f"{degrees} deg from ", "stable" if stable else "unstable"
    how = "by Newton's method on the full equations, of which it is an exact solution"
    if away < _AT:
        near, how = "", "as one of the gradient's 24 attitudes, an exact solution of the full equations"
        why = " (least dynamic potential)" if order == (0, 1, 2) else " (by gyroscopic torques alone)"
        said += why if stable else ""
    described = f"{near}{first} towards the source and {last} along the orbit's normal: {said}"
    found_start = FoundStart(
        name="relative",
        described=f"relative equilibrium, {described}",
        how=how,
        exponents=exponents,
        stable=stable,
    )
    return found.start(context, precision.bits, found_start)


def _orbit(scene: Scene) -> KeplerOrbit:
    """The orbit in whose frame the body may rest."""
    context, loads, moments = scene.context, loads_of(scene), scene.body.principal_moments
    orbits = [orbit for load in loads if (orbit := load.orbit) is not None]
    if scene.free_flight:
        raise NoEquilibrium("the body flies on another orbit, and this is for a prescribed one")
    if not orbits:
        raise NoEquilibrium("no load has a source on an orbit (gravity_gradient with orbit)")
    if any(load.changes for load in loads):
        raise NoEquilibrium("the body's moments vary, and its equilibria with them")
    if max(moments) - min(moments) <= max(moments) * negligible(context):
        raise NoEquilibrium("a body whose moments are all the same rests in any attitude, or in none")
    first = orbits[0]
    if not first.circular:
        size = context.nstr(first.eccentricity, 6)
        what = f"the orbit's eccentricity is {size}, and a body rests only relative to a circle; set it to 0"
        raise NoEquilibrium(f"{what}, or give attitude and rates")
    if not first.fixed_plane:
        raise NoEquilibrium('the orbit\'s node moves; choose "cassini_1" to "cassini_4"')
    normal, turning = first.normal(context), [load.corotating_orbit for load in loads]
    alike = (orbit in turning and orbit.mean_motion == first.mean_motion for orbit in orbits)
    if not all(alike) or not all(parallel(context, orbit.normal(context), normal) for orbit in orbits):
        raise NoEquilibrium("the sources are on different orbits, so that nothing rests between them")
    return first


def _frame(orbit: KeplerOrbit, context: Any, time: Any) -> Matrix:
    """Unit vectors (rows, space axes) towards the source, forward, and along the normal."""
    angle, node, tilt = orbit.eccentric_anomaly(context, time), orbit.ascending_node, orbit.inclination
    r = attitude.rotation_matrix(attitude.quaternion_from_euler(context, [node, tilt, angle], "zxz"))
    return transpose(r)


def _nearest(scene: Scene, frame: Matrix) -> tuple[Matrix, tuple[int, ...]]:
    """Of the 24 attitudes the one nearest to what is given, or Lagrange's; and which principal axes, by size
    of their moments, are towards the source, forward and along the normal.
    """
    body, table = scene.body, scene.config.initial
    by_size = sorted(range(3), key=lambda k: body.principal_moments[k])
    given = any(getattr(table, key) is not None for key in ATTITUDES)
    wanted = attitude.rotation_matrix(scene.quaternion)
    found: list[tuple[Any, Matrix, tuple[int, ...]]] = []
    for order in permutations(range(3)):
        if not given and order != (0, 1, 2):
            continue
        for signs in product((1, -1), repeat=2):
            first, last = (
                [s * x for x in body.principal_axes[by_size[k]]]
                for s, k in zip(signs, order[::2], strict=True)
            )
            matrix = multiply(transpose(frame), [first, cross(last, first), last])
            trace = sum(dot(row, other) for row, other in zip(matrix, wanted, strict=True))
            # without an attitude given, the axes themselves and not their opposites
            found.append((trace if given else sum(signs), matrix, order))
    return max(found, key=lambda entry: entry[0])[1:]


def _refuse_passing(scene: Scene, precision: Any, orbit: KeplerOrbit, found: Pose, here: PoseMotion) -> None:
    """Refuse loads that don't rest in the turning frame, and other states that do not."""
    context, n, least = scene.context, orbit.mean_motion, scene.context.mpf(_RESTS)
    seconds = 2 * context.pi / n * context.mpf(_LATER)
    start = scene.start + seconds
    later = PoseMotion(replace(scene, start=start, end=scene.end + seconds), precision, found)
    turn = multiply(transpose(_frame(orbit, context, start)), _frame(orbit, context, scene.start))
    there = Pose(multiply(turn, found.matrix), found.rates)
    if norm(context, later.acceleration(there)[0]) / n**2 > least:
        what = "a load changes relative to the turning frame (it depends on time, or is fixed in space)"
        raise NoEquilibrium(f"{what}: nothing rests there")
    for name, slope in here.acceleration(found)[1].items():
        if abs(slope) > least:
            raise NoEquilibrium(f"the state {name} changes in this equilibrium; start the state at rest")


def _linear(context: Any, motion: PoseMotion, at: Pose, bits: int) -> Matrix:
    """Matrix of the linearised equations in (turn, change of rates), 1/s."""

    def slopes(x: Vector) -> Vector:
        return motion.acceleration(at.moved(context, x[:3], x[3:]))[0]

    scale = norm(context, at.rates)
    below = jacobian(context, lambda x: slopes([*x[:3], *(scale * v for v in x[3:])]), 6, bits)
    below = [[*row[:3], *(v / scale for v in row[3:])] for row in below]
    units = [[context.mpf(i == j) for j in range(3)] for i in range(3)]
    above = []
    for i in range(3):
        turning = [cross(unit, at.rates)[i] for unit in units]
        above.append([*turning, *units[i]])
    return above + below


# --- Cassini states -----------------------------------------------------------------------------------------

_SWIFT = 60  # turns from one return to the next
_DOUBLE = 53  # bits
_NEAR = 0.1  # rad of obliquity from the averaged state
_MOST_REVOLUTIONS = 600
_MOST_APSIDAL_TURNS = 12
_ANOMALIES = 1024
_ANGLES = 1440
_BISECTIONS = 60
_STEP = 1e-4  # rad, of derivatives


def cassini_state(scene: Scene, number: int) -> InitialRotation:
    """The motion at rest in a Cassini state, at the scene's start.

    Raises:
        NoEquilibrium: the scene has no such state, or no motion near it comes back.
        ConfigError: its spin is missing, or in the other sense.
    """
    name, context = f"cassini_{number}", scene.context
    search = search_for(scene, name)
    states = averaged_states(search)
    if number not in states:
        degrees = [f"cassini_{n} ({abs(np.degrees(tilt)):.4g} deg)" for n, (tilt, _) in states.items()]
        what = f"this body and orbit don't have it; there are {' and '.join(degrees)}"
        raise NoEquilibrium(f"{what}, by the angle from the orbit's normal; choose one of them")
    tilt, phase = (context.mpf(x) for x in states[number])
    found, linear, bits, sure = _return(search, _begin(search, tilt, phase))
    period, turns, orbit = search.period, search.turns, search.orbit
    if search.slow is not None:
        _, linear, _, sure = _return(search.slow, _begin(search.slow, tilt, phase))
        period = search.slow.period
    nutation = None
    if turns is None:
        moments = search.scene.body.principal_moments
        nutation = max(moments) / min(moments) * search.rate * period
    exponents, stable = exponents_of(context, linear, sure / period, period, nutation)
    pole = apply(found.matrix, search.axes[2])
    normal = replace(orbit, ascending_node=_node(orbit, scene.start)).normal(context)
    angles = [context.atan2(norm(context, cross(pole, v)), dot(pole, v)) for v in (normal, [0, 0, 1])]
    degrees = [str(context.nstr(context.degrees(angle), 6)) for angle in (*angles, abs(tilt))]
    if abs(abs(tilt) - angles[0]) > _NEAR:
        what = f"the motion that returns to itself is {degrees[0]} deg from the orbit's normal, and the "
        raise NoEquilibrium(f"{what}averaged state {degrees[2]} deg: the torque is too strong for averages")
    step = "turning at the given rate"
    if turns is not None:
        step = (
            f"{int(turns)}:1 with the orbit" if turns == int(turns) else f"{int(2 * turns)}:2 with the orbit"
        )
    where = (
        f"figure axis {degrees[0]} deg from the orbit's normal, {degrees[1]} deg from the axis about which "
    )
    where += f"its node moves; {'stable' if stable else 'unstable'}"
    found_start = FoundStart(
        name=name,
        described=f"Cassini state {number}, {step}: {where}",
        how=search.how + (" (in double precision)" if bits <= _DOUBLE else ""),
        exponents=exponents,
        stable=stable,
    )
    return found.start(context, bits, found_start)


def _node(orbit: KeplerOrbit, time: Any) -> Any:
    return orbit.ascending_node + orbit.node_rate * time


def _begin(search: SoughtReturn, tilt: Any, phase: Any) -> Pose:
    """An averaged state at the scene's start."""
    orbit, context, time, turn = (
        search.orbit,
        search.scene.context,
        search.scene.start,
        search.scene.context.zero,
    )
    if search.turns is not None:
        anomaly = orbit.mean_anomaly + orbit.mean_motion * time
        turn = search.turns * anomaly + orbit.periapsis + orbit.periapsis_rate * time + phase
    angles = [_node(orbit, time), orbit.inclination - tilt, turn]
    axes = attitude.rotation_matrix(attitude.quaternion_from_euler(context, angles, "zxz"))
    matrix = multiply(axes, search.axes)
    node = apply(transpose(matrix), [context.zero, context.zero, orbit.node_rate])
    c, rate = search.axes[2], search.rate
    if search.turns is None:
        rate = rate - dot(node, c)
    return Pose(matrix, [rate * x + y for x, y in zip(c, node, strict=True)])


# --- what comes back ----------------------------------------------------------------------------------------


def _return(search: SoughtReturn, pose: Pose) -> tuple[Pose, Matrix, int, Any]:
    """The pose that comes back, the map over T about it, the bits to which the pose is known, and the map's
    uncertainty.
    """
    scene, context, rate = search.scene, search.scene.context, search.rate
    levels = widths(scene)
    rounds = search.period * rate / (2 * context.pi)
    lost = 4 + int(context.ceil(context.log(max(rounds, 1), 2)))  # bits, to rounding along the way
    swift = rounds > _SWIFT
    narrow = working_bits(scene.config.integrator.precision) <= levels[0].bits
    if search.revolutions > 2 or (swift and narrow):
        levels = levels[:1]  # on an orbit that isn't quite the scene's, or where more digits take minutes
    a, b, c = search.axes
    basis = [a, b] if search.turns is None else [a, b, c]
    count = len(basis)
    back = turned(context, [context.zero, context.zero, -search.orbit.node_rate * search.period])
    known: Matrix = []
    sure = context.zero
    for level, precision in enumerate(levels):
        motion = PoseMotion(scene, precision)

        def residual(at: Pose, motion: PoseMotion = motion) -> Vector:
            after = motion.after(at, search.period)
            inside = multiply(multiply(transpose(at.matrix), back), after.matrix)
            if search.turns is None:
                pole, rates = apply(inside, c), apply(inside, after.rates)
                turn = cross(c, pole)
            else:
                _, *vector = attitude.quaternion_from_matrix(context, inside)
                turn, rates = [2 * x for x in vector], after.rates
            change = [(x - y) / rate for x, y in zip(rates, at.rates, strict=True)]
            return [dot(e, turn) for e in basis] + [dot(e, change) for e in basis]

        def moved(at: Pose, step: Vector) -> Pose:
            turn, change = (
                [sum(x * e[i] for x, e in zip(part, basis, strict=True)) for i in range(3)]
                for part in (step[:count], step[count:])
            )
            change = [rate * x for x in change]
            if search.turns is None:  # of the rates in space, since the body may turn about c by any angle
                inside = cross(turn, at.rates)
                change = [x - y + dot(inside, c) * z for x, y, z in zip(change, inside, c, strict=True)]
            return at.moved(context, turn, change)

        newton = Newton(context, precision.bits - lost, residual, moved, 2 * count)
        try:
            if level < (1 if swift else 2):  # in more digits a narrower one's are enough
                known, sure = newton.slope(pose), newton.uncertainty
            pose = newton.settled(pose, known)
        except (NoEquilibrium, ZeroDivisionError):
            raise NoEquilibrium("near the averaged state no motion comes back") from None
    linear = [[x + (i == j) for j, x in enumerate(row)] for i, row in enumerate(known)]
    return pose, linear, levels[-1].bits, sure


# --- what is sought -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SoughtReturn:
    """What is sought: a pose that comes back.

    Attributes:
        axes: rows a, b, c in body axes: least, middle and largest moment.
        turns: p turns to a revolution, or None for a body with A = B that turns at any rate.
        rate: spin about c in the node's frame, rad/s (mpf); of the whole angular velocity for A = B.
        orbit: on which the pose comes back.
        strength: G M / a^3, 1/s^2.
        revolutions: of the source from one return to the next.
        scene: on that orbit.
        how: it is found, and to what order it is the state.
        slow: the same with apsides at rest, whose map shows faster librations, too; None if nothing differs.
    """

    scene: Scene
    orbit: KeplerOrbit
    strength: Any
    axes: Matrix
    turns: Any | None
    rate: Any
    revolutions: int
    how: str
    slow: SoughtReturn | None = None

    @property
    def period(self) -> Any:
        """T, s."""
        return self.revolutions * 2 * self.scene.context.pi / self.orbit.mean_motion


def _source(scene: Scene) -> tuple[Load, KeplerOrbit, Any]:
    context, loads = scene.context, loads_of(scene)
    sources = [(load, source) for load in loads if (source := load.gradient_source) is not None]
    if scene.free_flight or len(loads) != 1 or len(sources) != 1 or sources[0][1].orbit is None:
        what = "it is for a body under the gravity_gradient of one source with elements of its orbit, and "
        if any(load.beside is not None for load in loads):
            what = f"it is found by the gradient alone: leave degree and figure out; {what}"
        raise NoEquilibrium(f"{what}nothing else; remove other loads, or give attitude and rates")
    load, source = sources[0]
    orbit = source.orbit
    assert orbit is not None
    if abs(context.sin(orbit.inclination)) <= negligible(context):
        what = "the orbit isn't inclined to the plane that its node moves in; give orbit.inclination"
        raise NoEquilibrium(what)
    if orbit.node_rate == 0:
        other = ', or choose "relative"' if orbit.circular else ""
        raise NoEquilibrium(f"the orbit's node is at rest; give orbit.node_rate{other}")
    if scene.gravity is not None and scene.torque_arm is not None:
        raise NoEquilibrium("uniform_gravity has a torque; remove it")
    return load, orbit, source.gravitational_parameter / orbit.semi_major_axis**3


def search_for(scene: Scene, name: str) -> SoughtReturn:
    """What is sought in a scene for the state of a name. Raises ``NoEquilibrium`` and ``ConfigError``."""
    context, body = scene.context, scene.body
    _, orbit, strength = of = _source(scene)
    order = sorted(range(3), key=lambda k: body.principal_moments[k])
    least, middle, most = (body.principal_moments[k] for k in order)
    tiny = most * negligible(context)
    if most - middle <= tiny:
        raise NoEquilibrium("no axis has the largest moment alone, about which the body would turn")
    symmetric = middle - least <= tiny
    axes = _axes(scene, order, symmetric=symmetric)
    if scene.config.initial.spin_period is None:
        if symmetric:
            what = f'missing; "{name}" of a body with two equal moments can turn at any rate: give it'
            raise refusal("spin_period", what)
        return _on(scene, *of, axes, context.one, None)
    spin = spin_rate(scene)
    if spin < 0:
        what = "given a negative time with a Cassini state, whose spin is about the figure axis; states at "
        raise refusal("spin_period", what + "more than 90 deg from the normal are retrograde: cassini_3")
    if symmetric:
        return _on(scene, *of, axes, None, spin)
    turns = context.nint(2 * spin / orbit.mean_motion) / 2
    width = context.sqrt(3 * strength * (middle - least) / most)
    away = abs(spin - turns * orbit.mean_motion - orbit.periapsis_rate - orbit.node_rate)
    if turns > 0 and away <= width:
        return _on(scene, *of, axes, turns, None)
    mean = (least + middle) / 2
    round_body = _with_moments(scene, [most if k == order[2] else mean for k in range(3)])
    found = _on(round_body, *of, _axes(round_body, order, symmetric=True), None, spin)
    part, within = context.nstr((middle - least) / most, 2), context.nstr(width / spin, 2)
    how = f"{found.how}, of a body with the mean of both smaller moments, since its rotation isn't in step "
    return replace(found, how=f"{how}with the orbit (within {within} of the rate): to order {part}")


def _with_moments(scene: Scene, moments: list[Any]) -> Scene:
    """The scene with other moments about the body's principal axes."""
    axes = scene.body.principal_axes
    tensors = (
        [[sum(m * a[i] * a[j] for m, a in zip(given, axes, strict=True)) for j in range(3)] for i in range(3)]
        for given in (moments, [1 / m for m in moments])
    )
    inertia, inverse = tensors
    body = replace(scene.body, inertia=inertia, principal_moments=moments)
    return replace(scene, body=body, turning_inertia=inertia, inverse_inertia=inverse)


def _axes(scene: Scene, order: list[int], *, symmetric: bool) -> Matrix:
    """Principal axes a, b, c; c on the side of the figure axis, a the figure's first axis for A = B."""
    principal, figure = scene.body.principal_axes, scene.figure
    c = list(principal[order[2]])
    if dot(c, figure.pole) < 0:
        c = [-x for x in c]
    a = list(principal[order[0]])
    if symmetric and abs(dot(c, figure.pole)) > 1 - 1e-12:
        a = list(figure.first)
    return [a, cross(c, a), c]


def _on(
    scene: Scene, load: Load, orbit: KeplerOrbit, strength: Any, axes: Matrix, turns: Any | None, spin: Any
) -> SoughtReturn:
    """The search on the scene's orbit, or on the nearest one on which something comes back."""
    context, rest = scene.context, orbit.mean_motion + orbit.periapsis_rate
    once = 1 if turns is None or turns == int(turns) else 2
    full = "by Newton's method on the full equations: it comes back after "
    how = full + ("a revolution" if once == 1 else "two revolutions")

    def on(other: KeplerOrbit, revolutions: int, how: str, slow: SoughtReturn | None = None) -> SoughtReturn:
        rate = spin if turns is None else turns * other.mean_motion + other.periapsis_rate
        moved = scene if other is orbit else _with_orbit(scene, load, other)
        return SoughtReturn(moved, other, strength, axes, turns, rate, revolutions, how, slow)

    if orbit.periapsis_rate == 0:
        return on(orbit, once, how)
    motion = orbit.mean_motion + (0 if turns is None else orbit.periapsis_rate / turns)
    how += " with the slow apsides at rest; free librations are of the order of what their turning forces"
    slow = on(_paced(orbit, motion, context.zero, scene.start), once, how)
    whole, apsidal = _recurrence(orbit, once)
    if not whole:
        return slow
    motion = rest / (1 + context.mpf(apsidal) / whole)
    changed = context.nstr(abs((rest - motion) / orbit.periapsis_rate - 1), 2)
    how = f"{full}{whole} revolutions, while the apsides turn {abs(apsidal)} times, at a rate changed by "
    how += f"{changed} of itself: free librations are about that part of what the apsides force (exponents: "
    how += "apsides at rest)"
    return on(_paced(orbit, motion, rest - motion, scene.start), whole, how, slow)


def _paced(orbit: KeplerOrbit, motion: Any, apsidal: Any, start: Any) -> KeplerOrbit:
    """The orbit with other rates of mean anomaly and periapsis, and the same place at the start."""
    return replace(
        orbit,
        mean_motion=motion,
        mean_anomaly=orbit.mean_anomaly + (orbit.mean_motion - motion) * start,
        periapsis=orbit.periapsis + (orbit.periapsis_rate - apsidal) * start,
        periapsis_rate=apsidal,
    )


def _recurrence(orbit: KeplerOrbit, halves: int) -> tuple[int, int]:
    """Revolutions and turns of the apsides after which both come back nearly; zeros if that takes long."""
    once = float(orbit.mean_motion / orbit.periapsis_rate)  # revolutions to a turn
    best = (1.0, 0, 0)
    for turns in range(1, _MOST_APSIDAL_TURNS + 1):
        count = round(once * turns / halves) * halves
        if 0 < abs(count) <= _MOST_REVOLUTIONS:
            best = min(best, (abs(count / turns / once - 1), abs(count), turns if once > 0 else -turns))
    return best[1:]


def _with_orbit(scene: Scene, load: Any, orbit: KeplerOrbit) -> Scene:
    """The scene with its source on another orbit that has the same place at the start."""
    moved = replace(load, placement=replace(load.placement, orbit=orbit))
    return replace(scene, loads=tuple(moved if x is load else x for x in scene.loads))


# --- where averages have it ---------------------------------------------------------------------------------


def averaged_states(search: SoughtReturn) -> dict[int, tuple[float, float]]:
    """Where the averaged equations of a body and an orbit have Cassini states: by number the angle th (rad,
    -pi to pi) from the orbit's normal n towards the pole k, and the angle of the least axis from the node
    beyond p M + w, rad.

    In the frame that turns with the node at the rate g about the pole k of its plane, the spin axis s of a
    body with the momentum L about its largest axis moves by H = U(s) - g L k . s, where U is the gradient's
    potential averaged over the orbit and, out of resonance, over the rotation (Colombo 1966, Astronomical
    Journal 71, 891; Peale 1969, Astronomical Journal 74, 483). In step with the orbit, p turns to a
    revolution, U has the part

        -(3 G M / 4 a^3) (B - A) |<(a/r)^3 (r1 + i r2)^2 exp -2 i (p M + w)>|

    besides, with r1, r2 the source's direction along the node and across it in the body's equator: the least
    axis is turned to where that is lowest. States lie in the plane of k and n, where H is stationary; with I
    between both, a body of A = B has

        (C - A)/C (3 G M / 2 a^3) (1 - e^2)^(-3/2) / w cos th sin th + g sin(th - I) = 0.

    They are numbered as by Peale for a node that moves backwards: 1 and 3 are the least values of H nearest
    to n and to -n, 2 the greatest on k's side, 4 that on the other. A node that moves forwards gives the same
    with the spin reversed.
    """
    orbit, turns = search.orbit, search.turns
    least, middle, most = sorted(map(float, search.scene.body.principal_moments))
    e, inclination, node_rate = float(orbit.eccentricity), float(orbit.inclination), float(orbit.node_rate)
    place = float(orbit.periapsis + orbit.periapsis_rate * search.scene.start)
    eccentric = 2 * np.pi * np.arange(_ANOMALIES) / _ANOMALIES
    radius = 1 - e * np.cos(eccentric)
    weight = radius / radius**3 / _ANOMALIES  # dM = (1 - e cos E) dE
    true = np.arctan2(np.sqrt(1 - e * e) * np.sin(eccentric), np.cos(eccentric) - e) + place
    c, s = np.cos(inclination), np.sin(inclination)
    source = np.array([np.cos(true), np.sin(true) * c, np.sin(true) * s])

    def energy(tilts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """U (J) and the least axis' phase at angles (n,)."""
        lean = inclination - tilts  # of the spin axis from k
        none = np.zeros_like(lean)
        second, pole = (
            np.array(x).T for x in ([none, np.cos(lean), np.sin(lean)], [none, -np.sin(lean), np.cos(lean)])
        )
        flat = (most - (least + middle) / 2) * (weight * (pole @ source) ** 2).sum(axis=1)
        phase = none
        if turns is not None:
            mean = eccentric - e * np.sin(eccentric)
            wave = np.exp(-2j * (float(turns) * mean + place))
            part = (weight * (source[0] + 1j * (second @ source)) ** 2 * wave).sum(axis=1)
            flat, phase = flat - (middle - least) / 2 * np.abs(part), np.angle(part) / 2
        return 1.5 * float(search.strength) * flat, phase

    def slope(tilts: np.ndarray) -> np.ndarray:
        ahead, behind = (energy(tilts + sign * _STEP)[0] for sign in (1, -1))
        turning = node_rate * most * float(search.rate)
        return np.asarray((ahead - behind) / (2 * _STEP) + turning * np.sin(tilts - inclination))

    grid = -np.pi + 2 * np.pi * (np.arange(_ANGLES + 1) + 0.5) / _ANGLES
    slopes = slope(grid)
    at = np.flatnonzero(np.sign(slopes[:-1]) != np.sign(slopes[1:]))
    low, high, rising = grid[at], grid[at + 1], slopes[at] < 0
    for _ in range(_BISECTIONS):
        half = (low + high) / 2
        inside = (slope(half) < 0) == rising
        low, high = np.where(inside, half, low), np.where(inside, high, half)
    tilts = ((low + high) / 2 + np.pi) % (2 * np.pi) - np.pi
    seen = tilts if node_rate < 0 else tilts % (2 * np.pi) - np.pi
    near, positive = np.abs(seen) < np.pi / 2, seen > 0
    numbers = np.where(rising, np.where(near, 1, 3), np.where(positive, 2, 4)).tolist()
    found = dict(zip(reversed(numbers), zip(tilts[::-1], energy(tilts)[1][::-1], strict=True), strict=True))
    return {number: (float(found[number][0]), float(found[number][1])) for number in sorted(found)}


# --- as starts ----------------------------------------------------------------------------------------------

_KEPT = 64
_BESIDE = ("name", "description", "integrator", "model", "output", "limits", "sweep", "events")
"""Tables on which no equilibrium depends; the precision is the context's."""
_known: OrderedDict[Any, InitialRotation] = OrderedDict()


def once(
    name: str,
    find: Callable[[Scene], InitialRotation],
    scene: Scene,
    fault: Callable[[str, str], ConfigError] = refusal,
) -> InitialRotation:
    """The start that is found, perhaps before in this process.

    Raises:
        ConfigError: made by ``fault`` of a key and a text, if there is none.
    """
    if isinstance(scene.context, SweptContext):
        raise Untraceable("an equilibrium that is found")
    tables = {name: table for name, table in scene.config if name not in _BESIDE}
    key = scene.context.prec, repr(tables)
    if key not in _known:
        try:
            _known[key] = find(scene)
        except NoEquilibrium as none:
            remedy = "" if ";" in str(none) else "; give the attitude and rates themselves"
            raise fault("equilibrium", f'given "{name}", but {none}{remedy}') from None
        while len(_known) > _KEPT:
            _known.popitem(last=False)
    found, own = _known[key], scene.context.make_mpf
    vectors = (found.quaternion, found.angular_velocity or (), *(found.partner or ()))
    quaternion, rates, *partner = ([own(x._mpf_) for x in vector] for vector in vectors)
    return InitialRotation(quaternion, rates, found=found.found, partner=partner or None)


_FINDERS: dict[str, Callable[[Scene], InitialRotation]] = {
    "relative": relative_equilibrium,
    **{f"cassini_{number}": partial(cassini_state, number=number) for number in (1, 2, 3, 4)},
}
STARTS.update({name: partial(once, name, find) for name, find in _FINDERS.items()})
