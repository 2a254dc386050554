"""``rigidsim plot``: figures of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rigidsim.cli.options import RunPath
from rigidsim.errors import RigidsimError
from rigidsim.look.figure_names import FIGURES, OVERVIEW, SPECTRUM

ALL = "all"


def plot(
    run_path: RunPath,
    what: Annotated[
        list[str] | None,
        typer.Option(
            "--what", metavar="NAME", help="Figure to draw; repeatable. all: every one the run has."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="PNG or SVG, or a folder for several; default figure.png or figure_NAME.png in the run.",
        ),
    ] = None,
) -> None:
    """Draw the page that suits the scene, or the figures named; of a sweep a variable over its axes."""
    from rigidsim.look.figures import available, check_name, figure_format, save_figure
    from rigidsim.look.figures.spectrum import save_spectrum
    from rigidsim.store import atomic
    from rigidsim.store.run import open_run
    from rigidsim.store.sweeps.folder import is_sweep
    from rigidsim.workflows.analyse import analyse

    if is_sweep(run_path):
        _plot_sweep(run_path, what, out)
        return
    opened = open_run(run_path)
    wanted = list(dict.fromkeys(what or [OVERVIEW]))
    try:
        for name in wanted:
            if name != ALL:
                check_name(name)
    except ValueError as error:
        raise RigidsimError(f"--what: {error}, {ALL}") from None
    several = len(wanted) > 1 or ALL in wanted
    if several and out is not None and not out.is_dir():
        raise RigidsimError(f"{out}: several figures need a folder that is there; give one as --out, or none")
    target = out or opened.folder.figure
    with opened.dataset as dataset:
        try:
            if ALL in wanted:
                wanted = available(dataset)
            for name in wanted:
                if several or out is None:
                    target = opened.folder.figure if name == OVERVIEW else opened.folder.figure_of(name)
                    target = target if out is None else out / target.name
                file_format = figure_format(target)
                with atomic.replacing(target) as new:
                    if name == SPECTRUM:
                        save_spectrum(analyse(opened).dataset, new, file_format=file_format)
                    else:
                        save_figure(dataset, new, name, file_format=file_format)
                print(target)
        except ValueError as error:
            raise RigidsimError(str(error)) from None
        except OSError as error:
            why = error.strerror or error
            raise RigidsimError(f"{target}: can't be written: {why}; choose another --out") from None


def _plot_sweep(run_path: Path, what: list[str] | None, out: Path | None) -> None:
    """Variables of a sweep over its axes."""
    from rigidsim.look.figures import figure_format
    from rigidsim.look.figures.sweep_maps import drawable, save_sweep_figure
    from rigidsim.store import atomic
    from rigidsim.store.sweeps.run import open_sweep

    found = open_sweep(run_path)
    several = what is not None and (len(what) > 1 or ALL in what)
    if several and out is not None and not out.is_dir():
        raise RigidsimError(f"{out}: several figures need a folder that is there; give one as --out, or none")
    with found.dataset as dataset:
        wanted: list[str | None] = [*what] if what else [None]
        if ALL in wanted:
            wanted = [*drawable(dataset)]
        for name in wanted:
            own = "figure.png" if name is None else f"figure_{name.replace('[', '_').replace(']', '')}.png"
            target = found.folder.path / own if out is None else (out / own if several else out)
            try:
                file_format = figure_format(target)
                with atomic.replacing(target) as new:
                    save_sweep_figure(dataset, new, name, file_format=file_format)
            except ValueError as error:
                raise RigidsimError(f"plot: {error}") from None
            except OSError as error:
                why = error.strerror or error
                raise RigidsimError(f"{target}: can't be written: {why}; choose another --out") from None
            print(target)


plot.__doc__ = f"""{plot.__doc__}

    Example: rigidsim plot runs/intermediate_axis --what polhode --out flip.svg

    \b
    Figures:
    {"".join(f"{name:14}{summary}" + chr(10) + "    " for name, summary in FIGURES.items())}
    """
