"""Resuming a run that was interrupted, killed or stopped, and prolonging a finished one, bit for bit."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from rigidsim.errors import FORCE, Remedy, RunFolderError
from rigidsim.model.load import Load
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.config import Experiment, Overrides, parse
from rigidsim.scene.scene import build_scene
from rigidsim.scene.toml_text import assignments, assignments_of
from rigidsim.session.dataset import root_attributes as attributes_now
from rigidsim.session.execution import execute, with_timeline
from rigidsim.session.progress import watched
from rigidsim.session.session import Observer, Session, Tuning
from rigidsim.solve.assembly import assemble
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.solve.status import Status
from rigidsim.store import atomic
from rigidsim.store.folder import RunFolder, find_run
from rigidsim.store.netcdf import root_attributes
from rigidsim.store.provenance import SYSTEM, changed, platform_of, read_attributes
from rigidsim.store.reader import open_dataset
from rigidsim.store.run import SavedRun, open_run
from rigidsim.store.seal import check_seal
from rigidsim.store.segments import Chain, read_chain
from rigidsim.store.summary import Summary
from rigidsim.workflows.read import embedded, refuse_other_kernel, text_difference, with_recorded_variables_of
from rigidsim.workflows.run import certified

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
            text = "nothing had been saved, so the run began anew"
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
    limits = experiment.having(overrides).config.limits
    return replace(experiment, config=experiment.config.model_copy(update={"limits": limits}))


def _prolonged(experiment: Experiment, until: str) -> Experiment:
    """The same experiment to a later end, with the same sampling interval."""
    before = build_scene(experiment).samples
    if before.times is not None:
        raise RunFolderError(f"{_UNTIL}: this run has a list of sample times, which no later end prolongs")
    later = experiment.having([f"time.end={until}"])
    if later.config.time.every is None:
        intervals = (build_scene(later).samples.exact_last - before.begin) / before.step
        if intervals.denominator != 1:
            raise RunFolderError(
                f"{_UNTIL} {until}: lies between two samples of the grid; give a whole number of intervals "
                "of (end - start) / (samples - 1)"
            )
        later = experiment.having([f"time.end={until}", f"time.samples={intervals.numerator + 1}"])
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
        longer = ends and begun.having(ends).text == experiment.text
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
    with open_dataset(*chain.paths, indexed=False) as saved:
        for first in range(0, saved.sizes["time"], _ROWS_AT_ONCE):
            times = saved["time"][first : first + _ROWS_AT_ONCE].values
            if not np.array_equal(prepared.clock.labels(first, first + len(times)), times):
                raise RunFolderError(
                    f"{_UNTIL}: the longer grid's first sample times differ from those saved by a rounding; "
                    "choose an end that is a multiple of the old one, or [time] every"
                )
