"""Running an experiment: choose what the config leaves to be chosen, run, certify, and retry on failure."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, overload

from rigidsim.accuracy.choice import Choice, chosen
from rigidsim.accuracy.models.level import choose_level
from rigidsim.accuracy.setting import Setting, leaves_choice, wanted
from rigidsim.errors import ConfigError
from rigidsim.model.load import Load
from rigidsim.scene.choices import AUTO, FULL
from rigidsim.session.dataset import refuse_taken_names
from rigidsim.session.execution import execute
from rigidsim.session.progress import watched
from rigidsim.session.session import Observer, Session, Tuning
from rigidsim.session.storage import refuse_too_large, refuse_too_large_for_memory
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.store.folder import RunFolder
from rigidsim.store.run import MemoryRun, Run, SavedRun
from rigidsim.store.summary_parts import WarningCode
from rigidsim.workflows.certify import certified
from rigidsim.workflows.read import Experiment, Given, as_experiment


@overload
def run(
    experiment: Given,
    *,
    changes: Mapping[str, Any] | None = ...,
    out: str | Path = ...,
    force: bool = ...,
    observer: Observer | None = ...,
    progress: bool | None = ...,
    loads: Sequence[Load] = ...,
    tuning: Tuning | None = ...,
) -> SavedRun: ...


@overload
def run(
    experiment: Given,
    *,
    changes: Mapping[str, Any] | None = ...,
    out: None,
    observer: Observer | None = ...,
    progress: bool | None = ...,
    loads: Sequence[Load] = ...,
    tuning: Tuning | None = ...,
) -> MemoryRun: ...


def run(
    experiment: Given,
    *,
    changes: Mapping[str, Any] | None = None,
    out: str | Path | None = "runs",
    force: bool = False,
    observer: Observer | None = None,
    progress: bool | None = None,
    loads: Sequence[Load] = (),
    tuning: Tuning | None = None,
) -> Run:
    """Run an experiment and save it in ``out/<name>/``, or keep it in memory.

    Args:
        experiment: from ``load`` or ``Experiment.from_dict``, the path of a config, or a dictionary.
        changes: values to replace, ``{"time.end": 10}``, as for ``Experiment.replace``.
        out: folder of the run folders; None: nothing is written, and the run's ``dataset`` is in memory.
        force: replace a run of the same name.
        observer: receives the run's progress.
        progress: whether to show a progress bar; None: only in notebooks.
        loads: your own loads besides the config's, which then can't reproduce the run by itself.
        tuning: how often to check and save, and when to look for a cheaper model; no bit depends on it.

    Returns:
        The run; its ``status`` tells how it ended, which need not be "finished".

    Raises:
        ConfigError: the config can't be run; nothing was written.
        RunFolderError: the run folder is in use or can't be written, or the run doesn't fit on its disk or in
            memory.
    """
    experiment, failed = as_experiment(experiment, changes), list[str]()
    with watched(observer, progress) as watching:

        def once(level: Experiment) -> Run:
            session = Session(watching, tuning=tuning or Tuning())
            return _run(level, session, out, force or bool(failed), loads)

        while experiment.config.model.level == AUTO:  # the cheapest whose error is within the accuracy
            watching.choosing(experiment.config.name)
            choice = choose_level(experiment, loads=loads, without=failed)
            assert choice is not None
            if choice.level == FULL:
                experiment = choice.experiment
                break
            result = once(choice.experiment)
            codes = result.summary["warning_codes"]
            if result.status != "finished" or WarningCode.MODEL_UNCERTAIN.value not in codes:
                return result
            failed.append(choice.level)
        return once(experiment)


def _run(
    experiment: Experiment, session: Session, out: str | Path | None, force: bool, loads: Sequence[Load]
) -> Run:
    """Run a level, with other settings as long as the accuracy asked for isn't kept."""
    observer = session.observer
    choice: Choice | None
    beyond: Setting | None = None
    result: Run | None = None
    while True:
        setting, choice = experiment, None
        if leaves_choice(experiment):
            observer.choosing(experiment.config.name)
            try:
                setting, choice = chosen(experiment, loads=loads, beyond=beyond, told=observer.trying)
            except ConfigError:
                if result is None:
                    raise
                return result  # no dearer setting is left to try
        if choice is not None:
            session.phases.next("choose")
        prepared = prepare(setting, loads=loads)
        refuse_taken_names(prepared)
        with _place(prepared, out, setting.text, force=force or beyond is not None) as folder:
            result = execute(session, prepared, folder)
            kept = True
            if wanted(setting) is not None:
                result, kept = certified(result, setting, choice, session, loads)
        if kept or choice is None:
            return result
        beyond = choice.setting
        session = session.another()


@contextmanager
def _place(
    prepared: InitialValueProblem, out: str | Path | None, config: str, *, force: bool
) -> Iterator[RunFolder | None]:
    """The run's folder, locked and begun; None in memory."""
    if out is None:
        refuse_too_large_for_memory(prepared)
        yield None
        return
    folder = RunFolder(Path(out) / prepared.scene.name)
    refuse_too_large(prepared, folder.path)
    with folder.locked():
        folder.begin(config, force=force)
        yield folder
