"""Viewing a run's timeline, which is drawn first if there is none yet."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from rigidsim.errors import RunFolderError
from rigidsim.store import atomic
from rigidsim.store.folder import RunFolder
from rigidsim.store.summary import Brief

if TYPE_CHECKING:
    import xarray


class Viewable(Protocol):
    """The part of a run's interface needed here."""

    @property
    def dataset(self) -> xarray.Dataset:
        """The labelled dataset."""

    @property
    def outcome(self) -> Brief:
        """The contents of its summary."""


def view(run: Viewable, folder: RunFolder | None, *, web: bool = False) -> int:
    """Open a run's timeline in the viewer and wait until it is closed.

    Args:
        folder: the run's folder; None for one in memory.
        web: in the browser, served on loopback only, until Ctrl-C.

    Returns:
        The viewer's exit code; 130 after Ctrl-C.

    Raises:
        RunFolderError: the timeline can't be drawn, no viewer is installed, or there is no screen for it.
    """
    from rigidsim.look.viewer import NoDisplay, open_viewer

    with drawn(run, folder) as timeline:
        try:
            return open_viewer(timeline, web=web)
        except (FileNotFoundError, NoDisplay) as error:
            raise RunFolderError(str(error)) from None


@contextmanager
def drawn(run: Viewable, folder: RunFolder | None) -> Iterator[Path]:
    """The recording: the run's own, saved with the run if it can be written, or a temporary one.

    Raises:
        RunFolderError: the timeline can't be drawn.
    """
    if folder is not None and folder.timeline.exists():
        yield folder.timeline
    elif folder is not None and folder.read_only is None:
        _draw(run, folder.timeline)
        folder.note_timeline(run.outcome, folder.timeline)
        yield folder.timeline
    else:
        with tempfile.TemporaryDirectory(prefix="rigidsim-view-") as scratch:
            timeline = Path(scratch) / "timeline.rrd"
            _draw(run, timeline)
            yield timeline


def _draw(run: Viewable, timeline: Path) -> None:
    from rigidsim.look.timeline import write_timeline

    try:
        with run.dataset as dataset, atomic.replacing(timeline) as new:
            write_timeline(dataset, new)
    except (OSError, RuntimeError) as error:
        why = getattr(error, "strerror", None) or error
        raise RunFolderError(f"{timeline}: can't be written: {why}") from None
