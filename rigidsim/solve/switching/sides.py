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
from functools import cached_property
from itertools import product
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.step_limiter import slopes
from rigidsim.model.system import System
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.switching.moments import moments_of

SLIDES = 0
"""Mode in place of a side (1 or -1): the motion slides along the surface."""
HELD = 2
"""Mode in place of a side: the motion keeps to the surface while it slides along surface number m, whose side
it has (``HELD + m``) or the opposite one (``-HELD - m``); see ``rigidsim.solve.switching.sliding``.
"""
_ROUNDINGS = 32.0  # units of rounding of an argument's terms, below which it is zero
PARALLEL = 1e-9  # relative difference of fields that count as equal
_RATE_ROUNDINGS = 1024.0  # the same for its rate, whose terms are products of derivatives

_LEAST = 2.0**-20
"""The same where the state is zero: a rate that is zero but for a rounding turns back after its square."""
_CLOSE = 2.0**10 * _ROUNDINGS  # roundings from which on an argument is far from zero
_CLEAR = 2.0**-40  # relative size of a rate from which on double precision knows its sign


@dataclass(frozen=True)
class SurfaceValues:
    """Surfaces and field at a state: arguments, their partial derivatives, gradients (surfaces, states)."""

    u: np.ndarray
    by_time: np.ndarray
    gradients: np.ndarray
    field: np.ndarray
    time: Scalar

    def rate(self, j: int) -> Scalar:
        """Rate of an argument along the motion."""
        if not issubclass(self.field.dtype.type, np.floating):
            return sum((g * f for g, f in zip(self.gradients[j], self.field, strict=True)), self.by_time[j])
        return in_order(self.by_time[j : j + 1], self.gradients[j] * self.field)

    @cached_property
    def _sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the arguments' derivatives by time (surfaces) and by the states (states, surfaces), float64."""
        return np.abs(self.by_time.astype(np.float64)), np.abs(self.gradients.astype(np.float64)).T

    def rate_size(self, j: int) -> float:
        """Size to which the rate's rounding is relative."""
        by_time, by_state = self._sizes
        return float(in_order(by_time[j : j + 1], by_state[:, j] * np.abs(self.field.astype(np.float64))))

    def sizes(self, states: Sequence[np.ndarray], times: np.ndarray) -> np.ndarray:
        """Sizes to which the rounding of the arguments is relative, by states and times (surfaces)."""
        by_time, by_state = self._sizes
        largest = np.abs(np.array([row.astype(np.float64) for row in states])).max(axis=0)
        return in_order((by_time * times)[None], by_state * largest[:, None])


@dataclass(frozen=True)
class SurfacesAtStates:
    """The same at many states, float64: (surfaces, n), gradients (surfaces, states, n), field (states, n)."""

    u: np.ndarray
    by_time: np.ndarray
    gradients: np.ndarray
    field: np.ndarray
    spans: np.ndarray
    epsilon: float

    def noises(self, states: np.ndarray) -> np.ndarray:
        """Sizes (surfaces, n) up to which arguments are zero but for rounding of states (n, states)."""
        sizes = np.einsum("jin,in->jn", np.abs(self.gradients), np.abs(states.T.astype(np.float64)))
        return _ROUNDINGS * self.epsilon * (np.abs(self.by_time) * self.spans + sizes)

    def widest_noises(self, before: np.ndarray, states: np.ndarray) -> np.ndarray:
        """The largest that any decision works with, of states (n, states) before and after each step."""
        begun, ended = (np.abs(given.astype(np.float64)) for given in (before, states))
        largest = np.maximum(np.maximum(begun, ended), np.abs(self.field.T))
        swings = np.sqrt((self.gradients**2).sum(axis=1)) * ended.max(axis=1)
        return np.maximum(self.noises(largest), _ROUNDINGS * self.epsilon * swings)

    def rates(self, surfaces: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rate of one argument in each of some rows, and the size below which it counts as zero."""
        terms = self.gradients[surfaces, :, rows] * self.field[:, rows].T
        by_time = self.by_time[surfaces, rows]
        noise = max(_RATE_ROUNDINGS * self.epsilon, _CLEAR)
        return terms.sum(axis=1) + by_time, noise * (np.abs(terms).sum(axis=1) + np.abs(by_time))


def in_order(first: np.ndarray, terms: np.ndarray) -> Any:
    """Sum along the first axis, term after term: what decides must not depend on how numpy groups terms."""
    return np.concatenate([first, terms]).cumsum(axis=0)[-1]


class SurfaceFunctions:
    """Compiled functions of a system that locate its surfaces."""

    def __init__(self, system: System, precision: Precision) -> None:
        self._epsilon = float(precision.epsilon)
        self.surfaces, self._states = len(system.surfaces), len(system.states)
        self._angles = len(system.turning)
        self.unturned = [0.0] * self._angles + [1.0] * bool(system.signed)
        self.parameters = system.parameters
        self.clocked = system.clocked
        self.moments = moments_of(system, precision)
        self.hides = any(moments.may_hide for moments in self.moments)
        named = [hy.par[self.parameters - 1], hy.time]  # functions without them take no such argument
        variables = system.variables
        by_time, gradients, changes = [], [], []
        for u in system.surfaces:
            explicit, by_state = slopes(u)
            by_time += explicit or [hy.expression(0.0)]
            gradients += [by_state.get(name, hy.expression(0.0)) for name in system.states]
            terms = [slope * hy.make_vars(name) for name, slope in by_state.items()]
            terms += [slope * hy.time for slope in explicit]
            changes.append(hy.sqrt(hy.sum([term * term for term in terms])))
        field = [right for _, right in system.equations]
        options = {"compact_mode": True, **precision.options}
        read = [*system.surfaces, *system.turning, *system.signed]
        self._read = len(read)
        spin = [hy.sum([w * w for w in system.mechanics.rates])] if self.unturned else []
        self._values = hy.cfunc([*read, *spin, *named], variables, **options)
        found = [c.expression for c in system.crossings]
        sizes = [[g * g for g in slopes(expression)[1].values()] for expression in found]
        lengths = [hy.sqrt(hy.sum(squares)) if squares else hy.expression(0.0) for squares in sizes]
        self._crossings = hy.cfunc([*found, *lengths, *named], variables, **options)
        self._beside = hy.cfunc([*system.surfaces, *changes, *named], variables, **options)
        outputs = [*system.surfaces, *by_time, *gradients, *field, *named]
        self._everything = hy.cfunc(outputs, variables, **options)

    def values(
        self, state: np.ndarray, time: Scalar, pars: np.ndarray
    ) -> tuple[np.ndarray, list[float], list[float]]:
        """Arguments in the run's precision; the plain angles and the plain quaternion if needed."""
        found = self._values(np.array(state), pars=pars, time=time)
        rest = [float(x) for x in found[self.surfaces : self._read]]
        return found[: self.surfaces], rest[: self._angles], rest[self._angles :]

    def rate(self, state: np.ndarray, time: Scalar, pars: np.ndarray) -> float:
        """The body's angular velocity, rad per internal unit of time, where turns are continued."""
        return math.sqrt(float(self._values(np.array(state), pars=pars, time=time)[-3]))

    def crossings(self, state: np.ndarray, time: Scalar, pars: np.ndarray) -> list[tuple[float, float]]:
        """Values of the events' expressions, and the effect on them of rounding in states of order one."""
        found = [float(x) for x in self._crossings(np.array(state), pars=pars, time=time)[:-2]]
        noise, half = _RATE_ROUNDINGS * self._epsilon, len(found) // 2
        return [(value, noise * size) for value, size in zip(found[:half], found[half:], strict=True)]

    def beside(self, state: np.ndarray, time: Scalar, pars: np.ndarray, j: int) -> float:
        """A size well above an argument's rounding, which is added to its event beside its zero."""
        found = self._beside(state, pars=pars, time=time)
        noise = max(_ROUNDINGS * float(found[self.surfaces + j]), _LEAST)
        return 2 * abs(float(found[j])) + self._epsilon * noise

    def asks(self, states: np.ndarray, times: np.ndarray, pars: np.ndarray, sides: np.ndarray) -> np.ndarray:
        """At which of many states (n,) an argument isn't well on its side (n, surfaces)."""
        found = _by_columns(self._beside, states, times, pars)
        u, sizes = found[: self.surfaces], found[self.surfaces : 2 * self.surfaces]
        return np.asarray((sides.T * u <= _CLOSE * self._epsilon * (sizes + 1.0)).any(axis=0))

    def looks(self, states: np.ndarray, times: np.ndarray, pars: np.ndarray) -> SurfacesAtStates:
        """Surfaces and fields at many states (n, states), times (n,) and parameters (n, parameters)."""
        found = _by_columns(self._everything, states, times, pars)
        s, n, count = self.surfaces, self._states, len(times)
        spans = np.array([moments.all_rounded_from(times) for moments in self.moments])
        return SurfacesAtStates(
            found[:s],
            found[s : 2 * s],
            found[2 * s : 2 * s + s * n].reshape(s, n, count),
            found[-2 - n : -2],
            spans.reshape(s, count),
            self._epsilon,
        )

    def crosses_too(self, states: np.ndarray, times: np.ndarray, pars: np.ndarray) -> np.ndarray:
        """At which of many states an event's expression is zero but for rounding (n,)."""
        found = np.abs(_by_columns(self._crossings, states, times, pars)[:-2])
        half = len(found) // 2
        return np.asarray((found[:half] <= _RATE_ROUNDINGS * self._epsilon * found[half:]).any(axis=0))

    def look(self, state: np.ndarray, time: Scalar, pars: np.ndarray) -> SurfaceValues:
        """Surfaces and field at a state."""
        found = self._everything(np.array(state), pars=pars, time=time)
        s, n = self.surfaces, self._states
        return SurfaceValues(
            found[:s], found[s : 2 * s], found[2 * s : 2 * s + s * n].reshape(s, n), found[-2 - n : -2], time
        )

    def noises(self, look: SurfaceValues, states: Sequence[np.ndarray]) -> np.ndarray:
        """Sizes below which the arguments count as zero because of rounding."""
        times = np.array([moments.rounded_from(look.time) for moments in self.moments])
        return _ROUNDINGS * self._epsilon * look.sizes(states, times)

    def noise(self, look: SurfaceValues, j: int, states: Sequence[np.ndarray]) -> float:
        """The same of one argument."""
        return float(self.noises(look, states)[j])

    def swing_noises(self, look: SurfaceValues, state: np.ndarray) -> np.ndarray:
        """The same for small differences of states of order one, as when swings come to rest."""
        gradients = np.hypot.reduce(look.gradients.astype(np.float64), axis=1)
        return _ROUNDINGS * self._epsilon * gradients * np.abs(state.astype(np.float64)).max()

    def rate_noise(self, look: SurfaceValues, j: int) -> float:
        """Size below which an argument's rate counts as zero because of rounding."""
        return _RATE_ROUNDINGS * self._epsilon * look.rate_size(j)


def _by_columns(function: Any, states: np.ndarray, times: np.ndarray, pars: np.ndarray) -> np.ndarray:
    """Values (outputs, n), float64, of a compiled function at many states."""
    found = function(np.ascontiguousarray(states.T), pars=np.ascontiguousarray(pars.T), time=times)
    return np.asarray(found.astype(np.float64))


@dataclass(frozen=True)
class Continuation:
    """How to continue from surfaces: 1, -1 or ``SLIDES`` for each; None for no way, or more than one."""

    modes: Mapping[int, int] | None
    why: str = ""
    tangential: bool = False


def contributions(looks: Mapping[tuple[int, ...], SurfaceValues]) -> tuple[np.ndarray, np.ndarray, bool]:
    """Field without sides and what each side adds, (surfaces, states), float64, from looks at all
    combinations of sides; and whether these add up to all fields.
    """
    fields = {sides: look.field.astype(np.float64) for sides, look in looks.items()}
    m = len(next(iter(fields)))
    above, below = fields[(1,) * m], fields[(-1,) * m]
    base = (above + below) / 2
    parts = np.array([(above - fields[tuple(-1 if i == k else 1 for i in range(m))]) / 2 for k in range(m)])
    size = sum(map(np.abs, fields.values()))
    off = [np.abs(field - (base + np.array(sides) @ parts)) for sides, field in fields.items()]
    return base, parts, bool(np.all(np.array(off) <= PARALLEL * size))


class Fields:
    """Fields of all combinations of sides of some surfaces, at one state."""

    def __init__(self, at: Any, probe: SurfaceFunctions, surfaces: Sequence[int]) -> None:
        """``at``: from sides by number to a ``SurfaceValues``."""
        self.surfaces = list(surfaces)
        self._looks = {
            sides: at(dict(zip(surfaces, sides, strict=True)))
            for sides in product((1, -1), repeat=len(surfaces))
        }
        looks = self._looks.values()
        self._noise = [max(probe.rate_noise(look, j) for look in looks) for j in surfaces]
        m = len(surfaces)
        above, below = self._looks[(1,) * m], self._looks[(-1,) * m]
        self._base = np.array([float((above.rate(j) + below.rate(j)) / 2) for j in surfaces])
        self._parts = np.zeros((m, m))
        for k in range(m):
            other = self._looks[tuple(-1 if i == k else 1 for i in range(m))]
            self._parts[:, k] = [float((above.rate(j) - other.rate(j)) / 2) for j in surfaces]

    @property
    def add_up(self) -> bool:
        """Whether the contributions of all surfaces to the field add up."""
        return contributions(self._looks)[2]

    def tangential_surfaces(self) -> list[int]:
        """Surfaces on which the motion stays, or which it touches, whatever the sides."""
        return [
            j
            for j, noise in zip(self.surfaces, self._noise, strict=True)
            if all(abs(float(look.rate(j))) <= noise for look in self._looks.values())
        ]

    def choose(self) -> Continuation:
        """The one combination of sides whose field agrees with it."""
        found, added = [], len(self.surfaces) == 1 or self.add_up
        for modes in product((1, -1, SLIDES), repeat=len(self.surfaces)):
            if SLIDES not in modes:
                look = self._looks[modes]
                agrees = all(
                    s * float(look.rate(j)) > noise
                    for s, j, noise in zip(modes, self.surfaces, self._noise, strict=True)
                )
            else:
                agrees = added and self._slides(modes)
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
        if any(abs(self._parts[i, i]) <= self._noise[i] for i in along):
            return False
        beside = [i for i, mode in enumerate(modes) if mode != SLIDES]
        across = self._parts[np.ix_(along, along)]
        right = -self._base[along] - self._parts[np.ix_(along, beside)] @ np.array(
            [float(modes[i]) for i in beside]
        )
        try:
            inner = np.linalg.solve(across, right)
        except np.linalg.LinAlgError:
            return False
        if np.any(np.abs(inner) > 1) or np.any(np.linalg.eigvals(across).real >= 0):
            return False
        sides = np.array([float(mode) for mode in modes])
        sides[along] = inner
        rates = self._base + self._parts @ sides
        return all(modes[i] * rates[i] > self._noise[i] for i in beside)


def crossings(
    at: Callable[[dict[int, int]], SurfaceValues], probe: SurfaceFunctions, sides: Mapping[int, int]
) -> dict[int, int]:
    """Sides to which surfaces are crossed whatever the sides of all are, as those of plates in the light: the
    sides don't change a rate by so much that its sign could change.

    Args:
        at: from sides by number to a ``SurfaceValues``.
        sides: of the surfaces that meet, to begin with.
    """
    seen: list[dict[int, int]] = []
    for _ in range(2):  # from these sides, and from those to which the rates lead
        here = at(dict(sides))
        beside = [at({**sides, k: -side}) for k, side in sides.items()]
        found = {}
        for j in sides:
            rate = float(here.rate(j))
            changes = sum(abs(float(look.rate(j)) - rate) for look in beside)
            if abs(rate) > changes + probe.rate_noise(here, j):
                found[j] = 1 if rate > 0 else -1
        sides = {**sides, **found}
        seen.append(found)
    return {j: side for j, side in seen[1].items() if seen[0].get(j) == side}
