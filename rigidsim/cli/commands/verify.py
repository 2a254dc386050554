"""``rigidsim verify``: integrate again and compare."""

from __future__ import annotations

from typing import Annotated

import typer

from rigidsim.cli.machine import print_json
from rigidsim.cli.options import JsonOption, RunPath

MembersOption = Annotated[
    int, typer.Option("--members", metavar="N", help="Of a sweep: how many members, drawn at random.")
]


def verify(run_path: RunPath, members: MembersOption = 100, as_json: JsonOption = False) -> None:
    """Integrate the embedded config again and compare: identical, or what differs first. Exit code 1 then.

    Example: rigidsim verify runs/intermediate_axis
    """
    from rigidsim.cli.screens import summary as tables
    from rigidsim.session import progress
    from rigidsim.store.sweeps.folder import is_sweep

    if is_sweep(run_path):
        from rigidsim.workflows.sweeps.verify import verify_sweep

        verdict, what = verify_sweep(run_path, members=members), "member"
    else:
        from rigidsim.workflows.verify import verify as compare

        with progress.observer() as observer:
            verdict, what = compare(run_path, observer=observer), "sample"
    if as_json:
        print_json(verdict.as_dict())
    else:
        tables.print_verdict(verdict.as_dict(), what)
    raise typer.Exit(0 if verdict.identical else 1)
