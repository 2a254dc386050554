"""``rigidsim run``: integrate configs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rigidsim.cli.options import JsonOption, OutOption, SetOption


def run(
    configs: Annotated[
        list[Path] | None, typer.Argument(metavar="CONFIG...", help="TOML files.", show_default=False)
    ] = None,
    dataset: Annotated[
        Path | None,
        typer.Option("--from", metavar="DATASET", help="Run the config that a dataset embeds."),
    ] = None,
    out: OutOption = Path("runs"),
    overrides: SetOption = None,
    scan: Annotated[
        list[str] | None,
        typer.Option(
            "--sweep",
            metavar="KEY=SPEC",
            help="Run once for each value of a key, time.end=[1,2] or KEY=linspace(0,1,11); repeatable.",
        ),
    ] = None,
    member: Annotated[
        int | None,
        typer.Option("--member", metavar="N", min=0, help="Of a sweep: member N by itself, counted from 0."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a run of the same name.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Integrate, write the run folder, print a summary of invariants and cost.

    Example: rigidsim run configs/intermediate_axis.toml --set time.end=100
    """
    from rigidsim.cli.running import run_all

    raise typer.Exit(run_all(configs, dataset, out, overrides, scan, member, force, as_json))
