"""``rigidsim analyse``: secular rates and labelled lines."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rigidsim.cli.machine import print_json
from rigidsim.cli.options import JsonOption, RunPath


def analyse(
    run_path: RunPath,
    variable: Annotated[
        list[str] | None,
        typer.Option(
            "--variable",
            metavar="NAME",
            help="A variable (obliquity) or one of its signals (obliquity.figure); repeatable. Default: "
            "those that the scene is about.",
        ),
    ] = None,
    lines: Annotated[int, typer.Option("--lines", metavar="N", help="Of each signal at most.")] = 20,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Dataset; default analysis.h5 in the run. The figure goes beside it.",
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Secular rates and spectral lines, labelled with the scene's frequencies: table, dataset and figure.

    Example: rigidsim analyse runs/earth_free_nutation --lines 5
    """
    from rigidsim.cli.screens.analysis import print_analysis
    from rigidsim.store.run import open_run
    from rigidsim.workflows.analyse import analyse as find
    from rigidsim.workflows.analyse import save

    opened = open_run(run_path)
    analysis = find(opened, variable or (), lines=lines)
    saved = save(analysis, out or opened.folder.analysis)
    if as_json:
        print_json(analysis.as_dict())
        return
    print_analysis(analysis, saved)
