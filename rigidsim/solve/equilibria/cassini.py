"""Cassini states: motions that are the same after each revolution, in the frame that turns with the node.

Averaged equations say where the state is (``colombo``). The full equations have a motion beside it that is
periodic in the node's frame: with the orbit at the same place after T, Newton's method finds the pose that
comes back, turned with the node (and, for A = B, about the figure axis by any angle). It has no free
libration. T is one revolution from pericentre to pericentre, two for a half-odd number of turns; if apsides
turn on an eccentric orbit, so many revolutions as they need to come back, on an orbit whose apsides turn at
the nearest such rate, and for slow ones with the apsides at rest. Eigenvalues of the map over T are exp(x T)
with the exponents x of the stability, whose imaginary part is known but for multiples of 2 pi / T.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rigidsim.model.capabilities import gradient_source_of
from rigidsim.model.load import loads_of
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import (
    Matrix,
    Vector,
    apply,
    cross,
    dot,
    multiply,
    norm,
    transpose,
    working_bits,
)
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.starts import InitialRotation, refusal
from rigidsim.solve.equilibria.colombo import AveragedState, Colombo, doubles
from rigidsim.solve.equilibria.motion import Lost, Pose, PoseMotion, turned, widths
from rigidsim.solve.equilibria.newton import Newton, NotFound, exponents_of
from rigidsim.solve.equilibria.search import SoughtReturn, search_for
from rigidsim.store.summary import FoundStart

_SWIFT = 60  # turns from one return to the next
_DOUBLE = 53  # bits
_NEAR = 0.1  # rad of obliquity from the averaged state


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
    (source,) = (s for load in loads_of(scene) if (s := gradient_source_of(load)) is not None)
    least, middle, most = sorted(doubles(scene.body.principal_moments))
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
