"""A panel of a figure: what it needs of a dataset, and how that is drawn."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import xarray
from matplotlib.axes import Axes

from rigidsim.look import signals

Find = Callable[["xarray.Dataset"], Any]
Draw = Callable[["Axes", "xarray.Dataset", Any], None]


@dataclass(frozen=True)
class Panel:
    """A panel: `find` gives what it draws of a dataset in memory, or None; `draw_found` draws that on axes,
    with title, labels and units. One that `begins` shows only the start if the whole would be a solid band.
    """

    find: Find
    draw_found: Draw
    begins: bool = False

    def shows(self, rows: xarray.Dataset) -> bool:
        """Whether a dataset (in memory) has something for it."""
        return self.find(rows) is not None

    def draw(self, axes: Axes, rows: xarray.Dataset) -> None:
        """Draw what a dataset that it shows has for it."""
        self.draw_found(axes, rows, self.find(rows))


def panel(find: Find, *, begins: bool = False) -> Callable[[Draw], Panel]:
    """Declare a panel: the function below draws what ``find`` finds. See ``Panel``."""
    return lambda draw: Panel(find, draw, begins)


def recorded(*names: str) -> Find:
    """The first of these variables that was recorded along time."""

    def find(dataset: xarray.Dataset) -> Any:
        tables = (signals.values(dataset, name) for name in names)
        return next((table for table in tables if table is not None), None)

    return find
