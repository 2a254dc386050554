"""Relative equilibria: a body at rest in the frame that turns with a circular orbit.

With the orbit's rate n and normal o the body turns at w = n o, and its equations leave w' = 0 in body axes at
24 attitudes under the gradient alone: each principal axis along the source's direction, the orbit's normal,
or forward (Lagrange 1780; Hughes, Spacecraft Attitude Dynamics, 1986, ch. 9). With other loads that rest in
the turning frame, or momentum in the body, Newton's method leads from one of these to the zero beside it.

With the least axis towards the source and the largest along the normal the dynamic potential is least, and
the equilibrium is stable (Lagrange); others may be held by gyroscopic torques alone (DeBra and Delp 1961, J.
Astronaut. Sci. 8, 14). The exponents are eigenvalues of

    d' = v + d x w,    v' = (df/dd) d + (df/dw) v

for a turn d and a change v of the rates, both along body axes, and w' = f(attitude, w).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations, product
from typing import Any

from rigidsim.model.load import loads_of
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import (
    Matrix,
    Vector,
    apply,
    cross,
    multiply,
    negligible,
    norm,
    parallel,
    transpose,
)
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.starts import ATTITUDES, InitialRotation, refusal
from rigidsim.solve.equilibria.motion import Pose, PoseMotion, widths
from rigidsim.solve.equilibria.newton import Newton, NotFound, exponents_of, jacobian
from rigidsim.store.summary import FoundStart

_KEY = "equilibrium"
_ROUNDS = 40
_STILL = 1e-9
"""Part of the orbit's rate below which a part of an exponent is zero: equal ones lose half of theirs."""
_AT = 1e-9  # rad from one of the 24 attitudes
_FAR = 1.0  # rad from the attitude that Newton's method begins at
_LATER = "0.3819660112501051"  # of a revolution, at which loads that rest in the frame are the same
_NAMES = ("the axis of least moment", "the middle axis", "the axis of largest moment")


def relative_equilibrium(scene: Scene) -> InitialRotation:
    """The relative equilibrium nearest to the attitude given, or without one the stable one.

    Raises:
        ConfigError: the scene has none, or none was found.
    """
    context, orbit = scene.context, _orbit(scene)
    precision = widths(scene)[-1]
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
            what = 'given "relative", but a load has a kink or jump, or happens at a moment; give attitude '
            raise refusal(_KEY, f"{what}and rates themselves")
        size = norm(context, residual(found))
        if size <= context.ldexp(1, 24 - precision.bits) or size >= before:
            break
        try:
            found = Newton(context, precision.bits, residual, moved, 3).settled(found)
        except NotFound:
            what = 'given "relative", but none was found near that attitude; give another one to begin at'
            raise refusal(_KEY, what) from None
    away = _angle(context, begun, found.matrix)
    if away > _FAR:
        degrees = context.nstr(context.degrees(away), 3)
        what = (
            f'given "relative", but the nearest one is {degrees} deg from where the gradient alone has one: '
        )
        raise refusal(_KEY, f"{what}the other loads are too strong; give attitude and rates themselves")
    _refuse_passing(scene, precision, orbit, found, here)
    matrix = _linear(context, here, found, precision.bits)
    exponents, stable = exponents_of(context, matrix, orbit.mean_motion * context.mpf(_STILL))
    told = FoundStart(
        name="relative",
        described=_described(order, stable, away),
        how=_how(away),
        exponents=exponents,
        stable=stable,
    )
    return found.start(context, precision.bits, told)


def _orbit(scene: Scene) -> KeplerOrbit:
    loads = loads_of(scene)
    orbits = [orbit for load in loads if (orbit := load.orbit) is not None]
    given = 'given "relative", but '
    if not orbits or scene.free_flight:
        what = "no load has a source on an orbit (gravity_gradient with orbit)"
        if scene.free_flight:
            what = "the body flies on another orbit, and this is for a prescribed one"
        raise refusal(_KEY, f"{given}{what}; give the attitude and rates themselves")
    if any(load.changes for load in loads):
        what = "the body's moments vary, and its equilibria with them"
        raise refusal(_KEY, f"{given}{what}; give the attitude and rates themselves")
    moments = scene.body.principal_moments
    if max(moments) - min(moments) <= max(moments) * negligible(scene.context):
        what = "a body whose moments are all the same rests in any attitude, or in none"
        raise refusal(_KEY, f"{given}{what}; give the attitude and rates themselves")
    first = orbits[0]
    if not first.circular:
        size = scene.context.nstr(first.eccentricity, 6)
        what = f"the orbit's eccentricity is {size}, and a body rests only relative to a circle; "
        raise refusal(_KEY, f"{given}{what}set it to 0, or give attitude and rates")
    if not first.fixed_plane:
        raise refusal(_KEY, f'{given}the orbit\'s node moves; choose "cassini_1" to "cassini_4"')
    normal = first.normal(scene.context)
    turning = [orbit for load in loads if (orbit := load.corotating_orbit) is not None]
    for orbit in orbits:
        same = orbit in turning and orbit.mean_motion == first.mean_motion
        if not same or not parallel(scene.context, orbit.normal(scene.context), normal):
            raise refusal(
                _KEY, f"{given}the sources are on different orbits, so that nothing rests between them"
            )
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
            trace = sum(
                a * b
                for row, other in zip(matrix, wanted, strict=True)
                for a, b in zip(row, other, strict=True)
            )
            # without an attitude given, the axes themselves and not their opposites
            found.append((trace if given else sum(signs), matrix, order))
    return max(found, key=lambda entry: entry[0])[1:]


def _angle(context: Any, a: Matrix, b: Matrix) -> Any:
    """Angle (rad) of the rotation between two attitudes."""
    w, *vector = attitude.quaternion_from_matrix(context, multiply(transpose(a), b))
    return 2 * context.atan2(norm(context, vector), abs(w))


def _refuse_passing(scene: Scene, precision: Any, orbit: KeplerOrbit, found: Pose, here: PoseMotion) -> None:
    """Refuse loads that don't rest in the turning frame, and states beside the rotation that do not."""
    context, n = scene.context, orbit.mean_motion
    seconds = 2 * context.pi / n * context.mpf(_LATER)
    later = PoseMotion(replace(scene, start=scene.start + seconds, end=scene.end + seconds), precision, found)
    turn = multiply(
        transpose(_frame(orbit, context, scene.start + seconds)), _frame(orbit, context, scene.start)
    )
    there = Pose(multiply(turn, found.matrix), found.rates)
    size = norm(context, later.acceleration(there)[0]) / n**2
    if size > context.mpf(10) ** -12:
        what = 'given "relative", but a load changes relative to the turning frame (it depends on time, or is'
        raise refusal(
            _KEY, f"{what} fixed in space): nothing rests there; give the attitude and rates themselves"
        )
    for name, slope in here.acceleration(found)[1].items():
        if abs(slope) > context.mpf(10) ** -12:
            what = f'given "relative", but the state {name} changes in it; start it where it rests'
            raise refusal(_KEY, what)


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


def _described(order: tuple[int, ...], stable: bool, away: Any) -> str:
    first, _, last = (_NAMES[k] for k in order)
    said = "stable" if stable else "unstable"
    if stable and away < _AT:
        said += " (least dynamic potential)" if order == (0, 1, 2) else " (by gyroscopic torques alone)"
    near = "" if away < _AT else f"{float(away) * 57.29577951308232:.4g} deg from "
    return (
        f"relative equilibrium, {near}{first} towards the source and {last} along the orbit's normal: {said}"
    )


def _how(away: Any) -> str:
    if away < _AT:
        return "as one of the gradient's 24 attitudes, an exact solution of the full equations"
    return "by Newton's method on the full equations, of which it is an exact solution"
