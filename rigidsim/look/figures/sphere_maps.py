"""Values over directions of a sweep, on an equal-area map of the whole sphere."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rigidsim.look.figures.style import PALE

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_FEWEST = 12  # directions that make a map
_ALIKE = 1e-9  # lengths, relative
_FILLED = 2.0  # area of the dots over that of the map


def directions(dataset: xarray.Dataset, dim: str) -> Array | None:
    """Unit vectors (members, 3) of an axis that sweeps directions; None for any other axis."""
    name = f"{dim}_value"
    if name not in dataset.coords or dataset[name].dims[0] != dim or dataset[name].shape[1:] != (3,):
        return None
    vectors = np.asarray(dataset[name].values, dtype=np.float64)
    lengths = np.linalg.norm(vectors, axis=1)
    if len(vectors) < _FEWEST or not lengths.min() > 0 or np.ptp(lengths) > _ALIKE * lengths.max():
        return None
    return np.asarray(vectors / lengths[:, None])


def on_sphere(figure: Figure, vectors: Array, values: Array, scale: dict[str, Any]) -> tuple[Axes, Any]:
    """A Mollweide map, +z at the top and +x in the centre, with a dot for each direction.

    Args:
        vectors: unit vectors, (members, 3).
        values: (members,).
        scale: colours, as ``scatter`` takes them.

    Returns:
        The axes, and the object for a colour bar.
    """
    axes = figure.add_subplot(projection="mollweide")
    axes.set_facecolor(PALE)
    longitude, latitude = np.arctan2(vectors[:, 1], vectors[:, 0]), np.arcsin(np.clip(vectors[:, 2], -1, 1))
    figure.canvas.draw()  # the layout says how large the map is
    box = axes.get_window_extent()
    area = np.pi / 4 * box.width * box.height * (72 / figure.dpi) ** 2  # of the ellipse, square points
    size = _FILLED * area / len(vectors)
    shown = axes.scatter(
        longitude, latitude, c=values, s=size, lw=0, cmap="viridis", rasterized=True, **scale
    )
    named = {"+x": (0, 0), "+y": (np.pi / 2, 0), "−y": (-np.pi / 2, 0), "+z": (0, 1.35), "−z": (0, -1.35)}
    box_of_name = {"boxstyle": "round,pad=0.2", "facecolor": "white", "alpha": 0.7, "linewidth": 0}
    for name, place in named.items():
        axes.annotate(name, place, ha="center", va="center", fontsize=8, bbox=box_of_name)
    axes.set(xticklabels=[], yticklabels=[])
    axes.grid(visible=False)
    return axes, shown
