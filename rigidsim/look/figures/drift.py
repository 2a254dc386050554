"""Drifts of invariants against the bound that rounding explains."""

import textwrap
from itertools import cycle

import numpy as np
import xarray
from matplotlib.axes import Axes

from rigidsim.look import signals
from rigidsim.look.figures.panel import clock, panel
from rigidsim.look.figures.style import GREY, PALETTE, key, note
from rigidsim.look.signals import by_role, in_words
from rigidsim.look.solids import Array

TYPICAL, MOST = 0.5, 50.0
"""In units of tolerance times sqrt(steps): a random walk of one rounding per step (Brouwer 1937), and the
drift above which a summary warns (a few roundings of several operations per step).
"""


def law(dataset: xarray.Dataset) -> Array | None:
    """tolerance sqrt(steps until then) (rows,), steps spread evenly over the run; None if there were none."""
    try:
        steps, tolerance = float(dataset.attrs["steps"]), float(dataset.attrs["tolerance"])
    except (KeyError, ValueError, TypeError):
        return None
    if not (steps > 0 and tolerance > 0):
        return None
    seconds = signals.seconds(dataset)
    span = seconds[-1] - seconds[0]
    if span == 0:
        return None
    return tolerance * np.sqrt(np.maximum(steps * (seconds - seconds[0]) / span, 1.0))


@panel(lambda dataset: by_role(dataset, "drift_of") or None)
def drift(axes: Axes, dataset: xarray.Dataset, found: dict[str, xarray.DataArray]) -> None:
    """Magnitudes of all relative drifts on a logarithmic axis, over the band that rounding explains."""
    time = clock(dataset)[0]
    projected = by_role(dataset, "put_back_of")
    curves: list[Array] = []
    still: list[str] = []
    for (name, variable), hue in zip(found.items(), cycle(PALETTE), strict=False):
        shown = _magnitude(variable, len(time))
        label = in_words(name)
        if not np.isfinite(shown).any():  # zero has no place on a logarithmic axis
            still.append(label)
        else:
            curves.append(shown)
            axes.plot(time, shown, color=hue, label=label, lw=0.7, alpha=0.85, rasterized=len(time) > 6000)
        if name in projected:  # what the drift would have been
            curves.append(_magnitude(projected[name], len(time)))
            axes.plot(time, curves[-1], color=hue, lw=1.0, ls=(0, (4, 2)))
    band = law(dataset)
    if band is not None:
        axes.fill_between(time, TYPICAL * band, MOST * band, color="#e9edf2", lw=0, zorder=0)
        curves.append(TYPICAL * band)
    tops = [float(np.nanmax(c)) for c in curves if np.isfinite(c).any()]
    lows = [float(np.nanpercentile(c, 1)) for c in curves if np.isfinite(c).any()]
    if still:
        text = textwrap.fill("exactly 0: " + ", ".join(still), 80)
        note(axes, 0.01, 0.03, text, ha="left", va="bottom", fontsize=8.5, color=GREY)
    if tops:
        axes.set_yscale("log")
        low = min(lows)
        if band is not None:  # what cancels to far less than a rounding says nothing
            low = max(low, 0.02 * float(band[0]))
        axes.set_ylim(low / (20 if still else 5), max(tops) * 8)
    else:
        axes.set_yticks([0.0])
    remarks = ["grey: what rounding explains"] if band is not None else []
    remarks += ["dashed: corrections by projection"] if projected else []
    key(axes, "Drift of invariants" + (f" ({', '.join(remarks)})" if remarks else ""))
    axes.set_ylabel("relative drift")


def _magnitude(variable: xarray.DataArray, rows: int) -> Array:
    """The largest over the components, a gap where it is zero."""
    table = np.abs(np.asarray(variable.transpose("time", ...).values, dtype=np.float64)).reshape(rows, -1)
    largest = table.max(axis=1)
    return np.where(largest > 0, largest, np.nan)
