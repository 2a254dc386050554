"""``rigidsim view``: the timeline in the viewer."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from rigidsim.cli.options import RunPath
from rigidsim.errors import RunFolderError


def view(
    run_path: RunPath,
    web: Annotated[bool, typer.Option("--web", help="In the browser, served on loopback only.")] = False,
) -> None:
    """Open the timeline in the rerun viewer (drawn first, where the run has none).

    Example: rigidsim view runs/intermediate_axis
    """
    from rigidsim.look.viewer import open_viewer
    from rigidsim.store.run import open_run

    opened = open_run(run_path)
    timeline = opened.folder.timeline
    with ExitStack() as stack:
        if not timeline.exists():
            from rigidsim.look.timeline import write_timeline
            from rigidsim.store import atomic

            if opened.folder.read_only is not None:  # drawn elsewhere, and gone with the viewer
                scratch = stack.enter_context(tempfile.TemporaryDirectory(prefix="rigidsim-view-"))
                timeline = Path(scratch) / timeline.name
            with opened.dataset as dataset:
                try:
                    with atomic.replacing(timeline) as new:
                        write_timeline(dataset, new)
                except (OSError, RuntimeError) as error:
                    why = getattr(error, "strerror", None) or error
                    raise RunFolderError(f"{timeline}: can't be written: {why}") from None
            opened.folder.note_timeline(opened.outcome, timeline)
        try:
            raise typer.Exit(open_viewer(timeline, web=web))
        except FileNotFoundError as error:
            raise RunFolderError(str(error)) from None
