"""One session of a run: integrate and save segments; if the run ended, complete its files; summarise."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass, field

from rigidsim.session.attributes import of_complete, root_attributes
from rigidsim.session.completion import Completion
from rigidsim.session.diagnostics import Diagnostics
from rigidsim.session.event_variables import event_counts, event_times, event_variables
from rigidsim.session.guards import Guards, Interruption, Observer
from rigidsim.session.recorder import Recorder
from rigidsim.session.restore import restore
from rigidsim.session.summary import chart_changes, closing_words, cost_so_far, summarise, time_reached
from rigidsim.session.timings import Effort, Phases
from rigidsim.session.tuning import Tuning
from rigidsim.session.variables import dataset_variables, unused_variables
from rigidsim.solve.assembly import assemble, sampler
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.status import Status
from rigidsim.store.folder import RunFolder
from rigidsim.store.memory import MemoryRun, MemoryWriter
from rigidsim.store.run import Run, SavedRun
from rigidsim.store.segments import Chain, SegmentWriter
from rigidsim.store.summary_parts import Caution


@dataclass
class Session:
    """The work of one process on a run: all of it, or what was left.

    Attributes:
        remarks: remarks for the summary on how the session began.
        mixed: what changed in versions or machine since the run began; empty if nothing did.
        effort, phases: cost of all sessions and of this one, including choosing and certifying.
        tuning: how often it checks and saves, and when it looks for a cheaper model.
    """

    observer: Observer
    remarks: list[Caution] = field(default_factory=list)
    mixed: str = ""
    effort: Effort = field(default_factory=Effort)
    phases: Phases = field(default_factory=Phases)
    tuning: Tuning = field(default_factory=Tuning)

    def another(self) -> Session:
        """Session for the next attempt after this one missed the accuracy; its cost includes this one's."""
        return Session(
            self.observer, effort=self.effort, phases=self.phases.begin_again(), tuning=self.tuning
        )

    def execute(
        self, prepared: InitialValueProblem, folder: RunFolder | None, chain: Chain | None = None
    ) -> Run:
        """Integrate to the end, or to whatever ends it, and complete the files.

        Args:
            folder: the run's folder; None for a run in memory.
            chain: segments to resume from, with the arrays of the last one's checkpoint.

        Raises:
            RunFolderError: the folder can't be written, or the checkpoint belongs to another system.
        """
        clock = self.phases
        parts = assemble(prepared)
        log, stepper, evaluator, corrected = parts.log, parts.stepper, parts.evaluator, parts.corrected
        resumed = None if chain is None else restore(chain, prepared, corrected, evaluator, log)
        run_id = os.urandom(8).hex() if chain is None else chain.run
        attributes = root_attributes(prepared, stepper, run_id, self.mixed)
        limits = self.tuning.segments
        variables = dataset_variables(prepared)
        writer: SegmentWriter | MemoryWriter = MemoryWriter()
        if folder is not None:
            writer = SegmentWriter(folder.segments, variables, attributes.as_dict(), chain, limits)
        recorder = Recorder(prepared, evaluator, writer, log, self.effort)
        interruption = Interruption()
        clock.next("build")
        self.observer.started(prepared, None if folder is None else folder.path)
        self.observer.phase("integrate")
        start = None if resumed is None else resumed.position
        guards = Guards(prepared, recorder.statistics, interruption, self.observer)
        most_steps = prepared.scene.config.limits.max_steps
        if most_steps is not None and start is not None:  # the limit starts anew in each session
            most_steps += start.boundary.mark.steps
        loop = sampler(prepared, parts, recorder, guards, start, self.tuning.pacing, most_steps)
        recorder.progress = loop.progress
        if resumed is not None:
            recorder.restore(resumed.statistics)
            self.observer.resumed(loop.progress)
        with interruption.watching():
            progress = loop.run()
            if not progress.status.final:
                recorder.save(loop.position())
            clock.next("integrate_and_record")
            self.observer.progressed(progress)
            spectrum = None
            if prepared.scene.config.output.lyapunov and progress.status is Status.FINISHED:
                from rigidsim.session.lyapunov import spectrum_of

                self.observer.phase("lyapunov")
                with suppress(KeyboardInterrupt):  # while its equations were compiled
                    spectrum = spectrum_of(prepared, folder, run_id, interruption, limits.seconds)
                clock.next("lyapunov")
                if interruption.requested:
                    progress.status = Status.INTERRUPTED
                    recorder.save(loop.position())
            found = Diagnostics(prepared, progress, recorder.statistics)
            if prepared.scene.config.output.estimate and progress.status.final:
                self.observer.phase("estimate")
                with interruption.dispensable():
                    found = found.estimated(
                        recorder.trail,
                        stepper,
                        corrected.waypoints,
                        lambda: not interruption.requested,
                    )
                    found = found.compared(self.tuning.advice, lambda: not interruption.requested)
                clock.next("estimate")
                if prepared.system.plan.average is not None and progress.status is Status.FINISHED:
                    self.observer.phase("modelling")
                    with interruption.dispensable():
                        found = found.modelled(recorder.trail, lambda: not interruption.requested)
                    clock.next("modelling")
                if interruption.requested:
                    progress.status = Status.INTERRUPTED
                    recorder.save(loop.position())
        clock.engine(progress.integration_seconds)
        last = float(prepared.clock.at(prepared.clock.count - 1))
        summary = summarise(
            found,
            spectrum,
            message=closing_words(prepared, progress, evaluator, log),
            remarks=self.remarks,
            initial=evaluator.initial_invariants(),
            cost=cost_so_far(prepared, progress, clock, self.effort),
            attributes=attributes,
            time_reached=time_reached(prepared, progress, log),
            events=event_counts(prepared, log, last),
            event_times=event_times(prepared, log, last),
            chart_changes=chart_changes(prepared, corrected),
        )
        extras = event_variables(prepared, log, evaluator, last)
        if spectrum is not None:
            from rigidsim.session.lyapunov import lyapunov_variables

            extras += lyapunov_variables(spectrum)
        unused = unused_variables(prepared, progress.steps)
        if isinstance(writer, MemoryWriter):
            variables = [variable for variable in variables if variable.name not in unused]
            wrapped_from = recorder.statistics.angles_wrapped_from
            ended = of_complete(attributes, summary, self.effort, wrapped_from)
            return MemoryRun(summary, variables, writer.blocks, extras, ended.as_dict())
        assert folder is not None
        if progress.status.final:
            summary = Completion(
                prepared, folder, writer, recorder, loop, attributes, extras, clock, self.effort,
                self.observer, unused, summary,
            ).complete()  # fmt: skip
        summary = summary.having(cost=cost_so_far(prepared, progress, clock, self.effort))
        folder.write_summary(summary)
        return SavedRun(folder, summary)
