"""Pictures and films of a run's timeline, drawn without a screen: at which moment, and of which part."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.errors import RunFolderError
from rigidsim.look import film
from rigidsim.scene.exact import parse_number
from rigidsim.scene.parts_of_values import in_time_order
from rigidsim.scene.readable import TimeWords
from rigidsim.store.outputs import writing

if TYPE_CHECKING:
    import xarray

PARTS = ("page", "scene", "plots")
_SIZES = {"page": film.SIZE, "scene": (1600, 800), "plots": (900, 900)}
_GIF_SIZES = {"page": (1000, 600), "scene": (720, 420), "plots": (640, 640)}
"""Points of pictures and MP4 films, and of GIF films, by the part of the page that they show."""

_FEW, _MOST = 20, 5000  # rows between which a telling moment is looked for
_SUDDEN = 5.0  # times the median change of rates: a flip, or a jump

FrameProgress = Callable[[int, int], None]


def draw(
    dataset: xarray.Dataset, target: Path, *, seconds: float | None = None,
    progress: FrameProgress | None = None, at: str | None = None, part: str = "page",
) -> None:  # fmt: skip
    """Draw a run to a PNG picture, or a GIF or MP4 film, without the viewer's own bars.

    Args:
        dataset: of the run, possibly lazy.
        seconds: that a film lasts.
        progress: receives the numbers of frames drawn and in all.
        at: moment of a picture: a number in the scene's unit of time, or with its own (``"2.4 hr"``).
        part: of the page, one of ``PARTS``.

    Raises:
        RunFolderError: no such moment or part, nothing to draw with, or the target can't be written.
    """
    if part not in PARTS:
        raise RunFolderError(f"--part: given {part}; {', '.join(PARTS)} is allowed")
    dataset = in_time_order(dataset)
    share = _telling(dataset) if at is None else _share(dataset, at)
    from rigidsim.look.timeline import write_timeline  # which loads rerun, see look.viewer

    size = (_GIF_SIZES if target.suffix.lower() == ".gif" else _SIZES)[part]
    with tempfile.TemporaryDirectory(prefix="rigidsim-view-") as scratch:
        recording = Path(scratch) / "timeline.rrd"
        try:
            write_timeline(dataset, recording, part=part, height=size[1])
        except (OSError, RuntimeError, ValueError) as error:
            raise RunFolderError(f"{target}: can't be drawn: {error}") from None
        draw_recording(recording, target, seconds=seconds, progress=progress, at=share, size=size)


def draw_recording(
    recording: Path, target: Path, *, seconds: float | None = None, progress: FrameProgress | None = None,
    at: float = film.PICTURED_AT, size: tuple[int, int] = film.SIZE,
) -> None:  # fmt: skip
    """Draw a recording at a fraction of the run, or a film of it; see ``draw``."""
    with _new(target) as new:
        try:
            film.render(recording, new, seconds=seconds or film.SECONDS, progress=progress, at=at, size=size)
        except (FileNotFoundError, RuntimeError, ValueError) as error:
            raise RunFolderError(f"{target}: can't be drawn: {error}") from None


def _telling(dataset: xarray.Dataset) -> float:
    """The fraction of a run at which a picture shows most: near 40 %, where a body that mostly turns
    uniformly changes its rates fastest.
    """
    count, rates = dataset.sizes["time"], dataset.get("angular_velocity")
    first, last = round(0.3 * count), round(0.6 * count)
    if rates is None or last - first < _FEW:
        return film.PICTURED_AT
    rows = slice(first, last, -(-count // _MOST))
    table = rates.transpose("time", ...).isel(time=rows).values.astype(float)
    change = np.linalg.norm(np.diff(table, axis=0), axis=1)
    if not change.max() > _SUDDEN * np.median(change):
        return film.PICTURED_AT
    time = dataset["time"].values.astype(float)
    return float((time[rows][change.argmax()] - time[0]) / (time[-1] - time[0]))


def _share(dataset: xarray.Dataset, at: str) -> float:
    """The fraction of a run at a moment."""
    start, end = (float(dataset["time"].values[k]) for k in (0, -1))
    words = TimeWords.of(dataset.attrs, start, end)
    try:
        moment = float(at) * words.unit.seconds
    except ValueError:
        try:
            moment = float(parse_number(at, "s"))
        except ValueError as error:
            raise RunFolderError(f"--at: given {at!r}; {error}") from None
    share = (moment - start) / (end - start) if end != start else 0.0
    if not 0 <= share <= 1:
        span = f"{words.short(start)} to {words.short(end)}"
        raise RunFolderError(f"--at: given {at!r}, outside of the run; {span} is allowed")
    return share


@contextmanager
def _new(target: Path) -> Iterator[Path]:
    """A temporary file of the target's suffix that replaces the target once complete."""
    with tempfile.TemporaryDirectory(prefix="rigidsim-view-") as scratch:
        new = Path(scratch) / f"new{target.suffix}"
        yield new
        with writing(target) as placed:
            placed.write_bytes(new.read_bytes())
