"""The command line. Each command loads what it needs, when it needs it."""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rigidsim.errors import RigidsimError, RunFolderError

if TYPE_CHECKING:
    from rigidsim.archive import Run

app = typer.Typer(
    name="rigidsim",
    help="High-precision experiments on rotating rigid bodies: one TOML file is one experiment.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)

ConfigPath = Annotated[Path, typer.Argument(metavar="CONFIG", help="TOML file of the experiment.")]
RunPath = Annotated[Path, typer.Argument(metavar="RUN", help="Run folder (runs/NAME) or its dataset.h5.")]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Replace a value, such as time.end=10; repeatable."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]


def _user_errors(command: Callable[..., None]) -> Callable[..., None]:
    """Errors meant for the user end the program with their message and exit code, without a traceback."""

    @wraps(command)
    def guarded(*args: Any, **kwargs: Any) -> None:
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends like Ctrl-C
        try:
            command(*args, **kwargs)
        except RigidsimError as error:
            print(f"rigidsim: {error}", file=sys.stderr)
            raise typer.Exit(error.exit_code) from None
        except KeyboardInterrupt:
            print("rigidsim: interrupted", file=sys.stderr)
            raise typer.Exit(130) from None
        except BrokenPipeError:
            sys.stderr.close()
            raise typer.Exit(0) from None
        finally:
            signal.signal(signal.SIGTERM, before)

    return guarded


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


@app.command()
@_user_errors
def run(
    configs: Annotated[
        list[Path] | None, typer.Argument(metavar="CONFIG...", help="TOML files.", show_default=False)
    ] = None,
    dataset: Annotated[
        Path | None,
        typer.Option("--from", metavar="DATASET", help="Run the config that a dataset embeds."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the run folders.")] = Path(
        "runs"
    ),
    overrides: SetOption = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a run of the same name.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Integrate, write the run folder, print a summary of invariants and cost.

    Example: rigidsim run configs/intermediate_axis.toml --set time.end=100
    """
    from rigidsim import progress
    from rigidsim.runner import run as run_experiment
    from rigidsim.scene.reading import load

    experiments = [load(path, overrides=overrides or []) for path in configs or []]
    if dataset is not None:
        from rigidsim.verification import embedded

        experiments.append(embedded(dataset, overrides=overrides or []))
    if not experiments:
        raise RigidsimError("run: give a CONFIG, or --from a dataset; rigidsim run --help shows an example")
    worst = 0
    for experiment in experiments:
        with progress.observer() as observer:
            result = run_experiment(experiment, out=out, force=force, observer=observer)
        code = _told(result, as_json)
        worst = worst or code
        if code == 130:
            break
    raise typer.Exit(worst)


def _told(result: Run, as_json: bool) -> int:
    """Print a run's summary; returns its exit code."""
    from rigidsim import report

    if as_json:
        print(json.dumps(result.summary))
    else:
        report.print_summary(result.summary, str(result.folder.path))
    code = int(result.summary["exit_code"])
    if code:
        print(f"rigidsim: {result.summary['message']}", file=sys.stderr)
    return code


@app.command()
@_user_errors
def resume(
    run_path: RunPath,
    until: Annotated[
        str | None, typer.Option("--until", metavar="END", help='A later end, such as "2 h" or 5000.')
    ] = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="A guard of this session, such as limits.max_steps=1000000."
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Go on with an interrupted, killed or guarded run; the result is bit for bit the uninterrupted one.

    Example: rigidsim resume runs/intermediate_axis
    """
    from rigidsim import progress
    from rigidsim.resuming import resume as go_on

    with progress.observer() as observer:
        result = go_on(run_path, until=until, overrides=overrides or [], observer=observer)
    raise typer.Exit(_told(result, as_json))


@app.command()
@_user_errors
def verify(run_path: RunPath, as_json: JsonOption = False) -> None:
    """Integrate the embedded config again and compare: identical, or what differs first. Exit code 1 then.

    Example: rigidsim verify runs/intermediate_axis
    """
    from rigidsim import progress, report
    from rigidsim.verification import verify as compare

    with progress.observer() as observer:
        verdict = compare(run_path, observer=observer)
    if as_json:
        print(json.dumps(verdict.as_dict()))
    else:
        report.print_verdict(verdict.as_dict())
    raise typer.Exit(0 if verdict.identical else 1)


@app.command()
@_user_errors
def plan(config: ConfigPath, overrides: SetOption = None, as_json: JsonOption = False) -> None:
    """Explain what would be integrated and why; predict steps, time, memory and file sizes.

    Example: rigidsim plan configs/heavy_top_nutating.toml
    """
    from rigidsim import report
    from rigidsim.planner import plan as make_plan
    from rigidsim.scene.reading import load

    made = make_plan(load(config, overrides=overrides or []))
    if as_json:
        print(json.dumps(made))
    else:
        report.print_plan(made)


@app.command()
@_user_errors
def info(run_path: RunPath, as_json: JsonOption = False) -> None:
    """Summary of a run, finished or partial.

    Example: rigidsim info runs/intermediate_axis
    """
    from rigidsim import report
    from rigidsim.archive import open_run

    opened = open_run(run_path)
    if as_json:
        print(json.dumps(opened.summary))
        return
    report.print_summary(opened.summary, str(opened.folder.path))
    if not opened.saved:
        report.console().print("dataset  nothing was saved yet")
        return
    with opened.dataset as dataset:
        report.console().print(
            f"dataset  {dataset.sizes['time']:,} samples of {', '.join(map(str, dataset.data_vars))}"
        )


@app.command()
@_user_errors
def view(
    run_path: RunPath,
    web: Annotated[bool, typer.Option("--web", help="In the browser, served on loopback only.")] = False,
) -> None:
    """Open the timeline in the rerun viewer (drawn first, where the run has none).

    Example: rigidsim view runs/intermediate_axis
    """
    from rigidsim.archive import open_run
    from rigidsim.look.viewer import open_viewer

    opened = open_run(run_path)
    timeline = opened.folder.timeline
    if not timeline.exists():
        from rigidsim.look.timeline import write_timeline

        with opened.dataset as dataset:
            write_timeline(dataset, timeline)
    try:
        raise typer.Exit(open_viewer(timeline, web=web))
    except FileNotFoundError as error:
        raise RunFolderError(str(error)) from None


@app.command()
@_user_errors
def plot(
    run_path: RunPath,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="PNG or SVG; default figure.png in the run.")
    ] = None,
) -> None:
    """Draw the standard figures: rates, angles, drifts, polhode.

    Example: rigidsim plot runs/intermediate_axis --out flip.svg
    """
    from rigidsim.archive import open_run
    from rigidsim.look.figures import save_figure

    opened = open_run(run_path)
    target = out or opened.folder.figure
    with opened.dataset as dataset:
        try:
            save_figure(dataset, target)
        except ValueError as error:
            raise RigidsimError(str(error)) from None
        except OSError as error:
            raise RigidsimError(f"{target}: can't be written: {error.strerror or error}") from None
    print(target)


@app.command()
@_user_errors
def tradeoff(
    config: ConfigPath,
    overrides: SetOption = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the run folders.")] = Path(
        "runs"
    ),
    budget: Annotated[
        float, typer.Option("--budget", metavar="SECONDS", help="Time that it may take, roughly.")
    ] = 90.0,
    repeats: Annotated[
        int, typer.Option("--repeats", metavar="N", help="Fresh processes in which speeds are taken.")
    ] = 3,
    full: Annotated[
        bool, typer.Option("--full", help="Every tolerance in every formulation; needs a larger budget.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier measurement.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Measure speed against accuracy of a scene: what to use for which accuracy. Dataset and figure in
    NAME_tradeoff.

    Example: rigidsim tradeoff configs/asymmetric_top.toml
    """
    from rigidsim import report
    from rigidsim.scene.reading import load
    from rigidsim.tradeoff import tradeoff as measure

    experiment = load(config, overrides=overrides or [])

    def told(text: str) -> None:
        print(f"{experiment.config.name}: {text}", file=sys.stderr, flush=True)

    result = measure(
        experiment, out=out, budget=budget, repeats=repeats, full=full, force=force, told=told
    ).as_dict()
    if as_json:
        print(json.dumps(result))
    else:
        report.print_tradeoff(result)


@app.command()
@_user_errors
def export(
    run_path: RunPath,
    file_format: Annotated[
        str, typer.Option("--format", metavar="FORMAT", help="csv, parquet, zarr, aem or oem.")
    ],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="PATH", help="Default NAME.FORMAT in this folder.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace what is there.")] = False,
    epoch: Annotated[
        str | None, typer.Option("--epoch", metavar="TIME", help="Of time zero, for aem and oem (TT).")
    ] = None,
    object_name: Annotated[
        str | None, typer.Option("--object-name", metavar="NAME", help="For aem and oem.")
    ] = None,
    frame: Annotated[
        str | None, typer.Option("--frame", metavar="NAME", help="Of the space axes, for aem and oem.")
    ] = None,
) -> None:
    """Write a run for other tools: tables with every digit, or CCSDS attitude and orbit messages.

    Example: rigidsim export runs/intermediate_axis --format csv
    """
    from rigidsim.archive import open_run
    from rigidsim.exchange.ccsds import Naming
    from rigidsim.export import export as write

    given = {"epoch": epoch, "object_name": object_name, "frame": frame}
    naming = Naming(**{key: value for key, value in given.items() if value is not None})
    for path in write(open_run(run_path), file_format, out, force=force, naming=naming):
        print(path)


@app.command()
@_user_errors
def schema() -> None:
    """Print the config's JSON schema, for editors.

    Example: rigidsim schema > rigidsim.schema.json
    """
    from rigidsim.scene.schema import Config

    print(json.dumps(Config.model_json_schema(), indent=2))
