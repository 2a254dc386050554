"""Torques and forces of loads at random states, which show about what axes they act: no load declares what it
conserves.

heyoka works operations on numbers out at once. A load that is asked on a state of numbers answers in numbers,
in all digits of the scene, and nothing is compiled. Where it depends on more than that, nothing is known of
it. Formulas of the config stand for any value, since they may be narrow pulses (``Kinematics.guess``).
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import MassDistribution
from rigidsim.model.load import Load, Term, force_terms, torque_terms
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.orbits import KeplerParts, OrbitStates
from rigidsim.model.scaling import choose_scaling, scaled_numbers
from rigidsim.model.state_blocks import AttitudeStates, StateBlock
from rigidsim.scene import attitude
from rigidsim.scene.arithmetic import (
    Matrix,
    Vector,
    apply,
    cross,
    dot,
    negligible,
    norm,
    parallel,
    unit_vectors,
)
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.swept import Swept, plain

_STATES = 3
_SWEPT = "swept"  # numbers of a sweep's member that the probes have read
_SPREAD = 8  # part of the start's distance and speed by which a flight's are varied

Acting = tuple[Vector, Any]
"""What a load exerts, and the sum of its parts' sizes, which rounding is relative to (mpf)."""


@dataclass(frozen=True)
class Probe(Mechanics):
    """A state of numbers."""

    turn: Matrix | None = None
    place: Vector | None = None  # m
    moment: Any = None  # s
    draw: random.Random | None = None

    @classmethod
    def several(cls, m: Mechanics, about: Vector | None = None) -> list[Probe]:
        """Random states; about an axis of the body (unit), those that the start turns to."""
        draw = random.Random(0)
        return [cls._one(m, draw, about) for _ in range(_STATES)]

    @classmethod
    def _one(cls, m: Mechanics, draw: random.Random, about: Vector | None) -> Probe:
        scene, context, scaling = m.scene, m.scene.context, m.scaling

        def real(x: Any) -> Any:
            mantissa, exponent = context.mpf(x).man_exp
            size = hy.real(mantissa, context.prec) * hy.real(2.0, context.prec) ** exponent
            return -size if x < 0 else size

        def number(x: Any) -> Any:
            if isinstance(x, Swept):  # zero in all members of a sweep or in none
                m.cache.setdefault(_SWEPT, []).append(x)
                x = context.zero if x == 0 else x.first
            return real(x)

        def drawn(count: int) -> Vector:
            return [context.mpf(draw.gauss(0, 1)) for _ in range(count)]

        def shown(vector: Vector) -> list[Any]:
            return [hy.expression(real(plain(x))) for x in vector]  # a state is as good as another

        rates, quaternion, units = drawn(3), attitude.unit_quaternion(context, drawn(4)), m.numbers.rate_units
        if about is not None:
            spin, angle = drawn(2)
            rates, s = [spin * x for x in about], context.sin(angle)
            turned = [context.cos(angle), *(s * x for x in about)]
            quaternion = attitude.product(list(scene.quaternion), turned)
        turn = attitude.rotation_matrix(quaternion)
        states = AttitudeStates([], [], [], [shown(row) for row in turn], shown(quaternion), "state")
        a, b, c, d, e, f = shown(drawn(6))  # for moments that vary, any tensor
        shape = None if m.shape is None else MassDistribution([[a, b, c], [b, d, e], [c, e, f]], None)
        up = None if m.numbers.arm is None else m.numbers.vertical_of(states.matrix, number)
        place = speed = None
        if scene.position is not None and scene.velocity is not None:
            place, speed = (
                [x + norm(context, v) / _SPREAD * y for x, y in zip(v, drawn(3), strict=True)]
                for v in (scene.position, scene.velocity)
            )
        return cls(
            scene, scaling, m.numbers, shown([w / u for w, u in zip(rates, units, strict=True)]), states, up,
            None if place is None else shown([context.ldexp(x, -scaling.length) for x in place]),
            None if speed is None else shown([context.ldexp(x, -scaling.speed) for x in speed]),
            number, loads=m.loads, shape=shape, turn=turn, place=place, draw=draw,
            moment=scene.start + (scene.end - scene.start) * context.mpf(draw.random()),
        )  # fmt: skip

    def orbit(self, orbit: KeplerOrbit) -> OrbitStates:
        """Where the source is at some time."""
        context = self.scene.context
        place, velocity, _ = KeplerParts.at(orbit, context, self.moment).motions()
        vectors = [[x / norm(context, v) for x in v] for v in (place, cross(place, velocity))]
        direction, normal = ([hy.expression(self.number(x)) for x in v] for v in vectors)
        inverse = hy.expression(self.number(1 / norm(context, place)))
        return OrbitStates(StateBlock([], [], []), direction, normal, inverse)

    def guess(self) -> Any:
        """An arbitrary number."""
        return hy.expression(self.number(self.scene.context.mpf(self.carried(self.draw).gauss(0, 1))))

    def added(self, terms: Iterable[Term]) -> Acting | None:
        """The sum of terms; None if they aren't numbers."""
        context = self.scene.context
        total, size = [context.zero] * 3, context.zero
        for vector, expression in terms:
            try:
                x = context.mpf(str(expression))
            except ValueError:
                return None
            total = [a + x * b for a, b in zip(total, vector, strict=True)]
            size += abs(x) * norm(context, vector)
        return total, size

    def exerted(self, load: Load, about: Vector | None) -> Acting | None:
        """Torque of a load, space axes; with a point (m), together with its force's moment about that."""
        context, scaling = self.scene.context, self.scaling
        if _reads_more(load) or (found := self.added(terms := torque_terms(load, self))) is None:
            return None
        if terms and found[1] == 0:  # perhaps in this state alone
            return None
        total, size = apply(self.carried(self.turn), found[0]), found[1]
        if about is None or self.place is None:
            return total, size
        if (force := self.added(force_terms(load, self))) is None:
            return None
        mass = context.ldexp(self.scene.body.mass, scaling.speed - scaling.time - scaling.energy)
        arm = [mass * (x - p) for x, p in zip(self.place, about, strict=True)]
        total = [a + b for a, b in zip(total, cross(arm, force[0]), strict=True)]
        return total, size + norm(context, arm) * force[1]


def _reads_more(load: Load) -> bool:
    """Whether a load depends on more than a state of numbers has, or says that it is narrow."""
    moves = load.table or load.sights or load.of_time or load.reacts
    return bool(moves) or type(load).narrow is not Load.narrow


def turned_out(scene: Scene, loads: Sequence[Load], axis: Vector) -> Load | None:
    """The first load that may turn a body, which turns about an axis (unit, body axes), about another one."""
    context, scaling = scene.context, choose_scaling(scene)
    m = Mechanics(
        scene, scaling, scaled_numbers(scene, scaling), [], None, None, None, None, float, loads=list(loads)
    )
    probes = Probe.several(m, axis)
    for load in loads:
        if _reads_more(load) or not type(load).__module__.startswith("rigidsim."):  # may vanish when tried
            return load
        for probe in probes:
            terms = torque_terms(load, probe)
            found = probe.added(term for term in terms if not parallel(context, term[0], axis))
            size = sum(norm(context, vector) for vector, _ in terms)  # whose factors are of order 1
            if found is None or norm(context, cross(found[0], axis)) > negligible(context) * size:
                return load
    _share(m)
    return None


def _share(m: Mechanics) -> None:
    """Restrict members of a sweep to these numbers: what vanishes with them may not with others."""
    for x in m.cache.pop(_SWEPT, ()):
        x.decided()


def samples(m: Mechanics, about: Vector | None = None) -> list[list[Acting | None]]:
    """What each load exerts at random states (see ``Probe.exerted``); None where that isn't known."""
    key = "samples", None if about is None else tuple(about)
    if key not in m.cache:
        m.cache[key] = [[probe.exerted(load, about) for load in m.loads] for probe in Probe.several(m)]
    return m.cache[key]


def spared(m: Mechanics, found: Sequence[Sequence[Acting | None]], axis: Vector) -> bool:
    """Whether loads exert nothing about a unit axis in space, each by itself or together."""
    context = m.scene.context
    for sample in found:
        rest, size = context.zero, context.zero
        for acting in sample:
            if acting is None:
                return False
            part = dot(acting[0], axis)
            if abs(part) > negligible(context) * acting[1]:
                rest, size = rest + part, size + acting[1]
        if abs(rest) > negligible(context) * size:
            return False
    _share(m)
    return True


def spared_axis(m: Mechanics, found: Sequence[Sequence[Acting | None]]) -> Vector | None:
    """The unit axis in space about which loads exert nothing; None unless there is exactly one."""
    context = m.scene.context
    known = [[acting for acting in sample if acting is not None] for sample in found]
    if [len(sample) for sample in known] != [len(sample) for sample in found]:
        return None
    sums = [[sum((acting[0][i] for acting in sample), context.zero) for i in range(3)] for sample in known]
    axis = max((cross(a, b) for a, b in combinations(sums, 2)), key=lambda x: norm(context, x))
    size, tiny = norm(context, axis), negligible(context)
    if size <= tiny * max(sum(acting[1] for acting in sample) for sample in known) ** 2:
        return None
    axis = [x / size if abs(x) > tiny * size else context.zero for x in axis]
    axis = [x / norm(context, axis) for x in axis]
    return axis if spared(m, found, axis) else None


# --- axes about which nothing acts -------------------------------------------------------------------------


def keeps(m: Mechanics, axis: Vector, loads: Sequence[Load] | None = None) -> bool:
    """Whether no torque of these loads (or any) acts about a unit axis in space, however the body moves."""
    which = [i for i, load in enumerate(m.loads) if load in m.turning and (loads is None or load in loads)]
    return not which or spared(m, [[sample[i] for i in which] for sample in samples(m)], axis)


def kept_axes(m: Mechanics) -> dict[str, Vector]:
    """Unit axes in space without a torque about them, where some torque acts, by what momenta along them are
    called: the only one by sources at rest, or by a field; x, y and z by nothing else. The vertical is apart.
    """
    if "kept axes" in m.cache:
        return m.cache["kept axes"]
    found: dict[str, Vector] = {}
    context, up = m.scene.context, m.numbers.up if m.numbers.arm is not None else None
    marks = [mark for load in m.turning if (mark := load.direction(m.scene)) is not None]
    axis = spared_axis(m, samples(m)) if m.torque else None
    if axis is not None and not (up is not None and parallel(context, up, axis)):
        along = next((x for mark in marks if abs(x := dot(mark, axis)) > negligible(context)), context.one)
        axis = axis if along > 0 else [-x for x in axis]
        in_field = any(parallel(context, mark, axis) for mark in marks)
        if any(load.fixed_source(m.scene) is not None for load in m.turning):
            found["source"] = axis
        elif in_field or all(abs(x) != 1 for x in axis):
            found["field"] = axis
    named = [*found.values(), *([] if up is None else [up])]
    for name, axis in zip("xyz", unit_vectors(context) if m.torque else [], strict=False):
        if not any(parallel(context, axis, other) for other in named) and keeps(m, axis):
            found[name] = axis
    m.cache["kept axes"] = found
    return found


def _points(m: Mechanics) -> list[Vector]:
    return [point for load in m.loads if (point := load.attracting_point) is not None]


def one_point(m: Mechanics) -> bool:
    """Whether nothing turns the motion, spin and orbit together, about an attracting point."""
    points, context = _points(m), m.scene.context
    return bool(points) and all(spared(m, samples(m, points[0]), axis) for axis in unit_vectors(context))


def attracting_line(m: Mechanics) -> Vector | None:
    """Unit vector of the one line through an attracting point about which nothing turns the motion."""
    points = _points(m)
    return spared_axis(m, samples(m, points[0])) if points else None
