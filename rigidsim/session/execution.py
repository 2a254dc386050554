"""One session of a run: integrate and save segments; if the run ended, complete its files; summarise."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
from typing import TYPE_CHECKING

from rigidsim.session.active_run import ActiveRun
from rigidsim.session.attributes import of_complete
from rigidsim.session.completion import Completion
from rigidsim.session.diagnostics import Diagnostics
from rigidsim.session.event_variables import event_counts, event_times, event_variables
from rigidsim.session.session import Session
from rigidsim.session.summary import chart_changes, closing_words, summarise, time_reached
from rigidsim.session.variables import unused_variables
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.status import Status
from rigidsim.store.folder import RunFolder
from rigidsim.store.memory import MemoryRun, MemoryWriter
from rigidsim.store.run import Run, SavedRun
from rigidsim.store.segments import Chain
from rigidsim.store.summary import Summary
from rigidsim.store.variables import Extra

if TYPE_CHECKING:
    from rigidsim.solve.lyapunov import LyapunovSpectrum


def execute(
    session: Session, prepared: InitialValueProblem, folder: RunFolder | None, chain: Chain | None = None
) -> Run:
    """Integrate to the end, or to whatever ends it, and complete the files.

    Args:
        folder: the run's folder; None for a run in memory.
    """
    run = ActiveRun.begun(session, prepared, folder, chain)
    with run.interruption.watching():
        _integrate(session, run)
        spectrum = _spectrum(session, run)
        found = _diagnosed(session, run)
    summary, extras = _summarised(session, run, found, spectrum)
    unused = unused_variables(prepared, run.progress.steps)
    if isinstance(run.writer, MemoryWriter):
        return _in_memory(session, run, run.writer, summary, extras, unused)
    assert folder is not None
    if run.progress.status.final:
        summary = Completion(session, run, folder, run.writer, extras, unused, summary).complete()
    summary = summary.having(cost=run.cost(session))
    folder.write_summary(summary)
    return SavedRun(folder, summary)


def _integrate(session: Session, run: ActiveRun) -> None:
    progress = run.driver.run()
    if not progress.status.final:
        run.save()
    session.phases.next("integrate_and_record")
    session.observer.progressed(progress)


def _spectrum(session: Session, run: ActiveRun) -> LyapunovSpectrum | None:
    """Lyapunov exponents, if they are asked for and the run reached its end."""
    if not run.prepared.scene.config.output.lyapunov or run.progress.status is not Status.FINISHED:
        return None
    from rigidsim.session.lyapunov import spectrum_of

    session.observer.phase("lyapunov")
    spectrum = None
    with suppress(KeyboardInterrupt):  # while its equations were compiled
        seconds = session.tuning.segments.seconds
        spectrum = spectrum_of(run.prepared, run.folder, run.run_id, run.interruption, seconds)
    session.phases.next("lyapunov")
    _heed_interruption(run)
    return spectrum


def _diagnosed(session: Session, run: ActiveRun) -> Diagnostics:
    """What the run tells of itself: drifts, and its errors if they are to be estimated."""
    found = Diagnostics(run.prepared, run.progress, run.recorder.statistics)
    if not run.prepared.scene.config.output.estimate or not run.progress.status.final:
        return found
    trail, parts = run.recorder.trail, run.parts
    session.observer.phase("estimate")
    with run.interruption.dispensable():
        found = found.estimated(trail, parts.corrected, run.wanted, run.driver.solver.errors)
        found = found.compared(session.tuning.advice, run.wanted)
    session.phases.next("estimate")
    if run.prepared.system.plan.average is not None and run.progress.status is Status.FINISHED:
        session.observer.phase("modelling")
        with run.interruption.dispensable():
            found = found.modelled(trail, run.wanted)
        session.phases.next("modelling")
    _heed_interruption(run)
    return found


def _heed_interruption(run: ActiveRun) -> None:
    """After what can be left out: the run is interrupted if that was asked for meanwhile."""
    if run.interruption.requested:
        run.progress.status = Status.INTERRUPTED
        run.save()


def _summarised(
    session: Session, run: ActiveRun, found: Diagnostics, spectrum: LyapunovSpectrum | None
) -> tuple[Summary, list[Extra]]:
    """The summary, and the variables with dimensions of their own."""
    prepared, progress = run.prepared, run.progress
    log, evaluator = run.parts.log, run.parts.evaluator
    session.phases.engine(progress.integration_seconds)
    summary = summarise(
        found,
        spectrum,
        message=closing_words(prepared, progress, run.parts),
        remarks=session.remarks,
        initial=evaluator.initial_invariants(),
        cost=run.cost(session),
        attributes=run.attributes,
        time_reached=time_reached(prepared, progress, log),
        events=event_counts(prepared, log, run.last_time),
        event_times=event_times(prepared, log, run.last_time),
        chart_changes=chart_changes(prepared, run.parts),
    )
    extras = list(event_variables(prepared, log, evaluator, run.last_time))
    if spectrum is not None:
        from rigidsim.session.lyapunov import lyapunov_variables

        extras += lyapunov_variables(spectrum)
    return summary, extras


def _in_memory(
    session: Session,
    run: ActiveRun,
    writer: MemoryWriter,
    summary: Summary,
    extras: list[Extra],
    unused: Collection[str],
) -> MemoryRun:
    variables = [variable for variable in run.variables if variable.name not in unused]
    wrapped_from = run.recorder.statistics.angles_wrapped_from
    ended = of_complete(run.attributes, summary, session.effort, wrapped_from)
    return MemoryRun(summary, variables, writer.blocks, extras, ended.as_dict())
