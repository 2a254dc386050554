"""``rigidsim resume``: complete an unfinished run, or prolong a finished one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NoReturn

import typer

from rigidsim.cli.machine import print_json
from rigidsim.cli.options import JsonOption, RunPath
from rigidsim.cli.running import print_run
from rigidsim.errors import RigidsimError


def resume(
    run_path: RunPath,
    until: Annotated[
        str | None, typer.Option("--until", metavar="END", help='A later end, such as "2 h" or 5000.')
    ] = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="A guard of this session, such as limits.max_steps=1000000."
        ),
    ] = None,
    workers: Annotated[
        int, typer.Option("--workers", metavar="N", min=1, help="Of a sweep: processes that run members.")
    ] = 1,
    as_json: JsonOption = False,
) -> None:
    """Go on with an interrupted, killed or guarded run; the result is bit for bit the uninterrupted one.

    On a run that is complete it says so and does nothing: a script can call it until the exit code is 0.

    Example: rigidsim resume runs/intermediate_axis
    """
    from rigidsim.store.sweeps.folder import is_sweep

    if is_sweep(run_path):
        if until is not None or overrides:
            raise RigidsimError(
                "resume: --until and --set are for single runs; change the config of a sweep and give "
                "rigidsim sweep CONFIG again, which computes only what is new"
            )
        _resume_sweep(run_path, workers, as_json)
    from rigidsim.session import progress
    from rigidsim.workflows.resume import resume as go_on

    with progress.observer() as observer:
        result = go_on(run_path, until=until, overrides=overrides or [], observer=observer)
    raise typer.Exit(print_run(result, as_json))


def _resume_sweep(path: Path, workers: int, as_json: bool) -> NoReturn:
    from rigidsim.workflows.sweeps.workers import started

    with started(workers) as processes:
        from rigidsim.cli.screens.sweeps import observer, print_sweep
        from rigidsim.workflows.sweeps.sweep import resume_sweep

        with observer() as watching:
            result = resume_sweep(path, workers=processes, observer=watching)
    if as_json:
        print_json(result.summary)
    else:
        print_sweep(result)
    raise typer.Exit(int(result.summary["exit_code"]))
