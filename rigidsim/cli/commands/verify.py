"""``rigidsim verify``: integrate again and compare."""

from __future__ import annotations

import json

import typer

from rigidsim.cli.options import JsonOption, RunPath


def verify(run_path: RunPath, as_json: JsonOption = False) -> None:
    """Integrate the embedded config again and compare: identical, or what differs first. Exit code 1 then.

    Example: rigidsim verify runs/intermediate_axis
    """
    from rigidsim.cli import tables
    from rigidsim.session import progress
    from rigidsim.workflows.verify import verify as compare

    with progress.observer() as observer:
        verdict = compare(run_path, observer=observer)
    if as_json:
        print(json.dumps(verdict.as_dict()))
    else:
        tables.print_verdict(verdict.as_dict())
    raise typer.Exit(0 if verdict.identical else 1)
