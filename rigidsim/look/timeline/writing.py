"""Writing a run's timeline, whole or as the run goes on: with strict errors, and never on a full disk."""

import errno
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import xarray
from rerun.error_utils import set_strict_mode, strict_mode

from rigidsim.look.page import legible
from rigidsim.look.signals import title_of
from rigidsim.look.timeline.blueprint import build_blueprint
from rigidsim.look.timeline.drawn import DrawnRun
from rigidsim.scene.parts_of_values import in_time_order

LIVE_ROWS = 100_000
CHUNK = 4096  # rows per chunk: larger ones make the viewer slow, smaller ones heavy
_ROW_BYTES = 600  # at most: some twenty variables
_FIRST_BYTES = 1024 * _ROW_BYTES  # bodies, layout, page


def write_timeline(
    dataset: xarray.Dataset, path: Path, *, rows: int = 100_000, part: str | None = None
) -> int:
    """Write a dataset as a rerun recording with its own layout; returns the number of rows written.

    Args:
    dataset: of a run, or any part of it: what is missing isn't shown, every other numeric variable along
    time gets a plot. It may be lazy: only the rows shown are read.
    path: the file; it is whole when this returns.
    rows: at most so many rows are shown, evenly strided, with the first and the last.
    part: of the page that a picture shows, "page", "scene" or "plots", without the viewer's own bars;
    or "player", for a small frame within another page.

    Raises:
    ValueError: no samples, a time that isn't finite, `rows` < 2 or an unreadable `drawing`.
    RuntimeError: the environment variable RERUN switches recording off.
    OSError: the file can't be written, or there is no room for it.
    """
    run = DrawnRun.of(in_time_order(dataset), rows)
    count = len(run.steps)
    with recording_to(path, title_of(dataset), count, build_blueprint(run, part=part)) as recording:
        run.draw_static(recording)
        for piece in chunks(0, count):
            check_room(path, count - piece.start)
            run.draw_rows(recording, piece)
    return count


def chunks(first: int, count: int) -> Iterator[slice]:
    """The rows from the first to the last, ``CHUNK`` at a time."""
    return (slice(start, min(start + CHUNK, count)) for start in range(first, count, CHUNK))


@contextmanager
def recording_to(path: Path, name: str, rows: int, blueprint: rrb.Blueprint) -> Iterator[rr.RecordingStream]:
    """A recording of at most so many rows, with its layout, whose file is whole when the block ends."""
    check_room(path, rows)
    with strict():
        # The context manager finishes the file: without it there is no footer.
        with rr.RecordingStream("rigidsim") as stream:
            if not rr.is_enabled(stream):
                raise RuntimeError("RERUN is set to off in the environment: unset it")
            stream.save(path, default_blueprint=blueprint)
            stream.send_recording_name(legible(name))
            yield stream


@contextmanager
def strict() -> Iterator[None]:
    """Turn errors of the rerun API into exceptions; wrong shapes and times would be dropped otherwise."""
    before = strict_mode()
    set_strict_mode(True)
    try:
        yield
    finally:
        set_strict_mode(before)


def check_room(path: Path, rows: int) -> None:
    """Refuse if there is too little room, before rerun finds the disk full and may wait for ever."""
    room, needed = shutil.disk_usage(path.parent).free, _FIRST_BYTES + _ROW_BYTES * rows
    if room < needed:
        missing = f"it may need {needed / 1e6:.1f} MB, and {room / 1e6:.1f} MB are free"
        raise OSError(errno.ENOSPC, missing, str(path))


class LiveRecording:
    """A recording that grows with a run, by `rows` so far, on a stream to a viewer or a file."""

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._scales: tuple[object, ...] = ()
        self._last = -1
        self.rows = 0

    def update(self, dataset: xarray.Dataset) -> None:
        """Send the new rows of all so far; everything where the scales have changed with them."""
        if dataset.sizes["time"] - 1 == self._last:  # nothing is new
            return
        run = DrawnRun.of(dataset, LIVE_ROWS)
        steps = run.steps
        with strict():
            scales = _scales_of(run)
            if scales != self._scales:
                self._scales, self._last = scales, -1
                self._stream.send_blueprint(build_blueprint(run, following=True))
                self._stream.send_recording_name(legible(title_of(dataset)))
            run.draw_static(self._stream)
            first = int(np.searchsorted(steps, self._last, side="right"))
            for part in chunks(first, len(steps)):
                run.draw_rows(self._stream, part)
            self.rows += len(steps) - first
        self._last = int(steps[-1])
        self._stream.flush()


def _scales_of(run: DrawnRun) -> tuple[object, ...]:
    """What earlier rows were drawn with: equal for two parts of a run whose rows fit together."""
    picture = run.picture
    arrows = [(s.root, a.name, *np.round(a.vectors[0], 4)) for s in picture.stages for a in s.arrows]
    trails = [(s.root, t.name, t.line, *np.round(t.points[0], 4)) for s in picture.stages for t in s.trails]
    plots = [(p.heading, p.place, len(p.labels)) for p in run.plots]
    stages = [
        (s.root, s.title, s.unit, len(s.lines), *(line.words for line in s.lines)) for s in picture.stages
    ]
    return (run.clock.name, *stages, *arrows, *trails, *plots)


@contextmanager
def live_recording(address: str) -> Iterator[LiveRecording]:
    """A recording that grows in a viewer which listens at an address."""
    with rr.RecordingStream("rigidsim") as stream:
        stream.connect_grpc(address)
        yield LiveRecording(stream)
