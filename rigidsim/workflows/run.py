"""Running an experiment: choose what the config leaves to be chosen, run, certify, and retry on failure.

A saved run once more, to be compared with, or for its motion between the samples. And resuming a run that was
interrupted, killed or stopped, or prolonging a finished one, bit for bit.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, overload

import numpy as np

from rigidsim.accuracy.choice import Choice, certify, choose_level, chosen, verdict
from rigidsim.accuracy.setting import Setting, asked_of_attitude, leaves_choice, wanted
from rigidsim.errors import FORCE, ConfigError, Remedy, RunFolderError
from rigidsim.model.load import Load
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.choices import AUTO, FULL
from rigidsim.scene.config import Experiment, Overrides, assignments, assignments_of, parse
from rigidsim.scene.parts_of_values import in_time_order
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.session.dataset import refuse_taken_names
from rigidsim.session.dataset import root_attributes as attributes_now
from rigidsim.session.execution import execute, with_timeline
from rigidsim.session.progress import watched
from rigidsim.session.session import Observer, Session, Tuning, refuse_too_large, refuse_too_large_for_memory
from rigidsim.solve.assembly import assemble
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.solve.status import Status
from rigidsim.store import atomic
from rigidsim.store.folder import RunFolder, find_run
from rigidsim.store.netcdf import root_attributes
from rigidsim.store.outputs import refuse_inputs
from rigidsim.store.provenance import SYSTEM, changed, platform_of, read_attributes
from rigidsim.store.run import MemoryRun, Run, SavedRun, open_run
from rigidsim.store.seal import check_seal
from rigidsim.store.segments import Chain, read_chain
from rigidsim.store.summary import ENGINE, Brief, Summary
from rigidsim.workflows.read import (
    Given,
    as_experiment,
    embedded,
    refuse_other_kernel,
    text_difference,
    with_recorded_variables_of,
)

if TYPE_CHECKING:
    import xarray

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


# --- at given times, and once more --------------------------------------------------------------------------


@dataclass(frozen=True)
class Sampled:
    """A motion at given times on both sides of its start.

    Attributes:
        dataset: in memory, its rows ascending in time; of two runs without their events.
        reached: which of the times it has.
        outcome: of the run that ended early, else of the last one.
        attitude_error: announced, rad, the larger one of both ways; None if unknown.
    """

    dataset: "xarray.Dataset"
    reached: slice
    outcome: Brief
    attitude_error: float | None


def sampled(
    experiment: Experiment,
    times: Sequence[float] | np.ndarray,
    record: Sequence[str] | None = None,
    **quiet: Any,
) -> Sampled:
    """An experiment's motion at exactly these ascending times, s, by a run backwards and one forwards.

    Args:
        record, quiet: as for ``Experiment.quiet``.

    Raises:
        ConfigError: it can't be run.
    """
    ways = experiment.ways(times)
    made = {
        n: run(experiment.quiet(record, way, **quiet), out=None, progress=False)
        for n, way in enumerate(ways)
        if way
    }
    parts = {n: in_time_order(one.dataset) for n, one in made.items()}
    missing = [len(way) - parts[n].sizes["time"] if way else 0 for n, way in enumerate(ways)]
    dataset = parts[max(parts)]
    if len(parts) > 1:
        import xarray

        events = [event.name for event in experiment.config.events]
        both = [part.drop_dims(events, errors="ignore") for part in (dataset, parts[0])]
        joined = xarray.concat(
            both, "time", data_vars="minimal", coords="minimal", compat="override", combine_attrs="override"
        )
        dataset = joined.sortby("time")
    errors = [error for one in made.values() if (error := one.attitude_error) is not None]
    return Sampled(
        dataset,
        slice(missing[0], len(times) - missing[1]),
        made[0 if missing[0] else max(made)].outcome,
        max(errors) if len(errors) == len(made) else None,
    )


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
        """Exact times of the earliest and the latest sample of the config, s."""
        ends = self._scene.samples.begin, self._scene.samples.exact_last
        return min(ends), max(ends)

    def at(self, times: Sequence[Fraction]) -> tuple[np.ndarray, np.ndarray]:
        """Quaternions (rows, 4), body to space axes, and angular velocities (rows, 3), body axes, rad/s.

        Args:
            times: ascending, s, within the span.

        Raises:
            RunFolderError: the motion ends before.
        """
        way = self._scene.samples.direction
        again = run(self._experiment.quiet(times=times[::way]), out=None, progress=False)
        found = again.dataset.isel(time=slice(None, None, way))
        if found.sizes["time"] != len(times):
            raise RunFolderError(f"{self.dataset}: integrated again, the run {again.outcome.message}")
        return found[ATTITUDE].values, found[RATES].values


# --- going on -----------------------------------------------------------------------------------------------

_ROWS_AT_ONCE = 65536
_UNTIL = Remedy("--until", "until")
_SET = Remedy("--set", "overrides")


def resume(
    path: str | Path,
    *,
    until: str | float | Decimal | None = None,
    overrides: Overrides = (),
    observer: Observer | None = None,
    progress: bool | None = None,
    loads: Sequence[Load] = (),
    tuning: Tuning | None = None,
) -> SavedRun:
    """Resume a run from its last checkpoint.

    Args:
        path: run folder.
        until: a later end, as in ``[time] end``; a finished run is prolonged to it.
        overrides: ``limits.KEY=VALUE`` texts, or ``{"limits.KEY": value}``: guards for this session in place
            of the config's.
        observer, progress: as for ``rigidsim.run``.
        loads: loads that the run was begun with.
        tuning: as for ``rigidsim.run``.

    Returns:
        The run. Its dataset has the bits of an uninterrupted run, on the same versions and CPU features; on
        others the summary says so. A complete run is returned as it is, with a report to the observer.

    Raises:
        RunFolderError: the run doesn't exist, is in use, can't be written, or its config or segments were
            changed.
        ConfigError: a bad ``until`` or override.
    """
    if isinstance(overrides, Mapping):
        overrides = assignments_of(overrides)
    until = until if until is None else str(until)
    folder = find_run(path)
    with watched(observer, progress) as watching, folder.locked():
        session = Session(watching, tuning=tuning or Tuning())
        _refuse_links(folder)
        if folder.read_only is None:
            folder.remove_torn()
        experiment = _config(folder, overrides)
        if until is not None:
            experiment = _prolonged(experiment, until)
        experiment = _guarded(experiment, overrides)
        # a run that was killed while its dataset was being completed has both, and is completed again
        finished = folder.dataset.exists() and not folder.segments.exists()
        if finished and until is None:
            return _as_it_is(folder, experiment, session, loads)
        folder.refuse_read_only()
        lost = not folder.dataset.exists() and not folder.segments.exists()
        if lost and folder.read_summary().dataset_digest is not None:
            raise RunFolderError(f"{folder.path}: its dataset.h5 is missing; run it again with {FORCE}")
        chain = _of_finished(folder) if finished else read_chain(folder.segments)
        if chain.paths:
            experiment = with_recorded_variables_of(_continued(experiment, chain.paths[-1]), chain.paths[0])
            refuse_other_kernel(experiment, chain.paths[-1])
        prepared = prepare(experiment, loads=loads)
        if chain.paths:
            session.mixed = _compared(prepared, chain)
        if finished:
            folder.reopen()
            chain = read_chain(folder.segments)
        if chain.damage is not None:
            session.remarks.append(_set_aside(chain, folder))
        if folder.config.read_text(encoding="utf-8") != experiment.text:
            atomic.write_bytes(folder.config, experiment.text.encode())
        if not chain.paths:
            text = "nothing had been saved, so the run started again"
            session.remarks.append(Caution(WarningCode.BEGUN_ANEW, text))
        run = execute(session, prepared, folder, chain if chain.paths else None)
        assert isinstance(run, SavedRun)
        return certified(run, prepared.experiment, None, session, loads)[0]


def _as_it_is(folder: RunFolder, experiment: Experiment, session: Session, loads: Sequence[Load]) -> SavedRun:
    """A run whose dataset is complete; finishes what a Ctrl-C left out after that."""
    done = open_run(folder.path)
    done.refuse_damaged()
    summary = done.outcome
    if isinstance(summary, Summary) and summary.status == Status.INTERRUPTED.value:
        folder.refuse_read_only()
        found = read_attributes(folder.dataset)
        summary = with_timeline(summary, folder, experiment.config.output, session.observer)
        summary = summary.having(
            status=found["status"],
            message=found.get("status_message", ""),
            exit_code=Status(found["status"]).exit_code,
        )
        folder.write_summary(summary)
        return certified(SavedRun(folder, summary), experiment, None, session, loads)[0]
    session.observer.nothing_left(done.outcome.message or done.status)
    return done


def _refuse_links(folder: RunFolder) -> None:
    for place in (folder.path, folder.segments):
        if place.is_symlink():
            raise RunFolderError(f"{place}: is a symbolic link, which no run writes; give its target")
        for entry in place.iterdir() if place.is_dir() else ():
            if entry.is_symlink():
                raise RunFolderError(f"{entry}: is a symbolic link, which no run writes; remove it")


def _config(folder: RunFolder, overrides: Sequence[str]) -> Experiment:
    foreign = [o for o in overrides if not o.strip().startswith("limits.")]
    if foreign:
        raise RunFolderError(
            f"{_SET} {foreign[0]}: would change the experiment; only limits.KEY=VALUE is allowed here"
        )
    try:
        text = folder.config.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RunFolderError(f"{folder.config}: can't be read ({error})") from None
    return parse(text, source=str(folder.config))


def _guarded(experiment: Experiment, overrides: Sequence[str]) -> Experiment:
    """The same experiment and text with other guards."""
    if not overrides:
        return experiment
    limits = experiment.with_overrides(overrides).config.limits
    return replace(experiment, config=experiment.config.model_copy(update={"limits": limits}))


def _prolonged(experiment: Experiment, until: str) -> Experiment:
    """The same experiment to a later end, with the same sampling interval."""
    before = build_scene(experiment).samples
    if before.times is not None:
        raise RunFolderError(f"{_UNTIL}: this run has a list of sample times, which no later end prolongs")
    later = experiment.with_overrides([f"time.end={until}"])
    if later.config.time.every is None:
        intervals = (build_scene(later).samples.exact_last - before.begin) / before.step
        if intervals.denominator != 1:
            raise RunFolderError(
                f"{_UNTIL} {until}: lies between two samples of the grid; give a whole number of intervals "
                "of (end - start) / (samples - 1)"
            )
        later = experiment.with_overrides([f"time.end={until}", f"time.samples={intervals.numerator + 1}"])
    after = build_scene(later).samples
    if after.count <= before.count:
        raise RunFolderError(f"{_UNTIL} {until}: no later than the run's end, or before its next sample")
    return later


def _of_finished(folder: RunFolder) -> Chain:
    """A finished run's dataset and its checkpoint as a chain of segments from which it is prolonged."""
    found = read_attributes(folder.dataset)
    if found["status"] != Status.FINISHED.value:
        raise RunFolderError(f"{folder.path}: cannot be prolonged: {found.get('status_message')}")
    if not folder.checkpoint.exists():
        raise RunFolderError(f"{folder.checkpoint}: is missing, so that this run cannot be prolonged")
    last = check_seal(folder.dataset)
    check_seal(folder.checkpoint)
    after = root_attributes(folder.checkpoint)
    if after.get("run_id") != found.get("run_id") or after.get("previous_seal") != last:
        raise RunFolderError(f"{folder.checkpoint}: doesn't belong to {folder.dataset.name} next to it")
    rows = root_attributes(folder.dataset)["rows"]
    return Chain([folder.dataset, folder.checkpoint], rows, found.get("run_id", ""), last)


def _set_aside(chain: Chain, folder: RunFolder) -> Caution:
    """Move segments that don't belong out of the way, so that they are neither read nor lost."""
    folder.set_aside.mkdir(exist_ok=True)
    for path in chain.spoiled:
        target, number = folder.set_aside / path.name, 0
        while target.exists():
            number += 1
            target = folder.set_aside / f"{path.stem}-{number}{path.suffix}"
        path.replace(target)
    files = "file was" if len(chain.spoiled) == 1 else "files were"
    return Caution(
        WarningCode.SET_ASIDE,
        f"{chain.damage}; the run was resumed from the {len(chain.paths)} segments before it "
        f"({chain.rows} samples); {len(chain.spoiled)} {files} moved to {folder.set_aside.name}/",
    )


def _continued(experiment: Experiment, last: Path) -> Experiment:
    """The experiment with its values when the run began, and the later end that it has since been given."""
    begun = embedded(last)
    ends: list[str] = []
    if experiment.text != begun.text:
        ends = assignments(experiment.text, ["time.end", "time.samples"])
        longer = ends and begun.with_overrides(ends).text == experiment.text
        if not longer or build_scene(experiment).samples.count <= build_scene(begun).samples.count:
            raise RunFolderError(
                f"{experiment.source}: was changed since the run began "
                f"({text_difference(experiment.text, begun.text)}); "
                "put it back (the segments hold it as their attribute config), or begin a new run"
            )
    return replace(experiment, given=begun.given, settings=(*begun.settings, *ends))


def _compared(prepared: InitialValueProblem, chain: Chain) -> str:
    """Differences in versions or machine from the run's beginning; empty if there are none."""
    last = chain.paths[-1]
    saved = read_attributes(last)
    now = attributes_now(prepared, assemble(prepared), chain.run)
    for name, then, value in changed(SYSTEM, saved, now):
        raise RunFolderError(f"{last}: cannot be resumed from: its {name} is {then}, now {value}")
    if (loads := saved.get("python_loads")) != now["python_loads"]:
        raise RunFolderError(
            f"{last}: the run was begun with loads from Python ({loads}); resume it from Python with the same"
        )
    _same_times(prepared, chain)
    others = changed(platform_of(saved), saved, now)
    differing = [f"{name} {then} -> {value}" for name, then, value in others]
    return "; ".join([x for x in [saved.get("mixed_provenance"), *differing] if x])


def _same_times(prepared: InitialValueProblem, chain: Chain) -> None:
    """Require that a grid to a later end begins with exactly the times that are saved."""
    from rigidsim.store.reader import open_dataset  # which loads xarray

    with open_dataset(*chain.paths, indexed=False) as saved:
        for first in range(0, saved.sizes["time"], _ROWS_AT_ONCE):
            times = saved["time"][first : first + _ROWS_AT_ONCE].values
            if not np.array_equal(prepared.clock.labels(first, first + len(times)), times):
                raise RunFolderError(
                    f"{_UNTIL}: the longer grid's first sample times differ from those saved by a rounding; "
                    "choose an end that is a multiple of the old one, or [time] every"
                )
