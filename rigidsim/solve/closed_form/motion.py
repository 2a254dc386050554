"""Interface of closed-form rotations, and the frame in which they are written."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from rigidsim.scene.arithmetic import Matrix, cross, dot
from rigidsim.solve.closed_form.arithmetic import Arithmetic


class NoClosedForm(ValueError):
    """Raised if a scene has no closed form here; the message says why, as the rest of a sentence."""


@dataclass(frozen=True)
class Motion:
    """A rotation in closed form, in the units of time and inertia of the numbers that it was made from."""

    axes: Matrix  # rows are the axes of the frame in which the motion is written (right-handed, body axes)
    title: ClassVar[str] = "rotation"  # name of the motion, for plans and summaries

    def at(self, arithmetic: Arithmetic, time: Any) -> tuple[list[Any], list[Any]]:
        """Rates along ``axes`` and a quaternion from ``axes`` to a frame fixed in space, at times after the
        start (see ``Arithmetic`` for their type).
        """
        raise NotImplementedError


def right_handed(axes: Matrix, flip: int = 1) -> Matrix:
    """The axes, with number ``flip`` reversed if they are left-handed."""
    if dot(cross(axes[0], axes[1]), axes[2]) > 0:
        return axes
    return [[-x for x in axis] if i == flip else axis for i, axis in enumerate(axes)]
