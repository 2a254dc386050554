"""Running an experiment: choose what it asks to be chosen, run, certify, and try again where that fails."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rigidsim.accuracy.choice import chosen, leaves_choice
from rigidsim.accuracy.setting import Setting
from rigidsim.errors import ConfigError
from rigidsim.session.guards import Observer
from rigidsim.session.session import Session
from rigidsim.session.storage import refuse_too_large
from rigidsim.session.tuning import Tuning
from rigidsim.solve.problem import prepare
from rigidsim.store.folder import RunFolder
from rigidsim.store.run import Run
from rigidsim.workflows.certify import certified
from rigidsim.workflows.read import Experiment, load

if TYPE_CHECKING:
    from rigidsim.model.load import Load


def run(
    experiment: Experiment | str | Path,
    *,
    out: str | Path = "runs",
    force: bool = False,
    observer: Observer | None = None,
    loads: Sequence[Load] = (),
    tuning: Tuning | None = None,
) -> Run:
    """Run an experiment and save it in ``out/<name>/``.

    Args:
        experiment: from ``load``, or the path of a config.
        out: folder of the run folders.
        force: replace a run of the same name.
        observer: is told how it goes.
        loads: loads of one's own, beside those of the config, which alone can't reproduce the run then.
        tuning: how often to look up and save; no bit depends on it.

    Returns:
        The run; its ``status`` tells how it ended, which need not be "finished".

    Raises:
        ConfigError: the config can't be run; nothing was written.
        RunFolderError: the run folder is in use or can't be written, or the run doesn't fit on its disk.
    """
    if not isinstance(experiment, Experiment):
        experiment = load(experiment)
    observer = observer or Observer()
    session = Session(observer, tuning=tuning or Tuning())
    beyond: Setting | None = None
    result: Run | None = None
    while True:
        try:
            if leaves_choice(experiment):
                observer.choosing(experiment.config.name)
            setting, choice = chosen(experiment, loads=loads, beyond=beyond, told=observer.trying)
        except ConfigError:
            if result is None:
                raise
            return result  # no dearer setting is left to try
        if choice is not None:
            session.phases.next("choose")
        prepared = prepare(setting, loads=loads)
        folder = RunFolder(Path(out) / prepared.scene.name)
        refuse_too_large(prepared, folder.path)
        with folder.locked():
            folder.begin(setting.text, force=force or beyond is not None)
            result = session.execute(prepared, folder)
            result, kept = certified(result, setting, choice, session, loads)
        if kept or choice is None:
            return result
        beyond = choice.setting
        session = session.another()
