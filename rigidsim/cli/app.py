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
from rigidsim.formats import FORMATS
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
    """Take arguments and docstring from a command, done by a module of ``rigidsim.cli.commands``."""

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
def new(
    scene: Annotated[
        str | None,
        typer.Argument(
            metavar="SCENE",
            help="Its name, or another that it is known by.",
            autocompletion=options.offered("scenes"),
            show_default=False,
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="Of the experiment and its file NAME.toml; default SCENE."),
    ] = None,
) -> None:
    """Write a ready scene to start from, with the tables it reads; alone, list those there are by subject.

    An existing file is never replaced.

    Example: rigidsim new coin my_coin
    """


@_command("configs")
def check(
    configs: Annotated[list[Path], typer.Argument(metavar="CONFIG...", help=options.CONFIGS)],
    overrides: options.SetOption = None,
    as_json: options.JsonOption = False,
) -> None:
    """Validate configs, and show what was understood of them; nothing is run.

    The exit code is 2 where one of them can't be run.

    Example: rigidsim check heavy_top_nutating
    """


@_command("run")
def run(
    configs: Annotated[
        list[Path] | None, typer.Argument(metavar="CONFIG...", help=options.CONFIGS, show_default=False)
    ] = None,
    dataset: Annotated[
        Path | None, options.option("--from", "DATASET", "Run the config that a dataset embeds.")
    ] = None,
    out: options.OutOption = Path("runs"),
    overrides: options.SetOption = None,
    scan: Annotated[
        list[str] | None,
        options.option(
            "--sweep",
            "KEY=SPEC",
            "Run once for each value of a key, time.end=[1,2] or KEY=linspace(0,1,11); repeatable.",
        ),
    ] = None,
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
    workers: Annotated[
        int | None,
        options.option("--workers", "N", "Processes of this machine that run members; default 1.", min=1),
    ] = None,
    scheduler: Annotated[
        str | None,
        options.option(
            "--scheduler", "ADDRESS", "Dask scheduler whose workers run members (rigidsim[cluster])."
        ),
    ] = None,
    tiles: Annotated[
        str | None, options.option("--tiles", "A:B", "Only tiles A to B-1: a share, for job arrays.")
    ] = None,
    force: Annotated[bool, options.replacing("Replace what lies there.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Run all members, and write one labelled dataset; what is there already isn't computed again. With [fit]
    in the config each member is a fit.

    Give the command again to go on after an interruption, or with a config whose axes are longer.

    Example: rigidsim sweep first_flip --workers 2
    """


@_command("saved")
def resume(
    run_path: options.RunPath,
    until: Annotated[
        str | None, options.option("--until", "END", 'A later end, such as "2 h" or 5000.')
    ] = None,
    overrides: Annotated[
        list[str] | None,
        options.option("--set", "KEY=VALUE", "A guard of this session, such as limits.max_steps=1000000."),
    ] = None,
    workers: Annotated[
        int | None,
        options.option("--workers", "N", "Of a sweep: processes that run members; default 1.", min=1),
    ] = None,
    as_json: options.JsonOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Go on with an interrupted, killed or guarded run; the result is bit for bit the uninterrupted one.

    On a run that is complete it says so and does nothing: a script can call it until the exit code is 0.

    Example: rigidsim resume runs/intermediate_axis
    """


@_command("saved")
def verify(
    run_path: options.RunPath,
    members: Annotated[
        int | None,
        options.option("--members", "N", "Of a sweep: how many members, drawn at random; default 100."),
    ] = None,
    back: Annotated[
        bool, typer.Option("--reversed", help="Integrate to the end and back, too: how close does it return?")
    ] = False,
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
    physics: Annotated[
        str | None,
        options.option("--physics", "ERROR", 'Find the least model within an angle, as "0.1 arcsec".'),
    ] = None,
    write: Annotated[Path | None, options.option("--write", "FILE", "With --physics: its config.")] = None,
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
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="CSV, Parquet, netCDF, AEM or CK, or the folder of a run.")
    ],
    overrides: options.SetOption = None,
    within: Annotated[
        float, options.option("--within", "RAD", "Largest angle between attitudes that agree, in rad.")
    ] = 1e-9,
    convention: Annotated[
        str | None,
        options.option(
            "--convention", "KEY=VALUE,...", "What is known of it, as order=xyzw,rate_axes=space."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        options.option("--out", "FILE", "Dataset of what was found along time, such as comparison.h5."),
    ] = None,
    figure: Annotated[Path | None, options.option("--figure", "FILE", "Figure, a .png or a .svg.")] = None,
    timeline: Annotated[
        Path | None,
        options.option("--timeline", "FILE", "Timeline (.rrd) of both bodies, with the angle between them."),
    ] = None,
    kernels: Annotated[
        list[Path] | None,
        options.option(
            "--kernels", "FILE", "Clock (SCLK) and leap seconds that a CK is read with; repeatable."
        ),
    ] = None,
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
    out: Annotated[
        Path, options.option("--out", "DIR", "Folder of the fits' folders; an interrupted fit there goes on.")
    ] = Path("fits"),
    overrides: options.SetOption = None,
    write: Annotated[
        Path | None, options.option("--write", "FILE", "Config with the estimated values, ready to be run.")
    ] = None,
    member: options.MemberOption = None,
    force: Annotated[bool, options.replacing("Replace a fit of the same name, and the file.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Estimate the parameters of the config's [fit] from its data: values, sigmas, correlations, residuals,
    and what the data don't determine. Exit code 1 if the fit doesn't converge.

    Example: rigidsim fit toutatis_1992
    """


@_command("saved")
def info(run_path: options.RunPath, as_json: options.JsonOption = False) -> None:
    """Summary of a run, finished or partial; exit code 2 if its dataset is damaged or was edited.

    Example: rigidsim info runs/intermediate_axis
    """


@_command("results")
def view(
    run_paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN...",
            help="Folders of runs (runs/NAME) or fits (fits/NAME), their dataset.h5, or other tools' files; "
            "several go side by side.",
            autocompletion=options.offered("runs"),
        ),
    ],
    web: Annotated[bool, typer.Option("--web", help="In the browser, served on loopback only.")] = False,
    png: Annotated[Path | None, options.option("--png", "FILE", "Draw a picture, without a display.")] = None,
    gif: Annotated[Path | None, options.option("--gif", "FILE", "Draw a film, without a display.")] = None,
    mp4: Annotated[Path | None, options.option("--mp4", "FILE", "The same; needs rigidsim[film].")] = None,
    seconds: Annotated[
        float | None, typer.Option("--seconds", min=0.5, max=120.0, help="That a film lasts; default 6.")
    ] = None,
    member: Annotated[
        list[int] | None,
        typer.Option("--member", metavar="N", min=0, help="Of a sweep: member N, from 0; repeatable."),
    ] = None,
    at: Annotated[
        str | None,
        options.option("--at", "TIME", 'Moment of a picture, in the scene\'s unit or as "2.4 hr".'),
    ] = None,
    part: Annotated[
        str | None,
        options.option(
            "--part", "PART", "Of the page, in pictures and films: page (the default), scene or plots."
        ),
    ] = None,
) -> None:
    """Open timelines in the rerun viewer (drawn first, where a run has none), or draw them to a file.

    A run that another process is working on is followed while it goes on. A fit is shown as its motion,
    with a cone of one standard deviation about the figure axis.

    Example: rigidsim view runs/intermediate_axis
    """


_EACH_FIGURE = "\n".join(f"{name:17}{description}" for name, description in FIGURES.items())


@_command("results", f"\n\n\b\nFigures:\n{_EACH_FIGURE}")
def plot(
    run_path: options.SeenPath,
    what: Annotated[
        list[str] | None,
        options.option("--what", "NAME", "Figure to draw; repeatable. all: every one the run has."),
    ] = None,
    out: Annotated[
        Path | None,
        options.option(
            "--out",
            "FILE",
            "PNG or SVG, or a folder for several; default figure.png or figure_NAME.png in the run.",
        ),
    ] = None,
    for_slides: Annotated[
        str | None,
        options.option(
            "--for-slides", "GROUND", "One panel in large letters on a light or dark ground: light or dark."
        ),
    ] = None,
) -> None:
    """Draw the page that suits the scene, or the figures named; of a sweep a variable over its axes.

    Example: rigidsim plot runs/intermediate_axis --what polhode --out flip.svg
    """


@_command("configs")
def tradeoff(
    config: options.ConfigPath,
    overrides: options.SetOption = None,
    out: options.OutOption = Path("runs"),
    budget: Annotated[float, options.option("--budget", "SECONDS", "Time that it may take, roughly.")] = 90.0,
    repeats: Annotated[
        int, options.option("--repeats", "N", "Fresh processes in which speeds are taken.")
    ] = 3,
    full: Annotated[
        bool, typer.Option("--full", help="Every tolerance in every formulation; needs a larger budget.")
    ] = False,
    files: Annotated[
        list[str] | None,
        options.option(
            "--with", "FILE,SECONDS", "Another tool's trajectory, and the CPU time it took; repeatable."
        ),
    ] = None,
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
    file_format: Annotated[
        str, options.option("--format", "FORMAT", f"{', '.join(FORMATS[:-1])} or {FORMATS[-1]}.")
    ],
    out: Annotated[
        Path | None, options.option("--out", "PATH", "Default NAME.FORMAT in this folder.")
    ] = None,
    force: Annotated[bool, options.replacing("Replace what is there.")] = False,
    angle_unit: Annotated[
        str | None,
        options.option(
            "--angle-unit",
            "UNIT",
            "For csv, parquet and zarr: rad, turns, deg, arcsec or mas; columns are named by it.",
        ),
    ] = None,
    epoch: Annotated[
        str | None,
        options.option(
            "--epoch",
            "TIME",
            "What time 0 is, where the config doesn't say, for aem, oem, ck, pck and the dates of csv: "
            '"2029-04-13T21:46:00 TDB".',
        ),
    ] = None,
    axes: Annotated[
        str | None,
        options.option(
            "--axes",
            "NAME",
            "For aem, oem, ck, pck: the space axes, where the config doesn't say: ICRF, EME2000, ...",
            "--frame",
        ),
    ] = None,
    object_name: Annotated[
        str | None,
        options.option("--object-name", "NAME", "For aem and oem; the frame's name for ck and pck."),
    ] = None,
    object_id: Annotated[
        str | None,
        options.option("--object-id", "ID", "For aem and oem; for ck and pck NAIF's, 301 or moon."),
    ] = None,
    variable: Annotated[
        list[str] | None, options.option("--variable", "NAME", "Only this variable, along time; repeatable.")
    ] = None,
) -> None:
    """Write a run for other tools: tables with every digit, CCSDS messages, or kernels of SPICE.

    Of a sweep csv and parquet hold a row per member, and zarr its dataset.

    Example: rigidsim export runs/intermediate_axis --format csv
    """


@_command("results")
def analyse(
    run_path: options.SeenPath,
    variable: Annotated[
        list[str] | None,
        options.option(
            "--variable",
            "NAME",
            "A variable (obliquity) or one of its signals (obliquity.figure); repeatable. Default: "
            "the main signals of the scene.",
        ),
    ] = None,
    lines: Annotated[int, typer.Option("--lines", metavar="N", help="Of each signal at most.")] = 20,
    out: Annotated[
        Path | None,
        options.option(
            "--out", "FILE", "Dataset; default analysis.h5 in the run. The figure goes next to it."
        ),
    ] = None,
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
