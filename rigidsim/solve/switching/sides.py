"""The side of its switching surfaces on which a motion continues, decided by the fields of all sides
(Filippov).

Arriving on a surface whose other side carries it away, the motion crosses; if both sides push it back, it
slides along (``rigidsim.solve.switching.sliding``). On several surfaces at once each combination of
crossing and sliding is tried, and the one that agrees with its own field is taken.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import product
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.step_limiter import slopes
from rigidsim.model.system import System
from rigidsim.solve.compiled import compiled_function
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.switching.moments import Moments

SLIDES = 0
"""Mode in place of a side (1 or -1): the motion slides along the surface."""
_ROUNDINGS = 32.0  # units of rounding of an argument's terms, below which it is zero
_PARALLEL = 1e-9  # relative difference of fields that count as equal
_RATE_ROUNDINGS = 1024.0  # the same for its rate, whose terms are products of derivatives

_LEAST = 2.0**-20
"""The same where the state is zero: a rate that is zero but for a rounding turns back after its square."""


@dataclass(frozen=True)
class SurfaceValues:
    """Surfaces and field at n states, float64: arguments, their derivatives by time and rates along the
    motion (surfaces, n), gradients (surfaces, states, n), field (states, n).
    """

    u: np.ndarray
    by_time: np.ndarray
    rates: np.ndarray
    gradients: np.ndarray
    field: np.ndarray
    spans: np.ndarray  # of time, to which the rounding of the arguments is relative
    epsilon: float

    @cached_property
    def _slopes(self) -> np.ndarray:
        return np.abs(self.gradients)

    def _sizes(self, states: np.ndarray) -> np.ndarray:
        return np.einsum("jin,in->jn", self._slopes, np.abs(states))

    def noises(self, *states: np.ndarray) -> np.ndarray:
        """Sizes (surfaces, n) below which arguments are zero but for rounding of states (n, states)."""
        plain = (np.abs(np.atleast_2d(given).astype(np.float64, copy=False)) for given in states)
        sizes = self._sizes(reduce(np.maximum, plain).T)
        return _ROUNDINGS * self.epsilon * (np.abs(self.by_time) * self.spans + sizes)

    def beside(self, state: np.ndarray) -> np.ndarray:
        """Sizes (surfaces,) well above arguments' rounding, added to their events next to their zeros, at the
        only state (states,).
        """
        noise = np.maximum(self.noises(state)[:, 0], _LEAST * self.epsilon)
        return np.asarray(2 * np.abs(self.u[:, 0]) + noise)

    @cached_property
    def rate_noises(self) -> np.ndarray:
        """The same of rates."""
        return _RATE_ROUNDINGS * self.epsilon * (np.abs(self.by_time) + self._sizes(self.field))


class SurfaceFunctions:
    """Compiled functions of a system that locate its surfaces."""

    def __init__(self, system: System, precision: Precision, moments: Moments) -> None:
        self._epsilon, self._moments = float(precision.epsilon), moments
        self._surfaces, self._states = len(system.surfaces), len(system.states)
        self._angles = len(system.turning)
        self.unturned = [0.0] * self._angles + [1.0] * bool(system.signed)
        self.parameters = system.parameters
        self.clocked = system.clocked
        named = [hy.par[self.parameters - 1], hy.time]  # functions without them take no such argument
        variables, fields = system.variables, [right for _, right in system.equations]
        by_time, gradients, rates = [], [], []
        for u in system.surfaces:
            explicit, by_state = slopes(u)
            along = [by_state.get(name, hy.expression(0.0)) for name in system.states]
            by_time += explicit or [hy.expression(0.0)]
            gradients += along
            rates.append(hy.sum([*explicit, *(a * b for a, b in zip(along, fields, strict=True))]))
        spin = [hy.sum([w * w for w in system.mechanics.rates])] if self.unturned else []
        found = [c.expression for c in system.crossings]
        sizes = [[g * g for g in slopes(expression)[1].values()] for expression in found]
        lengths = [hy.sqrt(hy.sum(squares)) if squares else hy.expression(0.0) for squares in sizes]
        turning = [*system.turning, *system.signed, *spin]
        self._first = len(turning)
        outputs = [*system.surfaces, *by_time, *rates, *gradients, *fields, *named]
        self._often, self._everything = (
            compiled_function(given, variables, compact_mode=True, **precision.options)
            for given in ([*turning, *found, *lengths, *named], outputs)
        )

    def _turned(self, state: np.ndarray, time: Scalar, pars: np.ndarray) -> list[float]:
        found = self._often(np.array(state), pars=pars, time=time)
        return [float(x) for x in found[: self._first]]

    def plain(self, state: np.ndarray, time: Scalar, pars: np.ndarray) -> tuple[list[float], list[float]]:
        """The plain angles, and the plain quaternion, where turns are continued."""
        found = self._turned(state, time, pars)[:-1]
        return found[: self._angles], found[self._angles :]

    def spin(self, state: np.ndarray, time: Scalar, pars: np.ndarray) -> float:
        """The body's angular velocity, rad per internal unit of time, where turns are continued."""
        return math.sqrt(self._turned(state, time, pars)[-1])

    def crossings(self, states: np.ndarray, times: np.ndarray, pars: np.ndarray) -> np.ndarray:
        """Values of the events' expressions at many states, and the effect on them of rounding in states of
        order one, (2, events, n).
        """
        found = _by_columns(self._often, states, times, pars)[self._first : -2]
        values, sizes = np.split(found, 2)
        return np.array([values, _RATE_ROUNDINGS * self._epsilon * sizes])

    def looks(self, states: np.ndarray, times: np.ndarray, pars: np.ndarray) -> SurfaceValues:
        """Surfaces and fields at many states (n, states), times (n,) and parameters (n, parameters)."""
        found = _by_columns(self._everything, states, times, pars)
        s, n, count = self._surfaces, self._states, len(times)
        u, by_time, rates = found[: 3 * s].reshape(3, s, count)
        gradients, field = found[3 * s : (3 + n) * s].reshape(s, n, count), found[(3 + n) * s :][:n]
        return SurfaceValues(u, by_time, rates, gradients, field, self._moments.spans(times), self._epsilon)

    def look(self, state: np.ndarray, time: Scalar, pars: np.ndarray) -> SurfaceValues:
        """The same at one state."""
        return self.looks(*one(state, time, pars))

    def exact(self, state: np.ndarray, time: Scalar, pars: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Arguments and gradients (surfaces, states) in the run's precision."""
        found, s = self._everything(np.array(state), pars=pars, time=time), self._surfaces
        return found[:s], found[3 * s : (3 + self._states) * s].reshape(s, self._states)


def one(state: np.ndarray, time: Scalar, pars: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One state, time and set of parameters as many."""
    return np.array([state]), np.array([time], dtype=state.dtype), pars[None]


def _by_columns(function: Any, states: np.ndarray, times: np.ndarray, pars: np.ndarray) -> np.ndarray:
    """Values (outputs, n), float64, of a compiled function at many states."""
    found = function(np.ascontiguousarray(states.T), pars=np.ascontiguousarray(pars.T), time=times)
    return np.asarray(found.astype(np.float64, copy=False))


@dataclass(frozen=True)
class Continuation:
    """How to continue from surfaces: 1, -1 or ``SLIDES`` for each; None for no way, or more than one."""

    modes: Mapping[int, int] | None
    why: str = ""
    tangential: bool = False


LookAt = Callable[[Mapping[int, int]], SurfaceValues]
"""From sides by number to the values there at one state."""


class Fields:
    """Fields of all combinations of sides of some surfaces, at one state."""

    def __init__(self, at: LookAt, surfaces: Sequence[int]) -> None:
        self.surfaces, m = list(surfaces), len(surfaces)
        combined = list(product((1, -1), repeat=m))
        looks = [at(dict(zip(surfaces, sides, strict=True))) for sides in combined]
        self._noise = np.max([look.rate_noises[self.surfaces, 0] for look in looks], axis=0)
        # rates of the surfaces, and the field behind them
        found = [np.concatenate([look.rates[self.surfaces, 0], look.field[:, 0]]) for look in looks]
        by_sides = dict(zip(combined, found, strict=True))
        above, below = by_sides[(1,) * m], by_sides[(-1,) * m]
        base = (above + below) / 2
        others = [by_sides[tuple(-1 if i == k else 1 for i in range(m))] for k in range(m)]
        parts = np.array([(above - other) / 2 for other in others])
        self._rates = {sides: values[:m] for sides, values in by_sides.items()}
        self._base, self._parts = base[:m], parts[:, :m].T
        off = [np.abs(values - (base + np.array(sides) @ parts))[m:] for sides, values in by_sides.items()]
        self._adds_up = m == 1 or bool(np.all(np.array(off) <= _PARALLEL * np.abs(found).sum(axis=0)[m:]))

    @property
    def tangential(self) -> list[int]:
        """Surfaces on which the motion stays, or which it touches, whatever the sides."""
        still = np.all(np.abs([*self._rates.values()]) <= self._noise, axis=0)
        return [j for j, stays in zip(self.surfaces, still, strict=True) if stays]

    def crossed(self, side: int) -> bool:
        """Whether the fields of both sides lead clearly to this side of a single surface."""
        return all(side * rates[0] > self._noise[0] for rates in self._rates.values())

    def choose(self) -> Continuation:
        """The one combination of sides whose field agrees with it."""
        found = []
        for modes in product((1, -1, SLIDES), repeat=len(self.surfaces)):
            if SLIDES in modes:
                agrees = self._adds_up and self._slides(modes)
            else:
                agrees = bool(np.all(np.array(modes) * self._rates[modes] > self._noise))
            if agrees:
                found.append(dict(zip(self.surfaces, modes, strict=True)))
        if len(found) == 1:
            return Continuation(found[0])
        if found:
            return Continuation(
                None, "it could leave it in more than one way, so that what follows isn't unique"
            )
        return Continuation(None, "no side agrees with its own field", tangential=True)

    def _slides(self, modes: Sequence[int]) -> bool:
        along = [i for i, mode in enumerate(modes) if mode == SLIDES]
        beside = [i for i, mode in enumerate(modes) if mode != SLIDES]
        across, sides = self._parts[np.ix_(along, along)], np.array(modes, dtype=float)
        if np.any(np.abs(np.diag(across)) <= self._noise[along]):
            return False
        try:
            sides[along] = np.linalg.solve(across, -self._base[along] - self._parts[along] @ sides)
        except np.linalg.LinAlgError:
            return False
        if np.any(np.abs(sides[along]) > 1) or np.any(np.linalg.eigvals(across).real >= 0):
            return False
        rates = self._base + self._parts @ sides
        return bool(np.all((sides * rates > self._noise)[beside]))


def crossings(at: LookAt, sides: Mapping[int, int]) -> dict[int, int]:
    """Sides to which surfaces are crossed whatever the sides of all are, as those of plates in the light: the
    sides don't change a rate by so much that its sign could change. ``sides`` are those to begin with.
    """
    seen: list[dict[int, int]] = []
    for _ in range(2):  # from these sides, and from those to which the rates lead
        here = at(sides)
        others = [at({**sides, k: -side}).rates[:, 0] for k, side in sides.items()]
        rates, changes = here.rates[:, 0], np.sum(np.abs(others - here.rates[:, 0]), axis=0)
        clear = np.abs(rates) > changes + here.rate_noises[:, 0]
        found = {j: 1 if rates[j] > 0 else -1 for j in sides if clear[j]}
        sides = {**sides, **found}
        seen.append(found)
    return {j: side for j, side in seen[1].items() if seen[0].get(j) == side}
