"""Running an experiment: choose what it asks to be chosen, run, certify, and try again where that fails."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rigidsim.accuracy import chosen
from rigidsim.archive import Run
from rigidsim.certify import certified
from rigidsim.errors import ConfigError
from rigidsim.guards import Observer
from rigidsim.prepare import prepare
from rigidsim.scene.reading import Experiment, load
from rigidsim.session import Session
from rigidsim.store.folder import RunFolder
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
    session = Session(observer)
    beyond: Setting | None = None
    result: Run | None = None
    while True:
        try:
            setting, choice = chosen(experiment, loads=loads, beyond=beyond, observer=observer)
        except ConfigError:
            if result is None:
                raise
            return result  # no dearer setting is left to try
        if choice is not None:
            session.phases.next("choose")
        prepared = prepare(setting, loads=loads)
        folder = RunFolder(Path(out) / prepared.scene.name)
        with folder.locked():
            folder.begin(setting.text, force=force or beyond is not None)
            result = session.execute(prepared, folder)
            result, kept = certified(result, setting, choice, session, loads)
        if kept or choice is None:
            return result
        beyond = choice.setting
        session = session.another()
