"""Arguments and options of the commands, and what the shell offers for them on Tab."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from rigidsim.formats import FORMATS


def offered(what: str) -> Callable[[str], list[Any]]:
    """A function of ``rigidsim.cli.completion``, which is imported when the shell asks it."""

    def complete(incomplete: str) -> list[Any]:
        found: list[Any] = getattr(import_module("rigidsim.cli.completion"), what)(incomplete)
        return found

    return complete


def _option(flag: str, metavar: str, text: str, *others: str, **more: Any) -> Any:
    """An option with its value's name, its help, and other flags for it."""
    return typer.Option(flag, *others, metavar=metavar, help=text, **more)


def replacing(text: str) -> Any:
    """The option ``--force``, and what it replaces: never what the command reads."""
    return typer.Option("--force", help=text)


_CONFIG = "TOML file of the experiment, or the name of a ready scene (rigidsim new lists them)."
_CONFIGS = "TOML files, or names of ready scenes (rigidsim new lists them)."
Configs = Annotated[list[Path], typer.Argument(metavar="CONFIG...", help=_CONFIGS)]
ConfigPath = Annotated[Path, typer.Argument(metavar="CONFIG", help=_CONFIG)]
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
    _option(
        "--set",
        "KEY=VALUE",
        "Replace a value, such as time.end=10; nothing after = removes the key; repeatable.",
        autocompletion=offered("settings"),
    ),
]
PhysicsOption = Annotated[
    str | None, _option("--physics", "ERROR", 'Find the least model within an angle, as "0.1 arcsec".')
]
WriteOption = Annotated[Path | None, _option("--write", "FILE", "With --physics: its config.")]
OutOption = Annotated[Path, _option("--out", "DIR", "Folder of the run folders.")]
VerboseOption = Annotated[
    bool,
    typer.Option(
        "--verbose", "-v", help="Print the whole summary, with invariants, start, and cost by phase."
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
SceneArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="SCENE",
        help="Its name, or another that it is known by.",
        autocompletion=offered("scenes"),
        show_default=False,
    ),
]
NameArgument = Annotated[
    str | None,
    typer.Argument(metavar="NAME", help="Of the experiment and its file NAME.toml; default SCENE."),
]
AnyConfigs = Annotated[
    list[Path] | None, typer.Argument(metavar="CONFIG...", help=_CONFIGS, show_default=False)
]
FromOption = Annotated[Path | None, _option("--from", "DATASET", "Run the config that a dataset embeds.")]
ScanOption = Annotated[
    list[str] | None,
    _option(
        "--sweep",
        "KEY=SPEC",
        "Run once for each value of a key, time.end=[1,2] or KEY=linspace(0,1,11); repeatable.",
    ),
]
MemberOption = Annotated[
    int | None, _option("--member", "N", "Of a sweep: member N by itself, counted from 0.", min=0)
]
WorkersOption = Annotated[
    int | None, _option("--workers", "N", "Processes of this machine that run members; default 1.", min=1)
]
SchedulerOption = Annotated[
    str | None,
    _option("--scheduler", "ADDRESS", "Dask scheduler whose workers run members (rigidsim[cluster])."),
]
TilesOption = Annotated[
    str | None, _option("--tiles", "A:B", "Only tiles A to B-1: a share, for job arrays.")
]
UntilOption = Annotated[str | None, _option("--until", "END", 'A later end, such as "2 h" or 5000.')]
GuardOption = Annotated[
    list[str] | None,
    _option("--set", "KEY=VALUE", "A guard of this session, such as limits.max_steps=1000000."),
]
ResumeWorkersOption = Annotated[
    int | None, _option("--workers", "N", "Of a sweep: processes that run members; default 1.", min=1)
]
MembersOption = Annotated[
    int | None, _option("--members", "N", "Of a sweep: how many members, drawn at random; default 100.")
]
ReversedOption = Annotated[
    bool, typer.Option("--reversed", help="Integrate to the end and back, too: how close does it return?")
]
PictureOption = Annotated[Path | None, _option("--png", "FILE", "Draw a picture, without a display.")]
WebOption = Annotated[bool, typer.Option("--web", help="In the browser, served on loopback only.")]
MomentOption = Annotated[
    str | None, _option("--at", "TIME", 'Moment of a picture, in the scene\'s unit or as "2.4 hr".')
]
PartOption = Annotated[
    str | None,
    _option("--part", "PART", "Of the page, in pictures and films: page (the default), scene or plots."),
]
FilmOption = Annotated[Path | None, _option("--gif", "FILE", "Draw a film, without a display.")]
FilmLengthOption = Annotated[
    float | None, typer.Option("--seconds", min=0.5, max=120.0, help="That a film lasts; default 6.")
]
VideoOption = Annotated[Path | None, _option("--mp4", "FILE", "The same; needs rigidsim[film].")]
BudgetOption = Annotated[float, _option("--budget", "SECONDS", "Time that it may take, roughly.")]
RepeatsOption = Annotated[int, _option("--repeats", "N", "Fresh processes in which speeds are taken.")]
FullOption = Annotated[
    bool, typer.Option("--full", help="Every tolerance in every formulation; needs a larger budget.")
]
MembersSeenOption = Annotated[
    list[int] | None,
    typer.Option("--member", metavar="N", min=0, help="Of a sweep: member N, from 0; repeatable."),
]
ExportPathOption = Annotated[Path | None, _option("--out", "PATH", "Default NAME.FORMAT in this folder.")]
WithFilesOption = Annotated[
    list[str] | None,
    _option("--with", "FILE,SECONDS", "Another tool's trajectory, and the CPU time it took; repeatable."),
]
ExportedOption = Annotated[
    list[str] | None, _option("--variable", "NAME", "Only this variable, along time; repeatable.")
]
TrajectoryPath = Annotated[
    Path, typer.Argument(metavar="FILE", help="CSV, Parquet, netCDF, AEM or CK, or the folder of a run.")
]
WithinOption = Annotated[
    float, _option("--within", "RAD", "Largest angle between attitudes that agree, in rad.")
]
ComparisonOption = Annotated[
    Path | None, _option("--out", "FILE", "Dataset of what was found along time, such as comparison.h5.")
]
ComparedFigureOption = Annotated[Path | None, _option("--figure", "FILE", "Figure, a .png or a .svg.")]
ConventionOption = Annotated[
    str | None,
    _option("--convention", "KEY=VALUE,...", "What is known of it, as order=xyzw,rate_axes=space."),
]
KernelsOption = Annotated[
    list[Path] | None,
    _option("--kernels", "FILE", "Clock (SCLK) and leap seconds that a CK is read with; repeatable."),
]
ComparedTimelineOption = Annotated[
    Path | None,
    _option("--timeline", "FILE", "Timeline (.rrd) of both bodies, with the angle between them."),
]
RunPaths = Annotated[
    list[Path],
    typer.Argument(
        metavar="RUN...",
        help="Folders of runs (runs/NAME) or fits (fits/NAME), their dataset.h5, or other tools' files; "
        "several go side by side.",
        autocompletion=offered("runs"),
    ),
]
WhatOption = Annotated[
    list[str] | None, _option("--what", "NAME", "Figure to draw; repeatable. all: every one the run has.")
]
FigureOption = Annotated[
    Path | None,
    _option(
        "--out",
        "FILE",
        "PNG or SVG, or a folder for several; default figure.png or figure_NAME.png in the run.",
    ),
]
SlidesOption = Annotated[
    str | None,
    _option("--for-slides", "GROUND", "One panel in large letters on a light or dark ground: light or dark."),
]
FormatOption = Annotated[str, _option("--format", "FORMAT", f"{', '.join(FORMATS[:-1])} or {FORMATS[-1]}.")]
ObjectNameOption = Annotated[
    str | None, _option("--object-name", "NAME", "For aem and oem; the frame's name for ck and pck.")
]
ObjectIdOption = Annotated[
    str | None, _option("--object-id", "ID", "For aem and oem; for ck and pck NAIF's, 301 or moon.")
]
AngleUnitOption = Annotated[
    str | None,
    _option(
        "--angle-unit",
        "UNIT",
        "For csv, parquet and zarr: rad, turns, deg, arcsec or mas; columns are named by it.",
    ),
]
EpochOption = Annotated[
    str | None,
    _option(
        "--epoch",
        "TIME",
        "What time 0 is, where the config doesn't say, for aem, oem, ck, pck and the dates of csv: "
        '"2029-04-13T21:46:00 TDB".',
    ),
]
AxesOption = Annotated[
    str | None,
    _option(
        "--axes",
        "NAME",
        "For aem, oem, ck, pck: what the space axes are, where the config doesn't say: ICRF, EME2000, ...",
        "--frame",
    ),
]
VariableOption = Annotated[
    list[str] | None,
    _option(
        "--variable",
        "NAME",
        "A variable (obliquity) or one of its signals (obliquity.figure); repeatable. Default: "
        "the main signals of the scene.",
    ),
]
AnalysisOption = Annotated[
    Path | None,
    _option("--out", "FILE", "Dataset; default analysis.h5 in the run. The figure goes next to it."),
]
FitsOption = Annotated[
    Path, _option("--out", "DIR", "Folder of the fits' folders; an interrupted fit there goes on.")
]
FittedOption = Annotated[
    Path | None, _option("--write", "FILE", "Config with the estimated values, ready to be run.")
]
