"""Bodies with rotors as pictures read them, and the sphere on which their angular momentum moves.

With the tensor K of what turns with the body, which rotors on bearings don't, and the momentum h of the
rotors, constant as long as no motor works, the whole angular momentum M in body axes follows

    M' = M x w,    w = K^-1 (M - h):

it keeps to the sphere |M| = L, and on it to a level of w . K w / 2 (Volterra 1899, Acta Mathematica 22, 201).
Where M is along w it stays. Without rotors h vanishes, and the levels are the polhodes of Poinsot.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import xarray

from rigidsim.look import signals, surroundings
from rigidsim.look.solids import Array

_STEADY = 1e-5  # of its size, within which the momentum's is constant: more than rounding in single precision
_ALIKE = 1e-9  # of the largest, within which moments are equal, and of the momentum, within which h vanishes
_SAME = 1e-4  # rad, within which two points are one
_FLAT = 1e-7  # of the spread of 1/K, squared, below which curvatures tell no stability
_FAR = 0.05  # rad, by which Newton's method moves a root at most
_STEP, _STEPS = 0.01, 4000  # along a separatrix, rad; at most


@dataclass(frozen=True)
class RecordedRotor:
    """A rotor: unit axis (3,), body axes; moment about it, kg m^2; "free", "driven" or "fixed"; its rate
    (rows,) relative to the body, rad/s.
    """

    name: str
    axis: Array
    moment: float
    drive: str
    rate: Array

    @property
    def varies(self) -> bool:
        """Whether its rate is more than a constant and its rounding."""
        return bool(np.ptp(self.rate) > _ALIKE * np.abs(self.rate).max())

    @property
    def inner(self) -> Array:
        """Its momentum (rows, 3) relative to the body, body axes, kg m^2/s."""
        return self.moment * self.rate[:, None] * self.axis


def rotors(dataset: xarray.Dataset) -> list[RecordedRotor]:
    """The rotors of a dataset whose rates were recorded, or are fixed."""
    recorded = signals.values(dataset, "rotor_rate")
    named = {} if recorded is None else dict(zip(dataset["rotor"].values.tolist(), recorded.T, strict=True))
    found = []
    for one in surroundings.told(dataset, "rotor"):
        rate = named.get(one["name"])
        if rate is None and one["drive"] == "fixed":
            rate = np.full(dataset.sizes["time"], float(one["rate"]))
        if rate is not None:
            found.append(
                RecordedRotor(one["name"], np.array(one["axis"]), float(one["moment"]), one["drive"], rate)
            )
    return found


def tensor(dataset: xarray.Dataset) -> Array | None:
    """The body's tensor (3, 3), rotors locked, body axes, kg m^2; None if it changes, or isn't known."""
    if "principal_moments" in dataset:
        return None
    found, moments = signals.attribute(dataset, "inertia_tensor"), signals.moments(dataset)
    if found is not None and found.shape == (3, 3):
        return found
    axes = signals.principal_axes(dataset)
    return None if moments is None else np.asarray(axes.T * moments @ axes)


def momentum(dataset: xarray.Dataset) -> Array | None:
    """Angular momentum (rows, 3) of the body and all its rotors, body axes, kg m^2/s."""
    inertia, rates, found = tensor(dataset), signals.values(dataset, "angular_velocity"), rotors(dataset)
    unknown = len(found) < len(surroundings.told(dataset, "rotor")) or surroundings.told(dataset, "core")
    if inertia is None or rates is None or unknown:
        return None
    return np.asarray(signals.turned(rates, inertia) + sum(rotor.inner for rotor in found))


def path(dataset: xarray.Dataset) -> Array | None:
    """The same, if it keeps to a sphere; else None."""
    found = momentum(dataset)
    sizes = signals.norms(signals.finite_rows(found)) if found is not None else np.zeros(0)
    steady = len(sizes) and sizes.min() > 0 and sizes.max() <= (1 + _STEADY) * sizes.min()
    return found if steady else None


@dataclass(frozen=True)
class Equilibrium:
    """A spin that stays: the momentum's direction (3,), body axes, and the linearised equations' exponents
    beside it, ± the root of `square`, 1/s^2: imaginary if it is stable, real if not, unknown if zero.
    """

    direction: Array
    square: float

    @property
    def unstable(self) -> bool:
        """Whether a small displacement grows."""
        return self.square > 0


def _roots(inner: Array, moments: Array) -> list[float]:
    """All x with sum h_i^2 / (1 - x K_i)^2 = 1: the sum is convex between its poles and falls beyond."""

    def excess(x: float) -> float:
        return float(((inner / (1 - x * moments)) ** 2).sum()) - 1

    def slope(x: float) -> float:
        return float((inner**2 * moments / (1 - x * moments) ** 3).sum())

    poles = np.sort(1 / moments)
    beyond = 2 * float(np.linalg.norm(inner)) / float(moments.min())
    roots = []
    with np.errstate(divide="ignore"):
        roots += [
            _crossing(excess, pole - side * beyond, pole) for pole, side in ((poles[0], 1), (poles[-1], -1))
        ]
        for low, high in itertools.pairwise(poles):
            lowest = _crossing(slope, low, high)
            if excess(lowest) < 0:
                roots += [_crossing(excess, lowest, pole) for pole in (low, high)]
    return roots


def _crossing(function: Callable[[float], float], below: float, above: float) -> float:
    """Where a function changes its sign, from negative `below` to positive, by halving."""
    while True:
        middle = (below + above) / 2
        if middle in (below, above):
            return float(middle)
        below, above = (below, middle) if function(middle) > 0 else (middle, above)


@dataclass(frozen=True)
class Gyrostat:
    """A body with rotors whose motors, if any, are off: K (3, 3), h (3,), and the size L of its momentum."""

    tensor: Array
    inner: Array
    size: float

    @classmethod
    def of(cls, dataset: xarray.Dataset, row: int) -> Self | None:
        """That of a finite row, as if motors stopped there; None if the size of the momentum changes."""
        whole, inertia, rates = path(dataset), tensor(dataset), signals.values(dataset, "angular_velocity")
        if whole is None or inertia is None or rates is None:
            return None
        row = np.flatnonzero(np.isfinite(whole).all(axis=1))[row]
        turning, inner = inertia.copy(), np.zeros(3)
        for rotor in rotors(dataset):
            inner += rotor.inner[row]
            if rotor.drive != "fixed":
                turning -= rotor.moment * np.outer(rotor.axis, rotor.axis)
                inner += rotor.moment * (rotor.axis @ rates[row]) * rotor.axis
        return cls(turning, inner, float(np.linalg.norm(whole[row])))

    @cached_property
    def _inverse(self) -> Array:
        return np.asarray(np.linalg.inv(self.tensor))

    def rates(self, directions: Array) -> Array:
        """Angular velocity (n, 3), rad/s, for directions (n, 3) of the momentum."""
        return (self.size * directions - self.inner) @ self._inverse

    def energy(self, directions: Array) -> Array:
        """Energy (n,), J, that the momentum's direction determines, w . K w / 2."""
        rates = self.rates(directions)
        return np.asarray(((rates @ self.tensor) * rates).sum(axis=-1) / 2)

    @cached_property
    def equilibria(self) -> list[Equilibrium]:
        """All isolated ones, two to six. Of a body with equal moments whole circles may be equilibria."""
        found: list[Array] = []
        for point in self._stationary():
            if all(np.linalg.norm(point - other) > _SAME for other in found):
                found.append(point)
        return [Equilibrium(point, self._square(point)) for point in found]

    def _stationary(self) -> list[Array]:
        """Directions m with w = x m, so that (1 - x K) m = h."""
        moments, axes = np.linalg.eigh(self.tensor)
        moments = moments / moments[2]
        axes = axes.T
        for k in range(2):  # of equal moments any axes will do: one is taken along what h has in their plane
            if moments[k + 1] - moments[k] <= _ALIKE:
                pair = axes[[k, k + 1]]
                part = pair @ self.inner
                if np.linalg.norm(part) > 0:
                    x, y = part / np.linalg.norm(part)
                    axes[[k, k + 1]] = np.array([[x, y], [-y, x]]) @ pair
        inner = axes @ self.inner / self.size
        held = np.flatnonzero(np.abs(inner) > _ALIKE)
        points = []
        for root in _roots(inner[held], moments[held]) if len(held) else ():
            point = np.zeros(3)
            point[held] = inner[held] / (1 - root * moments[held])
            points.append(point / np.linalg.norm(point))
        for k in set(range(3)) - set(held):  # or x = 1 / K_k, and m may have any component there
            alike = np.flatnonzero(np.abs(moments - moments[k]) <= _ALIKE)
            if len(alike) > 1:  # a circle, or none
                continue
            point = np.zeros(3)
            point[held] = inner[held] / (1 - moments[held] / moments[k])
            rest = 1 - point @ point
            if rest > _ALIKE:
                point[k] = np.sqrt(rest)
                points += [point, np.where(np.arange(3) == k, -point, point)]
        return [self._closer(point @ axes) for point in points]

    def _closer(self, direction: Array) -> Array:
        """An equilibrium by Newton's method: roots near others have fewer digits."""
        for _ in range(4):
            values, tangents = self._curvatures(direction)
            if abs(values.prod()) <= _FLAT * np.abs(self._inverse).max() ** 2:
                break
            step = (tangents @ self.rates(direction)) / (self.size * values) @ tangents
            if np.linalg.norm(step) > _FAR:
                break
            direction = (direction - step) / np.linalg.norm(direction - step)
        return direction

    def _curvatures(self, direction: Array) -> tuple[Array, Array]:
        """The energy's second derivatives over L^2 at an equilibrium, and their axes (2, 3)."""
        pull = float(self.rates(direction) @ direction) / self.size
        frame = np.stack(signals.across(direction))
        values, turn = np.linalg.eigh(frame @ (self._inverse - pull * np.eye(3)) @ frame.T)
        return values, turn.T @ frame

    def _square(self, direction: Array) -> float:
        curvatures, _ = self._curvatures(direction)
        spread = np.linalg.eigvalsh(self._inverse)
        product = float(curvatures.prod())
        return 0.0 if abs(product) <= _FLAT * float(spread.max()) ** 2 else -product * self.size**2

    def separatrices(self) -> list[Array]:
        """Levels through unstable equilibria, as curves (points, 3) of directions from one to one."""
        saddles = [one.direction for one in self.equilibria if one.unstable]
        return [curve for saddle in saddles for curve in self._leaving(saddle, np.array(saddles))]

    def _leaving(self, saddle: Array, saddles: Array) -> list[Array]:
        """The two curves on which the motion leaves a saddle."""
        (low, high), tangents = self._curvatures(saddle)
        ways = [np.sqrt(high) * tangents[0] + sign * np.sqrt(-low) * tangents[1] for sign in (1, -1)]
        starts = saddle + _STEP * np.array([way / np.linalg.norm(way) for way in ways])
        way = next(
            (w for w, start in zip(ways, starts, strict=True) if self._flow(start[None])[0] @ w > 0), ways[0]
        )
        level = self.energy(saddle)
        now = self._back(saddle + _STEP * np.array([[1.0], [-1.0]]) * way / np.linalg.norm(way), level)
        curves = [np.tile(saddle, (2, 1)), now]
        near = np.full(2, -1)  # steps after which each comes to a saddle
        ends = np.zeros(2, dtype=int)
        for step in range(2, _STEPS):
            middle = now + 0.5 * _STEP * self._flow(now)
            now = self._back(now + _STEP * self._flow(middle), level)
            curves.append(now)
            apart = np.linalg.norm(now[:, None] - saddles, axis=2)
            there = (apart.min(axis=1) < 1.2 * _STEP) & (near < 0) & (step > 10)
            near[there], ends[there] = step, apart.argmin(axis=1)[there]
            if (near > 0).all():
                break
        whole = np.array(curves)
        return [
            np.vstack([whole[: near[k] + 1, k], saddles[ends[k]]]) if near[k] > 0 else whole[:, k]
            for k in (0, 1)
        ]

    def _flow(self, directions: Array) -> Array:
        """Unit tangents (n, 3) along which the momentum's direction moves."""
        ways = np.cross(directions, self.rates(directions))
        return np.asarray(ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-300))

    def _back(self, points: Array, level: Array) -> Array:
        """Points (n, 3) near the sphere and a level, put back on both."""
        points = points / np.linalg.norm(points, axis=1, keepdims=True)
        rates = self.size * self.rates(points)
        slopes = rates - (rates * points).sum(axis=1, keepdims=True) * points
        over = (self.energy(points) - level) / np.maximum((slopes**2).sum(axis=1), 1e-300)
        points = points - over[:, None] * slopes
        return np.asarray(points / np.linalg.norm(points, axis=1, keepdims=True))
