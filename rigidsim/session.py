"""One session of a run: integrate, save segments, complete the dataset, draw the timeline, summarise."""

from __future__ import annotations

import json
import secrets
from dataclasses import dataclass, field
from typing import Any

import rigidsim.summary as summaries
from rigidsim import labels
from rigidsim.archive import Run
from rigidsim.assembly import assemble
from rigidsim.crossings import event_counts, event_variables
from rigidsim.errors import StoppedWritingError
from rigidsim.guards import Guards, Interruption, Observer
from rigidsim.phases import ENGINE, Phases
from rigidsim.prepare import Prepared, motion_growth
from rigidsim.recorder import Effort, Recorder
from rigidsim.restoring import Resumed, restore
from rigidsim.solve.advance import Advance
from rigidsim.solve.closed.direct import Direct
from rigidsim.solve.status import Status
from rigidsim.spectra import spectrum_of
from rigidsim.store import provenance
from rigidsim.store.folder import RunFolder
from rigidsim.store.opening import open_dataset
from rigidsim.store.segments import Chain, SegmentWriter


@dataclass
class Session:
    """One process's work on a run: the whole of it, or what was left.

    Attributes:
        remarks: for the summary, on how the session began.
        mixed: why the parts of this run can't be promised to be one run's bits; empty where they can.
        effort, phases: what the run has cost, all its sessions and this one; choosing and certifying count.
    """

    observer: Observer
    remarks: list[str] = field(default_factory=list)
    mixed: str = ""
    effort: Effort = field(default_factory=Effort)
    phases: Phases = field(default_factory=Phases)

    def another(self) -> Session:
        """For the next attempt where this one didn't keep the accuracy; its cost is part of that one's."""
        return Session(self.observer, effort=self.effort, phases=self.phases.begin_again())

    def execute(self, prepared: Prepared, folder: RunFolder, chain: Chain | None = None) -> Run:
        """Integrate to the end, or to whatever ends it, and complete the files.

        Args:
            chain: segments to go on from, with the arrays of the last one's checkpoint.

        Raises:
            RunFolderError: the folder can't be written, or the checkpoint belongs to another system.
        """
        clock = self.phases
        parts = assemble(prepared)
        log, stepper, evaluator, rhythm = parts.log, parts.stepper, parts.evaluator, parts.rhythm
        growth = motion_growth(prepared)
        resumed: Resumed | None = None
        if chain is not None:
            resumed = restore(chain, prepared, rhythm, evaluator, log)
        attributes = labels.root_attributes(
            prepared, stepper, chain.run if chain is not None else secrets.token_hex(8)
        )
        if self.mixed:
            attributes["mixed_provenance"] = self.mixed
        writer = SegmentWriter(folder.segments, prepared.variables(), attributes, chain)
        recorder = Recorder(prepared, evaluator, writer, log, self.effort)
        interruption = Interruption()
        clock.next("build")
        self.observer.started(prepared, folder.path)
        self.observer.phase("integrate")
        before = 0 if resumed is None else resumed.checkpoint.place.mark.steps
        guards = Guards(prepared, recorder.watch, interruption, self.observer, steps_before=before)
        start = None if resumed is None else resumed.checkpoint
        advance: Advance | Direct
        if prepared.closed is not None:
            grid = (prepared.clock, prepared.precision)
            advance = Direct(prepared.closed, prepared.system, rhythm, *grid, recorder, guards, start)
        else:
            advance = Advance(rhythm, prepared.clock, prepared.precision, recorder, guards, start)
        recorder.progress = advance.progress
        if resumed is not None:
            recorder.restore(resumed.arrays, advance.progress)
        with interruption.watching():
            progress = advance.run()
            if not progress.status.final:
                recorder.save(advance.checkpoint())
            clock.next("integrate_and_record")
            self.observer.progressed(progress)
            spectrum = None
            if prepared.scene.config.output.lyapunov and progress.status is Status.FINISHED:
                self.observer.phase("lyapunov")
                spectrum = spectrum_of(prepared, folder, str(attributes["run_id"]), interruption)
                clock.next("lyapunov")
                if interruption.requested:
                    progress.status = Status.INTERRUPTED
                    recorder.save(advance.checkpoint())
        summary = summaries.summarise(
            prepared,
            progress,
            recorder.watch,
            growth,
            spectrum,
            message=labels.closing_words(prepared, progress, evaluator),
            initial=evaluator.initial_invariants(),
            seconds=clock.wall,
            cpu_seconds=self.effort.cpu,
            provenance=labels.repeated(attributes),
            remarks=self.remarks,
            mixed=self.mixed,
        )
        last = float(prepared.clock.at(prepared.clock.count - 1))
        summary["events"] = event_counts(prepared, log, last)
        summary["chart_changes"] = labels.chart_changes(prepared, rhythm)
        summary["cost"]["cpu_by_phase"] = clock.cpu
        summary["cost"]["sessions"] = self.effort.sessions
        summary["cost"]["seconds"][ENGINE] = progress.integration_seconds
        if progress.status.final:
            extras = event_variables(prepared, log, evaluator, last) + labels.lyapunov_variables(spectrum)
            finish = _Completion(prepared, folder, writer, recorder, advance, attributes, self.effort)
            finish.complete(summary, extras, clock, self.observer)
        summary["cost"]["cpu_seconds"] = self.effort.cpu
        summary["cost"]["wall_seconds"] = self.effort.wall
        folder.write_summary(summary)
        return Run(folder, json.loads(json.dumps(summary, default=str)))


@dataclass
class _Completion:
    """Segments to dataset, dataset to timeline."""

    prepared: Prepared
    folder: RunFolder
    writer: SegmentWriter
    recorder: Recorder
    advance: Advance | Direct
    attributes: dict[str, Any]
    effort: Effort

    def complete(self, summary: dict[str, Any], extras: list[Any], clock: Phases, observer: Observer) -> None:
        """Write the files; a Ctrl-C leaves what can be gone on from, and says so in the summary."""
        try:
            self._write(summary, extras, clock, observer)
        except KeyboardInterrupt:
            kept = "the dataset is complete, the timeline is missing"
            if self.folder.segments.exists():
                self.recorder.save(self.advance.checkpoint())
                kept = "all samples are saved as segments"
            summary |= {"status": Status.INTERRUPTED.value, "exit_code": Status.INTERRUPTED.exit_code}
            summary["message"] = f"interrupted after the integration; {kept}"

    def _write(self, summary: dict[str, Any], extras: list[Any], clock: Phases, observer: Observer) -> None:
        observer.phase("dataset")
        folder, progress = self.folder, self.advance.progress
        final = {
            **self.attributes,
            "status": summary["status"],
            "status_message": summary["message"],
            "warnings": "\n".join(summary["warnings"]),
            "steps": progress.steps,
            "wall_seconds": self.effort.wall,
            "cpu_seconds": self.effort.cpu,
            "finished_at": provenance.now(),
        }
        if self.prepared.holds_invariants:
            rows = summary["invariants"].items()
            final["put_back"] = json.dumps({name: row["put_back"] for name, row in rows})
        checkpoint = None
        if progress.status is Status.FINISHED:
            arrays = self.recorder.packed(self.advance.checkpoint())
            checkpoint = folder.checkpoint, arrays, self.recorder.all_events()

        def conclude() -> None:
            summary["dataset_sha256"] = self.writer.dataset_sha256
            folder.write_summary(summary)

        self.writer.complete(folder.dataset, final, extras, checkpoint=checkpoint, conclude=conclude)
        clock.next("dataset")
        output = self.prepared.scene.config.output
        if output.timeline and summary["samples"]:
            observer.phase("timeline")
            self._draw(output.timeline_rows)
            summary["timeline_sha256"] = provenance.file_sha256(folder.timeline)
            clock.next("timeline")

    def _draw(self, rows: int) -> None:
        from rigidsim.look.timeline import write_timeline

        path = self.folder.timeline
        try:
            with open_dataset(self.folder.dataset, indexed=False) as dataset:  # memory goes with the rows
                write_timeline(dataset, path, rows=rows)
        except (OSError, RuntimeError) as error:  # rerun raises its own on a full disk
            why = error.strerror if isinstance(error, OSError) else None
            raise StoppedWritingError(
                f"{path}: can't be written: {why or error}; the dataset is complete, and rigidsim view draws "
                "the timeline once that is possible"
            ) from None
