"""Loads of unknown size, tried at many states: units and drift scales are chosen from what they can do.

Torques given as expressions, or from Python, are evaluated over the run's time span, at the initial state
and at others like it: turned by the rotations of a tetrahedron, with rates, position and velocity reversed.
The mean torque over these states is taken to act for good, its impulse adding up; the rest is taken as a
spring or a swing, which does the work of one turn at most. The estimate is rounded to powers of
two, and never enters the equations.

What a carrier's drive exerts depends on its own momentum: friction ends, a wheel comes up to its rate. Its
states are followed over the run by their mean slopes, so that the lasting impulse is what they take up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain, pairwise, product
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.formulations.formulation import ModelPlan, Requirements, quaternion_states
from rigidsim.model.kinematics import in_common_unit
from rigidsim.model.load import Load, Term, force_terms, loads_of, torque_terms
from rigidsim.model.mechanics import Carrier, Mechanics
from rigidsim.model.names import written
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import EstimatedEffect, Rounder, choose_scaling, scaled_numbers
from rigidsim.model.state_blocks import BODY, joined
from rigidsim.scene import attitude as numeric
from rigidsim.scene.arithmetic import apply, transpose
from rigidsim.scene.expressions.tree import names_used, readables
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene
from rigidsim.scene.surfaces import Surfaces

_TIMES = 2048  # over the run
_LARGEST = 1e100  # largest torque or force in internal units that is considered
_TETRAHEDRAL = np.concatenate([np.eye(4), [[0.5, *signs] for signs in product((-0.5, 0.5), repeat=3)]])
"""Rotations of a tetrahedron: over them, functions of first and second order of the attitude average out."""
_OBLIQUE = np.array([[0.8, 0.4, -0.2, 0.4], [0.5, -0.1, 0.7, -0.5], [0.3, 0.9, 0.1, 0.3]])
_OBLIQUE /= np.linalg.norm(_OBLIQUE, axis=1)[:, None]
"""Rotations applied before the tetrahedron's: charts of the attitude are singular or symmetric in
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
_OPPOSITE = 16  # states at which q and -q are compared
_ROUNDINGS = 8.0  # of the states, as they are drawn, in a sum of some terms that cancel
_ROUNDING = 1e-9  # of the largest component: far above rounding, far below any load that means its sign

Function = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From times (n,) and states (names, n) to values (expressions, n), internal units."""


def estimate_drive(
    scene: Scene, loads: Sequence[Load], requirements: Requirements, surfaces: Surfaces
) -> EstimatedEffect | None:
    """Estimate of what these loads, whose size is unknown, can add to the motion; None without any.

    Raises:
        ConfigError: a load that differs between q and -q, which are one attitude: it would depend on the
            formulation, on whether its attitude has a sign at all, and on how that was continued.
    """
    if not loads:
        return None
    trial = _Trial(scene, requirements, surfaces, loads)
    if requirements.attitude:
        trial.refuse_odd()
    return trial.drive()


def effects_at_start(plan: ModelPlan, groups: Sequence[Sequence[Load]]) -> list[list[tuple[str, float, str]]]:
    """Torque and force at the start of each group of loads together: what it is, its size and its unit."""
    if not any(groups):
        return [[] for _ in groups]
    scene, m = plan.scene, probe(plan.scene, plan.requirements, plan.loads)
    (names, start), unit = _in_double(start_of(m, plan.loads)), m.scaling
    kinds = [("torque", torque_terms, 2.0**unit.energy, "N m")]
    if m.velocity is not None:
        mass = float(m.carried(scene.body.mass))
        kinds.append(("force", force_terms, mass * 2.0 ** (unit.speed - unit.time), "N"))
    terms = [
        [term for load in group for term in terms_of(load, m)]
        for group in groups
        for _, terms_of, *_ in kinds
    ]
    function = hy.cfunc(
        [x for each in terms for x in sums_of(each)], list(hy.make_vars(*names)), compact_mode=True
    )
    values = function(start, time=float(scene.context.ldexp(scene.start, -unit.time)))
    sizes = iter(zip(terms, np.linalg.norm(np.reshape(values, (-1, 3)), axis=1), strict=True))
    rows = [[(what, *next(sizes), size, symbol) for what, _, size, symbol in kinds] for _ in groups]
    return [[(what, float(x) * size, symbol) for what, acts, x, size, symbol in row if acts] for row in rows]


def probe(
    scene: Scene, requirements: Requirements, loads: Sequence[Load], number: Rounder = float
) -> Mechanics:
    """The scene, by default in double precision, with quaternions, in units chosen without these loads."""
    scaling = choose_scaling(scene)
    numbers = scaled_numbers(scene, scaling)
    states = list(hy.make_vars(*BODY.rates))
    rates = in_common_unit(states, numbers.rate_units, number)
    attitude = quaternion_states(scene, rates) if requirements.attitude else None
    return Mechanics.built(
        scene, scaling, numbers, states, attitude, number,
        vertical=requirements.vertical, flies=requirements.flight, loads=list(loads),
        orbit_tags=orbit_tags(scene),
    )  # fmt: skip


def orbit_tags(scene: Scene) -> dict[KeplerOrbit, str]:
    """Suffixes of the states of each orbit: the number of the first load on it."""
    orbits = [(load.orbit, str(number)) for number, load in enumerate(loads_of(scene), start=1)]
    return {orbit: tag for orbit, tag in reversed(orbits) if orbit is not None}


def start_of(m: Mechanics, loads: Sequence[Load]) -> dict[str, Any]:
    """Initial values (mpf) of all states that the loads may read, by their names, internal units."""
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
    return values


def _in_double(values: Mapping[str, Any]) -> tuple[list[str], np.ndarray]:
    return list(values), np.array([float(x) for x in values.values()])


class _Trial:
    """Loads in double precision, all that is asked of them in one function: to compile it takes longer than
    to evaluate it.

    Attributes:
        names, start: of all states that the loads may read.
    """

    def __init__(
        self,
        scene: Scene,
        requirements: Requirements,
        surfaces: Surfaces,
        loads: Sequence[Load],
    ) -> None:
        m = self.m = probe(scene, requirements, loads)
        self._loads = loads
        carriers = [x for x in loads_of(scene) if isinstance(x, Carrier)]  # whose states any load may read
        carrying = [*loads, *(x for x in carriers if x not in loads)]
        self.names, self.start = _in_double(start_of(m, carrying))
        self._carriers: list[Any] = [load for load in self._loads if isinstance(load, Carrier)]
        torques = [torque_terms(load, m) for load in loads]
        forces = [force_terms(load, m) if m.velocity is not None else [] for load in loads]
        exerted = [load.exerted_torque(m) if isinstance(load, Carrier) else [] for load in loads]
        kinds, self._exerts = (torques, exerted, forces), any(exerted)
        sums = [x for terms in kinds for x in sums_of(chain(*terms))]
        self._parts = [x for terms in zip(*kinds, strict=True) for x in sums_of(chain(*terms))]
        in_time = (s.expression for s in surfaces.found if names_used(s.expression) == {"t"})
        narrow = [u for load in self._loads for u in load.narrow(m)] + written(m, in_time)
        zeros = [y for u in narrow for y in (u, _by_time(u))]
        self._all = self._compiled([*sums, *map(_by_time, sums), *zeros, *self._parts])
        self._narrow = range(18, 18 + len(zeros), 2)
        begin, end = sorted(float(scene.context.ldexp(x, -m.scaling.time)) for x in (scene.start, scene.end))
        self._begin, self._span = begin, end - begin

    def whole(self, times: np.ndarray, states: np.ndarray) -> np.ndarray:
        """Total torque, torque exerted by carriers, force, and of each the part of its rate of change that is
        explicit in time, (18, n).
        """
        return self._all(times, states)[:18]

    def _compiled(self, expressions: Sequence[Symbolic]) -> Function:
        """Values that aren't finite are 0."""
        variables = list(hy.make_vars(*self.names))
        function = hy.cfunc(list(map(hy.expression, expressions)), variables, compact_mode=True)

        def evaluated(times: np.ndarray, states: np.ndarray) -> np.ndarray:
            with np.errstate(all="ignore"):
                found = np.asarray(function(np.ascontiguousarray(states), time=times))
            # values that no run survives say nothing about its scale
            return np.where(np.abs(found) < _LARGEST, found, 0.0)

        return evaluated

    # --- the quaternion's sign ------------------------------------------------------------------------------

    def refuse_odd(self) -> None:
        """Refuse a load, given by expressions or from Python, that differs between q and -q."""
        generator = np.random.default_rng(0)  # the same each time
        states = self.start[:, None] + generator.uniform(-1, 1, (len(self.names), _OPPOSITE))
        rows = [self.names.index(name) for name in BODY.quaternion]
        states[rows] /= np.linalg.norm(states[rows], axis=0)
        other = states.copy()
        other[rows] *= -1
        times = self._begin + self._span * generator.uniform(0, 1, _OPPOSITE)
        here, there = (self._all(times, x)[-len(self._parts) :] for x in (states, other))
        for load, one, opposite in zip(
            self._loads, here.reshape(-1, 3, _OPPOSITE), there.reshape(-1, 3, _OPPOSITE), strict=True
        ):
            different = np.abs(one - opposite) > _ROUNDING * np.abs([one, opposite]).max(axis=(0, 1))
            if different.any():
                part, place = np.argwhere(different)[0]
                raise ConfigError(
                    _oddness(load, states[rows, place], one[part, place], opposite[part, place])
                )

    # --- what the loads can add -----------------------------------------------------------------------------

    def drive(self) -> EstimatedEffect:
        """Estimated energy of rotation and speed that the loads add."""
        m, names, states = self.m, self.names, self._states()
        context, scaling = m.scene.context, m.scaling
        times = self._moments(states)
        sampled = self.over(self.whole, times, states)
        rounding = 1 + np.finfo(float).eps * np.random.default_rng(0).uniform(-1, 1, states.shape)
        off = np.abs(self.over(self.whole, times[:1], states * rounding) - sampled[:, :1])
        for part, noise in zip(sampled.reshape(6, -1), off.reshape(6, -1), strict=True):
            if np.abs(part).max() <= _ROUNDINGS * noise.max():  # as at a rest, where terms cancel
                part[:] = 0.0
        torque, inner, pushed, torque_change, inner_change, pushed_change = sampled.reshape(
            6, 3, *sampled.shape[1:]
        )
        turned = torque + inner
        rates = (
            states[[names.index(x) for x in BODY.rates], None]
            * np.array(m.numbers.rate_units, dtype=float)[:, None, None]
        )
        power = (turned * rates).sum(axis=0)
        if m.velocity is not None:
            power = power + (pushed * states[[names.index(x) for x in BODY.velocity], None]).sum(axis=0)
        if np.any(power != 0) and power.max() <= 0:  # damping only removes energy
            return EstimatedEffect(context.zero, context.zero)
        inverse = np.array([[float(x) for x in row] for row in m.numbers.inverse_inertia])
        matrices = np.array([_matrix(q) for q in states[[names.index(x) for x in BODY.quaternion]].T])
        lasting = 0.0
        for values, frame in (
            (torque, np.eye(3)),
            (np.einsum("aij,jta->ita", matrices, torque), matrices[0].T),
        ):
            impulse = frame @ self._impulse(times, values)
            lasting = max(lasting, float(np.einsum("it,ij,jt->t", impulse, inverse, impulse).max()) / 2)
        peak = _peak(turned, without_mean=lasting > 0 or self._exerts)
        taken = self._taken_up(times, states)
        lasting += float(np.einsum("ti,ij,tj->t", taken, inverse, taken).max()) / 2
        swing = _swing(times, turned, torque_change + inner_change, peak)
        energy = lasting + min(_TURN * peak, float(np.linalg.norm(inverse, 2)) * swing**2 / 2)
        speed = float(np.linalg.norm(self._impulse(times, pushed), axis=0).max())
        peak = _peak(pushed, without_mean=speed > 0)
        room = 2.0 ** (scaling.length - scaling.speed - scaling.time)
        speed += min(_swing(times, pushed, pushed_change, peak), float(np.sqrt(2 * peak * room)))
        sizes = ((energy, scaling.energy), (speed, scaling.speed))
        return EstimatedEffect(*(context.ldexp(context.mpf(value), exponent) for value, exponent in sizes))

    def _states(self) -> np.ndarray:
        """States like the start, (names, states)."""
        states = np.repeat(self.start[:, None], _STATES, axis=1)
        for name in (*BODY.rates, *BODY.position, *BODY.velocity):
            if name in self.names:
                states[self.names.index(name), _STATES // 2 :] *= -1
        first = [self.names.index(name) for name in BODY.quaternion]
        turns = [_product(self.start[first], _product(g, h)) for g in _TETRAHEDRAL for h in _OBLIQUE]
        states[first] = np.tile(np.array([self.start[first], *turns]).T, (1, 2))
        return states

    def _moments(self, states: np.ndarray) -> np.ndarray:
        """Times over the run, and on a logarithmic grid around the zeros of arguments, which Newton's method
        finds.
        """
        cells, generator = np.linspace(0, 1, _TIMES + 1), np.random.default_rng(0)  # the same each time
        self._uniform = self._begin + self._span * (cells[:-1] + generator.uniform(0, 1, _TIMES) / _TIMES)
        found = [self._uniform, self._begin + self._span * np.array([0.0, 1.0])]
        for row in self._narrow:
            at = self._uniform
            for _ in range(_NEWTON):
                value, slope = self.over(self._all, at, states[:, :1])[row : row + 2, :, 0]
                moves = slope != 0
                step = np.where(moves, value / np.where(moves, slope, 1), 0)
                at = at - np.clip(step, -self._span, self._span)
            zeros = np.sort(at[np.abs(self.over(self._all, at, states[:, :1])[row, :, 0]) < 1])
            zeros = zeros[np.diff(zeros, prepend=-np.inf) > 1e-9 * self._span][:_MOST_PULSES]
            found += [zero + sign * self._span * _AROUND for zero in zeros for sign in (-1, 1)]
        times = np.unique(np.concatenate(found))
        return times[(times >= self._begin) & (times <= self._begin + self._span)]

    @staticmethod
    def over(function: Function, times: np.ndarray, states: np.ndarray) -> np.ndarray:
        """Values over all times and states, (expressions, times, states)."""
        count = states.shape[1]
        values = function(np.repeat(times, count), np.tile(states, (1, len(times))))
        return values.reshape(len(values), len(times), count)

    def _impulse(self, times: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Running integral of a vector's mean over the states, shape (3, times); zero if it is only noise."""
        means, size = values.mean(axis=2), np.sqrt((values**2).sum(axis=0).mean(axis=1))
        sums = np.cumsum((means[:, 1:] + means[:, :-1]) / 2 * np.diff(times), axis=1)
        total = np.concatenate([np.zeros((3, 1)), sums], axis=1)
        spread = means[:, np.searchsorted(times, self._uniform)].std(axis=1)
        noise = _NOISE * self._span * float(np.linalg.norm(spread)) / np.sqrt(_TIMES)
        noise = max(noise, _LASTING * float(np.trapezoid(size, times)))
        return total if np.linalg.norm(total, axis=0).max() > noise else np.zeros_like(total)

    def _taken_up(self, moments: np.ndarray, given: np.ndarray) -> np.ndarray:
        """What carriers' momenta have taken up by the ends of cells of the run, (cells, 3), if each of their
        states follows the mean of its slope over the others; zero where that is only noise.
        """
        blocks = [block for x in self._carriers if (block := x.extra_states(self.m)) is not None]
        if not blocks:
            return np.zeros((1, 3))
        momentum = sums_of(x for y in self._carriers for x in y.carried_momentum(self.m))
        block = joined(blocks)
        rows = [self.names.index(name) for name in block.names]
        function = self._compiled([*block.derivatives, *momentum])
        edges, start = np.linspace(0, len(moments) - 1, _CELLS + 1).astype(int), given[rows, :1]

        def at(times: np.ndarray, values: np.ndarray) -> np.ndarray:
            states = given.copy()
            states[rows] = values
            return self.over(function, times, states)

        def changes(times: np.ndarray, values: np.ndarray) -> list[np.ndarray]:
            """By the mean slopes with the states at these values, and by their root mean squares."""
            slopes = at(times, values)[: len(rows)]
            sizes = slopes.mean(axis=2), np.sqrt((slopes**2).mean(axis=2))
            return [np.trapezoid(x, times, axis=1)[:, None] for x in sizes]

        now, rms_change, found = start.copy(), np.zeros_like(start), []
        before = at(moments[:1], start)[len(rows) :].mean(axis=(1, 2))
        for first, last in pairwise(edges):
            times = moments[first : last + 1]
            change, _ = changes(times, now)
            share = np.ones_like(change)
            # a slope that falls as the state grows ends where the change equals the slope's there
            if np.any((changes(times, now + change)[0] - change) * change < 0):
                low, high = np.zeros_like(share), share.copy()
                for _ in range(_HALVINGS):
                    share = (low + high) / 2
                    short = (changes(times, now + share * change)[0] - share * change) * change > 0
                    low, high = np.where(short, share, low), np.where(short, high, share)
            now = now + share * change
            rms_change = rms_change + changes(times, now)[1]
            known = np.where(np.abs(now - start) > _LASTING * rms_change, now, start)
            found.append(at(moments[last : last + 1], known)[len(rows) :].mean(axis=(1, 2)) - before)
        return np.array(found)


def _oddness(load: Load, quaternion: np.ndarray, here: float, there: float) -> Problem:
    odd = (x.where for x in load.formulas() if any(readable.changes_sign for readable in readables(x)))
    shown = ", ".join(f"{x:.3g}" for x in quaternion)
    return Problem(
        next(odd, "loads"),
        f"{load.title} depends on the sign of the quaternion: at q = [{shown}] a part of it is "
        f"{here:.3g} (in internal units), at -q, which is the same attitude, {there:.3g}; use products such "
        "as qw*qx, or write the jump: sign(qw)*qx",
    )


def sums_of(terms: Iterable[Term], number: Rounder = float) -> list[Symbolic]:
    """Components of a sum of terms."""
    given = list(terms)
    return [hy.sum([number(vector[i]) * hy.expression(x) for vector, x in given]) for i in range(3)]


def _peak(values: np.ndarray, *, without_mean: bool) -> float:
    """Largest norm of a vector; with ``without_mean``, of it less its mean over the states."""
    values = values - values.mean(axis=2, keepdims=True) if without_mean else values
    return float(np.linalg.norm(values, axis=0).max(initial=0.0))


def _swing(times: np.ndarray, values: np.ndarray, changes: np.ndarray, peak: float) -> float:
    """Impulse of a vector that turns round as its explicit change in time makes it, or of the whole run."""
    size, fastest = np.linalg.norm(values, axis=0), float(np.linalg.norm(changes, axis=0).max())
    most = float(np.trapezoid(size.max(axis=1), times))
    return min(most, _CYCLE * peak * float(size.max()) / fastest) if fastest > 0 else most


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
