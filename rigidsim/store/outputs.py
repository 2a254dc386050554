"""Where commands write files for the user: no input is ever written over, whatever the options, and what
exists is replaced by force alone, pictures apart.

Every writer of such files asks here before it begins its work, and writes them here.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rigidsim.errors import FORCE, OUT, RunFolderError
from rigidsim.store import atomic

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

ANALYSIS = "analysis.h5"
"""File of a run's folder that an analysis writes, and no command reads."""
FILE = ("file", "")
_PICTURES = {".png", ".svg", ".gif", ".mp4", ".pdf"}


def refuse_loss(
    outputs: Iterable[str | Path],
    inputs: Iterable[str | Path],
    *,
    force: bool = False,
    kind: tuple[str, str] = FILE,
) -> None:
    """Refuse to write files that would replace something.

    Args:
        outputs: files that will be written.
        inputs: files and folders that are read; of a folder (a run's, say) all but pictures and ``ANALYSIS``.
        force: whether existing files may be replaced; inputs never are. A picture may replace a picture.
        kind: what the outputs are, and a file that such a folder holds.

    Raises:
        RunFolderError: naming the file, and what to do.
    """
    files, (what, mark) = [Path(path) for path in outputs], kind
    refuse_inputs(files, inputs)
    for number, path in enumerate(files):
        if any(_same(path, other) for other in files[:number]):
            raise RunFolderError(f"{path}: two outputs have this name; give each its own")
        if not os.path.isdir(path.parent):
            raise RunFolderError(
                f"{path}: there is no folder {path.parent}; make it first, or give another name"
            )
        if not os.path.lexists(path):
            continue
        if os.path.exists(path) and not os.path.isfile(path / mark):
            raise RunFolderError(f"{path}: exists and is no {what}; give another name")
        if not force and path.suffix.lower() not in _PICTURES:
            raise RunFolderError(f"{path}: exists; {FORCE} replaces it, or give another name")


def refuse_inputs(outputs: Iterable[str | Path], inputs: Iterable[str | Path]) -> None:
    """Refuse outputs, files or folders, that are an input, are read as a part of one, or contain one."""
    read = [Path(path) for path in inputs]
    for path in map(Path, outputs):
        for one in read:
            if _same(path, one) or _part(path, one):
                raise RunFolderError(
                    f"{path}: is read by this command ({one}), and an input is never written over; give "
                    "another name"
                )
            if _within(one, path) or _linked(one, path):
                raise RunFolderError(
                    f"{path}: holds {one}, which this command reads, and an input is never written over; "
                    f"choose another {OUT} or name"
                )


@contextmanager
def writing(path: Path, *, folder: bool = False) -> Iterator[Path]:
    """A temporary file (or folder) that becomes ``path`` when the block ends without an error; RunFolderError
    if that can't be written.
    """
    try:
        with (atomic.replacing_folder if folder else atomic.replacing)(path) as new:
            yield new
    except OSError as error:
        why = error.strerror or error
        raise RunFolderError(f"{path}: can't be written: {why}; give another name") from None


def write_drawn(dataset: xarray.Dataset, path: Path, figure: Figure, picture: Path) -> None:
    """Write a dataset and its figure, each of which appears only when complete."""
    with writing(path) as new:
        dataset.to_netcdf(new, engine="h5netcdf")
    with writing(picture) as new:
        figure.savefig(new, format="png")


def _same(one: Path, other: Path) -> bool:
    """Whether two paths are one file or folder, by whatever spelling or link."""
    if os.path.exists(one) and os.path.exists(other):
        return os.path.samefile(one, other)
    return os.path.realpath(one) == os.path.realpath(other)


def _part(path: Path, folder: Path) -> bool:
    """Whether a path is a file, or a link to one, that is read as a part of a folder."""
    if _within(path, folder):
        return not _remade(Path(os.path.realpath(path)))
    return _linked(path, folder)


def _within(path: Path, folder: Path) -> bool:
    """Whether a file that is there lies in a folder, however deep."""
    return os.path.isfile(path) and Path(os.path.realpath(folder)) in Path(os.path.realpath(path)).parents


def _linked(path: Path, folder: Path) -> bool:
    """Whether a file is, by a hard link, in a folder, too."""
    if not os.path.isfile(path) or path.stat().st_nlink < 2 or not os.path.isdir(folder):
        return False
    return any(os.path.samefile(path, part) for part in folder.rglob("*") if part.is_file())


def _remade(path: Path) -> bool:
    return path.suffix.lower() in _PICTURES or path.name == ANALYSIS
