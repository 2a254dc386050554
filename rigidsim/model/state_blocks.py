"""Blocks from which a system of equations is assembled: names of the body's states, states with their
equations, and those that carry an attitude.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import heyoka as hy

from rigidsim.model.rotations import Symbolic, SymbolicMatrix


class RotatingBody:
    """A body that turns: everything that is named after it.

    The names of its states begin with a prefix, which distinguishes several bodies.
    """

    def __init__(self, prefix: str = "") -> None:
        self.rates = [prefix + name for name in ("wx", "wy", "wz")]  # angular velocity, body axes
        self.vertical = [prefix + name for name in ("gx", "gy", "gz")]  # upwards, body axes
        self.quaternion = [prefix + name for name in ("qw", "qx", "qy", "qz")]  # scalar part first
        self.position = [prefix + name for name in "xyz"]  # of the centre of mass, space axes
        self.velocity = [prefix + name for name in ("vx", "vy", "vz")]


BODY = RotatingBody()
"""The body of the scene."""


@dataclass(frozen=True)
class StateBlock:
    """A group of states that belong together, with their right-hand sides and initial values."""

    names: Sequence[str]
    derivatives: Sequence[Symbolic]
    initial: Sequence[Any]  # mpf, internal units
    norms: Sequence[Symbolic] = field(default_factory=list)  # expressions that stay 1 by construction
    exponents: Sequence[int] = ()  # binary, that bring the states to SI; empty for pure numbers
    why: str = ""  # they are carried

    @property
    def variables(self) -> list[Symbolic]:
        """The states as heyoka variables."""
        return list(hy.make_vars(*self.names)) if len(self.names) > 1 else [hy.make_vars(*self.names)]

    @property
    def unit_exponents(self) -> list[int]:
        """Binary exponent of the unit of each state."""
        return list(self.exponents) or [0] * len(self.names)


@dataclass(frozen=True)
class AttitudeStates:
    """The part of a system of equations that carries the attitude; the first three as in ``StateBlock``.

    The quaternion is made continuous as ``quaternion_sign`` says: "state" (it is one), "wrapping" (it changes
    sign with each full turn of an angle) or "nearest" (the sign nearest to the sample before).
    """

    names: list[str]
    derivatives: list[Symbolic]
    initial: list[Any]
    matrix: SymbolicMatrix  # R, body to space, as expressions of the states
    quaternion: list[Symbolic]  # [w, x, y, z] as expressions
    quaternion_sign: str
    angles: tuple[int, ...] = ()  # indices in ``names`` of states that are angles and grow without bound
    defect: tuple[str, str, Symbolic] | None = None  # name, long name and value of what stays by construction
    singular_factor: Symbolic | None = None  # vanishes where the states are singular
    sequence: str = ""  # of Euler angles, if that is what the states are
    angle_unit: int = 0  # binary exponent of the unit in which such angles are carried, rad
    chord: float | None = None  # rad between attitudes at a small distance of 1, if the same everywhere
    momenta: tuple[str, ...] = ()  # further states of the rotation in the place of the body rates
    observables: tuple[str, ...] = ()  # recorded by default because they follow from the states directly

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
