"""The command line: all commands as one program."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterable
from importlib import import_module
from typing import TYPE_CHECKING, Any

from rigidsim.cli.commands import COMMANDS

if TYPE_CHECKING:
    import typer

    app: typer.Typer
    """All commands."""


def main() -> None:
    """Entry point of ``rigidsim``: its arguments decide which command has to be loaded."""
    # hundreds of modules are about to be imported, without garbage worth a search every 700 objects
    gc.set_threshold(400_000, 20, 20)
    # pydantic would read the metadata of every installed package to find plugins that nothing here uses
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    named = sys.argv[1:2]
    try:
        program(named if set(named) <= set(COMMANDS) and named else COMMANDS)(prog_name="rigidsim")
    finally:
        gc.freeze()  # the rest is freed with the process and needn't be searched for garbage


def program(names: Iterable[str] = COMMANDS) -> typer.Typer:
    """A program with the given commands."""
    import typer

    from rigidsim.cli.options import user_errors, version

    made = typer.Typer(
        name="rigidsim",
        help="High-precision experiments on rotating rigid bodies: one TOML file is one experiment.",
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
        pretty_exceptions_enable=False,
        rich_markup_mode="rich",
    )
    made.callback()(version)
    for name in names:
        made.command()(user_errors(getattr(import_module(f"rigidsim.cli.commands.{name}"), name)))
    return made


def __getattr__(name: str) -> Any:
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()["app"] = whole = program()
    return whole
