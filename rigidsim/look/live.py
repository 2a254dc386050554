"""Following a running run in the viewer: what has been saved so far, and the rest as it comes."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from rigidsim.look import viewer

if TYPE_CHECKING:
    import xarray

POLL_SECONDS = 1.0
_ANSWER_SECONDS = 20.0
_CLOSING_SECONDS = 3.0


def follow(
    read: Callable[[], tuple[xarray.Dataset | None, bool]], *, web: bool = False, poll: float = POLL_SECONDS
) -> int:
    """Open the viewer on a run that goes on, and keep it up to date until the run or the viewer ends.

    Args:
        read: returns the dataset saved so far (None before there is one), and whether the run goes on.
        web, and what is returned: as for ``viewer.open_viewer``.

    Raises:
        NoDisplay, FileNotFoundError: as for ``viewer.open_viewer``.
        RuntimeError: the viewer ended before it listened.
    """
    with viewer.empty_viewer(web=web) as (process, port):
        # Ctrl-C ends the viewer, too: what was on its way there would be complained of, and `process` tells
        # enough. rerun looks at this when it is loaded
        os.environ.setdefault("RUST_LOG", "off")
        from rigidsim.look.timeline.writing import live_recording

        try:
            viewer.wait_for(process, port, _ANSWER_SECONDS)
            with live_recording(f"rerun+http://{viewer.LOOPBACK}:{port}/proxy") as recording:
                going_on = True
                while going_on and process.poll() is None:
                    dataset, going_on = read()
                    if dataset is not None:
                        with dataset:
                            recording.update(dataset)
                    until = time.monotonic() + (poll if going_on else 0.0)
                    while process.poll() is None and time.monotonic() < until:
                        time.sleep(0.1)
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
