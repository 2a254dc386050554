"""Panels of what changes beside the motion: states of one's own, and moments of inertia that vary."""

from collections.abc import Callable

import numpy as np
import xarray
from matplotlib.axes import Axes

from rigidsim.look import signals
from rigidsim.look.figures.panel import angle_scale, panel, recorded
from rigidsim.look.figures.style import PALETTE, X, Y, Z, key
from rigidsim.look.figures.timelines import lines
from rigidsim.look.solids import Array
from rigidsim.scene.readable import si_scale


@panel(recorded("principal_moments"))
def moments(axes: Axes, dataset: xarray.Dataset, table: Array) -> None:
    """Moments of inertia that vary."""
    lines(axes, dataset, table, ["$I_x$", "$I_y$", "$I_z$"], (X, Y, Z))
    key(axes, "Principal moments of inertia")
    axes.set_ylabel("I [kg m²]")


def _own_states(place: int) -> Callable[[xarray.Dataset], tuple[Array, list[str], str] | None]:
    """Those states of ``[[states]]``, (rows, n), that have the unit in some place, with their names."""

    def find(dataset: xarray.Dataset) -> tuple[Array, list[str], str] | None:
        own = [v for v in dataset.data_vars.values() if signals.is_own_state(v)]
        units = list(dict.fromkeys(str(v.attrs.get("units", "1")) for v in own))
        if place >= len(units):
            return None
        names = [str(v.name) for v in own if v.attrs.get("units", "1") == units[place]]
        columns = [found for name in names if (found := signals.values(dataset, name)) is not None]
        return np.stack(columns, axis=1), names, units[place]

    return find


def _draw_states(axes: Axes, dataset: xarray.Dataset, found: tuple[Array, list[str], str]) -> None:
    table, names, unit = found
    if unit == "rad":
        scale, shown = angle_scale(table)
    else:
        scale, shown = si_scale(table, unit) if unit == "rad/s" else (1.0, unit)
    lines(axes, dataset, table / scale, names, [PALETTE[n % len(PALETTE)] for n in range(len(names))])
    key(axes, "Own states" if len(names) > 1 else f"Own state {names[0]}")
    axes.set_ylabel("value" if shown == "1" else f"value [{shown}]")


OWN_STATES = [panel(_own_states(place), begins=True)(_draw_states) for place in range(3)]
"""Panels of states of one's own, one for each of the first units."""
