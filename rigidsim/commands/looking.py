"""Commands on what was integrated: info, view, plot, export."""

from __future__ import annotations

import json
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from rigidsim.commands.shared import JsonOption, RunPath
from rigidsim.errors import RigidsimError, RunFolderError


def info(run_path: RunPath, as_json: JsonOption = False) -> None:
    """Summary of a run, finished or partial.

    Example: rigidsim info runs/intermediate_axis
    """
    from rigidsim import report
    from rigidsim.archive import open_run

    opened = open_run(run_path)
    if as_json:
        print(json.dumps(opened.summary))
        return
    report.print_summary(opened.summary, str(opened.folder.path))
    if not opened.saved:
        report.console().print("dataset  nothing was saved yet")
        return
    with opened.dataset as dataset:
        report.console().print(
            f"dataset  {dataset.sizes['time']:,} samples of {', '.join(map(str, dataset.data_vars))}"
        )


def view(
    run_path: RunPath,
    web: Annotated[bool, typer.Option("--web", help="In the browser, served on loopback only.")] = False,
) -> None:
    """Open the timeline in the rerun viewer (drawn first, where the run has none).

    Example: rigidsim view runs/intermediate_axis
    """
    from rigidsim.archive import open_run
    from rigidsim.look.viewer import open_viewer

    opened = open_run(run_path)
    timeline = opened.folder.timeline
    with ExitStack() as stack:
        if not timeline.exists():
            from rigidsim.look.timeline import write_timeline

            if opened.folder.read_only is not None:  # drawn elsewhere, and gone with the viewer
                scratch = stack.enter_context(tempfile.TemporaryDirectory(prefix="rigidsim-view-"))
                timeline = Path(scratch) / timeline.name
            with opened.dataset as dataset:
                try:
                    write_timeline(dataset, timeline)
                except (OSError, RuntimeError) as error:
                    why = getattr(error, "strerror", None) or error
                    raise RunFolderError(f"{timeline}: can't be written: {why}") from None
            opened.folder.note_timeline(opened.summary, timeline)
        try:
            raise typer.Exit(open_viewer(timeline, web=web))
        except FileNotFoundError as error:
            raise RunFolderError(str(error)) from None


def plot(
    run_path: RunPath,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="PNG or SVG; default figure.png in the run.")
    ] = None,
) -> None:
    """Draw the standard figures: rates, angles, drifts, polhode.

    Example: rigidsim plot runs/intermediate_axis --out flip.svg
    """
    from rigidsim.archive import open_run
    from rigidsim.look.figures import save_figure

    opened = open_run(run_path)
    target = out or opened.folder.figure
    with opened.dataset as dataset:
        try:
            save_figure(dataset, target)
        except ValueError as error:
            raise RigidsimError(str(error)) from None
        except OSError as error:
            why = error.strerror or error
            raise RigidsimError(f"{target}: can't be written: {why}; choose another --out") from None
    print(target)


def export(
    run_path: RunPath,
    file_format: Annotated[
        str, typer.Option("--format", metavar="FORMAT", help="csv, parquet, zarr, aem or oem.")
    ],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="PATH", help="Default NAME.FORMAT in this folder.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace what is there.")] = False,
    epoch: Annotated[
        str | None, typer.Option("--epoch", metavar="TIME", help="Of time zero, for aem and oem (TT).")
    ] = None,
    object_name: Annotated[
        str | None, typer.Option("--object-name", metavar="NAME", help="For aem and oem.")
    ] = None,
    frame: Annotated[
        str | None, typer.Option("--frame", metavar="NAME", help="Of the space axes, for aem and oem.")
    ] = None,
) -> None:
    """Write a run for other tools: tables with every digit, or CCSDS attitude and orbit messages.

    Example: rigidsim export runs/intermediate_axis --format csv
    """
    from rigidsim.archive import open_run
    from rigidsim.exchange.ccsds import Naming
    from rigidsim.export import export as write

    given = {"epoch": epoch, "object_name": object_name, "frame": frame}
    naming = Naming(**{key: value for key, value in given.items() if value is not None})
    for path in write(open_run(run_path), file_format, out, force=force, naming=naming):
        print(path)
