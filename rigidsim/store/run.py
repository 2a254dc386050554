"""Runs, finished or partial, opened for reading."""

from __future__ import annotations

import sys
from abc import abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from rigidsim.errors import FORCE, RESUME, RunFolderError, either
from rigidsim.store import provenance, segments, viewing
from rigidsim.store.folder import RunFolder, find_run
from rigidsim.store.joined_segments import join_segments
from rigidsim.store.seal import check_whole, read_seal
from rigidsim.store.summary import Brief, Summary
from rigidsim.store.validated_open import open_dataset
from rigidsim.store.variables import SCHEMA_VERSION

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


class Run:
    """The result of a run, wherever its numbers are kept.

    Attributes:
        outcome: the contents of its summary; a ``Summary`` if the run ended.
    """

    outcome: Brief

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The content of ``summary.json``."""
        return self.outcome.as_dict()

    @property
    def status(self) -> str:
        """How it ended; ``"finished"`` is the only complete one."""
        return self.outcome.status

    @property
    @abstractmethod
    def place(self) -> str:
        """Description of where the run is kept."""

    @property
    @abstractmethod
    def dataset(self) -> xarray.Dataset:
        """The labelled dataset."""

    def plot(self, what: str = "overview") -> Figure:
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

    @abstractmethod
    def view(self, *, web: bool = False) -> int:
        """Open the timeline in the viewer or the browser and wait until it is closed; returns the exit code.

        Raises:
            RunFolderError: the timeline can't be drawn, or no viewer is installed.
        """

    @abstractmethod
    def concluded(self, outcome: Brief) -> Self:
        """The same run with the given summary, saved where the run is kept."""

    def __repr__(self) -> str:
        return f"<Run {self.outcome.name!r} ({self.place}): {self.status}>"

    def _repr_html_(self) -> str:
        import html

        title = f"{html.escape(self.outcome.name)}: {html.escape(self.status)}"
        return f"<b>{title}</b> ({html.escape(self.place)}){_table(self.outcome)}"


@dataclass(frozen=True, repr=False)
class SavedRun(Run):
    """A run on disk, finished or partial.

    Attributes:
        folder: its files.
        outcome: the contents of ``summary.json``; a ``Summary`` if the run ended.
    """

    folder: RunFolder
    outcome: Brief

    @property
    def place(self) -> str:
        """Path of the run's folder."""
        return str(self.folder.path)

    def view(self, *, web: bool = False) -> int:
        """See ``Run``; a timeline that had to be drawn is kept in the folder."""
        return viewing.view(self, self.folder, web=web)

    def concluded(self, outcome: Brief) -> Self:
        """The same run with the given summary, which is written."""
        self.folder.write_summary(outcome)
        return replace(self, outcome=outcome)

    @property
    def saved(self) -> bool:
        """Whether anything was saved that ``dataset`` could read."""
        return self.folder.dataset.exists() or bool(segments.segment_paths(self.folder.segments))

    @property
    def dataset(self) -> xarray.Dataset:
        """The dataset, read lazily; for an unfinished run, what its segments hold.

        Raises:
            RunFolderError: nothing was saved, or a file is damaged.
        """
        return self.opened()

    def refuse_damaged(self) -> None:
        """Check a complete dataset against its seal and the summary, which reads the whole file.

        Raises:
            RunFolderError: it is damaged, edited, or another run's.
        """
        if self.folder.dataset.exists():
            # a run completed again after a crash still has the summary of the first time, or none
            claimed = None if self.folder.segments.exists() else self.outcome.dataset_digest
            _refuse_damaged(self.folder.dataset, claimed)

    def opened(self, *, indexed: bool = True) -> xarray.Dataset:
        """The dataset as in ``dataset``; without ``indexed``, sample times aren't loaded and can't be
        selected by.

        Raises:
            RunFolderError: nothing was saved, or a file is damaged.
        """
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
        return join_segments(chain.paths, status=self.status, indexed=indexed)


def _refuse_damaged(path: Path, expected: str | None) -> None:
    """Check a dataset's seal; datasets of the first schema version have none.

    Args:
        expected: SHA-256 of the file, if the summary beside it gives one.

    Raises:
        RunFolderError: the file is damaged, edited, replaced, or of a newer version than this rigidsim.
    """
    try:
        unsealed = read_seal(path) is None
        digest = provenance.file_sha256(path) if unsealed else check_whole(path)[1]
    except OSError as error:
        raise RunFolderError(f"{path}: can't be read: {error.strerror or error}") from None
    labels = segments.root_attributes(path)
    version = labels.get("schema_version")
    if not isinstance(version, int) or version > SCHEMA_VERSION:
        raise RunFolderError(
            f"{path}: has schema version {version}; this rigidsim reads versions up to {SCHEMA_VERSION}; "
            "install a newer one"
        )
    if version > 1 and unsealed:
        raise RunFolderError(f"{path}: is torn or was edited: its end holds no seal of rigidsim")
    if "segment" in labels:
        raise RunFolderError(f"{path}: is a segment of an unfinished run, no complete dataset")
    if expected not in (None, digest):
        raise RunFolderError(f"{path}: isn't the dataset that summary.json beside it was written for")


def open_run(path: str | Path) -> SavedRun:
    """Open a run folder, or the dataset in one, finished or partial.

    Raises:
        RunFolderError: no run there, or a damaged summary.
    """
    from rigidsim.store.sweeps.folder import is_sweep

    if is_sweep(path):
        what = either("rigidsim info shows it, and rigidsim resume completes it", "use rigidsim.open_sweep")
        raise RunFolderError(f"{path}: is a sweep, no single run; {what}; its dataset.h5 holds all members")
    folder = find_run(path)
    return SavedRun(folder, folder.read_summary())


def _table(outcome: Brief) -> str:
    """HTML table of a summary's warnings, attitude error and invariants, for a notebook."""
    import html

    if not isinstance(outcome, Summary):
        return f"<p>{html.escape(outcome.message)}</p>"
    lines = [f"warning: {html.escape(text)}" for text in outcome.warnings]
    accuracy = outcome.accuracy
    error, how = accuracy.estimated_attitude_error, "estimated"
    if accuracy.certified is not None:
        error, how = accuracy.certified, "certified"
    if error is not None:
        lines.append(f"attitude at the end: {how} error {error:.2g} rad")
    lines.append(f"{outcome.cost.steps} steps, {outcome.samples} samples, {outcome.precision} precision")
    rows = "".join(
        f"<tr><td>{html.escape(name)}</td><td>{_short(kept.largest_drift)}</td>"
        f"<td>{_short(kept.final_drift)}</td><td>{_short(kept.bound)}</td></tr>"
        for name, kept in outcome.invariants.items()
    )
    heads = "".join(f"<th>{text}</th>" for text in ("invariant", "largest drift", "final", "bound"))
    return f"<p>{'<br>'.join(lines)}</p><table><tr>{heads}</tr>{rows}</table>"


def _short(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
