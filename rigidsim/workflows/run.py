"""Running an experiment: choose what the config leaves to be chosen, run, certify, and retry on failure; and
a saved run once more, to be compared with, or for its motion between the samples.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, overload

import numpy as np

from rigidsim.accuracy.choice import Choice, certify, choose_level, chosen, verdict
from rigidsim.accuracy.setting import Setting, asked_of_attitude, leaves_choice, wanted
from rigidsim.errors import ConfigError, RunFolderError
from rigidsim.model.load import Load
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.choices import AUTO, FULL
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.session.dataset import refuse_taken_names
from rigidsim.session.execution import execute
from rigidsim.session.progress import watched
from rigidsim.session.session import Observer, Session, Tuning, refuse_too_large, refuse_too_large_for_memory
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.solve.status import Status
from rigidsim.store.folder import RunFolder
from rigidsim.store.outputs import refuse_inputs
from rigidsim.store.provenance import read_attributes
from rigidsim.store.run import MemoryRun, Run, SavedRun
from rigidsim.store.summary import ENGINE, Summary
from rigidsim.workflows.read import (
    Experiment,
    Given,
    as_experiment,
    embedded,
    refuse_other_kernel,
    with_recorded_variables_of,
)

AnyRun = TypeVar("AnyRun", bound=Run)


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
        The run; its ``status`` says how it ended, which need not be "finished".

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
                setting, choice = chosen(experiment, loads=loads, beyond=beyond, report=observer.trying)
            except ConfigError:
                if result is None:
                    raise
                return result  # no dearer setting is left to try
        if choice is not None:
            session.watch.next("choose")
        prepared = prepare(setting, loads=loads)
        refuse_taken_names(prepared)
        with _place(prepared, out, setting.text, force=force or beyond is not None) as folder:
            result, kept = certified(execute(session, prepared, folder), setting, choice, session, loads)
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
    scene = prepared.scene
    places = [None if scene.ephemeris is None else scene.ephemeris.kernel.place]
    places.append(None if scene.orientation is None else scene.orientation.place)
    kernels = [place for place in (*places, *prepared.experiment.long_tables) if place is not None]
    refuse_inputs([folder.path], [*prepared.experiment.files, *kernels])
    with folder.locked():
        folder.begin(config, force=force, kernels=kernels)
        yield folder


def certified(
    result: AnyRun,
    experiment: Experiment,
    choice: Choice | None,
    session: Session,
    loads: Sequence[Load] = (),
) -> tuple[AnyRun, bool]:
    """Certify a finished run, if its config asks for an accuracy: the certificate is put into its summary."""
    integrator, summary = experiment.config.integrator, result.outcome
    accuracy, length = wanted(experiment), integrator.accuracy_position
    complete = result.status in (Status.FINISHED.value, Status.EVENT.value)
    if accuracy is None or not complete or not isinstance(summary, Summary):
        return result, True
    session.observer.phase("certify")
    key, requested = asked_of_attitude(experiment) or ("accuracy", None)
    place = None if length is None else float(length)
    with result.dataset as dataset:
        found = certify(
            dataset,
            experiment,
            accuracy=accuracy,
            accuracy_position=place,
            loads=loads,
            known=None if choice is None else choice.known,
            report=session.observer.trying,
        )
    known: dict[str, Any] = {"requested": requested}
    if place is not None:
        known["requested_position"] = place
    doubt: str | None = "too little was recorded to certify the accuracy asked for"
    if found is not None:
        doubt = verdict(found, requested, place, key=key)
        known |= found.as_dict()
    if choice is not None:
        known |= {"chosen": choice.setting.title, "chosen_why": choice.why, "forecast": choice.forecast}
    cautions = summary.cautions
    if doubt is None:  # a certified error needs no estimate
        cautions = [c for c in cautions if c.code != WarningCode.ATTITUDE_UNCERTAIN]
    else:
        cautions.append(Caution(WarningCode.NOT_CERTIFIED, doubt))
    session.watch.next("certify")
    cost = summary.cost.having(**session.watch.as_dict(summary.cost.seconds[ENGINE]))
    summary = summary.warned(cautions).having(accuracy=summary.accuracy.having(**known), cost=cost)
    return result.concluded(summary), doubt is None


# --- once more ----------------------------------------------------------------------------------------------

RATES, ATTITUDE = "angular_velocity", "quaternion"


def experiment_again(dataset: Path) -> Experiment:
    """The experiment of a dataset as it was run: without guards, nothing left to be chosen, nothing drawn.

    Raises:
        RunFolderError: no config can reproduce it, or a kernel is another one now.
    """
    begun = embedded(dataset)
    loads = read_attributes(dataset).get("python_loads")
    if loads:
        raise RunFolderError(f"{dataset}: the run had loads from Python ({loads}), which its config lacks")
    experiment = with_recorded_variables_of(begun, dataset)
    refuse_other_kernel(experiment, dataset)
    config = experiment.config
    tables = {
        "output": config.output.model_copy(update={"timeline": False}),
        "integrator": config.integrator.model_copy(update={"accuracy": None}),
        "limits": type(config.limits).model_construct(),
    }
    return replace(experiment, config=config.model_copy(update=tables))


@dataclass(frozen=True)
class MotionAgain:
    """The motion of a saved run at any times: its own, in every bit, on the same versions and machine."""

    dataset: Path

    @cached_property
    def _experiment(self) -> Experiment:
        found = experiment_again(self.dataset)
        names = found.config.output.record or read_attributes(self.dataset).get("recorded", "").split()
        return found.quiet(list(dict.fromkeys([*names, RATES])))

    @cached_property
    def _scene(self) -> Scene:
        return build_scene(self._experiment)

    @property
    def host(self) -> str:
        """The body that it is, as ``[body] host`` names it; empty for none."""
        return self._experiment.config.body.host or ""

    @property
    def ahead(self) -> Fraction | None:
        """Date of time 0, seconds of TDB since J2000; None where the config doesn't say."""
        return None if self._scene.epoch is None else self._scene.epoch.since_j2000()

    @property
    def span(self) -> tuple[Fraction, Fraction]:
        """Exact times of the first and the last sample of the config, s."""
        return self._scene.samples.begin, self._scene.samples.exact_last

    def at(self, times: Sequence[Fraction]) -> tuple[np.ndarray, np.ndarray]:
        """Quaternions (rows, 4), body to space axes, and angular velocities (rows, 3), body axes, rad/s.

        Args:
            times: ascending, s, within the span.

        Raises:
            RunFolderError: the motion ends before.
        """
        again = run(self._experiment.quiet(times=times), out=None, progress=False)
        found = again.dataset
        if found.sizes["time"] != len(times):
            raise RunFolderError(f"{self.dataset}: integrated again, the run {again.outcome.message}")
        return found[ATTITUDE].values, found[RATES].values
