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
    dot,
    multiply,
    negligible,
    norm,
    parallel,
    transpose,
)
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.starts import ATTITUDES, InitialRotation
from rigidsim.solve.equilibria.search import (
    Newton,
    NoEquilibrium,
    Pose,
    PoseMotion,
    exponents_of,
    jacobian,
    widths,
)
from rigidsim.store.summary import FoundStart

_ROUNDS = 40
_STILL = 1e-9
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
    exponents, stable = exponents_of(context, matrix, orbit.mean_motion * context.mpf(_STILL))
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
    """Refuse loads that don't rest in the turning frame, and states beside the rotation that do not."""
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
            raise NoEquilibrium(f"the state {name} changes in it; start it where it rests")


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
