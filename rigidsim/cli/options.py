"""Arguments and options of the commands, and what the shell offers for them on Tab."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer


def offered(what: str) -> Callable[[str], list[Any]]:
    """A function of ``rigidsim.cli.completion``, which is imported when the shell asks it."""

    def complete(incomplete: str) -> list[Any]:
        found: list[Any] = getattr(import_module("rigidsim.cli.completion"), what)(incomplete)
        return found

    return complete


def option(flag: str, metavar: str, text: str, *others: str, **more: Any) -> Any:
    """An option with its value's name, its help, and other flags for it."""
    return typer.Option(flag, *others, metavar=metavar, help=text, **more)


def replacing(text: str) -> Any:
    """The option ``--force``, and what it replaces: never what the command reads."""
    return typer.Option("--force", help=text)


CONFIG = "TOML file of the experiment, or the name of a ready scene (rigidsim new lists them)."
CONFIGS = "TOML files, or names of ready scenes (rigidsim new lists them)."
ConfigPath = Annotated[Path, typer.Argument(metavar="CONFIG", help=CONFIG)]
RunPath = Annotated[
    Path,
    typer.Argument(
        metavar="RUN", help="Run folder (runs/NAME) or its dataset.h5.", autocompletion=offered("runs")
    ),
]
SeenPath = Annotated[
    Path,
    typer.Argument(
        metavar="RUN",
        help="Run folder (runs/NAME) or its dataset.h5; or another tool's file (CSV, Parquet, AEM ...).",
        autocompletion=offered("runs"),
    ),
]
SetOption = Annotated[
    list[str] | None,
    option(
        "--set",
        "KEY=VALUE",
        "Replace a value, such as time.end=10; nothing after = removes the key; repeatable.",
        autocompletion=offered("settings"),
    ),
]
OutOption = Annotated[Path, option("--out", "DIR", "Folder of the run folders.")]
VerboseOption = Annotated[
    bool,
    typer.Option(
        "--verbose", "-v", help="Print the whole summary, with invariants, start, and cost by phase."
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
MemberOption = Annotated[
    int | None, option("--member", "N", "For a sweep: run member N alone, counted from 0.", min=0)
]
