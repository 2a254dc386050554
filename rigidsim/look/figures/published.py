"""A run's attitude beside a published orientation: the angle between them, and its parts in the body."""

import numpy as np
import xarray
from matplotlib.axes import Axes

from rigidsim.look import signals
from rigidsim.look.figures.panel import panel, recorded
from rigidsim.look.figures.style import BLUE, ORANGE, X, Y, Z
from rigidsim.look.figures.timelines import angles_over_time
from rigidsim.look.solids import Array


def _angles(dataset: xarray.Dataset) -> Array | None:
    """The whole angle, and that between the poles (rows, 2)."""
    found = [signals.values(dataset, f"published_{name}") for name in ("angle", "pole_angle")]
    tables = [table.reshape(len(table), 1) for table in found if table is not None]
    return np.concatenate(tables, axis=1) if len(tables) == len(found) else None


@panel(_angles)
def angles(axes: Axes, dataset: xarray.Dataset, table: Array) -> None:
    """The angle between the attitudes, and that between the poles."""
    title = f"From the published orientation ({dataset['published_angle'].attrs.get('kernel', 'a kernel')})"
    angles_over_time(axes, dataset, table, title, hues=(BLUE, ORANGE), labels=("attitude", "pole"))


@panel(recorded("published_rotation"))
def rotation(axes: Axes, dataset: xarray.Dataset, table: Array) -> None:
    """The rotation vector between them, less its mean, which is an offset of the body's axes."""
    title = "The same about the body's axes, less its mean"
    labels = ("about x", "about y", "about z")
    angles_over_time(axes, dataset, table - table.mean(axis=0), title, hues=(X, Y, Z), labels=labels)
