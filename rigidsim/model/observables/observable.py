"""Observables: one entry from a name to its expressions, and how its samples are joined.

A new observable is one ``Observable`` in a list of this package. A new invariant is an observable whose
``conserved`` says when and why it holds. Angles that may turn around are ``continuous_angles``. Each then
shows up in the dataset, the summary, the plots and the timeline.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.model.euler_poles import Poles
from rigidsim.model.frames import reference_plane
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.needs import NEEDS
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.registry import register_observable

Dims = tuple[str, ...]
BODY: Dims = ("body_axis",)
SPACE: Dims = ("space_axis",)


def _without(_: Mechanics) -> None:
    return None


def always(_: Mechanics) -> bool:
    """Record wherever a scene has the quantity, unless the config names what to record."""
    return True


def only_when_named(_: Mechanics) -> bool:
    """Record only if ``[output] record`` names the quantity."""
    return False


@dataclass(frozen=True)
class Angle:
    """atan2(across, along), an angle that may turn around: sine and cosine times a common size, of order 1.

    Where that is below ``rigidsim.model.euler_poles.UNDEFINED`` rounding errors, NaN is recorded.
    """

    across: Symbolic
    along: Symbolic

    @property
    def value(self) -> Symbolic:
        """The angle within half a turn, rad."""
        return hy.atan2(self.across, self.along)

    @property
    def squared_size(self) -> Symbolic:
        """Squared common size, which vanishes where the angle is undefined."""
        return self.across * self.across + self.along * self.along


@dataclass(frozen=True)
class Steady:
    """How angles advance between samples, if that tells their full turns without following the motion.

    The last two count for an angle whose sine and cosine have size 1, and are divided by a smaller one.
    """

    rates: list[Symbolic]  # of each angle, rad per internal unit of time
    uncertainty: float  # by how much the rates may change between samples, rad/s
    excursion: float  # additional deviation of the angles, rad


@dataclass(frozen=True)
class Observable:
    """One recordable quantity; register your own with ``rigidsim.scene.registry.register_observable``.

    Attributes:
        name: name of the dataset's variable.
        dims: dimensions besides time; keys of ``rigidsim.store.variables.LABELS``.
        units: SI.
        long_name: description for readers.
        frame: "body axes", "space axes" or "".
        expressions: components as expressions of the state, in internal units (see ``Kinematics``).
        exponents: binary exponents of the components' internal units; None where they are in SI or have none.
        needs: what the scene must have; names in ``rigidsim.model.needs.NEEDS``.
        conserved: why it is an invariant of this scene, or None where it isn't.
        drift_scale: scale of its drift in SI (mpf), and the name of that scale.
        by_default: whether it is recorded if the config names nothing.
        continuity: how samples are joined, see ``rigidsim.model.outputs.Recorded``.
        angles: the angles whose full turns are counted (``continuous_angles``), if it consists of such.
        poles: for Euler angles that are functions of the state, where only one of the outer ones is defined.
        steady: how its angles advance between samples; None if the motion has to be followed.
        attributes: further attributes of the variable: convention, reference plane, ...
        absent: why this scene can't have it although it meets all needs; None if it can.
    """

    name: str
    dims: Dims
    units: str
    long_name: str
    expressions: Callable[[Mechanics], list[Symbolic]]
    exponents: Callable[[Mechanics], list[int]] | None = None
    frame: str = ""
    needs: tuple[str, ...] = ()
    conserved: Callable[[Mechanics], str | None] = _without
    drift_scale: Callable[[Mechanics], tuple[Any, str]] | None = None
    by_default: Callable[[Mechanics], bool] = always
    continuity: Callable[[Mechanics], str] = lambda _: ""
    angles: Callable[[Mechanics], list[Angle]] | None = None
    poles: Callable[[Mechanics], Poles | None] = _without
    steady: Callable[[Mechanics], Steady | None] = _without
    attributes: Callable[[Mechanics], Mapping[str, str]] = lambda _: {}
    absent: Callable[[Mechanics], str | None] = _without

    def available(self, m: Mechanics) -> bool:
        """Whether the scene meets all needs and nothing else makes the quantity absent."""
        return m.tells(self.name) and self.needed(m) and self.absent(m) is None

    def needed(self, m: Mechanics) -> bool:
        """Whether the scene has what ``needs`` names."""
        return all(NEEDS[need].met(m) for need in self.needs)

    def unit_exponents(self, m: Mechanics, count: int) -> list[int]:
        """Binary exponents of the units of ``count`` components."""
        return [0] * count if self.exponents is None else self.exponents(m)


def continuous_angles(
    name: str,
    dims: Dims,
    long_name: str,
    angles: Callable[[Mechanics], list[Angle]],
    *,
    by_default: Callable[[Mechanics], bool] = only_when_named,
    **more: Any,
) -> Observable:
    """An observable of angles (one per component), in rad, whose full turns are counted along the motion,
    however far apart the samples are; ``more`` as for ``Observable``.
    """
    values = lambda m: [angle.value for angle in angles(m)]  # noqa: E731
    return Observable(
        name, dims, "rad", long_name, values, continuity=lambda m: "unwrap", angles=angles,
        by_default=by_default, **more,
    )  # fmt: skip


def register_all(*observables: Observable) -> None:
    """Register observables in the order of the dataset."""
    for observable in observables:
        register_observable(observable)


def same_unit(exponent: Callable[[Mechanics], int], count: int) -> Callable[[Mechanics], list[int]]:
    """``Observable.exponents`` for components that share one unit."""
    return lambda m: [exponent(m)] * count


MOMENTUM = lambda m: m.scaling.momentum  # noqa: E731
ENERGY = lambda m: m.scaling.energy  # noqa: E731


def told(
    convention: str | Callable[[Mechanics], str], *, figure: bool = False, plane: bool = False
) -> Callable[[Mechanics], Mapping[str, str]]:
    """Attributes that tell readers a convention, and the figure axis and reference plane if it uses them."""

    def attributes(m: Mechanics) -> dict[str, str]:
        found = {"convention": convention if isinstance(convention, str) else convention(m)}
        if figure:
            pole = ", ".join(m.scene.context.nstr(x, 17) for x in m.scene.figure.pole)
            found["figure_axis"] = f"{m.scene.figure.described}: [{pole}] in body axes"
        if plane:
            found["reference_plane"] = reference_plane(m).described
        return found

    return attributes
