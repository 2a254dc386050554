"""``rigidsim view``: the timeline in the viewer."""

from __future__ import annotations

from typing import Annotated

import typer

from rigidsim.cli.options import RunPath


def view(
    run_path: RunPath,
    web: Annotated[bool, typer.Option("--web", help="In the browser, served on loopback only.")] = False,
) -> None:
    """Open the timeline in the rerun viewer (drawn first, where the run has none).

    Example: rigidsim view runs/intermediate_axis
    """
    from rigidsim.store.run import open_run

    raise typer.Exit(open_run(run_path).view(web=web))
