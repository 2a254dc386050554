"""The command line: all commands as one program."""

from __future__ import annotations

import gc
import os
from importlib import import_module
from typing import Annotated

import typer

from rigidsim.cli.commands import COMMANDS
from rigidsim.cli.options import user_errors

app = typer.Typer(
    name="rigidsim",
    help="High-precision experiments on rotating rigid bodies: one TOML file is one experiment.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


def _version(wanted: bool) -> None:
    if wanted:
        from rigidsim import __version__

        print(f"rigidsim {__version__}")
        raise typer.Exit


@app.callback()
def main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """High-precision experiments on rotating rigid bodies: one TOML file is one experiment."""
    # what follows loads hundreds of modules, which hold no garbage to be looked for every 700 objects
    gc.set_threshold(100_000, 20, 20)
    # pydantic would read the metadata of every installed package to find plugins that nothing here uses
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")


for _name in COMMANDS:
    app.command()(user_errors(getattr(import_module(f"rigidsim.cli.commands.{_name}"), _name)))
