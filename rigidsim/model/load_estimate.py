"""Estimates of loads of unknown size, from which units and drift scales are chosen.

Torques given as expressions, or from Python, are evaluated over the run's time span, at the initial state
and at others like it: turned by the rotations of a tetrahedron, with rates, position and velocity reversed.
The mean torque over these states is taken to act for good, its impulse adding up; the rest is taken as a
spring or a swing, which does the work of one turn at most. The estimate is rounded to powers of
two, and never enters the equations.

What a carrier's drive exerts depends on its own momentum: friction ends, a wheel comes up to its rate. Its
states are followed over the run by their mean slopes, so that the lasting impulse is what they take up.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import heyoka as hy
import numpy as np

from rigidsim.model.carriers import Carrier
from rigidsim.model.formulations.formulation import ModelPlan, Requirements
from rigidsim.model.formulations.quaternion import quaternion_states
from rigidsim.model.kinematics import in_common_unit
from rigidsim.model.load import Load, Term, force_terms, loads_of, torque_terms
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.names import written
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Drive, choose_scaling, scaled_numbers
from rigidsim.model.state_blocks import BODY, StateBlock
from rigidsim.scene import attitude as numeric
from rigidsim.scene.arithmetic import apply, transpose
from rigidsim.scene.expressions.tree import names_used
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.surfaces import surfaces_of

_TIMES = 2048  # over the run
_LARGEST = 1e100  # largest torque or force in SI that is considered
_TETRAHEDRAL = np.concatenate([np.eye(4), [[0.5, *signs] for signs in product((-0.5, 0.5), repeat=3)]])
"""Rotations of a tetrahedron: over them, functions of first and second order of the attitude average out."""
_OBLIQUE = np.array([[0.8, 0.4, -0.2, 0.4], [0.5, -0.1, 0.7, -0.5], [0.3, 0.9, 0.1, 0.3]])
_OBLIQUE /= np.linalg.norm(_OBLIQUE, axis=1)[:, None]
"""Rotations applied before those of the tetrahedron: charts of the attitude are singular or symmetric in
special places.
"""
_STATES = 2 * (1 + len(_TETRAHEDRAL) * len(_OBLIQUE))
"""Number of states: the initial one and the rotated ones, and each with everything else reversed."""
_LASTING = 0.3  # of a torque's impulse; a mean over few states leaves as much where the true mean is zero
_TURN = 2 * np.pi  # rad of one swing
_CYCLE = 8.0  # over the rate of change: impulse of half a period, and a margin
_NOISE = 4.0  # standard deviations of a mean over the times
_AROUND = 2.0 ** -np.arange(0, 48, 0.25)  # in units of the run's length, around what is narrow in time
_MOST_PULSES = 16
_CELLS = 64  # of the run, in which carriers' momenta are followed
_HALVINGS = 8
_NEWTON = 40  # iterations, each of which halves the distance to a double zero
_CLOCK = "t_of_drive"


def estimate_drive(scene: Scene, loads: Sequence[Load], requirements: Requirements) -> Drive | None:
    """Estimate of what these loads, whose size is unknown, can add to the motion; None without any."""
    if not loads:
        return None
    m = probe(scene, requirements, loads)
    torque = [term for load in loads for term in torque_terms(load, m)]
    carriers = [load for load in loads if isinstance(load, Carrier)]
    inner = [term for carrier in carriers for term in carrier.exerted_torque(m)]
    force = [term for load in loads for term in force_terms(load, m)] if m.velocity is not None else []
    names, start = start_of(m, loads)
    narrow = [u for load in loads for u in load.narrow(m)]
    in_time = (s.expression for s in surfaces_of(scene).found if names_used(s.expression) == {"t"})
    narrow += written(m, in_time)
    samples = _Samples(m, names, start, narrow)
    context, scaling = scene.context, m.scaling
    inverse = np.array([[float(x) for x in row] for row in m.numbers.inverse_inertia])
    lasting_only = samples.evaluate(torque)
    turned = samples.evaluate([*torque, *inner]) if inner else lasting_only
    pushed = samples.evaluate(force)
    rates = samples.of(m.rates)
    power = (turned.values * rates).sum(axis=0)
    if m.velocity is not None:
        power = power + (pushed.values * samples.of(m.velocity)).sum(axis=0)
    if np.any(power != 0) and power.max() <= 0:  # damping only removes energy
        return Drive(context.zero, context.zero)
    heaviest = float(np.linalg.norm(inverse, 2))
    by_space = np.einsum("aij,jta->ita", samples.matrices, lasting_only.values)
    lasting = 0.0
    for values, frame in ((lasting_only.values, np.eye(3)), (by_space, samples.matrices[0].T)):
        impulse = frame @ samples.impulse(values)
        lasting = max(lasting, float(np.einsum("it,ij,jt->t", impulse, inverse, impulse).max()) / 2)
    peak = turned.peak(without_mean=lasting > 0 or bool(inner))
    blocks = [block for x in carriers if (block := x.extra_states(m)) is not None]
    if blocks:
        taken = samples.taken_up(blocks, [term for x in carriers for term in x.carried_momentum(m)])
        lasting += float(np.einsum("ti,ij,tj->t", taken, inverse, taken).max()) / 2
    swing = min(_TURN * peak, heaviest * min(turned.most, _CYCLE * peak * turned.period) ** 2 / 2)
    energy = lasting + swing
    speed = 0.0
    if force:
        speed = float(np.linalg.norm(samples.impulse(pushed.values), axis=0).max())
        peak = pushed.peak(without_mean=speed > 0)
        room = 2.0 ** (scaling.length - scaling.speed - scaling.time)
        speed += min(pushed.most, _CYCLE * peak * pushed.period, float(np.sqrt(2 * peak * room)))
    sizes = ((energy, scaling.energy), (speed, scaling.speed))
    return Drive(*(context.ldexp(context.mpf(value), exponent) for value, exponent in sizes))


def effect_at_start(plan: ModelPlan, loads: Sequence[Load]) -> list[tuple[str, float, str]]:
    """Torque and force of loads together at the start: what it is, its size and its unit."""
    scene, m = plan.scene, probe(plan.scene, plan.requirements, plan.loads)
    names, start = start_of(m, plan.loads)
    unit, sizes = m.scaling, []
    given = [("torque", torque_terms, 2.0**unit.energy, "N m")]
    if m.velocity is not None:
        given.append(
            ("force", force_terms, 2.0 ** (unit.speed - unit.time) * float(m.carried(scene.body.mass)), "N")
        )
    for what, terms_of, size, symbol in given:
        if terms := [term for load in loads for term in terms_of(load, m)]:
            parts = [hy.sum([float(vector[i]) * x for vector, x in terms]) for i in range(3)]
            function = hy.cfunc(parts, list(hy.make_vars(*names)), compact_mode=True)
            values = function(start, time=float(scene.context.ldexp(scene.start, -unit.time)))
            sizes.append((what, float(np.linalg.norm(values)) * size, symbol))
    return sizes


def probe(scene: Scene, requirements: Requirements, loads: Sequence[Load]) -> Mechanics:
    """The scene in double precision with quaternions, in units chosen without these loads."""
    scaling = choose_scaling(scene)
    numbers = scaled_numbers(scene, scaling)
    states = list(hy.make_vars(*BODY.rates))
    rates = in_common_unit(states, numbers.rate_units, float)
    attitude = quaternion_states(scene, rates) if requirements.attitude else None
    return Mechanics.built(
        scene, scaling, numbers, states, attitude, float,
        vertical=requirements.vertical, flies=requirements.flight, loads=list(loads),
        orbit_tags=orbit_tags(scene),
    )  # fmt: skip


def orbit_tags(scene: Scene) -> dict[KeplerOrbit, str]:
    """Suffixes of the states of each orbit: the number of the first load on it."""
    orbits = [(load.orbit, str(number)) for number, load in enumerate(loads_of(scene), start=1)]
    return {orbit: tag for orbit, tag in reversed(orbits) if orbit is not None}


def start_of(m: Mechanics, loads: Sequence[Load]) -> tuple[list[str], np.ndarray]:
    """Names and initial values of all states that the loads may read, internal units."""
    scene, scaling, context = m.scene, m.scaling, m.scene.context
    values = {
        name: context.ldexp(w, scaling.time - e)
        for name, w, e in zip(BODY.rates, scene.angular_velocity, scaling.rates, strict=True)
    }
    values |= zip(BODY.quaternion, scene.quaternion, strict=True)
    if m.numbers.up is not None:
        up = apply(transpose(numeric.rotation_matrix(scene.quaternion)), m.numbers.up)
        values |= zip(BODY.vertical, up, strict=True)
    if scene.position is not None and scene.velocity is not None:
        values |= zip(BODY.position, [context.ldexp(x, -scaling.length) for x in scene.position], strict=True)
        values |= zip(BODY.velocity, [context.ldexp(v, -scaling.speed) for v in scene.velocity], strict=True)
    for orbit in {x: None for load in scene.loads if (x := load.orbit or load.table) is not None}:
        block = (m.orbit(orbit) if isinstance(orbit, KeplerOrbit) else m.table(orbit)).block
        values |= zip(block.names, block.initial, strict=True)
    if m.sky is not None:
        block = m.sky.block()
        values |= zip(block.names, block.initial, strict=True)
    if m.point_masses is not None:
        block = m.point_masses.block()
        values |= zip(block.names, block.initial, strict=True)
    values |= {x.name: context.ldexp(x.initial, -scaling.own.get(x.name, 0)) for x in scene.states}
    for load in loads:
        extra = load.extra_states(m)
        if extra is not None:
            values |= zip(extra.names, extra.initial, strict=True)
    return list(values), np.array([float(x) for x in values.values()])


@dataclass(frozen=True)
class _Sampled:
    """A vector sampled over times and states."""

    values: np.ndarray  # shape (3, times, states)
    most: float  # impulse that it would give if it always pointed the same way
    period: float  # inverse rate of its explicit change in time; infinite if it has none

    def peak(self, *, without_mean: bool) -> float:
        """Largest norm; with ``without_mean``, of the vector less its mean over the states."""
        values = self.values - self.values.mean(axis=2, keepdims=True) if without_mean else self.values
        return float(np.linalg.norm(values, axis=0).max(initial=0.0))


class _Samples:
    """Times and states at which expressions are evaluated."""

    def __init__(self, m: Mechanics, names: list[str], start: np.ndarray, narrow: list[Symbolic]) -> None:
        self._names = names
        generator = np.random.default_rng(0)  # the same each time: the units are a function of the scene
        states = np.repeat(start[:, None], _STATES, axis=1)
        index = {name: i for i, name in enumerate(names)}
        for name in (*BODY.rates, *BODY.position, *BODY.velocity):
            if name in index:
                states[index[name], _STATES // 2 :] *= -1
        first = [index[name] for name in BODY.quaternion]
        turns = [_product(start[first], _product(g, h)) for g in _TETRAHEDRAL for h in _OBLIQUE]
        states[first] = np.tile(np.array([start[first], *turns]).T, (1, 2))
        self._states = states
        self.matrices = np.array([_matrix(q) for q in states[first].T])
        unit = float(m.scene.context.ldexp(m.scene.context.one, m.scaling.time))
        begin, end = sorted(float(time) / unit for time in (m.scene.start, m.scene.end))
        cells = np.linspace(begin, end, _TIMES + 1)
        uniform = cells[:-1] + generator.uniform(0, 1, _TIMES) * np.diff(cells)
        self._span = end - begin
        self._times = np.unique(np.concatenate([[begin, end], uniform, *self._pulses(narrow, uniform)]))
        self._times = self._times[(self._times >= begin) & (self._times <= end)]
        self._uniform = np.searchsorted(self._times, uniform)

    def _compiled(self, expressions: Sequence[Symbolic]) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
        """Function of times (t,) and states (names, s) to values (expressions, t, s), 0 if they aren't
        finite.
        """
        function = hy.cfunc(list(expressions), list(hy.make_vars(*self._names)), compact_mode=True)

        def evaluated(times: np.ndarray, states: np.ndarray) -> np.ndarray:
            inputs = np.ascontiguousarray(np.tile(states, (1, len(times))))
            with np.errstate(all="ignore"):
                found = function(inputs, time=np.repeat(times, states.shape[1]))
            found = np.asarray(found).reshape(len(expressions), len(times), states.shape[1])
            # values that no run survives tell nothing about its scale
            return np.where(np.abs(found) < _LARGEST, found, 0.0)

        return evaluated

    def of(self, expressions: Sequence[Symbolic]) -> np.ndarray:
        """Values of expressions over all times and states."""
        return self._compiled(expressions)(self._times, self._states)

    def evaluate(self, terms: Sequence[Term]) -> _Sampled:
        """Samples of the sum of terms."""
        if not terms:
            return _Sampled(np.zeros((3, len(self._times), _STATES)), 0.0, np.inf)
        sums = [hy.sum([float(vector[i]) * x for vector, x in terms]) for i in range(3)]
        values = self.of([*sums, *(_by_time(x) for x in sums)])
        changes, values = values[3:], values[:3]
        size = np.linalg.norm(values, axis=0)
        fastest = float(np.linalg.norm(changes, axis=0).max())
        most = float(np.trapezoid(size.max(axis=1), self._times))
        return _Sampled(values, most, float(size.max()) / fastest if fastest > 0 else np.inf)

    def taken_up(self, blocks: Sequence[StateBlock], momentum: Sequence[Term]) -> np.ndarray:
        """What carriers' momenta, as terms, have taken up by the ends of cells of the run, (cells, 3), if
        each of their states follows the mean of its slope over the others; zero where that is only noise.
        """
        rows = [self._names.index(name) for block in blocks for name in block.names]
        slopes = self._compiled([x for block in blocks for x in block.derivatives])
        carried = self._compiled([hy.expression(x) for _, x in momentum])
        vectors = np.array([[float(x) for x in vector] for vector, _ in momentum])
        edges = np.linspace(0, len(self._times) - 1, _CELLS + 1).astype(int)
        start = self._states[rows, :1]

        def holding(values: np.ndarray) -> np.ndarray:
            states = self._states.copy()
            states[rows] = values
            return states

        def changes(times: np.ndarray, values: np.ndarray) -> list[np.ndarray]:
            """By the mean slopes with the states at these values, and by their root mean squares."""
            given = slopes(times, holding(values))
            sizes = given.mean(axis=2), np.sqrt((given**2).mean(axis=2))
            return [np.trapezoid(x, times, axis=1)[:, None] for x in sizes]

        now, tossed, found = start.copy(), np.zeros_like(start), []
        before = carried(self._times[:1], holding(start)).mean(axis=(1, 2))
        for first, last in pairwise(edges):
            times = self._times[first : last + 1]
            change, _ = changes(times, now)
            share = np.ones_like(change)
            # a slope that falls as the state grows ends where the change is that of the slope there
            if np.any((changes(times, now + change)[0] - change) * change < 0):
                low = np.zeros_like(share)
                high = share.copy()
                for _ in range(_HALVINGS):
                    share = (low + high) / 2
                    short = (changes(times, now + share * change)[0] - share * change) * change > 0
                    low, high = np.where(short, share, low), np.where(short, high, share)
            now = now + share * change
            tossed = tossed + changes(times, now)[1]
            known = np.where(np.abs(now - start) > _LASTING * tossed, now, start)
            after = carried(self._times[last : last + 1], holding(known)).mean(axis=(1, 2))
            found.append((after - before) @ vectors)
        return np.array(found)

    def impulse(self, values: np.ndarray) -> np.ndarray:
        """Running integral of a vector's mean over the states, shape (3, times); zero if it is only noise."""
        means, size = values.mean(axis=2), np.sqrt((values**2).sum(axis=0).mean(axis=1))
        steps = np.diff(self._times)
        sums = np.cumsum((means[:, 1:] + means[:, :-1]) / 2 * steps, axis=1)
        total = np.concatenate([np.zeros((3, 1)), sums], axis=1)
        spread = means[:, self._uniform].std(axis=1)
        noise = _NOISE * self._span * float(np.linalg.norm(spread)) / np.sqrt(_TIMES)
        noise = max(noise, _LASTING * float(np.trapezoid(size, self._times)))
        return total if np.linalg.norm(total, axis=0).max() > noise else np.zeros_like(total)

    def _pulses(self, narrow: list[Symbolic], times: np.ndarray) -> list[np.ndarray]:
        """Times on a logarithmic grid around the zeros of arguments, which Newton's method finds."""
        found = []
        for u in narrow:
            argument, at = self._compiled([u, _by_time(u)]), times
            for _ in range(_NEWTON):
                value, slope = argument(at, self._states[:, :1])[:, :, 0]
                moves = slope != 0
                step = np.where(moves, value / np.where(moves, slope, 1), 0)
                at = at - np.clip(step, -self._span, self._span)
            zeros = np.sort(at[np.abs(argument(at, self._states[:, :1])[0, :, 0]) < 1])
            zeros = zeros[np.diff(zeros, prepend=-np.inf) > 1e-9 * self._span][:_MOST_PULSES]
            found += [zero + sign * self._span * _AROUND for zero in zeros for sign in (-1, 1)]
        return found


def _by_time(u: Symbolic) -> Symbolic:
    """Part of an expression's time derivative that is explicit in time."""
    clock = hy.make_vars(_CLOCK)
    slope = hy.diff(hy.subs(hy.expression(u), {hy.time: clock}), clock)
    return hy.subs(slope, {clock: hy.time})


def _product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Product of quaternions, shape (4,)."""
    w, v = p[0] * q[0] - p[1:] @ q[1:], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.array([w, *v])


def _matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrix, body to space axes."""
    return np.array([[float(x) for x in row] for row in numeric.rotation_matrix(list(q))])
