"""Following a running run in the viewer: what has been saved so far, and the rest as it comes."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidsim.look import viewer
from rigidsim.look.drawn import DrawnRun
from rigidsim.look.page import legible, title_of
from rigidsim.look.recording import STRETCH, strict
from rigidsim.look.thinning import thin, thinned_indices

if TYPE_CHECKING:
    import xarray

ROWS = 100_000
POLL_SECONDS = 1.0
_ANSWER_SECONDS = 20.0
_CLOSING_SECONDS = 3.0


class LiveRecording:
    """A recording that grows with a run.

    Args:
        stream: recording stream of rerun, connected to a viewer or a file.

    Attributes:
        rows: number of rows sent so far.
    """

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self._scales: tuple[object, ...] = ()
        self._last = -1
        self.rows = 0

    def update(self, dataset: xarray.Dataset) -> None:
        """Send the new rows of a dataset that has all samples so far.

        Where the scales of the picture have changed with the new samples, everything is sent again.
        """
        if not dataset.sizes["time"]:
            return
        shown = thin(dataset, ROWS)
        steps = thinned_indices(dataset.sizes["time"], ROWS)
        if steps[-1] == self._last:
            return
        run = DrawnRun.of(dataset, shown, steps)
        with strict():
            scales = _scales_of(run)
            if scales != self._scales:
                self._scales, self._last = scales, -1
                self._stream.send_blueprint(run.blueprint(following=True))
                self._stream.send_recording_name(legible(title_of(dataset)))
            run.draw_static(self._stream)
            first = int(np.searchsorted(steps, self._last, side="right"))
            for start in range(first, len(steps), STRETCH):
                part = slice(start, min(start + STRETCH, len(steps)))
                run.draw_rows(self._stream, part)
                self.rows += part.stop - part.start
        self._last = int(steps[-1])
        self._stream.flush()


def _scales_of(run: DrawnRun) -> tuple[object, ...]:
    """What earlier rows were drawn with: equal for two parts of a run whose rows fit together."""
    picture = run.picture
    arrows = [(s.root, a.name, *np.round(a.vectors[0], 4)) for s in picture.stages for a in s.arrows]
    trails = [(s.root, t.name, t.line, *np.round(t.points[0], 4)) for s in picture.stages for t in s.trails]
    plots = [(p.title, p.place, len(p.series)) for p in run.plots]
    stages = [(s.root, s.title, s.unit, len(s.lines)) for s in picture.stages]
    return (run.clock.name, *map(tuple, stages), *arrows, *trails, *plots)


def follow(
    read: Callable[[], tuple[xarray.Dataset | None, bool]], *, web: bool = False, poll: float = POLL_SECONDS
) -> int:
    """Open the viewer on a run that goes on, and keep it up to date until the run or the viewer ends.

    Args:
        read: returns the dataset saved so far (None before there is one), and whether the run goes on.
        web: in the browser, served on 127.0.0.1 only, until Ctrl-C.
        poll: interval between polls, s.

    Returns:
        The viewer's exit code; 130 after Ctrl-C.

    Raises:
        NoDisplay, FileNotFoundError: as for ``viewer.open_viewer``.
        RuntimeError: the viewer ended before it listened.
    """
    with viewer.empty_viewer(web=web) as (process, port):
        # Ctrl-C ends the viewer, too: what was on its way there would be complained of, and `process` tells
        # enough
        os.environ.setdefault("RUST_LOG", "off")
        import rerun as rr

        try:
            viewer.wait_for(process, port, _ANSWER_SECONDS)
            with rr.RecordingStream("rigidsim") as stream:
                stream.connect_grpc(f"rerun+http://{viewer.LOOPBACK}:{port}/proxy")
                recording, going_on = LiveRecording(stream), True
                while going_on and process.poll() is None:
                    dataset, going_on = read()
                    if dataset is not None:
                        with dataset:
                            recording.update(dataset)
                    if going_on:
                        _sleep(process, poll)
            return viewer.ended(process)
        except KeyboardInterrupt:
            return viewer.INTERRUPTED
        except RuntimeError:
            # sent while the viewer was being closed
            try:
                return viewer.ended(process, _CLOSING_SECONDS)
            except subprocess.TimeoutExpired:
                pass
            raise


def _sleep(process: subprocess.Popen[bytes], seconds: float) -> None:
    until = time.monotonic() + seconds
    while process.poll() is None and time.monotonic() < until:
        time.sleep(0.1)
