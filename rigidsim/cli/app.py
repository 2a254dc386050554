"""The command line: every command with its arguments and options.

A command is declared here, with its arguments and help, and does its work in a module of
``rigidsim.cli.commands`` that is imported when it is invoked: help and completion load little but this.
"""

import gc
import sys
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from inspect import cleandoc
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, Any

import typer

from rigidsim import __version__
from rigidsim.cli import options
from rigidsim.cli.exits import exit_code
from rigidsim.look.figure_names import FIGURES

app = typer.Typer(
    name="rigidsim",
    help="High-precision experiments on rotating rigid bodies: one TOML file is one experiment.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # in which [fit] would be a style
)


def main() -> None:
    """Entry point of ``rigidsim``."""
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a file's name may be no text
    try:
        app(prog_name="rigidsim")
    finally:
        gc.freeze()  # what is freed with the process isn't searched for garbage: 7 % of a tiny run's CPU time


def _command(module: str, more: str = "") -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make arguments and docstring those of a command, done by a module of ``rigidsim.cli.commands``."""

    def declared(function: Callable[..., None]) -> Callable[..., None]:
        name = function.__name__

        def work(given: dict[str, Any]) -> int:
            command = getattr(import_module(f"rigidsim.cli.commands.{module}"), name)
            compiled = sys.modules.get("rigidsim.solve.compiled")
            if compiled is not None:  # loaded by those that integrate
                compiled.quieten_engine()
            return command(**given) or 0

        @wraps(function)
        def invoked(**given: Any) -> None:
            raise typer.Exit(exit_code(lambda: work(given)))

        text = cleandoc(function.__doc__ or "")
        first = " ".join(text.split("\n\n")[0].split()).split(". ")[0].removesuffix(".")
        app.command(help=text + more, short_help=f"{first}.")(invoked)
        return function

    return declared


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"rigidsim {__version__}")
        raise typer.Exit


@app.callback()
def _program(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """High-precision experiments on rotating rigid bodies: one TOML file is one experiment."""


@_command("configs")
def new(scene: options.SceneArgument = None, name: options.NameArgument = None) -> None:
    """Write a ready scene to start from, with the tables it reads; alone, list those there are by subject.

    An existing file is never replaced.

    Example: rigidsim new coin my_coin
    """


@_command("configs")
def check(
    configs: options.Configs, overrides: options.SetOption = None, as_json: options.JsonOption = False
) -> None:
    """Validate configs, and show what was understood of them; nothing is run.

    The exit code is 2 where one of them can't be run.

    Example: rigidsim check heavy_top_nutating
    """


@_command("run")
def run(
    configs: options.AnyConfigs = None,
    dataset: options.FromOption = None,
    out: options.OutOption = Path("runs"),
    overrides: options.SetOption = None,
    scan: options.ScanOption = None,
    member: options.MemberOption = None,
    force: Annotated[bool, options.replacing("Replace a run of the same name.")] = False,
    as_json: options.JsonOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Integrate, write the run folder, print how the run came out and what it cost.

    Example: rigidsim run intermediate_axis --set time.end=100
    """


@_command("sweep")
def sweep(
    config: options.ConfigPath,
    out: options.OutOption = Path("runs"),
    overrides: options.SetOption = None,
    workers: options.WorkersOption = None,
    scheduler: options.SchedulerOption = None,
    tiles: options.TilesOption = None,
    force: Annotated[bool, options.replacing("Replace what lies there.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Run all members, and write one labelled dataset; what is there already isn't computed again. With [fit]
    in the config each member is a fit.

    Give the command again to go on after an interruption, or with a config whose axes are longer.

    Example: rigidsim sweep first_flip --workers 2
    """


@_command("sweep")
def resume(
    run_path: options.RunPath,
    until: options.UntilOption = None,
    overrides: options.GuardOption = None,
    workers: options.ResumeWorkersOption = None,
    as_json: options.JsonOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Go on with an interrupted, killed or guarded run; the result is bit for bit the uninterrupted one.

    On a run that is complete it says so and does nothing: a script can call it until the exit code is 0.

    Example: rigidsim resume runs/intermediate_axis
    """


@_command("sweep")
def verify(
    run_path: options.RunPath,
    members: options.MembersOption = None,
    back: options.ReversedOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Integrate the embedded config again and compare: identical, or what differs first. Exit code 1 then.

    Example: rigidsim verify runs/intermediate_axis --reversed
    """


@_command("configs")
def plan(
    config: options.ConfigPath,
    overrides: options.SetOption = None,
    out: options.OutOption = Path("runs"),
    physics: options.PhysicsOption = None,
    write: options.WriteOption = None,
    force: Annotated[bool, options.replacing("With --physics: replace earlier runs and the file.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Explain what would be integrated and why; predict steps, time, memory and file sizes.

    With --physics run the scene without each of its effects, print what each is worth, and name the least
    model within an error. Give the command again to go on after an interruption.

    Example: rigidsim plan heavy_top_nutating
    """


@_command("compare")
def compare(
    config: options.ConfigPath,
    file: options.TrajectoryPath,
    overrides: options.SetOption = None,
    within: options.WithinOption = 1e-9,
    convention: options.ConventionOption = None,
    out: options.ComparisonOption = None,
    figure: options.ComparedFigureOption = None,
    timeline: options.ComparedTimelineOption = None,
    kernels: options.KernelsOption = None,
    force: Annotated[bool, options.replacing("Replace existing files.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Judge another tool's trajectory: its convention, its error along time, and whether its model or its
    integration differs.

    Example: rigidsim compare intermediate_axis theirs.csv --figure theirs.png
    """


@_command("fit")
def fit(
    config: options.ConfigPath,
    out: options.FitsOption = Path("fits"),
    overrides: options.SetOption = None,
    write: options.FittedOption = None,
    member: options.MemberOption = None,
    force: Annotated[bool, options.replacing("Replace a fit of the same name, and the file.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Estimate the parameters of the config's [fit] from its data: values, sigmas, correlations, residuals,
    and what the data can't tell. Exit code 1 if the fit doesn't converge.

    Example: rigidsim fit toutatis_1992
    """


@_command("info")
def info(run_path: options.RunPath, as_json: options.JsonOption = False) -> None:
    """Summary of a run, finished or partial; exit code 2 if its dataset is damaged or was edited.

    Example: rigidsim info runs/intermediate_axis
    """


@_command("results")
def view(
    run_paths: options.RunPaths,
    web: options.WebOption = False,
    png: options.PictureOption = None,
    gif: options.FilmOption = None,
    mp4: options.VideoOption = None,
    seconds: options.FilmLengthOption = None,
    member: options.MembersSeenOption = None,
    at: options.MomentOption = None,
    part: options.PartOption = None,
) -> None:
    """Open timelines in the rerun viewer (drawn first, where a run has none), or draw them to a file.

    A run that another process is working on is followed while it goes on. A fit is shown as its motion,
    with a cone of one standard deviation about the figure axis.

    Example: rigidsim view runs/intermediate_axis
    """


_EACH_FIGURE = "\n".join(f"{name:17}{told}" for name, told in FIGURES.items())


@_command("results", f"\n\n\b\nFigures:\n{_EACH_FIGURE}")
def plot(
    run_path: options.SeenPath, what: options.WhatOption = None, out: options.FigureOption = None,
    for_slides: options.SlidesOption = None,
) -> None:  # fmt: skip
    """Draw the page that suits the scene, or the figures named; of a sweep a variable over its axes.

    Example: rigidsim plot runs/intermediate_axis --what polhode --out flip.svg
    """


@_command("configs")
def tradeoff(
    config: options.ConfigPath,
    overrides: options.SetOption = None,
    out: options.OutOption = Path("runs"),
    budget: options.BudgetOption = 90.0,
    repeats: options.RepeatsOption = 3,
    full: options.FullOption = False,
    files: options.WithFilesOption = None,
    force: Annotated[bool, options.replacing("Replace an earlier measurement.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Measure speed against accuracy of a scene: what to use for which accuracy. Dataset and figure in
    NAME_tradeoff.

    Example: rigidsim tradeoff asymmetric_top
    """


@_command("results")
def export(
    run_path: options.RunPath,
    file_format: options.FormatOption,
    out: options.ExportPathOption = None,
    force: Annotated[bool, options.replacing("Replace what is there.")] = False,
    angle_unit: options.AngleUnitOption = None,
    epoch: options.EpochOption = None,
    axes: options.AxesOption = None,
    object_name: options.ObjectNameOption = None,
    object_id: options.ObjectIdOption = None,
    variable: options.ExportedOption = None,
) -> None:
    """Write a run for other tools: tables with every digit, CCSDS messages, or kernels of SPICE.

    Of a sweep csv and parquet hold a row per member, and zarr its dataset.

    Example: rigidsim export runs/intermediate_axis --format csv
    """


@_command("results")
def analyse(
    run_path: options.SeenPath,
    variable: options.VariableOption = None,
    lines: Annotated[int, typer.Option("--lines", metavar="N", help="Of each signal at most.")] = 20,
    out: options.AnalysisOption = None,
    force: Annotated[bool, options.replacing("Replace an existing analysis.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Secular rates and spectral lines, labelled with the scene's frequencies: table, dataset and figure.

    Example: rigidsim analyse runs/earth_free_nutation --lines 5
    """


@_command("configs")
def schema() -> None:
    """Print the config's JSON schema, for editors.

    Example: rigidsim schema > rigidsim.schema.json; editors read the config's first line
    "#:schema rigidsim.schema.json"
    """
