"""``[model]``: how much of the motion is resolved."""

from __future__ import annotations

from typing import Literal

from pydantic import StrictBool

from rigidsim.scene.fields import ConfigTable

FULL, SPIN_AVERAGED, ORBIT_AVERAGED, AUTO = "full", "spin_averaged", "orbit_averaged", "auto"
REDUCED = (SPIN_AVERAGED, ORBIT_AVERAGED)
"""Levels that carry only the momentum's direction; later ones average more."""


class Model(ConfigTable):
    """``[model]``: every rotation, or the motion averaged over it, or over the sources' orbits as well."""

    level: Literal["full", "spin_averaged", "orbit_averaged", "auto"] = "full"
    """full resolves every rotation; spin_averaged follows the direction of the angular momentum, and its size
    and energy under torques that do work, averaged over the body's free rotation; orbit_averaged averages
    over the sources' orbits as well; auto is the cheapest level that keeps [integrator] accuracy_axis
    """
    short_period: StrictBool = False
    """add back, to first order, what averaging removed: the nutation with the orbital periods, and the offset
    of figure and spin axes from the angular momentum
    """

    @property
    def reduced(self) -> bool:
        """Whether the model averages anything."""
        return self.level in REDUCED
