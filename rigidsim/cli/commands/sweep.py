"""``rigidsim sweep``: run every member of a config's ``[sweep]``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rigidsim.cli.machine import print_json
from rigidsim.cli.options import ConfigPath, JsonOption, OutOption, SetOption
from rigidsim.errors import RigidsimError

WorkersOption = Annotated[
    int, typer.Option("--workers", metavar="N", min=1, help="Processes of this machine that run members.")
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Dask scheduler whose workers run members (rigidsim\\[cluster]).",
    ),
]


def sweep(
    config: ConfigPath,
    out: OutOption = Path("runs"),
    overrides: SetOption = None,
    workers: WorkersOption = 1,
    scheduler: SchedulerOption = None,
    tiles: Annotated[
        str | None,
        typer.Option("--tiles", metavar="A:B", help="Only tiles A to B-1: a share, for job arrays."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace what lies there.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Run all members, and write one labelled dataset; what is there already isn't computed again.

    Give the command again to go on after an interruption, or with a config whose axes are longer.

    Example: rigidsim sweep configs/sweeps/first_flip.toml --workers 2
    """
    share = None if tiles is None else _share(tiles)
    if scheduler is not None and workers > 1:
        raise RigidsimError("--workers are processes of this machine, --scheduler has its own: give one")
    from rigidsim.workflows.sweeps.workers import started

    with started(workers) as processes:  # import while this one does
        from rigidsim.cli.screens.sweeps import observer, print_sweep
        from rigidsim.workflows.read import load
        from rigidsim.workflows.sweeps.sweep import sweep as run_all

        with observer() as watching:
            result = run_all(
                load(config, overrides=overrides or []), out=out, force=force, workers=processes,
                scheduler=scheduler, tiles=share, observer=watching,
            )  # fmt: skip
    if as_json:
        print_json(result.summary)
    else:
        print_sweep(result)
    raise typer.Exit(0 if result.finished or share is not None else int(result.summary["exit_code"]))


def _share(text: str) -> tuple[int, int]:
    first, colon, stop = text.partition(":")
    if not (colon and first.isdigit() and stop.isdigit() and int(first) < int(stop)):
        raise RigidsimError(
            f"--tiles: given {text!a}; two whole numbers A:B are allowed, A below B, counted from 0, such as "
            "0:25 (rigidsim plan says how many tiles there are)"
        )
    return int(first), int(stop)
