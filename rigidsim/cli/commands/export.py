"""``rigidsim export``: a run in the formats of other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rigidsim.cli.options import RunPath
from rigidsim.formats import FORMATS


def export(
    run_path: RunPath,
    file_format: Annotated[
        str, typer.Option("--format", metavar="FORMAT", help=f"{', '.join(FORMATS[:-1])} or {FORMATS[-1]}.")
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
    from rigidsim.formats.ccsds import Naming
    from rigidsim.store.run import open_run
    from rigidsim.workflows.export import export as write

    given = {"epoch": epoch, "object_name": object_name, "frame": frame}
    naming = Naming(**{key: value for key, value in given.items() if value is not None})
    for path in write(open_run(run_path), file_format, out, force=force, naming=naming):
        print(path)
