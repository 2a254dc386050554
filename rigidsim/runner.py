"""Running an experiment: integrate, save segments, complete the dataset, draw the timeline, summarise."""

from __future__ import annotations

import json
import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import rigidsim.summary as summaries
from rigidsim import labels
from rigidsim.accuracy import chosen, is_open
from rigidsim.archive import Run
from rigidsim.assembly import assemble
from rigidsim.certify import certified
from rigidsim.crossings import event_counts, event_variables
from rigidsim.guards import Guards, Interruption, Observer
from rigidsim.prepare import Prepared, motion_growth, prepare
from rigidsim.recorder import Effort, Recorder
from rigidsim.restoring import Resumed, restore
from rigidsim.scene.reading import Experiment, load
from rigidsim.solve.advance import Advance
from rigidsim.solve.closed.direct import Direct
from rigidsim.solve.status import Status
from rigidsim.spectra import spectrum_of
from rigidsim.store import netcdf, provenance
from rigidsim.store.folder import RunFolder
from rigidsim.store.opening import open_dataset
from rigidsim.store.segments import Chain, SegmentWriter
from rigidsim.trial import Setting

if TYPE_CHECKING:
    from rigidsim.model.loads import LoadModel


def run(
    experiment: Experiment | str | Path,
    *,
    out: str | Path = "runs",
    force: bool = False,
    observer: Observer | None = None,
    loads: Sequence[LoadModel] = (),
) -> Run:
    """Run an experiment and save it in ``out/<name>/``.

    Args:
        experiment: from ``load``, or the path of a config.
        out: folder of the run folders.
        force: replace a run of the same name.
        observer: is told how it goes.
        loads: loads of one's own, beside those of the config, which alone can't reproduce the run then.

    Returns:
        The run; its ``status`` tells how it ended, which need not be "finished".

    Raises:
        ConfigError: the config can't be run; nothing was written.
        RunFolderError: the run folder is in use or can't be written.
    """
    if not isinstance(experiment, Experiment):
        experiment = load(experiment)
    observer = observer or Observer()
    beyond: Setting | None = None
    while True:
        setting, choice = chosen(experiment, loads=loads, beyond=beyond)
        session = Session(observer)
        prepared = prepare(setting, loads=loads)
        folder = RunFolder(Path(out) / prepared.scene.name)
        with folder.locked():
            folder.create(force=force or beyond is not None)
            netcdf.write_bytes(folder.config, setting.text.encode())
            folder.segments.mkdir()  # the mark of a run that isn't finished
            result, kept = certified(session.execute(prepared, folder), setting, choice, observer, loads)
        if kept or choice is None or not is_open(experiment, choice, loads):
            return result
        beyond = choice.setting


@dataclass
class Session:
    """One process's work on a run: the whole of it, or what was left.

    Attributes:
        remarks: for the summary, on how the session began.
        mixed: why the parts of this run can't be promised to be one run's bits; empty where they can.
    """

    observer: Observer
    remarks: list[str] = field(default_factory=list)
    mixed: str = ""
    effort: Effort = field(default_factory=Effort)

    def execute(self, prepared: Prepared, folder: RunFolder, chain: Chain | None = None) -> Run:
        """Integrate to the end, or to whatever ends it, and complete the files.

        Args:
            chain: segments to go on from, with the arrays of the last one's checkpoint.

        Raises:
            RunFolderError: the folder can't be written, or the checkpoint belongs to another system.
        """
        clock = _Phases()
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
            seconds=clock.seconds,
            cpu_seconds=self.effort.cpu,
            provenance=labels.repeated(attributes),
            remarks=self.remarks,
            mixed=self.mixed,
            put_back={} if parts.holder is None else parts.holder.drifts_put_back(),
        )
        last = float(prepared.clock.at(prepared.clock.count - 1))
        summary["events"] = event_counts(prepared, log, last)
        summary["chart_changes"] = labels.chart_changes(prepared, rhythm)
        summary["cost"]["sessions"] = self.effort.sessions
        summary["cost"]["seconds"]["engine"] = progress.integration_seconds
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

    def complete(
        self, summary: dict[str, Any], extras: list[Any], clock: _Phases, observer: Observer
    ) -> None:
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

    def _write(self, summary: dict[str, Any], extras: list[Any], clock: _Phases, observer: Observer) -> None:
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
            from rigidsim.look.timeline import write_timeline

            with open_dataset(folder.dataset, indexed=False) as dataset:  # memory goes with the rows shown
                write_timeline(dataset, folder.timeline, rows=output.timeline_rows)
            clock.next("timeline")


class _Phases:
    """Wall seconds of each phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._since = time.perf_counter()

    def next(self, finished: str) -> None:
        """Close the phase that was under way."""
        now = time.perf_counter()
        self.seconds[finished] = now - self._since
        self._since = now
