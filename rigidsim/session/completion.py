"""Completing a run's files: segments to dataset, dataset to timeline, and the summary beside them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rigidsim.errors import VIEW, StoppedWritingError
from rigidsim.scene.schema import Output
from rigidsim.session.active_run import ActiveRun
from rigidsim.session.attributes import of_complete
from rigidsim.session.guards import Observer
from rigidsim.session.session import Session
from rigidsim.solve.status import Status
from rigidsim.store import provenance
from rigidsim.store.attributes import RootAttributes
from rigidsim.store.folder import RunFolder
from rigidsim.store.segments import SegmentWriter
from rigidsim.store.summary import Summary
from rigidsim.store.variables import Extra

if TYPE_CHECKING:
    from rigidsim.look.thinning import KeptRows


@dataclass
class Completion:
    """Completes the files of a run that has ended.

    Attributes:
        unused: names of variables along time that the dataset leaves out.
        summary: without the files' digests at first; replaced as they become known.
    """

    session: Session
    run: ActiveRun
    folder: RunFolder
    writer: SegmentWriter
    extras: Sequence[Extra]
    unused: Collection[str]
    summary: Summary

    def complete(self) -> Summary:
        """Write the files; after a Ctrl-C, leave a state that can be resumed from and return a summary that
        says so.
        """
        try:
            self._write_dataset()
            self._draw_timeline()
        except KeyboardInterrupt:
            kept = "the dataset is complete, the timeline is missing"
            if self.folder.segments.exists():
                self.run.save()
                kept = "all samples are saved as segments"
            self.summary = self.summary.having(
                status=Status.INTERRUPTED.value,
                message=f"interrupted after the integration; {kept}",
                exit_code=Status.INTERRUPTED.exit_code,
            )
        return self.summary

    def _write_dataset(self) -> None:
        self.session.observer.phase("dataset")
        checkpoint, kept = None, self.run.checkpoints
        if self.run.progress.status is Status.FINISHED:
            position = self.run.driver.position()
            arrays, events = kept.packed(position), kept.events(position)
            checkpoint = self.folder.checkpoint, arrays, events
        self.writer.complete(
            self.folder.dataset,
            self._attributes().as_dict(),
            self.extras,
            unused=self.unused,
            checkpoint=checkpoint,
            conclude=self._conclude,
        )
        self.session.phases.next("dataset")

    def _attributes(self) -> RootAttributes:
        wrapped_from = self.run.recorder.statistics.angles_wrapped_from
        return of_complete(self.run.attributes, self.summary, self.session.effort, wrapped_from)

    def _conclude(self) -> None:
        """Write what remains once the dataset is in place and the segments are still there."""
        cost = self.run.cost(self.session)
        self.summary = self.summary.having(cost=cost, dataset_sha256=self.writer.dataset_sha256)
        self.folder.write_summary(self.summary)

    def _draw_timeline(self) -> None:
        self.summary = with_timeline(
            self.summary,
            self.folder,
            self.run.prepared.scene.config.output,
            self.session.observer,
            self.run.recorder.kept,
        )
        if self.summary.timeline_sha256 is not None:
            self.session.phases.next("timeline")


def with_timeline(
    summary: Summary,
    folder: RunFolder,
    output: Output,
    observer: Observer,
    kept: KeptRows | None = None,
) -> Summary:
    """Draw a complete dataset's timeline, if requested; returns the summary with its digest."""
    if not output.timeline or not summary.samples:
        return summary
    from rigidsim.look.timeline import write_timeline
    from rigidsim.store.reader import open_dataset

    path = folder.timeline
    observer.phase("timeline")
    try:
        with open_dataset(folder.dataset, indexed=False) as dataset:
            write_timeline(dataset, path, rows=output.timeline_rows, kept=kept)
    except (OSError, RuntimeError) as error:  # rerun raises its own on a full disk
        why = error.strerror if isinstance(error, OSError) else None
        raise StoppedWritingError(
            f"{path}: can't be written: {why or error}; the dataset is complete, and {VIEW} draws "
            "the timeline once that is possible"
        ) from None
    return summary.having(timeline_sha256=provenance.file_sha256(path))
