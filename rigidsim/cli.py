"""The command line. Each command loads what it needs, when it needs it."""

from __future__ import annotations

from typing import Annotated

import typer

from rigidsim.commands import looking, making
from rigidsim.commands.shared import user_errors

app = typer.Typer(
    name="rigidsim",
    help="High-precision experiments on rotating rigid bodies: one TOML file is one experiment.",
    no_args_is_help=True,
    add_completion=False,
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


for _command in (
    making.run,
    making.resume,
    making.verify,
    making.plan,
    looking.info,
    looking.view,
    looking.plot,
    making.tradeoff,
    looking.export,
    making.schema,
):
    app.command()(user_errors(_command))
