"""A comparison's dataset and figure as files, each of which appears only when complete."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import xarray

from rigidsim.errors import RigidsimError
from rigidsim.store.many_rows import blocks_of
from rigidsim.store.netcdf import writing as writing_netcdf
from rigidsim.store.outputs import refuse_loss, writing

FIGURES = (".png", ".svg")
DRAWN = ("drawing", "principal_moments", "principal_axes", "center_of_mass", "mass", "surroundings")
"""Attributes of a run's dataset that its body is drawn by."""
MOST_SHOWN = 20_000  # rows of a timeline
_MOST_DRAWN = 4000  # points of a figure


def refuse_targets(
    out: Path | None, figure: Path | None, timeline: Path | None, inputs: Iterable[Path], *, force: bool
) -> None:
    """Refuse files of the wrong kind, and those that would replace something (``store.outputs``)."""
    if out is not None and out.suffix.lower() in FIGURES:
        raise RigidsimError(f"{out}: the dataset is no picture; give --out FILE.h5, and --figure for that")
    if figure is not None and figure.suffix.lower() not in FIGURES:
        raise RigidsimError(f"{figure}: a figure is a .png or a .svg")
    if timeline is not None and timeline.suffix.lower() != ".rrd":
        raise RigidsimError(f"--timeline: given {timeline}; a name that ends in .rrd is allowed")
    refuse_loss(filter(None, (out, figure, timeline)), inputs, force=force)


def save_dataset(dataset: xarray.Dataset, path: Path) -> Path:
    """Write the dataset of a comparison, which has numbers alone."""
    with writing(path) as temporary:
        _write(dataset, temporary)
    return path


def _write(dataset: xarray.Dataset, path: Path) -> None:
    """Variable by variable, by blocks of rows."""
    with writing_netcdf(path) as file:
        file.attributes(dataset.attrs)
        for dim, size in dataset.sizes.items():
            file.dimension(str(dim), size)
        for name, variable in dataset.variables.items():
            target = file.variable(str(name), [str(dim) for dim in variable.dims], variable.attrs)
            for rows in blocks_of(len(variable)):
                target[rows] = variable[rows].values


def thinned(dataset: xarray.Dataset) -> xarray.Dataset:
    """A comparison's dataset with, of very many rows, the largest of each stretch, as a figure shows them."""
    count = dataset.sizes["time"]
    stretch = -(-count // _MOST_DRAWN)
    if stretch == 1:
        return dataset
    found: dict[str, list[np.ndarray]] = {}
    for rows in blocks_of(count, multiple=stretch):
        for name, variable in dataset.variables.items():
            if variable.dims == ("time",):
                values = variable[rows].values
                begins = np.arange(0, len(values), stretch)
                shown = values[begins] if name == "time" else np.maximum.reduceat(np.abs(values), begins)
                found.setdefault(str(name), []).append(shown)
    drawn = {name: ("time", np.concatenate(parts)) for name, parts in found.items()}
    return dataset.drop_dims("time").assign_coords(time=drawn.pop("time")).assign(drawn)


def save_figure(dataset: xarray.Dataset, path: Path) -> Path:
    """Draw the figure, a PNG or SVG by its name."""
    from rigidsim.look.figures.compared import save_compared

    with writing(path) as temporary:
        save_compared(thinned(dataset), temporary, file_format=path.suffix.lower()[1:])
    return path


def save_timeline(own: xarray.Dataset, theirs: xarray.Dataset, name: str, path: Path) -> Path:
    """Write a timeline of the experiment and of a trajectory, side by side, and the angle between them."""
    from rigidsim.look.timeline.comparison import write_comparison  # which loads rerun

    mine = str(own.attrs.get("title", "experiment"))
    named = [(mine, own), (name if name != mine else f"{name} of the file", theirs)]
    try:
        with writing(path) as temporary:
            write_comparison(named, temporary)
    except RuntimeError as error:
        raise RigidsimError(f"{path}: can't be written: {error}") from None
    return path
