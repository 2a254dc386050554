"""One session of a run: integrate and save segments; if the run ended, complete its files; summarise."""

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from rigidsim.errors import VIEW, StoppedWritingError
from rigidsim.scene.schema import Output
from rigidsim.session import dataset, lyapunov
from rigidsim.session.diagnostics import Diagnostics, cheaper_model
from rigidsim.session.ending import chart_changes, closing_words, time_reached
from rigidsim.session.recorder import Checkpoints, Recorder, SampleStatistics
from rigidsim.session.session import Guards, Interruption, Observer, RunCost, Session
from rigidsim.session.summary import cost_so_far, summarise
from rigidsim.solve.assembly import assemble
from rigidsim.solve.effects.waypoints import SampleTrail
from rigidsim.solve.lyapunov import LyapunovSpectrum
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.sampler import Progress
from rigidsim.solve.status import Status
from rigidsim.store import provenance
from rigidsim.store.folder import RunFolder
from rigidsim.store.run import MemoryRun, MemoryWriter, Run, SavedRun
from rigidsim.store.segments import Arrays, Chain, SegmentWriter
from rigidsim.store.summary import Summary
from rigidsim.store.summary_parts import Cost
from rigidsim.store.variables import Extra


def execute(
    session: Session, prepared: InitialValueProblem, folder: RunFolder | None, chain: Chain | None = None
) -> Run:
    """Integrate to the end, or to whatever ends it, and complete the files, if there is a folder.

    Raises:
        RunFolderError: the folder can't be written, or the checkpoint belongs to another system.
    """
    run = _ActiveRun(session, prepared, folder, chain)
    with run.interruption.watching():
        run.integrate()
        spectrum = run.spectrum()
        found = run.diagnosed()
    summary = run.summarised(found, spectrum)
    extras = dataset.event_variables(prepared, run.parts.log, run.parts.evaluator, run.last_time)
    if spectrum is not None:
        extras += lyapunov.lyapunov_variables(spectrum)
    if isinstance(run.writer, MemoryWriter):
        unused = dataset.unused_variables(prepared, run.progress.steps)
        variables = [variable for variable in run.variables if variable.name not in unused]
        return MemoryRun(summary, variables, run.writer.blocks, extras, run.ended(summary))
    assert folder is not None
    if run.progress.status.final:
        summary = _completed(run, folder, run.writer, extras, summary)
    summary = summary.having(cost=run.cost())
    folder.write_summary(summary)
    return SavedRun(folder, summary)


class _ActiveRun:
    """A run under way in one session: its compiled parts, what records them, and where they stand."""

    def __init__(
        self, session: Session, prepared: InitialValueProblem, folder: RunFolder | None, chain: Chain | None
    ) -> None:
        self.session, self.prepared, self._folder = session, prepared, folder
        self.parts = parts = assemble(prepared)
        system, progress = prepared.system, Progress(prepared.clock.count)
        statistics = SampleStatistics([i.name for i in system.invariants], [r.name for r in system.recorded])
        trail = SampleTrail(prepared.precision)
        cost = RunCost(session.watch, progress)
        beside = None
        if prepared.sensitivity_keys:
            from rigidsim.session.sensitivity import Sensitivity  # which few runs need

            beside = Sensitivity(prepared)
        more = {} if beside is None else {"sensitivity": beside}
        self.checkpoints = Checkpoints(parts, statistics=statistics, cost=cost, trail=trail, **more)
        start = None if chain is None else self.checkpoints.restore(chain)
        self._run_id = os.urandom(8).hex() if chain is None else chain.run
        self.attributes = dataset.root_attributes(prepared, parts, self._run_id, session.mixed)
        self.variables = dataset.dataset_variables(prepared)
        self.writer: SegmentWriter | MemoryWriter = MemoryWriter()
        if folder is not None:
            described, limits = self.attributes, session.tuning.segments
            self.writer = SegmentWriter(folder.segments, self.variables, described, chain, limits)
        self.recorder = Recorder(
            prepared, parts.evaluator, self.writer, statistics, trail, self.checkpoints, start, beside
        )
        self.interruption = Interruption()
        if beside is not None:
            beside.go_on = self._wanted
        session.watch.next("build")
        session.observer.started(prepared, None if folder is None else folder.path)
        session.observer.phase("integrate")
        guards = Guards(prepared, statistics, self.interruption, session.observer)
        most = prepared.scene.config.limits.max_steps  # of natural steps; it starts anew in each session
        if most is not None and start is not None:
            most += start.steps
        pacing = session.tuning.pacing
        self.driver = parts.driver(self.recorder, guards, start, pacing, most, progress)
        if start is not None:
            session.observer.resumed(progress)

    @property
    def progress(self) -> Progress:
        """How far it is, and how it ended."""
        return self.driver.progress

    @property
    def last_time(self) -> float:
        """Time of the last sample, internal units."""
        return float(self.prepared.clock.at(self.prepared.clock.count - 1))

    def cost(self) -> Cost:
        """Cost of the run so far, all of its sessions together."""
        return cost_so_far(self.prepared, self.progress, self.session.watch)

    def save(self) -> None:
        """Save where it stands, to go on from there."""
        self.recorder.save(self.driver.position())

    def integrate(self) -> None:
        """Integrate to the end, or until something ends it, and save what isn't complete."""
        progress = self.driver.run()
        if not progress.status.final:
            self.save()
        self.session.watch.next("integrate_and_record")
        self.session.observer.progressed(progress)

    def spectrum(self) -> LyapunovSpectrum | None:
        """Lyapunov exponents, if they are asked for and the run reached its end."""
        if not self.prepared.scene.config.output.lyapunov or self.progress.status is not Status.FINISHED:
            return None
        session, spectrum = self.session, None
        session.observer.phase("lyapunov")
        with suppress(KeyboardInterrupt):  # while its equations were compiled
            seconds = session.tuning.segments.seconds
            spectrum = lyapunov.spectrum_of(
                self.prepared, self._folder, self._run_id, self.interruption, seconds
            )
        session.watch.next("lyapunov")
        self._heed_interruption()
        return spectrum

    def diagnosed(self) -> Diagnostics:
        """What the run tells of itself: drifts, and its errors if they are to be estimated."""
        prepared, session, parts = self.prepared, self.session, self.parts
        found = Diagnostics(prepared, self.progress, self.recorder.statistics)
        if not prepared.scene.config.output.estimate or not self.progress.status.final:
            return found
        trail = self.recorder.trail
        session.observer.phase("estimate")
        with self.interruption.dispensable():
            found = found.estimated(trail, parts.corrected, self._wanted, self.parts.stepper.errors)
            found = replace(found, cheaper=cheaper_model(found, session.tuning.advice, self._wanted))
        session.watch.next("estimate")
        if not prepared.system.formulation.resolves_rotation and self.progress.status is Status.FINISHED:
            session.observer.phase("modelling")
            with self.interruption.dispensable():
                found = found.modelled(trail, self._wanted)
            session.watch.next("modelling")
        self._heed_interruption()
        return found

    def _wanted(self) -> bool:
        """Whether nobody has asked for its end."""
        return not self.interruption.requested

    def _heed_interruption(self) -> None:
        """After what can be left out: the run is interrupted if that was asked for meanwhile."""
        if self.interruption.requested:
            self.progress.status = Status.INTERRUPTED
            self.save()

    def summarised(self, found: Diagnostics, spectrum: LyapunovSpectrum | None) -> Summary:
        """The summary without the digests of files that are still to be written."""
        prepared, progress, log = self.prepared, self.progress, self.parts.log
        crossings = enumerate(prepared.system.events)
        return summarise(
            found,
            spectrum,
            message=closing_words(prepared, progress, self.parts),
            remarks=self.session.remarks,
            initial=self.parts.evaluator.initial_invariants(),
            cost=self.cost(),
            attributes=self.attributes,
            time_reached=time_reached(prepared, progress, log),
            events={c.name: len(log.occurrences(index, self.last_time)) for index, c in crossings},
            event_times=dataset.event_times(prepared, log, self.last_time),
            chart_changes=chart_changes(prepared, self.parts),
        )

    def ended(self, summary: Summary) -> dict[str, Any]:
        """Attributes of the dataset."""
        wrapped_from = self.recorder.statistics.angles_wrapped_from
        return dataset.of_complete(self.attributes, summary, wrapped_from)


def _completed(
    run: _ActiveRun, folder: RunFolder, writer: SegmentWriter, extras: Sequence[Extra], summary: Summary
) -> Summary:
    """Complete the files of a run that has ended; after a Ctrl-C, leave a state that can be resumed from and
    return a summary that says so.
    """
    session = run.session
    last: tuple[Path, Arrays, Arrays] | None = None

    def conclude() -> None:
        """Write what remains once the dataset is in place and the segments are still there."""
        nonlocal summary
        summary = summary.having(cost=run.cost(), dataset_sha256=writer.dataset_sha256)
        folder.write_summary(summary)

    try:
        session.observer.phase("dataset")
        if run.progress.status is Status.FINISHED:
            position, kept = run.driver.position(), run.checkpoints
            last = folder.checkpoint, kept.packed(position), kept.events(position)
        unused = dataset.unused_variables(run.prepared, run.progress.steps)
        attributes = run.ended(summary)
        writer.complete(folder.dataset, attributes, extras, unused=unused, checkpoint=last, conclude=conclude)
        session.watch.next("dataset")
        output = run.prepared.scene.config.output
        summary = with_timeline(summary, folder, output, session.observer)
        if summary.timeline_sha256 is not None:
            session.watch.next("timeline")
    except KeyboardInterrupt:
        done = "the dataset is complete, the timeline is missing"
        if folder.segments.exists():
            run.save()
            done = "all samples are saved as segments"
        summary = summary.having(
            status=Status.INTERRUPTED.value,
            message=f"interrupted after the integration; {done}",
            exit_code=Status.INTERRUPTED.exit_code,
        )
    return summary


def with_timeline(summary: Summary, folder: RunFolder, output: Output, observer: Observer) -> Summary:
    """Draw a complete dataset's timeline, if requested; returns the summary with its digest."""
    if not output.timeline or not summary.samples:
        return summary
    from rigidsim.look.timeline import write_timeline
    from rigidsim.store.reader import open_dataset

    path = folder.timeline
    observer.phase("timeline")
    try:
        with open_dataset(folder.dataset, indexed=False) as found:
            write_timeline(found, path, rows=output.timeline_rows)
    except (OSError, RuntimeError) as error:  # rerun raises its own on a full disk
        why = error.strerror if isinstance(error, OSError) else None
        raise StoppedWritingError(
            f"{path}: can't be written: {why or error}; the dataset is complete, and {VIEW} draws "
            "the timeline once that is possible"
        ) from None
    return summary.having(timeline_sha256=provenance.file_sha256(path))
