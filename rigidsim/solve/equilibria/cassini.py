"""Cassini states: motions that are the same after each revolution, in the frame that turns with the node.

Averaged equations say where the state is (``averaged_states``). The full equations have a motion beside it
that is periodic in the node's frame: with the orbit at the same place after T, Newton's method finds the pose
that comes back, turned with the node (and, for A = B, about the figure axis by any angle). It has no free
libration. T is one revolution from pericentre to pericentre, two for a half-odd number of turns; if apsides
turn on an eccentric orbit, so many revolutions as they need to come back, on an orbit whose apsides turn at
the nearest such rate, and for slow ones with the apsides at rest. Eigenvalues of the map over T are exp(x T)
with the exponents x of the stability, whose imaginary part is known but for multiples of 2 pi / T.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

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
    transpose,
    working_bits,
)
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.starts import InitialRotation, refusal, spin_rate
from rigidsim.solve.equilibria.search import (
    Newton,
    NoEquilibrium,
    Pose,
    PoseMotion,
    exponents_of,
    turned,
    widths,
)
from rigidsim.store.summary import FoundStart

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
        what = f"the motion that comes back near it is {degrees[0]} deg from the orbit's normal, and the "
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
            if level < (1 if swift else 2):  # in more digits those of a narrower one's are enough
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
