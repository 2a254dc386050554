"""``rigidsim resume``: complete an unfinished run, or prolong a finished one."""

from __future__ import annotations

from typing import Annotated

import typer

from rigidsim.cli.options import JsonOption, RunPath, print_run


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
    as_json: JsonOption = False,
) -> None:
    """Go on with an interrupted, killed or guarded run; the result is bit for bit the uninterrupted one.

    On a run that is complete it says so and does nothing: a script can call it until the exit code is 0.

    Example: rigidsim resume runs/intermediate_axis
    """
    from rigidsim.session import progress
    from rigidsim.workflows.resume import resume as go_on

    with progress.observer() as observer:
        result = go_on(run_path, until=until, overrides=overrides or [], observer=observer)
    raise typer.Exit(print_run(result, as_json))
