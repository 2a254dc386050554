"""``rigidsim view``: runs in the viewer, or drawn to a picture or a film."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from rigidsim.cli import completion
from rigidsim.errors import RigidsimError


def view(
    run_paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN...",
            help="Run folders (runs/NAME) or their dataset.h5; several are shown side by side.",
            autocompletion=completion.runs,
        ),
    ],
    web: Annotated[bool, typer.Option("--web", help="In the browser, served on loopback only.")] = False,
    png: Annotated[
        Path | None, typer.Option("--png", metavar="FILE", help="Draw a picture, without a display.")
    ] = None,
    gif: Annotated[
        Path | None, typer.Option("--gif", metavar="FILE", help="Draw a film, without a display.")
    ] = None,
    mp4: Annotated[
        Path | None, typer.Option("--mp4", metavar="FILE", help="The same; needs rigidsim\\[film].")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option("--seconds", min=0.5, max=120.0, help="That a film lasts; default 6.")
    ] = None,
    member: Annotated[
        list[int] | None,
        typer.Option("--member", metavar="N", min=0, help="Of a sweep: member N, from 0; repeatable."),
    ] = None,
) -> None:
    """Open timelines in the rerun viewer (drawn first, where a run has none), or draw them to a file.

    A run that another process is working on is followed while it goes on.

    Example: rigidsim view runs/intermediate_axis
    """
    from rigidsim.workflows.view import render, runs_of, show

    targets = {".png": png, ".gif": gif, ".mp4": mp4}
    asked = {suffix: target for suffix, target in targets.items() if target is not None}
    for suffix, target in asked.items():
        if target.suffix.lower() != suffix:
            raise RigidsimError(f"--{suffix[1:]}: given {target}; a name that ends in {suffix} is allowed")
        if not target.absolute().parent.is_dir():
            raise RigidsimError(
                f"--{suffix[1:]}: given {target}, in a folder that isn't there; make it first"
            )
    if asked and web:
        raise RigidsimError("view: --web opens the viewer, --png, --gif and --mp4 draw to a file: give one")
    if seconds is not None and not {".gif", ".mp4"} & set(asked):
        raise RigidsimError("view: --seconds is for --gif and --mp4: give one of them, too")
    named = runs_of(run_paths, member or ())
    if not asked:
        raise typer.Exit(show(named, web=web))
    for target in asked.values():
        render(named, target, seconds=seconds, told=_tell if sys.stderr.isatty() else None)
        print(target)


def _tell(done: int, count: int) -> None:
    end = "\n" if done == count else ""
    print(f"\r{done} of {count} frames", end=end, file=sys.stderr, flush=True)
