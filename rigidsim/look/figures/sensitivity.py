"""Sensitivities along a run: how far attitude, rates and position move for one SI unit of each key."""

from itertools import cycle

import numpy as np
import xarray
from matplotlib.axes import Axes

from rigidsim.look import signals
from rigidsim.look.figures.panel import Find, clock, panel
from rigidsim.look.figures.style import PALETTE, key
from rigidsim.look.solids import Array

_DASHES = ("-", (0, (5, 2)), (0, (1.5, 1.5)))  # of more parameters than there are hues

Found = tuple[Array, list[str], str]


def _sizes(name: str) -> Find:
    """Sizes of the derivatives (rows, parameters), the parameters with units, and the variable's unit."""

    def find(dataset: xarray.Dataset) -> Found | None:
        table = signals.values(dataset, name)
        if table is None:
            return None
        attributes = dataset[name].attrs
        keys = [str(label) for label in dataset["parameter"].values]
        units = str(attributes.get("parameter_units", "")).split(", ")
        told = [
            k if unit in ("1", "") else f"{k} [{unit}]"
            for k, unit in zip(keys, units + [""] * len(keys), strict=False)
        ]
        return np.linalg.norm(table, axis=2), told, str(attributes.get("units", "1"))

    return find


def _draw(axes: Axes, dataset: xarray.Dataset, found: Found, title: str) -> None:
    table, names, unit = found
    time = clock(dataset)[0]
    styles = [(hue, dash) for dash in _DASHES for hue in PALETTE]
    for column, name, (hue, dash) in zip(table.T, names, cycle(styles), strict=False):
        shown = np.where(column > 0, column, np.nan)  # zero has no place on a logarithmic axis
        if np.isfinite(shown).any():
            axes.plot(time, shown, color=hue, ls=dash, lw=1.1, label=name)
        else:
            axes.plot([], [], color=hue, ls=dash, lw=1.1, label=f"{name}: 0 throughout")
    if (table > 0).any():
        axes.set_yscale("log")
    key(axes, title)
    axes.set_ylabel(f"size [{unit.replace('rad s-1', 'rad/s')} per unit]")


@panel(_sizes("attitude_sensitivity"))
def attitude(axes: Axes, dataset: xarray.Dataset, found: Found) -> None:
    """Angle by which the attitude turns for one unit of each parameter."""
    _draw(axes, dataset, found, "How far the attitude moves, per SI unit of")


@panel(_sizes("angular_velocity_sensitivity"))
def rates(axes: Axes, dataset: xarray.Dataset, found: Found) -> None:
    """Change of the angular velocity for one unit of each parameter."""
    _draw(axes, dataset, found, "How far the angular velocity changes, per SI unit of")


@panel(_sizes("position_sensitivity"))
def position(axes: Axes, dataset: xarray.Dataset, found: Found) -> None:
    """Distance by which the centre of mass moves for one unit of each parameter."""
    _draw(axes, dataset, found, "How far the body moves, per SI unit of")
