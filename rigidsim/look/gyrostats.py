"""Bodies with rotors as pictures read them, and the sphere on which their angular momentum moves.

With the tensor K of what turns with the body, which rotors on bearings don't, and the momentum h of the
rotors, constant as long as no motor works, the whole angular momentum M in body axes follows

    M' = M x w,    w = K^-1 (M - h):

it keeps to the sphere |M| = L, and on it to a level of w . K w / 2 (Volterra 1899, Acta Mathematica 22, 201).
Where M is along w it stays. Without rotors h vanishes, and the levels are the polhodes of Poinsot.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import xarray

from rigidsim.look import signals
from rigidsim.look.record import scene_of
from rigidsim.look.signals import need, optional
from rigidsim.look.solids import Array

_STEADY = 1e-5  # of its size, within which the momentum's is constant: more than rounding in single precision
_ALIKE = 1e-9  # of the largest, within which moments are equal, and of the momentum, within which h vanishes
_SAME = 1e-4  # rad, within which two points are one
_FLAT = 1e-7  # of the largest 1/K, squared, below which curvatures decide no stability
_STARTS, _STEPS, _FAR = 300, 40, 0.2  # of Newton's method on the sphere; rad, that a step has at most
_KEPT = ("fixed", "gimballed")
_MOST = 6  # isolated equilibria of any gyrostat


@dataclass(frozen=True)
class RecordedRotor:
    """A rotor: unit axis at the start (3,), body axes; moment about it, kg m^2; "free", "driven", "fixed" or
    "gimballed"; its rate (rows,) relative to the body, rad/s; and its axis (rows, 3), if a gimbal turns it.
    """

    name: str
    axis: Array
    moment: float
    drive: str
    rate: Array
    turned: Array | None = None

    @property
    def works(self) -> bool:
        """Whether a motor changes its momentum in the body."""
        return self.drive in ("driven", "gimballed")

    @property
    def axes(self) -> Array:
        """Its unit axis, (3,) or (rows, 3), body axes."""
        return self.axis if self.turned is None else self.turned

    @property
    def varies(self) -> bool:
        """Whether its rate is more than a constant and its rounding."""
        return bool(np.ptp(self.rate) > _ALIKE * np.abs(self.rate).max())

    @property
    def inner(self) -> Array:
        """Its momentum (rows, 3) relative to the body, body axes, kg m^2/s."""
        return self.moment * self.rate[:, None] * self.axes


def rotors(dataset: xarray.Dataset) -> list[RecordedRotor]:
    """The rotors of a dataset whose rates were recorded, or are fixed."""
    recorded, listed = signals.values(dataset, "rotor_rate"), scene_of(dataset).rotors
    count = dataset.sizes["time"]
    kept = (one for one in listed if one["drive"] in _KEPT)
    rates = {one["name"]: np.full(count, float(one["rate"])) for one in kept}
    if recorded is not None:
        rates |= zip(dataset["rotor"].values.tolist(), recorded.T, strict=True)
    found = []
    for one in listed:
        name, axis, turned = one["name"], np.array(one["axis"]), None
        if one["drive"] == "gimballed":
            if (angle := signals.values(dataset, f"gimbal_{name}")) is None:
                continue
            side = np.cross(one["gimbal"], axis)
            turned = np.cos(angle)[:, None] * axis + np.sin(angle)[:, None] * side
        if name in rates:
            found.append(RecordedRotor(name, axis, float(one["moment"]), one["drive"], rates[name], turned))
    return found


def tensor(dataset: xarray.Dataset) -> Array | None:
    """The body's tensor (3, 3), rotors locked, body axes, kg m^2; None if it changes, or isn't known."""
    return None if "principal_moments" in dataset else scene_of(dataset).inertia


@optional
def momentum(dataset: xarray.Dataset) -> Array:
    """Angular momentum (rows, 3) of the body and all its rotors, body axes, kg m^2/s."""
    found, scene = rotors(dataset), scene_of(dataset)
    need(len(found) == len(scene.rotors) and not scene.core)
    body = signals.turned(need(signals.values(dataset, "angular_velocity")), need(tensor(dataset)))
    return np.asarray(body + sum(rotor.inner for rotor in found))


@optional
def path(dataset: xarray.Dataset) -> Array:
    """The same, if it keeps to a sphere; else None."""
    found = need(momentum(dataset))
    sizes = signals.norms(signals.finite_rows(found))
    need(len(sizes) > 0 and sizes.min() > 0 and sizes.max() <= (1 + _STEADY) * sizes.min())
    return found


@dataclass(frozen=True)
class Equilibrium:
    """A spin that stays: the momentum's direction (3,), body axes, and the linearised equations' exponents
    next to it, ± the root of `square`, 1/s^2: imaginary if it is stable, real if not, unknown if zero.
    """

    direction: Array
    square: float

    @property
    def unstable(self) -> bool:
        """Whether a small displacement grows."""
        return self.square > 0


@dataclass(frozen=True)
class Gyrostat:
    """A body with rotors whose motors, if any, are off: K (3, 3), h (3,), and the size L of its momentum."""

    tensor: Array
    inner: Array
    size: float

    @classmethod
    @optional
    def of(cls, dataset: xarray.Dataset, row: int) -> Self:
        """The gyrostat of a finite row, as if motors stopped; None if the momentum's size changes."""
        whole, inertia = need(path(dataset)), need(tensor(dataset))
        rates = need(signals.values(dataset, "angular_velocity"))
        row = np.flatnonzero(np.isfinite(whole).all(axis=1))[row]
        turning, inner = inertia.copy(), np.zeros(3)
        for rotor in rotors(dataset):
            inner += rotor.inner[row]
            if rotor.drive not in _KEPT:
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
        """All isolated ones, two to six, where the energy is stationary on the sphere: by Newton's method
        from everywhere. Of a body with equal moments whole circles may be equilibria.
        """
        height, turn = np.linspace(-1, 1, _STARTS + 2)[1:-1], np.pi * (1 + 5**0.5) * np.arange(_STARTS)
        flat = np.sqrt(1 - height**2)
        points = np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)
        for _ in range(_STEPS):
            slope, curvature = self._derivatives(points)
            step = np.einsum("nij,nj->ni", np.linalg.pinv(curvature, hermitian=True), slope)
            points = points - step * np.minimum(1, _FAR / np.maximum(signals.norms(step), 1e-300))[:, None]
            points /= signals.norms(points)[:, None]
        slope, curvature = self._derivatives(points)
        scale = self.size * float(np.abs(self._inverse).max())
        squares = -np.linalg.det(curvature)
        squares[np.abs(squares) <= _FLAT * scale**2] = 0.0
        found: list[Equilibrium] = []
        for place in np.flatnonzero(signals.norms(slope) <= _SAME**2 * scale):
            if all(np.linalg.norm(points[place] - one.direction) > _SAME for one in found):
                found.append(Equilibrium(points[place], float(squares[place])))
        return found if len(found) <= _MOST else [one for one in found if one.square]

    def _derivatives(self, points: Array) -> tuple[Array, Array]:
        """The energy's slope (n, 3) over L along the sphere, and its second derivatives (n, 3, 3) over L
        there, whose third axis is the normal, with 1.
        """
        rates = self.rates(points)
        along = np.einsum("ni,ni->n", rates, points)
        normal = points[:, :, None] * points[:, None, :]
        flat = np.eye(3) - normal
        whole = self.size * self._inverse - along[:, None, None] * np.eye(3)
        return rates - along[:, None] * points, flat @ whole @ flat + normal
