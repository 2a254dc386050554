"""``rigidsim new``: commented configs to start from."""

from __future__ import annotations

from typing import Annotated

import typer

from rigidsim.cli.completion import scenes


def new(
    scene: Annotated[
        str | None,
        typer.Argument(
            metavar="[SCENE]", help="Which kind of scene.", autocompletion=scenes, show_default=False
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Argument(metavar="[NAME]", help="Of the experiment and its file NAME.toml; default SCENE."),
    ] = None,
) -> None:
    """Write a commented config to start from; alone, list the scenes there are.

    An existing file is never replaced.

    Example: rigidsim new coin my_coin
    """
    from rigidsim.cli.screens import summary as tables
    from rigidsim.workflows.templates import described, write_new

    if scene is None:
        tables.print_scenes(described())
        return
    path = write_new(scene, name)
    print(f"{path}: edit it, then: rigidsim check {path}; rigidsim run {path}")
