"""``rigidsim export``: a run or a sweep in the formats of other tools."""

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
    angle_unit: Annotated[
        str | None,
        typer.Option(
            "--angle-unit",
            metavar="UNIT",
            help="For csv, parquet and zarr: rad, turns, deg, arcsec or mas; columns are named by it.",
        ),
    ] = None,
    epoch: Annotated[
        str | None,
        typer.Option(
            "--epoch",
            metavar="TIME",
            help="What time 0 is, where the config doesn't say, for aem, oem and the dates of csv: "
            '"2029-04-13T21:46:00 TDB".',
        ),
    ] = None,
    axes: Annotated[
        str | None,
        typer.Option(
            "--axes",
            "--frame",
            metavar="NAME",
            help="For aem and oem: what the space axes are, where the config doesn't say: ICRF, EME2000, ...",
        ),
    ] = None,
    object_name: Annotated[
        str | None, typer.Option("--object-name", metavar="NAME", help="For aem and oem.")
    ] = None,
) -> None:
    """Write a run for other tools: tables with every digit, or CCSDS attitude and orbit messages.

    Of a sweep csv and parquet hold a row per member, and zarr its dataset.

    Example: rigidsim export runs/intermediate_axis --format csv
    """
    from rigidsim.formats.naming import Naming
    from rigidsim.store.run import open_run
    from rigidsim.store.sweeps.folder import is_sweep
    from rigidsim.store.sweeps.run import open_sweep
    from rigidsim.workflows.export import export as write

    given = {"epoch": epoch, "axes": axes, "object_name": object_name}
    naming = Naming(**{key: value for key, value in given.items() if value is not None})
    saved = open_sweep(run_path) if is_sweep(run_path) else open_run(run_path)
    written = write(saved, file_format, out, force=force, naming=naming, angle_unit=angle_unit)
    for path in written:
        print(path)
