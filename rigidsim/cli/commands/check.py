"""``rigidsim check``: validation alone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rigidsim.cli.machine import print_json
from rigidsim.cli.options import JsonOption, SetOption


def check(
    configs: Annotated[list[Path], typer.Argument(metavar="CONFIG...", help="TOML files.")],
    overrides: SetOption = None,
    as_json: JsonOption = False,
) -> None:
    """Validate configs, and show what was understood of them; nothing is run.

    The exit code is 2 where one of them can't be run.

    Example: rigidsim check configs/heavy_top_nutating.toml
    """
    from rigidsim.cli.screens import summary as tables
    from rigidsim.workflows.check import check as validate

    valid = True
    for path in configs:
        found = validate(path, overrides=overrides or [])
        valid = valid and found.valid
        if as_json:
            print_json(found.as_dict())
        else:
            tables.print_checked(found)
    raise typer.Exit(0 if valid else 2)
