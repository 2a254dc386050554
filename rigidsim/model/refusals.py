"""What keeps a system from being integrated or recorded: a start in a singularity, numbers out of range."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.formulations import AttitudeStates
from rigidsim.model.numbers import Rounder
from rigidsim.model.outputs import Invariant, Recorded
from rigidsim.scene.scene import Scene

_LARGEST_EXPONENT = 1000
"""Of a recorded variable in SI: float64 ends at 2^1024, and the size of a variable is known roughly."""


def refuse_singular_start(scene: Scene, attitude: AttitudeStates | None) -> None:
    """A start where canonical momenta of Euler angles don't exist.

    Raises:
        ConfigError: it is one.
    """
    if attitude is None or attitude.singular_factor is None:
        return
    context = scene.context
    middle = attitude.initial[1]
    proper = attitude.sequence[0] == attitude.sequence[2]
    factor = abs(context.sin(middle) if proper else context.cos(middle))
    if factor < context.mpf(2) ** -20:
        raise ConfigError(
            Problem(
                "[integrator] formulation",
                f"the motion starts {context.nstr(factor, 3)} rad from the singularity of the sequence "
                f"{attitude.sequence} (middle angle {context.nstr(middle, 8)} rad), where Euler angles have "
                'no momenta; choose formulation = "euler_angles", which changes its sequence there, '
                '"quaternion", or another euler_sequence',
            )
        )


def refuse_out_of_range(
    initial: list[Any], variables: Sequence[Recorded | Invariant], number: Rounder
) -> None:
    """Numbers that neither the states nor the dataset's float64 can hold.

    Raises:
        OverflowError: there is one.
    """
    for value in initial:
        number(value)
    for variable in variables:
        for exponent in variable.exponents:
            if abs(exponent) > _LARGEST_EXPONENT:
                raise OverflowError(f"{variable.name} would be about 2^{exponent} {variable.units}")
