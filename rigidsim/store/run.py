"""Runs on disk, finished or partial, opened for reading, and runs in memory."""

import sys
import tempfile
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from rigidsim.errors import FORCE, RESUME, Remedy, RunFolderError, run_again
from rigidsim.look import viewer
from rigidsim.store import atomic, segments
from rigidsim.store.folder import FitFolder, RunFolder, SweepFolder, WorkFolder, find_run, folder_at
from rigidsim.store.netcdf import Block
from rigidsim.store.outputs import refuse_loss
from rigidsim.store.seal import refuse_damaged
from rigidsim.store.summary import Brief, Summary
from rigidsim.store.variables import Extra, Variable

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


class Result:
    """What a run or a sweep gave, wherever its numbers are kept."""

    outcome: Any

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The content of ``summary.json``."""
        found: dict[str, Any] = self.outcome.as_dict()
        return found

    @property
    def status(self) -> str:
        """How it ended; ``"finished"`` is the only complete one."""
        return str(self.outcome.status)

    @property
    @abstractmethod
    def place(self) -> str:
        """Description of where it is kept."""

    @property
    def files(self) -> list[Path]:
        """Files and folders that it is read from, which nothing may be written over."""
        return []

    @property
    @abstractmethod
    def dataset(self) -> "xarray.Dataset":
        """The labelled dataset."""

    def __repr__(self) -> str:
        kind = "Run" if isinstance(self, Run) else "Sweep"
        return f"<{kind} {self.outcome.name!r} ({self.place}): {self.status}>"


class Saved(Result):
    """A run or a sweep on disk."""

    folder: WorkFolder

    @property
    def place(self) -> str:
        """Path of its folder."""
        return str(self.folder.path)

    @property
    def files(self) -> list[Path]:
        """See ``Result``."""
        return [self.folder.path]


class Run(Result):
    """The result of a run; its ``outcome`` is a ``Summary`` if it ended."""

    outcome: Brief

    @property
    def attitude_error(self) -> float | None:
        """Certified or estimated error of the attitude at the end, rad; None if unknown."""
        if not isinstance(self.outcome, Summary):
            return None
        accuracy = self.outcome.accuracy
        return accuracy.estimated_attitude_error if accuracy.certified is None else accuracy.certified

    def plot(self, what: str = "overview") -> "Figure":
        """A figure of the run, by default the page that suits the scene; a notebook shows it.

        Args:
            what: a name of ``rigidsim.look.figures.FIGURES``.

        Raises:
            ValueError: no such figure, none for this run, or a run without samples.
        """
        from rigidsim.look.figures import figure

        if "ipykernel" in sys.modules:
            import matplotlib.pyplot  # noqa: F401  (it teaches notebooks to show figures)
        with self.dataset as dataset:
            return figure(dataset, what)

    def view(
        self, *, web: bool = False, png: str | Path | None = None, at: float | str | None = None,
        part: str = "page",
    ) -> int:  # fmt: skip
        """Open the timeline in the viewer, or in the browser (served on loopback, until Ctrl-C), and wait
        until it is closed; or draw a picture of it without a display.

        Args:
            png: file of the picture.
            at: its moment, in the scene's unit of time or with a unit (``"2.4 hr"``); else near 40 % of it.
            part: what it shows: "page", "scene" or "plots".

        Returns:
            The viewer's exit code; 130 after Ctrl-C; 0 for a picture.

        Raises:
            RunFolderError: the timeline can't be drawn, no viewer is installed, or there is no screen for it.
        """
        if png is not None:
            from rigidsim.store import pictures  # which loads Pillow

            refuse_loss([png], self.files)
            with self.dataset as dataset:
                pictures.draw(dataset, Path(png), at=None if at is None else str(at), part=part)
            return 0
        with self.recording() as timeline:
            try:
                return viewer.open_viewer(timeline, web=web)
            except (FileNotFoundError, viewer.NoDisplay) as error:
                raise RunFolderError(str(error)) from None

    @contextmanager
    def recording(self) -> Iterator[Path]:
        """The timeline: the run's own, or one drawn for this purpose."""
        with tempfile.TemporaryDirectory(prefix="rigidsim-view-") as scratch:
            timeline = Path(scratch) / "timeline.rrd"
            self._draw(timeline)
            yield timeline

    def _draw(self, timeline: Path) -> None:
        from rigidsim.look.timeline import write_timeline

        try:
            with self.dataset as dataset, atomic.replacing(timeline) as new:
                write_timeline(dataset, new)
        except (OSError, RuntimeError) as error:
            why = getattr(error, "strerror", None) or error
            raise RunFolderError(f"{timeline}: can't be written: {why}") from None

    @abstractmethod
    def concluded(self, outcome: Brief) -> Self:
        """The same run with the given summary, saved where the run is kept."""

    def _repr_html_(self) -> str:
        from html import escape  # which only notebooks need

        title = f"{escape(self.outcome.name)}: {escape(self.status)}"
        return f"<b>{title}</b> ({escape(self.place)}){_table(self.outcome, escape)}"


@dataclass(frozen=True, repr=False)
class SavedRun(Saved, Run):
    """A run on disk, finished or partial."""

    folder: RunFolder
    outcome: Brief

    @contextmanager
    def recording(self) -> Iterator[Path]:
        """See ``Run``; one that had to be drawn is kept in the folder, if that can be written."""
        timeline = self.folder.timeline
        if not timeline.exists():
            if self.folder.read_only is not None:
                with super().recording() as drawn:
                    yield drawn
                return
            self._draw(timeline)
            self.folder.note_timeline(self.outcome, timeline)
        yield timeline

    def concluded(self, outcome: Brief) -> Self:
        """The same run with the given summary, which is written."""
        self.folder.write_summary(outcome)
        return replace(self, outcome=outcome)

    @property
    def saved(self) -> bool:
        """Whether anything was saved that ``dataset`` could read."""
        return self.folder.dataset.exists() or bool(segments.segment_paths(self.folder.segments))

    @property
    def dataset(self) -> "xarray.Dataset":
        """The dataset, read lazily; for an unfinished run, what its segments hold.

        Raises:
            RunFolderError: nothing was saved, or a file is damaged.
        """
        return self.opened()

    def refuse_damaged(self) -> None:
        """Check a complete dataset against its seal and the summary, which reads the whole file."""
        if self.folder.dataset.exists():
            # a run completed again after a crash still has the summary of the first time, or none
            begun = self.folder.segments.exists()
            try:
                refuse_damaged(self.folder.dataset, None if begun else self.outcome.dataset_digest)
            except RunFolderError as error:
                remedy = f"{RESUME} completes it again" if begun else run_again(self.folder.path)
                raise RunFolderError(f"{error}; {remedy}") from None

    def opened(self, *, indexed: bool = True) -> "xarray.Dataset":
        """As ``dataset``; without ``indexed``, sample times aren't loaded and can't be selected by."""
        from rigidsim.store.reader import open_dataset

        if self.folder.dataset.exists():
            self.refuse_damaged()
            return open_dataset(self.folder.dataset, indexed=indexed)
        chain = segments.read_chain(self.folder.segments)
        if chain.damage is not None:
            raise RunFolderError(f"{chain.damage}; {RESUME} sets it aside and resumes before it")
        if not chain.paths:
            lost = self.outcome.dataset_digest is not None
            what = f"its dataset.h5 is missing; run it again with {FORCE}" if lost else "nothing was saved"
            raise RunFolderError(f"{self.folder.path}: {what}")
        return open_dataset(*chain.paths, status=self.status, indexed=indexed)


class MemoryWriter:
    """Takes what a ``SegmentWriter`` takes, and keeps it in memory."""

    due = False

    def __init__(self) -> None:
        self.blocks: list[Block] = []

    def add(self, block: Block) -> None:
        """Take a block of samples."""
        if len(block["time"][0]):
            self.blocks.append(block)

    def flush(self, checkpoint: segments.Arrays, events: segments.Arrays) -> None:
        """Do nothing: a run in memory can't be resumed."""


@dataclass(frozen=True, repr=False)
class MemoryRun(Run):
    """A run in memory; ``dataset`` equals the one that ``dataset.h5`` would hold, attribute for attribute."""

    outcome: Brief
    variables: Sequence[Variable]
    blocks: Sequence[Block]
    extras: Sequence[Extra]
    attributes: Mapping[str, Any]

    @property
    def place(self) -> str:
        """Description of where the run is kept."""
        return "memory"

    @cached_property
    def dataset(self) -> "xarray.Dataset":
        """The dataset, in memory."""
        from rigidsim.store.reader import in_memory

        return in_memory(self.variables, self.blocks, self.extras, self.attributes)

    def concluded(self, outcome: Brief) -> Self:
        """The same run with another summary."""
        return replace(self, outcome=outcome)


@dataclass(frozen=True, repr=False)
class ShownRun(Run):
    """What isn't a run, shown as one; ``path``: where it is kept. ``notes``: how it was read."""

    path: Path
    outcome: Brief
    shown: "xarray.Dataset"
    notes: tuple[str, ...] = ()

    @property
    def place(self) -> str:
        """Where it is kept."""
        return str(self.path)

    @property
    def dataset(self) -> "xarray.Dataset":
        """As of a run."""
        return self.shown

    @property
    def files(self) -> list[Path]:
        """See ``Run``."""
        return [self.path]

    def concluded(self, outcome: Brief) -> Self:
        """Nothing is saved of it."""
        return self


def open_run(path: str | Path) -> SavedRun:
    """Open a run folder, or the dataset in one, finished or partial.

    Raises:
        RunFolderError: no run there, or a damaged summary.
    """
    found = folder_at(path)
    if isinstance(found, SweepFolder):
        what = Remedy("rigidsim info shows it, and rigidsim resume completes it", "use rigidsim.open_sweep")
        raise RunFolderError(f"{path}: is a sweep, no single run; {what}; its dataset.h5 holds all members")
    if isinstance(found, FitFolder):
        what = Remedy("rigidsim info and rigidsim view show it", "xarray.open_dataset reads its dataset.h5")
        raise RunFolderError(f"{path}: is a fit, no run; {what}; rigidsim run takes its fitted.toml")
    folder = find_run(path)
    return SavedRun(folder, folder.read_summary())


def _table(outcome: Brief, escape: Callable[[str], str]) -> str:
    """HTML table of a summary's warnings, attitude error and invariants, for a notebook."""
    if not isinstance(outcome, Summary):
        return f"<p>{escape(outcome.message)}</p>"
    lines = [f"warning: {escape(text)}" for text in outcome.warnings]
    accuracy = outcome.accuracy
    error, how = accuracy.estimated_attitude_error, "estimated"
    if accuracy.certified is not None:
        error, how = accuracy.certified, "certified"
    if error is not None:
        lines.append(f"attitude at the end: {how} error {error:.2g} rad")
    lines.append(f"{outcome.cost.steps} steps, {outcome.samples} samples, {outcome.precision} precision")
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{_short(kept.largest_drift)}</td>"
        f"<td>{_short(kept.final_drift)}</td><td>{_short(kept.bound)}</td></tr>"
        for name, kept in outcome.invariants.items()
    )
    heads = "".join(f"<th>{text}</th>" for text in ("invariant", "largest drift", "final", "bound"))
    return f"<p>{'<br>'.join(lines)}</p><table><tr>{heads}</tr>{rows}</table>"


def _short(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
