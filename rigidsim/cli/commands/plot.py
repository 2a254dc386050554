"""``rigidsim plot``: the standard figures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rigidsim.cli.options import RunPath
from rigidsim.errors import RigidsimError


def plot(
    run_path: RunPath,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="PNG or SVG; default figure.png in the run.")
    ] = None,
) -> None:
    """Draw the standard figures: rates, angles, drifts, polhode.

    Example: rigidsim plot runs/intermediate_axis --out flip.svg
    """
    from rigidsim.look.figures import figure_format, save_figure
    from rigidsim.store import atomic
    from rigidsim.store.run import open_run

    opened = open_run(run_path)
    target = out or opened.folder.figure
    with opened.dataset as dataset:
        try:
            file_format = figure_format(target)
            with atomic.replacing(target) as new:
                save_figure(dataset, new, file_format=file_format)
        except ValueError as error:
            raise RigidsimError(str(error)) from None
        except OSError as error:
            why = error.strerror or error
            raise RigidsimError(f"{target}: can't be written: {why}; choose another --out") from None
    print(target)
