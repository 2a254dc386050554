"""Blocks from which a system of equations is assembled; the states that carry an attitude among them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import heyoka as hy

from rigidsim.model.rotations import Symbolic, SymbolicMatrix


@dataclass(frozen=True)
class StateBlock:
    """A group of states that belong together.

    Attributes:
        names: names of the states.
        derivatives: right-hand sides, in the same order.
        initial: initial values (mpf), internal units.
        norms: expressions that stay 1 by construction.
        exponents: binary exponents that bring the states to SI; empty for pure numbers.
        why: why they are carried.
    """

    names: Sequence[str]
    derivatives: Sequence[Symbolic]
    initial: Sequence[Any]
    norms: Sequence[Symbolic] = field(default_factory=list)
    exponents: Sequence[int] = ()
    why: str = ""

    @property
    def variables(self) -> list[Symbolic]:
        """The states as heyoka variables."""
        return list(hy.make_vars(*self.names)) if len(self.names) > 1 else [hy.make_vars(*self.names)]

    @property
    def unit_exponents(self) -> list[int]:
        """Binary exponent of the unit of each state."""
        return list(self.exponents) or [0] * len(self.names)


@dataclass(frozen=True)
class OrbitalFrame:
    """Quantities of the orbital frame, for an attitude carried relative to a circular orbit.

    Attributes:
        direction: unit vector towards the attracting body, body axes.
        normal: unit normal of the orbit, body axes.
        states: states of the orbit itself, from which the attitude in space follows.
    """

    direction: list[Symbolic]
    normal: list[Symbolic]
    states: StateBlock


@dataclass(frozen=True)
class AttitudeStates:
    """The part of a system of equations that carries the attitude.

    Attributes:
        names: names of the states.
        derivatives: right-hand sides, in the same order.
        initial: initial values (mpf).
        matrix: R, body to space, as expressions of the states.
        quaternion: [w, x, y, z] as expressions; see ``quaternion_sign``.
        quaternion_sign: how it is made continuous: "state" (it is one), "wrapping" (it changes sign with
            each full turn of an angle) or "nearest" (the sign nearest to the sample before).
        angles: indices in ``names`` of states that are angles and grow without bound.
        defect: name, long name and expression of what should stay constant by construction, or None.
        singular_factor: expression that vanishes where the states are singular, or None.
        sequence: sequence of Euler angles, if that is what the states are.
        orbital: the orbital frame, if the states are the attitude relative to it; else None.
        angle_unit: binary exponent of the unit in which such angles are carried, rad.
        chord: angle (rad) between attitudes whose states are at a small distance of 1, if it is the same
            everywhere; else None.
        momenta: names of further states of the rotation that are in the place of the body rates.
        observables: those recorded by default because the states tell them directly.
    """

    names: list[str]
    derivatives: list[Symbolic]
    initial: list[Any]
    matrix: SymbolicMatrix
    quaternion: list[Symbolic]
    quaternion_sign: str
    angles: tuple[int, ...] = ()
    defect: tuple[str, str, Symbolic] | None = None
    singular_factor: Symbolic | None = None
    sequence: str = ""
    orbital: OrbitalFrame | None = None
    angle_unit: int = 0
    chord: float | None = None
    momenta: tuple[str, ...] = ()
    observables: tuple[str, ...] = ()

    @property
    def variables(self) -> list[Symbolic]:
        """The states as heyoka variables."""
        return list(hy.make_vars(*self.names))


def joined(blocks: Iterable[StateBlock]) -> StateBlock:
    """Several blocks concatenated in order."""
    found = list(blocks)
    return StateBlock(
        [name for block in found for name in block.names],
        [rate for block in found for rate in block.derivatives],
        [value for block in found for value in block.initial],
        [norm for block in found for norm in block.norms],
        [exponent for block in found for exponent in block.unit_exponents],
    )
