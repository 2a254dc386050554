"""Panels of what changes beside the motion: own states, moments of inertia that vary, a fluid core."""

from collections.abc import Callable

import numpy as np
import xarray
from matplotlib.axes import Axes

from rigidsim.look import signals
from rigidsim.look.figures.panel import angle_scale, panel, recorded
from rigidsim.look.figures.style import PALETTE, PINK, VIOLET, X, Y, Z, key
from rigidsim.look.figures.timelines import angles_over_time, lines
from rigidsim.look.solids import Array
from rigidsim.scene.readable import si_scale

_VISIBLE = 0.01  # of an angle, from which a change is seen on an axis from zero
_ROUNDING = 1e-11  # of rates, below which their difference tells nothing


@panel(recorded("principal_moments"))
def moments(axes: Axes, dataset: xarray.Dataset, table: Array) -> None:
    """Moments of inertia that vary."""
    lines(axes, dataset, table, ["$I_x$", "$I_y$", "$I_z$"], (X, Y, Z))
    key(axes, "Principal moments of inertia")
    axes.set_ylabel("I [kg m²]")


def _core(dataset: xarray.Dataset) -> tuple[Array, Array] | None:
    """Rates (rows, 3) of a fluid core and of the mantle, body axes."""
    core, mantle = (signals.values(dataset, name) for name in ("core_angular_velocity", "angular_velocity"))
    return None if core is None or mantle is None else (core, mantle)


@panel(_core)
def core_axis(axes: Axes, dataset: xarray.Dataset, found: tuple[Array, Array]) -> None:
    """Angle between the axes about which core and mantle turn."""
    apart = signals.angle_between(*found)[:, None]
    angles_over_time(axes, dataset, apart, "Axis of the core, from the mantle's spin axis", hues=[PINK])
    if np.nanmin(apart) > (1 - _VISIBLE) * np.nanmax(apart):
        axes.set_ylim(0.0, 1.1 * axes.get_ylim()[1])


def _faster(dataset: xarray.Dataset) -> Array | None:
    """By how much faster the core turns than the mantle (rows, 1), rad/s; None if that is only rounding."""
    rates = _core(dataset)
    if rates is None:
        return None
    core, mantle = rates
    both = signals.norms(core) + signals.norms(mantle)
    # of vectors nearly alike: less is lost than by taking the difference of their norms
    difference = np.einsum("ti,ti->t", core - mantle, core + mantle)
    seen = np.abs(difference) > _ROUNDING * both**2
    return np.asarray((difference / both)[:, None]) if seen.any() else None


@panel(_faster)
def core_slip(axes: Axes, dataset: xarray.Dataset, faster: Array) -> None:
    """By how much faster the core turns than the mantle."""
    scale, unit = si_scale(faster, "rad/s")
    lines(axes, dataset, faster / scale, [None], [VIOLET])
    key(axes, "Rate of the core, less the mantle's")
    axes.set_ylabel(f"difference [{unit}]")


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
"""Panels of user-defined states, one for each of the first units."""
