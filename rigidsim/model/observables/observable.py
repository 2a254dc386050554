"""What an observable is: one entry from its name to its expressions, and how its samples are joined.

A new observable is one ``Observable`` in a list of this package; a new invariant one whose ``conserved`` says
when and why it holds; angles that may turn around are ``continuous_angles``. Each then shows up in the
dataset, the summary, the plots and the timeline.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import heyoka as hy

from rigidsim.model.mechanics import Mechanics
from rigidsim.model.needs import NEEDS
from rigidsim.model.rotations import Symbolic
from rigidsim.scene.records import dataclass

Dims = tuple[str, ...]
BODY: Dims = ("body_axis",)
SPACE: Dims = ("space_axis",)


def _never(_: Mechanics) -> str | None:
    return None


def _as_it_is(_: Mechanics) -> str:
    return ""


def _nothing(_: Mechanics) -> Mapping[str, str]:
    return {}


def always(_: Mechanics) -> bool:
    """Recorded wherever a scene has it, unless the config names what to record."""
    return True


def only_when_named(_: Mechanics) -> bool:
    """Recorded only where ``[output] record`` names it."""
    return False


@dataclass(frozen=True)
class Angle:
    """atan2(across, along), an angle that may turn around; it is undefined where both vanish.

    Attributes:
        across, along: sine and cosine times a common size, which is of order 1 where the angle is well
            defined: below ``rigidsim.solve.turns.UNDEFINED`` rounding errors of it, NaN is recorded.
    """

    across: Symbolic
    along: Symbolic

    @property
    def value(self) -> Symbolic:
        """Within half a turn, rad."""
        return hy.atan2(self.across, self.along)

    @property
    def squared_size(self) -> Symbolic:
        """What vanishes where it is undefined."""
        return self.across * self.across + self.along * self.along


@dataclass(frozen=True)
class Steady:
    """How angles advance between samples, where that tells their turns without following the motion.

    Attributes:
        rates: of each angle as expressions of the state, rad per internal unit of time.
        uncertainty: by which these may change between samples, rad/s.
        excursion: by which the angles may be off besides, rad. Both count for an angle whose sine and cosine
            have size 1, and are divided by a smaller one.
    """

    rates: list[Symbolic]
    uncertainty: float
    excursion: float


def _unsteady(_: Mechanics) -> Steady | None:
    return None


@dataclass(frozen=True)
class Observable:
    """One recordable quantity; one of your own enters by ``rigidsim.scene.registry.register_observable``.

    Attributes:
        name: of the dataset's variable.
        dims: beside time; keys of ``rigidsim.store.variables.LABELS``.
        units: SI.
        long_name: for readers.
        frame: "body axes", "space axes" or "".
        expressions: components as expressions of the state, in internal units (see ``Kinematics``).
        exponents: binary exponents of the components' internal units; None where they are in SI.
        needs: what the scene must have, names of ``rigidsim.model.needs.NEEDS``.
        conserved: why it is an invariant of this scene, or None where it isn't.
        drift_scale: scale of its drift in SI (mpf), with a name for it.
        by_default: whether it is recorded where the config names nothing.
        continuity: how samples are joined, see ``rigidsim.model.outputs.Recorded``.
        angles: where it is made of angles whose turns are counted (``continuous_angles``).
        steady: how its angles advance between samples; None where they have to be followed.
        attributes: further attributes of the variable: convention, reference plane, ...
        absent: why this scene can't have it although it has all that it needs; None where it can.
    """

    name: str
    dims: Dims
    units: str
    long_name: str
    expressions: Callable[[Mechanics], list[Symbolic]]
    exponents: Callable[[Mechanics], list[int]] | None = None
    frame: str = ""
    needs: tuple[str, ...] = ()
    conserved: Callable[[Mechanics], str | None] = _never
    drift_scale: Callable[[Mechanics], tuple[Any, str]] | None = None
    by_default: Callable[[Mechanics], bool] = always
    continuity: Callable[[Mechanics], str] = _as_it_is
    angles: Callable[[Mechanics], list[Angle]] | None = None
    steady: Callable[[Mechanics], Steady | None] = _unsteady
    attributes: Callable[[Mechanics], Mapping[str, str]] = _nothing
    absent: Callable[[Mechanics], str | None] = _never

    def available(self, m: Mechanics) -> bool:
        """Whether the scene has all that it needs."""
        return m.tells(self.name) and self.needed(m) and self.absent(m) is None

    def needed(self, m: Mechanics) -> bool:
        """Whether the scene has what ``needs`` names."""
        return all(NEEDS[need].met(m) for need in self.needs)

    def unit_exponents(self, m: Mechanics, count: int) -> list[int]:
        """One for each of ``count`` components."""
        return [0] * count if self.exponents is None else self.exponents(m)


def continuous_angles(
    name: str,
    dims: Dims,
    long_name: str,
    angles: Callable[[Mechanics], list[Angle]],
    *,
    frame: str = "",
    needs: tuple[str, ...] = (),
    by_default: Callable[[Mechanics], bool] = only_when_named,
    steady: Callable[[Mechanics], Steady | None] = _unsteady,
    attributes: Callable[[Mechanics], Mapping[str, str]] = _nothing,
    absent: Callable[[Mechanics], str | None] = _never,
) -> Observable:
    """An observable of angles, in rad, whose full turns are counted along the motion, however far apart the
    samples are.

    Args:
        angles: one for each component.
        steady: how they advance, where that is known well enough to tell turns between sparse samples.
    """
    return Observable(
        name,
        dims,
        "rad",
        long_name,
        lambda m: [angle.value for angle in angles(m)],
        frame=frame,
        needs=needs,
        by_default=by_default,
        continuity=lambda m: "unwrap",
        angles=angles,
        steady=steady,
        attributes=attributes,
        absent=absent,
    )


def same_unit(exponent: Callable[[Mechanics], int], count: int) -> Callable[[Mechanics], list[int]]:
    """``Observable.exponents`` of components that have one unit."""
    return lambda m: [exponent(m)] * count


MOMENTUM = lambda m: m.scaling.momentum  # noqa: E731
ENERGY = lambda m: m.scaling.energy  # noqa: E731
NO_UNIT = lambda m: 0  # noqa: E731
