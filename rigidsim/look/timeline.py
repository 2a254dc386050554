"""`timeline.rrd`: a run for the rerun viewer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rigidsim.look.drawn import DrawnRun
from rigidsim.look.page import title_of
from rigidsim.look.recording import STRETCH, check_room, recording_to
from rigidsim.look.thinning import KeptRows, thin, thinned_indices

if TYPE_CHECKING:
    import xarray


def write_timeline(
    dataset: xarray.Dataset, path: Path, *, rows: int = 100_000, kept: KeptRows | None = None
) -> int:
    """Write a dataset as a rerun recording with its own layout.

    Args:
        dataset: dataset of a run, or any part of it: what is missing isn't shown, every other numeric
            variable along time gets a plot. It may be lazy: only the rows shown are read.
        path: the file; it is whole when this returns.
        rows: at most so many rows are shown, evenly strided, with the first and the last.
        kept: these rows, if they were kept while the run went on; otherwise they are read.

    Returns:
        The number of rows written.

    Raises:
        ValueError: no samples, a time that isn't finite, `rows` < 2 or an unreadable `drawing`.
        RuntimeError: the environment variable RERUN switches recording off.
        OSError: the file can't be written, or there is no room for it.

    The viewer draws in float32: the picture is for looking, the dataset for measuring.
    """
    shown = thin(dataset, rows, kept=kept)
    count = shown.sizes["time"]
    steps = thinned_indices(dataset.sizes["time"], rows)
    run = DrawnRun.of(dataset, shown, steps)
    with recording_to(path, title_of(dataset), count) as recording:
        recording.start(run.blueprint())
        run.draw_static(recording.stream)
        for start in range(0, count, STRETCH):
            check_room(path, count - start)
            run.draw_rows(recording.stream, slice(start, min(start + STRETCH, count)))
    return count
