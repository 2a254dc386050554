"""Saving figures to files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rigidsim.look.figure_names import OVERVIEW
from rigidsim.look.figures.catalogue import figure
from rigidsim.look.figures.style import STYLE

if TYPE_CHECKING:
    import xarray

SUFFIXES = (".png", ".svg")
_DOTS = 160  # per inch


def save_figure(
    dataset: xarray.Dataset, path: str | Path, what: str = OVERVIEW, *, file_format: str | None = None
) -> Path:
    """Draw a figure of a run to a file.

    Args:
        dataset: dataset of a run, possibly lazy; at most 20,000 rows of each variable are drawn.
        path: the file; it is whole when this returns.
        what: see `figure`.
        file_format: see `figure_format`; by default given by the suffix of `path`.

    Returns:
        `path`.

    Raises:
        ValueError: another suffix, or as for `figure`.
    """
    path = Path(path)
    file_format = file_format or figure_format(path)
    from matplotlib import rc_context

    with rc_context(STYLE):  # type: ignore[arg-type]
        figure(dataset, what).savefig(path, dpi=_DOTS, format=file_format)
    return path


def figure_format(path: Path) -> str:
    """File format for a path's suffix: "png" or "svg".

    Raises:
        ValueError: another suffix.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(
            f"figure {path.name!r}: the suffix must be one of {', '.join(SUFFIXES)}, given {path.suffix!r}"
        )
    return path.suffix.lower()[1:]
