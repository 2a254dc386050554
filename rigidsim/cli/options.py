"""Shared parts of commands: arguments, and the handling of errors."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Annotated, Any

import typer

from rigidsim.cli import completion
from rigidsim.cli.ending import exit_code

ConfigPath = Annotated[Path, typer.Argument(metavar="CONFIG", help="TOML file of the experiment.")]
RunPath = Annotated[
    Path,
    typer.Argument(
        metavar="RUN", help="Run folder (runs/NAME) or its dataset.h5.", autocompletion=completion.runs
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace a value, such as time.end=10; nothing after = removes the key; repeatable.",
        autocompletion=completion.settings,
    ),
]
OutOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the run folders.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]


def _print_version(wanted: bool) -> None:
    if wanted:
        from rigidsim import __version__

        print(f"rigidsim {__version__}")
        raise typer.Exit


def version(
    wanted: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """High-precision experiments on rotating rigid bodies: one TOML file is one experiment."""


def user_errors(command: Callable[..., None]) -> Callable[..., None]:
    """Let errors meant for the user end the program with their message and exit code, without a traceback."""

    @wraps(command)
    def guarded(*args: Any, **kwargs: Any) -> None:
        def called() -> int:
            try:
                command(*args, **kwargs)
            except typer.Exit as ended:
                return ended.exit_code
            return 0

        code = exit_code(called)
        if code:
            raise typer.Exit(code)

    return guarded
