"""What commands share: arguments, how a run is told, and how errors end the program."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rigidsim.cli import completion
from rigidsim.errors import RigidsimError

if TYPE_CHECKING:
    from rigidsim.store.run import Run

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
        help="Replace a value, such as time.end=10; repeatable.",
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


def print_run(result: Run, as_json: bool) -> int:
    """Print a run's summary; returns its exit code."""
    from rigidsim.cli import tables

    if as_json:
        print(json.dumps(result.summary))
    else:
        tables.print_summary(result.outcome, result.place)
    code = result.outcome.exit_code
    if code:
        print(f"rigidsim: {result.outcome.message}", file=sys.stderr)
    return code


def _leave_builds(code: int) -> None:
    """End the process at once where something is still being compiled: that can neither be waited for, which
    may take seconds, nor be going on while libraries are unloaded.
    """
    threads = sys.modules.get("rigidsim.solve.building")  # not loaded, nothing was compiled
    if threads is not None and threads.building():
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def user_errors(command: Callable[..., None]) -> Callable[..., None]:
    """Errors meant for the user end the program with their message and exit code, without a traceback."""

    @wraps(command)
    def guarded(*args: Any, **kwargs: Any) -> None:
        # SIGTERM ends like Ctrl-C, and so does SIGINT where a script's background job starts with it ignored:
        # later on the run itself heeds both, and one that comes before that mustn't be lost
        ending = (signal.SIGINT, signal.SIGTERM)
        before = {number: signal.signal(number, signal.default_int_handler) for number in ending}
        try:
            command(*args, **kwargs)
        except RigidsimError as error:
            print(f"rigidsim: {error.for_command_line()}", file=sys.stderr)
            raise typer.Exit(error.exit_code) from None
        except KeyboardInterrupt:
            print("rigidsim: interrupted", file=sys.stderr)
            _leave_builds(130)
            raise typer.Exit(130) from None
        except typer.Exit as ended:
            _leave_builds(ended.exit_code)  # of a run that was interrupted, and saved meanwhile
            raise
        except BrokenPipeError:
            sys.stderr.close()
            raise typer.Exit(0) from None
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    return guarded
