"""`timeline.rrd`: a run as the rerun viewer plays it."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.look.clock import build_clock
from rigidsim.look.page import summary_page, title_of
from rigidsim.look.plots import Plot, Series, plan_plots
from rigidsim.look.stage import build_stages
from rigidsim.look.thinning import AnyTable, KeptRows, thin, thinned_indices

if TYPE_CHECKING:
    from rigidsim.look.rows import Table

CHUNK = 4096  # rows per chunk: larger ones make the viewer slow, smaller ones heavy
_ROW_BYTES = 600  # at most: some twenty variables
_FIRST_BYTES = 1024 * _ROW_BYTES  # bodies, layout, page


def write_timeline(
    dataset: AnyTable, path: Path, *, rows: int = 100_000, kept: KeptRows | None = None
) -> int:
    """Write a dataset as a rerun recording with its own layout.

    Args:
        dataset: of a run, or any part of it: what is missing isn't shown, every other numeric
            variable along time gets a plot. It may be lazy: only the rows shown are read.
        path: the file; it is whole when this returns.
        rows: at most so many rows are shown, evenly strided, with the first and the last.
        kept: these rows, where they were kept while the run went on; otherwise they are read.

    Returns:
        The number of rows written.

    Raises:
        ValueError: no samples, a time that isn't finite, `rows` < 2 or an unreadable `drawing`.
        RuntimeError: the environment variable RERUN switches recording off.
        OSError: the file can't be written, or there is no room for it.

    The viewer draws in float32: the picture is for looking, the dataset for measuring.
    """
    import rerun as rr

    shown = thin(dataset, rows, kept=kept)
    count = shown.sizes["time"]
    steps = thinned_indices(dataset.sizes["time"], rows)
    seconds = np.asarray(shown["time"].values, dtype=np.float64)
    clock = build_clock(seconds)
    stages, notes = build_stages(shown.assign_attrs(dataset.attrs))
    plots = plan_plots(shown)
    if not clock.duration:
        notes.append(f"the run doesn't fit nanoseconds: its timeline is `{clock.name}`")
        series = Series("time_seconds", ["time"], [(170, 170, 175)], seconds[:, None])
        plots.append(Plot("time_seconds", "Time [s]", "more", [series]))
    page = summary_page(dataset, shown, notes)

    _check_room(path, count)
    with _strict():
        from rigidsim.look.blueprint import build_blueprint
        from rigidsim.look.drawing import draw_plot_styles, draw_rows, draw_static

        blueprint = build_blueprint(stages, plots, clock, _turns(shown, seconds))
        # The context manager finishes the file: without it there is no footer.
        with rr.RecordingStream("rigidsim") as recording:
            if not rr.is_enabled(recording):
                raise RuntimeError("RERUN is set to off in the environment: unset it")
            recording.save(path, default_blueprint=blueprint)
            recording.send_recording_name(title_of(dataset))
            recording.log("/summary", rr.TextDocument(page, media_type=rr.MediaType.MARKDOWN), static=True)
            draw_static(recording, stages)
            draw_plot_styles(recording, plots)
            for start in range(0, count, CHUNK):
                _check_room(path, count - start)
                part = slice(start, min(start + CHUNK, count))
                ticks = clock.ticks[part]
                time = (
                    rr.TimeColumn(clock.name, duration=ticks.astype("timedelta64[ns]"))
                    if clock.duration
                    else rr.TimeColumn(clock.name, sequence=ticks)
                )
                times = [time, rr.TimeColumn("step", sequence=steps[part])]
                draw_rows(recording, stages, plots, times, part)
    return count


def _turns(dataset: Table, seconds: np.ndarray) -> float:
    """Turns of the body during the run, from its mean rate; 0 when the rate isn't known."""
    if "angular_velocity" not in dataset:
        return 0.0
    rate = np.linalg.norm(np.asarray(dataset["angular_velocity"].values, dtype=float), axis=-1)
    mean = float(np.nanmean(rate)) if np.isfinite(rate).any() else 0.0
    return mean * float(abs(seconds[-1] - seconds[0])) / (2 * np.pi)


@contextmanager
def _strict() -> Iterator[None]:
    """Errors of the rerun API as exceptions, for the length of the block only.

    Otherwise wrong lengths, shapes and times are dropped with a warning.
    """
    from rerun.error_utils import set_strict_mode, strict_mode

    before = strict_mode()
    set_strict_mode(True)
    try:
        yield
    finally:
        set_strict_mode(before)


def _check_room(path: Path, rows: int) -> None:
    """Refuse before rerun finds the disk full: then it may wait for ever."""
    room, needed = shutil.disk_usage(path.parent).free, _FIRST_BYTES + _ROW_BYTES * rows
    if room < needed:
        missing = f"it may need {needed / 1e6:.1f} MB, and {room / 1e6:.1f} MB are free"
        raise OSError(errno.ENOSPC, missing, str(path))
