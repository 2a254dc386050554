"""Running a sweep: tiles of members until all are there, then dataset and summary; resumable at any time."""

import json
import os
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import FORCE, OUT, ConfigError, Problem, RunFolderError
from rigidsim.scene.scene import build_scene
from rigidsim.scene.sweep import Sweep
from rigidsim.scene.validation_messages import shown
from rigidsim.session.dataset import kernel_attributes
from rigidsim.store import atomic
from rigidsim.store.folder import Begun, SweepFolder
from rigidsim.store.outputs import refuse_inputs
from rigidsim.store.sweeps.saved import ErrorsOfMembers, SavedSweep, SweepCost, SweepSummary, open_sweep
from rigidsim.store.sweeps.tiles import Gathered, Kept, Sources, identity, read_tile, write_dataset
from rigidsim.store.variables import SCHEMA_VERSION
from rigidsim.workflows.fit.observations import folder_of
from rigidsim.workflows.read import Given, as_experiment, reads_kernels
from rigidsim.workflows.sweeps.executors import Workers, cluster, leave_tile, processes, sent_tile
from rigidsim.workflows.sweeps.fits import fitted_of, given_files, keep_data, refuse_other_data
from rigidsim.workflows.sweeps.members import (
    ENDED_WELL,
    OUTCOMES,
    WARNINGS,
    batches_of,
    get_ready,
    recording,
    refuse_other_kernel,
    sweep_of,
    why_alone,
)
from rigidsim.workflows.sweeps.plan import Each, check_sweep, refuse_unknown_tiles, tile_length

_DECIDING = ("version_", "cpu_model", "ephemeris_", "orientation_")  # what decides on bits
_ERRORS = {
    "attitude": ("attitude_error", "rad"),
    "position": ("position_error", "m"),
    "modelling": ("modelling_error", "rad"),
    "modelling_norm": ("modelling_error_norm", "1"),
    "modelling_energy": ("modelling_error_energy", "1"),
}
"""Announced errors of members: their variables and units."""


def summary_of(wanted: Sweep, sources: Sources, found: Gathered, wall: float, cpu: float) -> SweepSummary:
    """Contents of ``summary.json`` for a complete sweep; seconds of this process."""
    ended_as, warned_of = np.zeros(len(OUTCOMES), dtype=np.int64), np.zeros(len(WARNINGS), dtype=np.int64)
    steps = 0
    worst: dict[str, float] = {}
    estimated: dict[str, list[np.ndarray]] = {name: [] for name in _ERRORS}
    fits: list[tuple[Kept, np.ndarray]] = []
    for tile, _, rows in sources.parts():
        arrays = {name: variable.values[rows] for name, variable in tile.kept.items()}
        ended_as += np.bincount(arrays["status"], minlength=len(OUTCOMES))
        if wanted.fits:
            fits.append((tile.kept, rows))
            continue
        bits = arrays["warnings"]
        warned_of += np.array([int((bits >> bit & 1).sum()) for bit in range(len(WARNINGS))])
        steps += int(arrays["steps"].sum())
        for name, seen in estimated.items():
            if (variable := _ERRORS[name][0]) in arrays:
                values = arrays[variable]
                seen.append(values[~np.isnan(values)])
        for name, values in arrays.items():
            if name.endswith("_drift_largest"):
                largest = np.nanmax(values, initial=0.0)
                drift = name.removesuffix("_largest")
                worst[drift] = max(worst.get(drift, 0.0), float(largest))
    outcomes = {OUTCOMES[i]: int(n) for i, n in enumerate(ended_as) if n}
    failing = wanted.count - sum(outcomes.get(status, 0) for status in ENDED_WELL)
    warned = {WARNINGS[i]: int(n) for i, n in enumerate(warned_of) if n}
    warnings = {code: f"{number:,} members are warned of: {code}" for code, number in warned.items()}
    if failing:
        said = f"{failing:,} members didn't end well; failed_member and failed_reason say which"
        warnings = {"members_failed": said, **warnings}
    fitted, of_fits = fitted_of(fits)
    warnings |= of_fits
    engines: Counter[str] = Counter()
    for made in found.made:
        engines.update(made["engines"])
    kinds = [{k: v for k, v in made.items() if k.startswith(_DECIDING)} for made in found.made]
    differing = sorted({k for kind in kinds for k, v in kind.items() if v != kinds[0].get(k)})
    mixed = ", ".join(differing) or None
    if mixed:
        said = f"tiles were computed with different {mixed}: members may differ in their last bits"
        warnings["mixed_provenance"] = said
    return SweepSummary(
        kind="sweep",
        name=wanted.experiment.config.name,
        description=wanted.experiment.config.description,
        status="finished",
        message=f"all {wanted.count:,} members were {'fitted' if wanted.fits else 'run'}",
        exit_code=0,
        members=wanted.count,
        shape=dict(zip(wanted.dims, wanted.shape, strict=True)),
        axes={axis.name: axis.key for axis in wanted.axes},
        keep=list(wanted.table.keep),
        outcomes=outcomes,
        warned=warned,
        warnings=list(warnings.values()),
        warning_codes=list(warnings),
        engines=dict(engines),
        why_alone=next((made["why_alone"] for made in found.made if made.get("why_alone")), None),
        cost=SweepCost(
            steps=steps,
            cpu_seconds=sum(made["cpu_seconds"] for made in found.made),
            wall_seconds_of_tiles=sum(made["wall_seconds"] for made in found.made),
            tiles=len(found.made),
            estimate_cpu_seconds=sum(made.get("estimate_cpu_seconds", 0.0) for made in found.made),
            session_wall_seconds=wall,
            session_cpu_seconds=cpu,
        ),
        largest_drifts=worst,
        estimated_errors={
            name: ErrorsOfMembers(
                members=len(values),
                median=float(np.median(values)),
                largest=float(values.max()),
                units=_ERRORS[name][1],
            )
            for name, parts in estimated.items()
            if len(values := np.concatenate([np.zeros(0), *parts]))
        },
        fitted=fitted,
        config_sha256=wanted.experiment.sha256,
        provenance=kinds[0] if kinds else {},
        mixed_provenance=mixed,
    )


class SweepObserver:
    """Receives a sweep's progress; the base class does nothing."""

    def checking(self, sweep: Sweep) -> None:
        """Members are about to be checked, before anything runs."""

    def started(self, folder: Path, members: int, done: int) -> None:
        """``members`` are to be run, of which ``done`` are complete already."""

    def progressed(self, done: int) -> None:
        """``done`` members are complete."""

    def completing(self) -> None:
        """All members are complete; the dataset is being written."""

    def nothing_left(self) -> None:
        """The sweep was already complete."""


def sweep(
    experiment: Given,
    *,
    changes: dict[str, Any] | None = None,
    out: str | Path = "runs",
    force: bool = False,
    workers: int = 1,
    scheduler: str | None = None,
    tiles: tuple[int, int] | None = None,
    observer: SweepObserver | None = None,
) -> SavedSweep:
    """Run every member of a config's ``[sweep]``, and save them as one dataset in ``out/<name>/``.

    Members of a config with ``[fit]`` are fits, by copies of their data in the folder.

    A folder that holds a part of the same sweep is completed; if axes are longer or more is kept than
    before, only what is new is computed.

    Args:
        experiment: from ``load`` or ``Experiment.from_dict``, the path of a config, or a dictionary.
        changes: values to replace, as for ``Experiment.replace``.
        out: folder of the sweep's own folder; unlike a run it can't be kept in memory.
        force: replace whatever run or sweep is there.
        workers: number of processes on this machine. They read your script again: in a script, sweep under
            ``if __name__ == "__main__":``.
        scheduler: address of a Dask scheduler whose workers run the members; needs ``rigidsim[cluster]``.
        tiles: first and stop of the share of tiles computed by this one of several processes on the folder.
        observer: receives the sweep's progress.

    Raises:
        ConfigError: no sweep, or one of its members can't be run; nothing was written.
        RunFolderError: the folder is in use, holds something else, or can't be written; or data of fits have
            other contents than before.
        StoppedError: a worker died, or a cluster is gone; what is complete stays.
        RigidsimError: data of fits aren't there.
    """
    given = as_experiment(experiment, changes)
    if not isinstance(out, str | os.PathLike):
        what = (
            f'given {shown(out)}; a folder is allowed, such as "runs" or a temporary one: members are saved '
            "as they are finished, so that a sweep can be gone on with"
        )
        raise ConfigError(Problem("out", what), given.source)
    folder = SweepFolder(Path(out) / given.config.name)
    refuse_inputs([folder.path], given.files)
    return _run(
        recording(Sweep.of(given)), folder, _workers(workers, scheduler), observer or SweepObserver(),
        force=force, share=tiles, beside=folder_of(given),
    )  # fmt: skip


def resume_sweep(
    path: str | Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    observer: SweepObserver | None = None,
) -> SavedSweep:
    """Complete a sweep that was interrupted or killed."""
    found = open_sweep(path)
    begun = found.folder.begun
    if begun is None:
        return found
    wanted = sweep_of(begun.config)
    return _run(wanted, found.folder, _workers(workers, scheduler), observer or SweepObserver())


def _workers(count: int, scheduler: str | None) -> AbstractContextManager[Workers | None]:
    if scheduler is not None:
        return cluster(scheduler)
    return processes(count) if count > 1 else nullcontext()


def _run(
    wanted: Sweep,
    folder: SweepFolder,
    working: AbstractContextManager[Workers | None],
    observer: SweepObserver,
    *,
    force: bool = False,
    share: tuple[int, int] | None = None,
    beside: Path | None = None,
) -> SavedSweep:
    """See ``sweep``; ``beside``: where data of fits lie, None if the copies in the folder have to do."""
    begun = None if force else folder.begun
    if share is not None and force:
        raise RunFolderError(f"{FORCE} is for a sweep as a whole, and its tiles are computed by others, too")
    if share is not None and begun is None:
        refuse_unknown_tiles(wanted)
    files = given_files(wanted) if wanted.fits else []
    refuse_other_data(files, beside, folder.data, anew=force)
    observer.checking(wanted)
    began, cpu = time.perf_counter(), time.process_time()
    if not force and _complete(wanted, folder):
        with folder.locked(shared=share is not None):
            done = open_sweep(folder.path)
            done.refuse_damaged()
            observer.nothing_left()
            return done
    text, source = wanted.experiment.text, wanted.experiment.source
    with working as workers:
        each: Each = map
        if workers is not None and workers.local:
            each = workers.executor.map
            for _ in range(min(workers.count(), wanted.count)):
                workers.executor.submit(get_ready, text, source)  # while this process still reads and checks
        known = begun if begun is not None and begun.config_sha256 == wanted.experiment.sha256 else None
        if known is None:  # a sweep that was begun before had all its members checked
            check_sweep(wanted, each=each)
        length = tile_length(wanted) if known is None else known.tile
        with folder.locked(shared=share is not None):
            if share is None:
                folder.claim(force=force, mine=folder.holds if folder.begun_here else (), clear=force)
            _refuse_other(wanted, folder)
            if beside is not None and files:
                keep_data(files, beside, folder.data)
            if reads_kernels(wanted.base):
                for path in folder.tile_files()[:1]:
                    refuse_other_kernel(wanted, read_tile(path).made, path)
            if _compute(wanted, folder, length, workers, share, observer):
                return open_sweep(folder.path)
    try:
        with folder.locked():
            observer.completing()
            return _completed(wanted, folder, time.perf_counter() - began, time.process_time() - cpu)
    except RunFolderError:
        if share is not None and folder.at_work:  # other processes complete it
            return open_sweep(folder.path)
        raise


def _complete(wanted: Sweep, folder: SweepFolder) -> bool:
    summary = folder.read_summary()
    return (
        summary.get("status") == "finished"
        and summary.get("config_sha256") == wanted.experiment.sha256
        and folder.dataset.exists()
    )


def _refuse_other(wanted: Sweep, folder: SweepFolder) -> None:
    """Refuse a folder whose sweep has different members altogether.

    The config saved with a finished dataset says this, too: its tiles may have been deleted.
    """
    begun = folder.begun
    if begun is None and not folder.dataset.exists():
        return
    try:
        config = begun.config if begun is not None else folder.config.read_text(encoding="utf-8")
        same = identity(sweep_of(config, wanted.experiment.source)) == identity(wanted)
    except (OSError, ValueError, ConfigError):  # edited, gone, or of a version that had other keys
        same = False
    if not same:
        raise RunFolderError(
            f"{folder.path}: holds a sweep of another experiment or of other keys; {FORCE} replaces it, "
            f"another {OUT} or name puts this one elsewhere"
        )


def _compute(
    wanted: Sweep,
    folder: SweepFolder,
    length: int,
    workers: Workers | None,
    share: tuple[int, int] | None,
    observer: SweepObserver,
) -> bool:
    """Compute the missing tiles; returns whether any is left to others."""
    sources, begun = Sources(wanted, folder.path, folder.tile_files()), folder.begun
    experiment, sha256 = wanted.experiment, wanted.experiment.sha256
    blocks = [range(first, min(first + length, wanted.count)) for first in range(0, wanted.count, length)]
    missing = [
        number for number, block in enumerate(blocks) if sources.missing[block.start : block.stop].any()
    ]
    if begun is None or begun.config_sha256 != sha256:
        alone = begun.alone if begun is not None else _alone(wanted)
        begun = Begun(experiment.text, sha256, int(sources.missing.sum()), len(missing), length, alone)
        folder.begin(begun)
    first, stop = share or (0, len(blocks))
    ours = [number for number in missing if first <= number < stop]

    def tasks() -> Iterator[tuple[Any, ...]]:
        for number in ours:
            members, items = sources.wanted(blocks[number])
            keys = sources.keys[members]
            path = folder.tile_file(sha256, number, keys, items)
            data = str(folder.data.absolute())
            yield path, experiment.text, experiment.source, members, keys, items, begun.alone, data

    todo = sum(int(sources.missing[blocks[number].start : blocks[number].stop].sum()) for number in ours)
    done = begun.members - todo if share is None else 0
    observer.started(folder.path, done + todo, done)
    if workers is None:
        results: Iterator[tuple[Any, bytes | None]] = ((task, leave_tile(*task)) for task in tasks())
    else:  # tiles are sent back by workers that don't see the folder
        results = workers.each(leave_tile if workers.local else sent_tile, tasks())
    for task, image in results:
        if image is not None:
            atomic.write_bytes(task[0], image)
        done += len(task[3])
        observer.progressed(done)
    return bool(Sources(wanted, folder.path, folder.tile_files()).missing.any())


def _alone(wanted: Sweep) -> bool | None:
    """See ``Begun``."""
    if why_alone(wanted, ()):
        return None
    return batches_of(wanted.experiment.text, wanted.experiment.source).alone is not None


def _completed(wanted: Sweep, folder: SweepFolder, wall: float, cpu: float) -> SavedSweep:
    """Write dataset and summary once all tiles are there."""
    sources = Sources(wanted, folder.path, folder.tile_files())
    found = sources.gather()
    summary = summary_of(wanted, sources, found, wall, cpu)
    attributes = {
        "Conventions": "CF-1.11",
        "title": wanted.experiment.config.name,
        "comment": wanted.experiment.config.description,
        "time_unit": wanted.experiment.config.time.unit or "",
        "source": "rigidsim",
        "kind": "sweep",
        "schema_version": SCHEMA_VERSION,
        "status": "finished",
        "config": wanted.experiment.text,
        "config_sha256": wanted.experiment.sha256,
        "config_given": wanted.experiment.given,
        "config_set": "\n".join(wanted.experiment.settings),
        "keep": " ".join(wanted.table.keep),
        "members": wanted.count,
        "engines": json.dumps(summary.engines),
        "warnings": "\n".join(summary.warnings),
        "mixed_provenance": summary.mixed_provenance or "",
        **summary.provenance,
    }
    if reads_kernels(wanted.base):  # of the first member, as the config's own values are
        attributes |= kernel_attributes(build_scene(wanted.experiment_of(0)))
    digest = write_dataset(folder.dataset, wanted, sources, found, attributes)
    summary = summary.having(dataset_sha256=digest)
    folder.write_summary(summary)
    return SavedSweep(folder, summary)
