"""``rigidsim view``: runs in the viewer, a running one followed as it goes on, or drawn to a file."""

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import xarray

from rigidsim.errors import RigidsimError, RunFolderError
from rigidsim.look import viewer
from rigidsim.scene.sweep import Sweep
from rigidsim.store import pictures
from rigidsim.store.folder import FitFolder, SweepFolder, folder_at
from rigidsim.store.pictures import FrameProgress
from rigidsim.store.run import Run, SavedRun, ShownRun, open_run
from rigidsim.store.sweeps.saved import open_sweep
from rigidsim.workflows.compare.as_run import open_any
from rigidsim.workflows.fit.fitting import fitted_run, read_dataset
from rigidsim.workflows.read import load, parse
from rigidsim.workflows.run import run
from rigidsim.workflows.sweeps.members import single_member


def runs_of(paths: Sequence[Path], members: Sequence[int] = ()) -> list[tuple[str, Run]]:
    """Runs with their names on the screen, each different; with ``members``, runs of one sweep."""
    if members:
        return _members(paths, members)
    runs: list[Run] = [*map(shown, paths)]
    names = [run.outcome.name for run in runs]
    if len(set(names)) < len(names):
        names = [run.place for run in runs]
    return list(zip(names, runs, strict=True))


def shown(path: Path) -> SavedRun | ShownRun:
    """A run, the motion of a fit, or another tool's file; a sweep is refused."""
    folder = folder_at(path)
    if isinstance(folder, SweepFolder):
        raise RunFolderError(
            f"{path}: is a sweep; choose members of it with --member N (repeatable, counted from 0); "
            "rigidsim plot draws a variable over its axes"
        )
    if isinstance(folder, FitFolder):
        return fitted_run(load(folder.fitted), read_dataset(folder), str(folder.path))
    return open_any(path)


def _members(paths: Sequence[Path], members: Sequence[int]) -> list[tuple[str, Run]]:
    if len(paths) != 1 or not isinstance(folder_at(paths[0]), SweepFolder):
        raise RunFolderError("--member is for one sweep: give its folder (runs/NAME), and no other run")
    folder = open_sweep(paths[0]).folder
    experiment = parse(folder.config.read_text(), source=str(folder.config))
    sweep, named = Sweep.of(experiment), list[tuple[str, Run]]()
    for member in dict.fromkeys(members):
        one = single_member(experiment, member)
        said = "; ".join(filter(None, (one.config.description, sweep.described(member))))
        named.append((f"member {member}", run(one.replace({"description": said}), out=None)))
    return named


def show(named: Sequence[tuple[str, Run]], *, web: bool = False) -> int:
    """Open runs in the viewer, side by side if there are several, and wait until it is closed; returns its
    exit code, 130 after Ctrl-C. A single run that another process works on is followed as it is saved.
    """
    first = named[0][1]
    try:
        if len(named) == 1 and isinstance(first, SavedRun) and first.folder.at_work:
            return viewer.follow(lambda: _so_far(first), web=web)
        with _recording_of(named) as timeline:
            return viewer.open_viewer(timeline, web=web)
    except (FileNotFoundError, RuntimeError) as error:
        raise RunFolderError(str(error)) from None


def render(
    named: Sequence[tuple[str, Run]], target: Path, *, seconds: float | None = None,
    progress: FrameProgress | None = None, at: str | None = None, part: str = "page",
) -> Path:  # fmt: skip
    """Draw a run to a PNG picture, or a GIF or MP4 film, without a screen; or several runs side by side, of
    which there is the page alone. See ``store.pictures.draw``.
    """
    if len(named) == 1:
        with named[0][1].dataset as dataset:
            pictures.draw(dataset, target, seconds=seconds, progress=progress, at=at, part=part)
        return target
    if at is not None or part != "page":
        raise RunFolderError("--at and --part: are for the picture of a single run; leave them out")
    with _recording_of(named, bars=False) as timeline:
        pictures.draw_recording(timeline, target, seconds=seconds, progress=progress)
    return target


@contextmanager
def _recording_of(named: Sequence[tuple[str, Run]], *, bars: bool = True) -> Iterator[Path]:
    """The recording of a run, or a temporary one of several runs side by side, for a picture without bars."""
    if len(named) == 1:
        with named[0][1].recording() as timeline:
            yield timeline
        return
    from rigidsim.look.timeline import write_comparison  # which loads rerun, see look.viewer

    with tempfile.TemporaryDirectory(prefix="rigidsim-view-") as scratch, ExitStack() as opened:
        datasets = [(name, opened.enter_context(run.dataset)) for name, run in named]
        path = Path(scratch) / "timeline.rrd"
        try:
            write_comparison(datasets, path, bars=bars)
        except (OSError, RuntimeError, ValueError) as error:
            raise RunFolderError(f"side by side: {getattr(error, 'strerror', None) or error}") from None
        yield path


def _so_far(run: SavedRun) -> tuple[xarray.Dataset | None, bool]:
    """What is saved of a run now (None before its first segment), and whether the run goes on."""
    going_on = run.folder.at_work
    try:
        return open_run(run.folder.path).opened(indexed=False), going_on
    except RigidsimError:
        # nothing is saved yet, or segments are just becoming the dataset: the next look finds it
        if going_on:
            return None, True
        raise
