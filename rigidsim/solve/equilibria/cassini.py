"""Cassini states: motions that are the same after each revolution, in the frame that turns with the node.

Averaged equations say where the state is (``Colombo``). The full equations have a motion beside it that is
periodic in the node's frame: with the orbit at the same place after T, Newton's method finds the pose that
comes back, turned with the node (and, for A = B, about the figure axis by any angle). It has no free
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
from rigidsim.solve.equilibria.motion import Lost, Pose, PoseMotion, turned, widths
from rigidsim.solve.equilibria.newton import Newton, NotFound, exponents_of
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
        ConfigError: the scene has no such state, or no motion near it comes back.
    """
    name, context = f"cassini_{number}", scene.context
    search = search_for(scene, name)
    state = _averaged(search, number, name)
    pose = _begin(search, state)
    found, linear, bits, sure = _return(search, pose, name)
    period = search.period
    if search.slow is not None:
        _, linear, _, sure = _return(search.slow, _begin(search.slow, state), name)
        period = search.slow.period
    nutation = None
    if search.turns is None:
        moments = search.scene.body.principal_moments
        nutation = max(moments) / min(moments) * search.rate * period
    exponents, stable = exponents_of(context, linear, sure / period, period, nutation)
    pole = apply(found.matrix, search.axes[2])
    normal = replace(search.orbit, ascending_node=_node(search.orbit, scene.start)).normal(context)
    tilt, lean = (context.atan2(norm(context, cross(pole, v)), dot(pole, v)) for v in (normal, [0, 0, 1]))
    if abs(abs(context.mpf(state.tilt)) - tilt) > _NEAR:
        what = (
            f'given "{name}", but the motion that comes back near it is {_degrees(context, tilt)} deg from '
        )
        what += f"the orbit's normal, and the averaged state {_degrees(context, abs(state.tilt))} deg; the "
        raise refusal("equilibrium", what + "torque is too strong for averages: give attitude and rates")
    words = "stable" if stable else "unstable"
    where = (
        f"{_degrees(context, tilt)} deg from the orbit's normal, {_degrees(context, lean)} deg from the axis "
    )
    where += "about which its node moves"
    step = "turning at the given rate" if search.turns is None else f"{_ratio(search.turns)} with the orbit"
    told = FoundStart(
        name=name,
        described=f"Cassini state {number}, {step}: figure axis {where}; {words}",
        how=search.how + (" (in double precision)" if bits <= _DOUBLE else ""),
        exponents=exponents,
        stable=stable,
    )
    return found.start(context, bits, told)


# --- where it begins ----------------------------------------------------------------------------------------


def _node(orbit: KeplerOrbit, time: Any) -> Any:
    return orbit.ascending_node + orbit.node_rate * time


def _averaged(search: SoughtReturn, number: int, name: str) -> AveragedState:
    scene, orbit = search.scene, search.orbit
    (source,) = (s for load in loads_of(scene) if (s := load.gradient_source) is not None)
    least, middle, most = sorted(map(float, scene.body.principal_moments))
    place = float(orbit.periapsis + orbit.periapsis_rate * scene.start)
    strength = float(source.gravitational_parameter / orbit.semi_major_axis**3)
    turns = None if search.turns is None else float(search.turns)
    states = Colombo(orbit, strength, (least, middle, most), float(search.rate), turns, place).states()
    for state in states:
        if state.number == number:
            return state
    degrees = [f"cassini_{s.number} ({abs(s.tilt) * 57.29577951308232:.4g} deg)" for s in states]
    what = f'given "{name}", which this body and orbit don\'t have; there are {" and ".join(degrees)}, by '
    raise refusal("equilibrium", what + "the angle from the orbit's normal")


def _begin(search: SoughtReturn, state: AveragedState) -> Pose:
    """The averaged state at the scene's start."""
    scene, orbit = search.scene, search.orbit
    context, time = scene.context, scene.start
    lean = orbit.inclination - context.mpf(state.tilt)
    turn = context.zero
    if search.turns is not None:
        anomaly = orbit.mean_anomaly + orbit.mean_motion * time
        place = orbit.periapsis + orbit.periapsis_rate * time
        turn = search.turns * anomaly + place + context.mpf(state.phase)
    angles = [_node(orbit, time), lean, turn]
    axes = attitude.rotation_matrix(attitude.quaternion_from_euler(context, angles, "zxz"))
    matrix = multiply(axes, search.axes)
    node = apply(transpose(matrix), [context.zero, context.zero, orbit.node_rate])
    c, rate = search.axes[2], search.rate
    if search.turns is None:
        rate = rate - dot(node, c)
    return Pose(matrix, [rate * x + y for x, y in zip(c, node, strict=True)])


# --- what comes back ----------------------------------------------------------------------------------------


def _return(search: SoughtReturn, pose: Pose, name: str) -> tuple[Pose, Matrix, int, Any]:
    """The pose that comes back, the map over T about it, the bits to which the pose is known, and the map's
    uncertainty.
    """
    scene, context = search.scene, search.scene.context
    levels = widths(scene)
    rounds = search.period * search.rate / (2 * context.pi)
    lost = 4 + int(context.ceil(context.log(max(rounds, 1), 2)))  # bits, to rounding along the way
    swift = rounds > _SWIFT
    if search.revolutions > 2 or (
        swift and working_bits(scene.config.integrator.precision) <= levels[0].bits
    ):
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
            change = [(x - y) / search.rate for x, y in zip(rates, at.rates, strict=True)]
            return [dot(e, turn) for e in basis] + [dot(e, change) for e in basis]

        def moved(at: Pose, step: Vector) -> Pose:
            turn, change = (
                [sum(x * e[i] for x, e in zip(part, basis, strict=True)) for i in range(3)]
                for part in (step[:count], step[count:])
            )
            change = [search.rate * x for x in change]
            if search.turns is None:  # of the rates in space, since the body may turn about c by any angle
                inside = cross(turn, at.rates)
                change = [x - y + dot(inside, c) * z for x, y, z in zip(change, inside, c, strict=True)]
            return at.moved(context, turn, change)

        newton = Newton(context, precision.bits - lost, residual, moved, 2 * count)
        try:
            if level < (1 if swift else 2):  # in more digits those of a narrower one's are enough
                known = newton.slope(pose)
                sure = newton.uncertainty
            pose = newton.settled(pose, known)
        except (NotFound, Lost, ZeroDivisionError):
            what = (
                f'given "{name}", but near the averaged state no motion comes back; give attitude and rates'
            )
            raise refusal("equilibrium", what) from None
    linear = [[x + (i == j) for j, x in enumerate(row)] for i, row in enumerate(known)]
    return pose, linear, levels[-1].bits, sure


# --- in words -----------------------------------------------------------------------------------------------


def _degrees(context: Any, angle: Any) -> str:
    return str(context.nstr(context.degrees(angle), 6))


def _ratio(turns: Any) -> str:
    return f"{int(turns)}:1" if turns == int(turns) else f"{int(2 * turns)}:2"


# --- what is sought -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SoughtReturn:
    """What is sought: a pose that comes back.

    Attributes:
        axes: rows a, b, c in body axes: least, middle and largest moment.
        turns: p turns to a revolution, or None for a body with A = B that turns at any rate.
        rate: spin about c in the node's frame, rad/s (mpf); of the whole angular velocity for A = B.
        orbit: on which the pose comes back.
        revolutions: of the source from one return to the next.
        scene: on that orbit.
        how: it is found, and to what order it is the state.
        slow: the same with apsides at rest, whose map shows faster librations, too; None if nothing differs.
    """

    scene: Scene
    orbit: KeplerOrbit
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


def _source(scene: Scene, given: str) -> tuple[Load, KeplerOrbit, Any]:
    loads = loads_of(scene)
    sources = [(load, source) for load in loads if (source := load.gradient_source) is not None]
    if scene.free_flight or len(loads) != 1 or len(sources) != 1 or sources[0][1].orbit is None:
        what = "it is for a body under the gravity_gradient of one source with elements of its orbit, and "
        if any(load.beside is not None for load in loads):
            what = f"it is found by the gradient alone: leave degree and figure out; {what}"
        raise refusal(
            "equilibrium", f"{given}{what}nothing else; remove other loads, or give attitude and rates"
        )
    load, source = sources[0]
    orbit = source.orbit
    assert orbit is not None
    context = scene.context
    if abs(context.sin(orbit.inclination)) <= negligible(context):
        what = "the orbit isn't inclined to the plane that its node moves in; give orbit.inclination"
        raise refusal("equilibrium", given + what)
    if orbit.node_rate == 0:
        other = ', or choose "relative"' if orbit.circular else ""
        raise refusal("equilibrium", f"{given}the orbit's node is at rest; give orbit.node_rate{other}")
    if scene.gravity is not None and scene.torque_arm is not None:
        raise refusal("equilibrium", f"{given}uniform_gravity has a torque; remove it")
    return load, orbit, source.gravitational_parameter / orbit.semi_major_axis**3


def search_for(scene: Scene, name: str) -> SoughtReturn:
    """What is sought in a scene for the state of a name; ``ConfigError`` if it can't have any."""
    given, context, body = f'given "{name}", but ', scene.context, scene.body
    load, orbit, strength = _source(scene, given)
    order = sorted(range(3), key=lambda k: body.principal_moments[k])
    least, middle, most = (body.principal_moments[k] for k in order)
    tiny = most * negligible(context)
    if most - middle <= tiny:
        raise refusal(
            "equilibrium", f"{given}no axis has the largest moment alone, about which the body would turn"
        )
    symmetric = middle - least <= tiny
    axes = _axes(scene, order, symmetric=symmetric)
    spin = None
    if scene.config.initial.spin_period is not None:
        spin = spin_rate(scene)
        if spin < 0:
            what = "given a negative time with a Cassini state, whose spin is about the figure axis; states "
            raise refusal(
                "spin_period", what + "at more than 90 deg from the normal are retrograde: cassini_3"
            )
    if symmetric:
        if spin is None:
            what = f'missing; "{name}" of a body with two equal moments can turn at any rate: give it'
            raise refusal("spin_period", what)
        return _on(scene, load, orbit, axes, None, spin)
    if spin is None:
        return _on(scene, load, orbit, axes, context.one, None)
    turns = context.nint(2 * spin / orbit.mean_motion) / 2
    width = context.sqrt(3 * strength * (middle - least) / most)
    away = abs(spin - turns * orbit.mean_motion - orbit.periapsis_rate - orbit.node_rate)
    if turns > 0 and away <= width:
        return _on(scene, load, orbit, axes, turns, None)
    mean = (least + middle) / 2
    round_body = _with_moments(scene, [most if k == order[2] else mean for k in range(3)])
    axes = _axes(round_body, order, symmetric=True)
    found = _on(round_body, load, orbit, axes, None, spin)
    part = context.nstr((middle - least) / most, 2)
    how = f"{found.how}, of a body with the mean of both smaller moments, since its rotation isn't in step "
    how += f"with the orbit (within {context.nstr(width / spin, 2)} of the rate): to order {part}"
    return replace(found, how=how)


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
    scene: Scene, load: Load, orbit: KeplerOrbit, axes: Matrix, turns: Any | None, spin: Any
) -> SoughtReturn:
    """The search on the scene's orbit, or on the nearest one on which something comes back."""
    context, rest = scene.context, orbit.mean_motion + orbit.periapsis_rate
    once = 1 if turns is None or turns == int(turns) else 2
    full = "by Newton's method on the full equations: it comes back after "
    how = full + ("a revolution" if once == 1 else "two revolutions")

    def on(other: KeplerOrbit, revolutions: int, how: str, slow: SoughtReturn | None = None) -> SoughtReturn:
        rate = spin if turns is None else turns * other.mean_motion + other.periapsis_rate
        moved = scene if other is orbit else _with_orbit(scene, load, other)
        return SoughtReturn(moved, other, axes, turns, rate, revolutions, how, slow)

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


@dataclass(frozen=True)
class AveragedState:
    """A state of the averaged equations.

    Attributes:
        number: 1 to 4.
        tilt: th, rad, from -pi to pi.
        phase: angle of the least axis from the node beyond p M + w, rad.
    """

    number: int
    tilt: float
    phase: float


@dataclass(frozen=True)
class Colombo:
    """Where the averaged equations of a body and an orbit have Cassini states.

    In the frame that turns with the node at the rate g about the pole k of its plane, the spin axis s of a
    body with the momentum L about its largest axis moves by H = U(s) - g L k . s, where U is the gradient's
    potential averaged over the orbit and, out of resonance, over the rotation (Colombo 1966, Astronomical
    Journal 71, 891; Peale 1969, Astronomical Journal 74, 483). In step with the orbit, p turns to a
    revolution, U has the part

        -(3 G M / 4 a^3) (B - A) |<(a/r)^3 (r1 + i r2)^2 exp -2 i (p M + w)>|

    besides, with r1, r2 the source's direction along the node and across it in the body's equator: the least
    axis is turned to where that is lowest. States lie in the plane of k and the orbit's normal n, where H is
    stationary; with the angle th from n towards k and I between both, a body of A = B has

        (C - A)/C (3 G M / 2 a^3) (1 - e^2)^(-3/2) / w cos th sin th + g sin(th - I) = 0.

    They are numbered as by Peale for a node that moves backwards: 1 and 3 are the least values of H nearest
    to n and to -n, 2 the greatest on k's side, 4 that on the other. A node that moves forwards gives the same
    with the spin reversed.

    Attributes:
        moments: least, middle, largest, kg m^2.
        spin: of the body about its largest axis in the turning frame, rad/s.
        turns: p, or None out of resonance.
    """

    orbit: KeplerOrbit
    strength: float  # G M / a^3, 1/s^2
    moments: tuple[float, float, float]
    spin: float
    turns: float | None
    periapsis: float

    def states(self) -> list[AveragedState]:
        """All states there are."""
        grid = -np.pi + 2 * np.pi * (np.arange(_ANGLES + 1) + 0.5) / _ANGLES
        slopes = self._slope(grid)
        at = np.flatnonzero(np.sign(slopes[:-1]) != np.sign(slopes[1:]))
        low, high, rising = grid[at], grid[at + 1], slopes[at] < 0
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            inside = (self._slope(middle) < 0) == rising
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        numbers: dict[int, float] = {}
        for least, tilt in zip(rising.tolist(), ((low + high) / 2).tolist(), strict=True):
            seen = tilt if self.orbit.node_rate < 0 else tilt + np.pi
            seen = (seen + np.pi) % (2 * np.pi) - np.pi
            number = (1 if abs(seen) < np.pi / 2 else 3) if least else (2 if seen > 0 else 4)
            numbers.setdefault(number, (tilt + np.pi) % (2 * np.pi) - np.pi)
        phases = self._energy(np.array(list(numbers.values())))[1].tolist()
        found = [AveragedState(n, x, phase) for (n, x), phase in zip(numbers.items(), phases, strict=True)]
        return sorted(found, key=lambda state: state.number)

    def _slope(self, tilts: np.ndarray) -> np.ndarray:
        ahead, behind = (self._energy(tilts + sign * _STEP)[0] for sign in (1, -1))
        turning = float(self.orbit.node_rate) * self.moments[2] * self.spin
        return np.asarray(
            (ahead - behind) / (2 * _STEP) + turning * np.sin(tilts - float(self.orbit.inclination))
        )

    def _energy(self, tilts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """U (J) and the least axis' phase at angles (n,)."""
        least, middle, most = self.moments
        e, tilt = float(self.orbit.eccentricity), float(self.orbit.inclination)
        eccentric = 2 * np.pi * np.arange(_ANOMALIES) / _ANOMALIES
        mean = eccentric - e * np.sin(eccentric)
        radius = 1 - e * np.cos(eccentric)
        weight = radius / radius**3 / _ANOMALIES  # dM = (1 - e cos E) dE
        true = np.arctan2(np.sqrt(1 - e * e) * np.sin(eccentric), np.cos(eccentric) - e) + self.periapsis
        source = np.array([np.cos(true), np.sin(true) * np.cos(tilt), np.sin(true) * np.sin(tilt)])
        lean = tilt - tilts  # of the spin axis from k
        second = np.array([np.zeros_like(lean), np.cos(lean), np.sin(lean)])
        pole = np.array([np.zeros_like(lean), -np.sin(lean), np.cos(lean)])
        r1, r2, r3 = source[0][None, :], second.T @ source, pole.T @ source
        flat = (most - (least + middle) / 2) * (weight * r3**2).sum(axis=1)
        phase = np.zeros_like(tilts)
        if self.turns is not None:
            wave = np.exp(-2j * (self.turns * mean + self.periapsis))
            part = (weight * (r1 + 1j * r2) ** 2 * wave).sum(axis=1)
            flat = flat - (middle - least) / 2 * np.abs(part)
            phase = np.angle(part) / 2
        return 1.5 * self.strength * flat, phase
