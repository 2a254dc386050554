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
    gc.disable()  # modules are no garbage: looking for it takes a tenth of the time of loading them
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
            gc.enable()
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
            help="Name of a ready scene, or an alias.",
            autocompletion=options.offered("scenes"),
            show_default=False,
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="Name of the experiment and its file NAME.toml; default SCENE."),
    ] = None,
) -> None:
    """Write a ready scene to start from, with the tables it reads; without a name, list all by subject.

    An existing file is never replaced.

    Example: rigidsim new coin my_coin
    """


@_command("configs")
def check(
    configs: Annotated[list[Path], typer.Argument(metavar="CONFIG...", help=options.CONFIGS)],
    overrides: options.SetOption = None,
    as_json: options.JsonOption = False,
) -> None:
    """Validate configs, and show how they were understood; nothing is run.

    The exit code is 2 if a config can't be run.

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
            "Run once for each value of a key: time.end=[1,2] or KEY=linspace(0,1,11); repeatable.",
        ),
    ] = None,
    member: options.MemberOption = None,
    force: Annotated[bool, options.replacing("Replace a run of the same name.")] = False,
    as_json: options.JsonOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Integrate, write the run folder, and print verdict, accuracy and cost.

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
    force: Annotated[bool, options.replacing("Replace an earlier sweep of the same name.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Run all members, and write one labelled dataset; members that exist aren't computed again. With [fit]
    in the config each member is a fit.

    The same command continues after an interruption, also with longer axes in the config.

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
        options.option("--workers", "N", "For a sweep: processes that run members; default 1.", min=1),
    ] = None,
    as_json: options.JsonOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Continue an interrupted, killed or guarded run; the result has the bits of an uninterrupted run.

    A complete run is reported and left unchanged: a script can call resume until the exit code is 0.

    Example: rigidsim resume runs/intermediate_axis
    """


@_command("saved")
def verify(
    run_path: options.RunPath,
    members: Annotated[
        int | None,
        options.option("--members", "N", "For a sweep: number of members, drawn at random; default 100."),
    ] = None,
    back: Annotated[
        bool,
        typer.Option(
            "--reversed", help="Also integrate to the end and back, and print the distance from the start."
        ),
    ] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Integrate the embedded config again and compare all bits. If any differ, print the first difference and
    exit with code 1.

    Example: rigidsim verify runs/intermediate_axis --reversed
    """


@_command("configs")
def plan(
    config: options.ConfigPath,
    overrides: options.SetOption = None,
    out: options.OutOption = Path("runs"),
    physics: Annotated[
        str | None,
        options.option(
            "--physics", "ERROR", 'Find the smallest model within an error, such as "0.1 arcsec".'
        ),
    ] = None,
    write: Annotated[
        Path | None,
        options.option("--write", "FILE", "With --physics: write the smallest model as a config."),
    ] = None,
    force: Annotated[bool, options.replacing("With --physics: replace earlier runs and the file.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Explain what would be integrated and why; predict steps, time, memory and file sizes.

    With --physics run the scene without each of its effects, print the size of each effect, and name the
    smallest model within an error. The same command continues after an interruption.

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
            "--convention",
            "KEY=VALUE,...",
            "Known parts of the file's convention, such as order=xyzw,rate_axes=space.",
        ),
    ] = None,
    offset: Annotated[
        str | None,
        options.option(
            "--offset",
            "TIME",
            'Added to the file\'s times: 12.5, "3 min", first (its first row is at the start), or estimate.',
        ),
    ] = None,
    out: Annotated[
        Path | None,
        options.option("--out", "FILE", "Dataset of errors and defects along time, such as comparison.h5."),
    ] = None,
    figure: Annotated[Path | None, options.option("--figure", "FILE", "Figure (.png or .svg).")] = None,
    timeline: Annotated[
        Path | None,
        options.option("--timeline", "FILE", "Timeline (.rrd) of both bodies, with the angle between them."),
    ] = None,
    kernels: Annotated[
        list[Path] | None,
        options.option("--kernels", "FILE", "Clock (SCLK) and leap seconds for reading a CK; repeatable."),
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
        Path,
        options.option("--out", "DIR", "Folder of the fits' folders; an interrupted fit there is restarted."),
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
    """Print the summary of a run, finished or partial; exit code 2 if its dataset is damaged or was edited.

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
    web: Annotated[
        bool, typer.Option("--web", help="Show the timeline in a browser, served on loopback only.")
    ] = False,
    png: Annotated[Path | None, options.option("--png", "FILE", "Draw a picture, without a display.")] = None,
    gif: Annotated[Path | None, options.option("--gif", "FILE", "Draw a film, without a display.")] = None,
    mp4: Annotated[
        Path | None, options.option("--mp4", "FILE", "Draw a film, without a display; needs rigidsim[film].")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option("--seconds", min=0.5, max=120.0, help="Length of a film; default 6.")
    ] = None,
    member: Annotated[
        list[int] | None,
        typer.Option(
            "--member", metavar="N", min=0, help="For a sweep: member N, counted from 0; repeatable."
        ),
    ] = None,
    at: Annotated[
        str | None,
        options.option("--at", "TIME", 'Moment of a picture, in the scene\'s unit or with a unit: "2.4 hr".'),
    ] = None,
    part: Annotated[
        str | None,
        options.option(
            "--part", "PART", "Part to draw in pictures and films: page (the default), scene or plots."
        ),
    ] = None,
) -> None:
    """Open timelines in the rerun viewer, or draw them to a file. Missing timelines are written first.

    A run in another process is followed while it continues. A fit is shown as its motion, with a cone of
    one standard deviation about the figure axis.

    Example: rigidsim view runs/intermediate_axis
    """


_EACH_FIGURE = "\n".join(f"{name:17}{description}" for name, description in FIGURES.items())


@_command("results", f"\n\n\b\nFigures:\n{_EACH_FIGURE}")
def plot(
    run_path: options.SeenPath,
    what: Annotated[
        list[str] | None,
        options.option("--what", "NAME", "Figure to draw, or all for every figure of the run; repeatable."),
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
            "--for-slides", "GROUND", "One panel in large letters, on a ground that is light or dark."
        ),
    ] = None,
) -> None:
    """Draw the page that suits the scene, or named figures; for a sweep, a variable over its axes.

    Example: rigidsim plot runs/intermediate_axis --what polhode --out flip.svg
    """


@_command("configs")
def tradeoff(
    config: options.ConfigPath,
    overrides: options.SetOption = None,
    out: options.OutOption = Path("runs"),
    budget: Annotated[float, options.option("--budget", "SECONDS", "Time limit, roughly.")] = 90.0,
    repeats: Annotated[
        int, options.option("--repeats", "N", "Fresh processes in which speed is measured.")
    ] = 3,
    full: Annotated[
        bool,
        typer.Option("--full", help="Measure every tolerance in every formulation; needs a larger budget."),
    ] = False,
    files: Annotated[
        list[str] | None,
        options.option("--with", "FILE,SECONDS", "Another tool's trajectory and its CPU time; repeatable."),
    ] = None,
    force: Annotated[bool, options.replacing("Replace an earlier measurement.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Measure the speed and accuracy of settings for a scene, and recommend settings by accuracy. Dataset and
    figure are written to NAME_tradeoff.

    Example: rigidsim tradeoff asymmetric_top
    """


@_command("results")
def export(
    run_path: options.RunPath,
    file_format: Annotated[
        str | None,
        options.option(
            "--format", "FORMAT", f"{', '.join(FORMATS[:-1])} or {FORMATS[-1]}; default: --out's."
        ),
    ] = None,
    out: Annotated[
        Path | None, options.option("--out", "PATH", "Default NAME.FORMAT in this folder.")
    ] = None,
    force: Annotated[bool, options.replacing("Replace existing files.")] = False,
    angle_unit: Annotated[
        str | None,
        options.option(
            "--angle-unit",
            "UNIT",
            "For csv, parquet and zarr: rad, turns, deg, arcsec or mas; names of columns contain it.",
        ),
    ] = None,
    epoch: Annotated[
        str | None,
        options.option(
            "--epoch",
            "TIME",
            "Date of time 0 if the config has none, for all formats but parquet and zarr: "
            '"2029-04-13T21:46:00 TDB".',
        ),
    ] = None,
    axes: Annotated[
        str | None,
        options.option(
            "--axes",
            "NAME",
            "Space axes if the config names none, for aem, oem, ck and pck: ICRF, EME2000, ...",
            "--frame",
        ),
    ] = None,
    object_name: Annotated[
        str | None,
        options.option(
            "--object-name", "NAME", "Name of the object in aem and oem; name of the frame for ck and pck."
        ),
    ] = None,
    object_id: Annotated[
        str | None,
        options.option(
            "--object-id", "ID", "ID of the object in aem and oem; for ck and pck NAIF's: 301 or moon."
        ),
    ] = None,
    message: Annotated[
        str | None,
        options.option(
            "--message",
            "KEY=VALUE,...",
            "Of aem and apm: type=quaternion/angvel, sequence=zyx, from=body, time=UTC; of aem segment=1000 "
            "(rows, or a time), of apm at=TIME.",
        ),
    ] = None,
    variable: Annotated[
        list[str] | None,
        options.option("--variable", "NAME", "Variable to export, along time; repeatable. Default: all."),
    ] = None,
) -> None:
    """Write a run for other tools: tables with every digit, CCSDS messages, or kernels of SPICE.

    For a sweep, csv and parquet hold a row per member, and zarr the dataset.

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
    lines: Annotated[
        int, typer.Option("--lines", metavar="N", help="Largest number of lines of each signal.")
    ] = 20,
    out: Annotated[
        Path | None,
        options.option(
            "--out", "FILE", "Dataset, with the figure next to it; default analysis.h5 in the run folder."
        ),
    ] = None,
    force: Annotated[bool, options.replacing("Replace an existing analysis.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Find secular rates and spectral lines, labelled with the scene's frequencies: table, dataset, figure.

    Example: rigidsim analyse runs/earth_free_nutation --lines 5
    """


@_command("orbits")
def orbits(
    planets: Annotated[
        list[str], typer.Argument(metavar="PLANET...", help="mercury, venus, earth, mars ... neptune.")
    ],
    end: Annotated[
        str, options.option("--end", "TIME", 'Last time, from J2000; negative in the past: "-1 Myr".')
    ],
    every: Annotated[str, options.option("--every", "TIME", "Interval between rows.")] = "1 kyr",
    window: Annotated[
        str, options.option("--window", "TIME", "Length of the average (Hann's weights); 0 for none.")
    ] = "1 kyr",
    kernel: Annotated[
        str, options.option("--kernel", "NAME", "Installed ephemeris that has the places at J2000.")
    ] = "de421",
    out: Annotated[Path, options.option("--out", "DIR", "Folder of the tables, PLANET.csv each.")] = Path(),
    force: Annotated[bool, options.replacing("Replace tables of these names.")] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue interrupted tables, with the same bits.")
    ] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Integrate the planets from J2000 (needs rigidsim[orbits]), and write tables of their averaged elements,
    which orbit = {table = "PLANET.csv"} reads.

    A million years take some four minutes. Ctrl-C keeps finished rows; --resume continues.

    Example: rigidsim orbits earth --end "-10 kyr" --every "400 yr"
    """


@_command("configs")
def schema() -> None:
    """Print the config's JSON schema, for editors.

    Example: rigidsim schema > rigidsim.schema.json; editors read the config's first line
    "#:schema rigidsim.schema.json"
    """
