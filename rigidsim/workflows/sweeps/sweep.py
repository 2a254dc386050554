"""Running a sweep: tiles of members until all are there, then dataset and summary; resumable at any time.

Tiles are computed in this process, in others of this machine, or by the workers of a Dask cluster; no bit
depends on which. A worker process that dies ends the session, and all tiles that are complete stay. Dask
computes the tiles of a worker that died with others.
"""

import itertools
import json
import multiprocessing
import os
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import (
    FORCE,
    OUT,
    ConfigError,
    Problem,
    RigidsimError,
    RunFolderError,
    StoppedError,
    Wording,
)
from rigidsim.scene.scene import build_scene
from rigidsim.scene.sweep import Sweep
from rigidsim.scene.validation_messages import shown
from rigidsim.session.dataset import kernel_attributes
from rigidsim.solve.compiled import quieten_engine
from rigidsim.store import atomic, provenance
from rigidsim.store.folder import Begun, SweepFolder
from rigidsim.store.outputs import refuse_inputs
from rigidsim.store.sweeps.saved import ErrorsOfMembers, SavedSweep, SweepCost, SweepSummary, open_sweep
from rigidsim.store.sweeps.tiles import Kept, Sources, Tile, identity, plain, read_tile, write_dataset
from rigidsim.store.variables import SCHEMA_VERSION
from rigidsim.workflows.fit.observations import folder_of
from rigidsim.workflows.read import Given, as_experiment, reads_kernels
from rigidsim.workflows.sweeps.fits import fit_members, fitted_of, given_files, keep_data, refuse_other_data
from rigidsim.workflows.sweeps.members import (
    ENDED_WELL,
    OUTCOMES,
    WARNINGS,
    MemberResults,
    batches_of,
    get_ready,
    kernel_of_members,
    recording,
    refuse_other_kernel,
    run_members,
    sweep_of,
    why_alone,
)
from rigidsim.workflows.sweeps.plan import check_sweep, refuse_unknown_tiles, tile_length

_LOOK_SECONDS = 0.5


# --- tiles and workers --------------------------------------------------------------------------------------


def results_of(
    sweep: Sweep, members: Sequence[int], keep: Sequence[str], alone: bool | None, data: Path
) -> MemberResults:
    """Run or fit some members, see ``run_members``; ``data``: the folder of what they are fitted to."""
    if not sweep.fits:
        return run_members(sweep, members, keep, alone)
    return fit_members(sweep, members, data)


def tile_image(
    config: str, source: str, members: np.ndarray, keys: np.ndarray, items: tuple[str, ...],
    alone: bool | None, data: str,
) -> bytes:  # fmt: skip
    """Run members of a sweep's config and keep items (``items_of``): the sealed file of their tile; ``data``:
    the folder of what members are fitted to.
    """
    began, cpu = time.perf_counter(), time.process_time()
    results = results_of(
        sweep_of(config, source), members.tolist(), [plain(item) for item in items], alone, Path(data)
    )
    made = {
        "engines": dict(results.engines),
        "why_alone": results.why_alone,
        "estimate_cpu_seconds": results.estimating,
        "wall_seconds": time.perf_counter() - began,
        "cpu_seconds": time.process_time() - cpu,
        "finished_at": provenance.now(),
        "cpu_model": provenance.cpu_model(),
        **{f"version_{name}": version for name, version in provenance.versions().items()},
        **kernel_of_members(config, source),
    }
    return Tile(keys, items, results.kept, results.reasons, made).image()


def leave_tile(path: Path, *task: Any) -> None:
    """Compute a tile (see ``tile_image``); on return it is saved.

    A worker sends no long answer: what was half written into the pipe of its pool when it was killed would be
    waited for, for ever.
    """
    atomic.write_bytes(path, tile_image(*task))


def sent_tile(path: Path, *task: Any) -> bytes:
    """Compute a tile for whoever sees the folder."""
    return tile_image(*task)


@dataclass(frozen=True)
class Workers:
    """An executor, and whether its workers see this machine's disk; ``count`` gives their number, or raises
    StoppedError if they are gone.
    """

    executor: Executor
    local: bool
    count: Callable[[], int]

    def each(
        self, function: Callable[..., Any], tasks: Iterator[tuple[Any, ...]]
    ) -> Iterator[tuple[Any, Any]]:
        """Tasks with their results, as they come; each worker has a task, and one ahead."""
        running: dict[Future[Any], Any] = {}
        task: tuple[Any, ...] | None = ()
        while task is not None or running:
            while task is not None and len(running) < 2 * self.count():
                if (task := next(tasks, None)) is not None:
                    running[self.executor.submit(function, *task)] = task
            done, _ = wait(running, timeout=_LOOK_SECONDS, return_when=FIRST_COMPLETED)
            self.count()
            for future in done:
                ended = running.pop(future)
                if future.cancelled():  # Dask lost it with the worker that had it
                    tasks, task = itertools.chain([ended], tasks), ()
                else:
                    yield ended, future.result()


@contextmanager
def processes(count: int) -> Iterator[Workers]:
    """``count`` worker processes, which end with the context, or with this process however it ends.

    Raises:
        StoppedError: a worker died.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        # this is a worker, which reads the caller's script again before it begins
        raise SystemExit(
            "rigidsim.sweep: workers read the script again that started them, and come upon the sweep "
            'itself: put what the script does under  if __name__ == "__main__":'
        )
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count, context, _begin_worker, (Wording.commands,))

    def present() -> int:  # the pool itself may overlook a worker that dies while another begins
        if not all(process.is_alive() for process in pool._processes.values()):
            raise BrokenProcessPool
        return count

    try:
        yield Workers(pool, True, present)
    except BrokenProcessPool:
        raise StoppedError(
            "a worker process died (memory that ran out ends one so); the tiles that are complete are kept: "
            "give the command again, with fewer workers, a smaller [sweep] tile, or fewer samples"
        ) from None
    finally:
        started = list((pool._processes or {}).values())
        pool.shutdown(wait=False, cancel_futures=True)
        for process in started:
            process.kill()
        for process in started:
            process.join(5)


def _begin_worker(commands: bool) -> None:
    """Ignore Ctrl-C, which is for the parent, and end when the parent ends, however it does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Wording.commands = commands
    quieten_engine()
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)  # by which alone a thread ends the whole process, whatever the others do

    threading.Thread(target=watch, name="rigidsim watch", daemon=True).start()


@contextmanager
def cluster(address: str, patience: float = 20.0, alone: float = 120.0) -> Iterator[Workers]:
    """The workers of a Dask scheduler (``tcp://10.0.0.1:8786``), which must answer within ``patience``
    seconds and may be without workers for ``alone`` seconds. Workers see nothing of this machine's disk.

    Raises:
        RigidsimError: Dask isn't installed, or no scheduler answers.
        StoppedError: the scheduler is gone, or its workers are, or they die again and again.
    """
    try:
        import distributed
    except ImportError:
        raise RigidsimError(
            "--scheduler needs Dask, which isn't installed; pip install 'rigidsim[cluster]'"
        ) from None
    try:
        client = distributed.Client(address, timeout=patience, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise RigidsimError(
            f"--scheduler {address}: no Dask scheduler answers ({error or type(error).__name__}); "
            "start one with: dask scheduler"
        ) from None
    kept = "and give the command again; the tiles that are complete are kept"
    seen = time.monotonic()

    def threads() -> int:
        nonlocal seen
        try:
            found = int(sum(client.nthreads().values()))
        except (OSError, RuntimeError) as error:  # what Dask raises if a connection is gone
            raise StoppedError(
                f"--scheduler {address}: the scheduler is gone; start it again, with its workers, {kept}"
            ) from error
        seen = time.monotonic() if found else seen
        if time.monotonic() - seen > alone:
            raise StoppedError(
                f"--scheduler {address}: no worker is left there; start some with: dask worker {address}, "
                f"{kept}"
            )
        return max(1, found)

    with client:
        try:
            yield Workers(client.get_executor(pure=False, retries=2), False, threads)
        except distributed.KilledWorker:
            raise StoppedError(
                f"--scheduler {address}: workers died again and again at the same members; give them more "
                f"memory, or take a smaller [sweep] tile, {kept}"
            ) from None


# --- a sweep ------------------------------------------------------------------------------------------------

_DECIDING = ("version_", "cpu_model", "ephemeris_", "orientation_")  # what decides on bits
_ERRORS = {
    "attitude": ("attitude_error", "rad"),
    "position": ("position_error", "m"),
    "modelling": ("modelling_error", "rad"),
    "modelling_norm": ("modelling_error_norm", "1"),
    "modelling_energy": ("modelling_error_energy", "1"),
}
"""Announced errors of members: their variables and units."""


def summary_of(wanted: Sweep, sources: Sources, wall: float, cpu: float) -> SweepSummary:
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
    for made in sources.made:
        engines.update(made["engines"])
    kinds = [{k: v for k, v in made.items() if k.startswith(_DECIDING)} for made in sources.made]
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
        why_alone=next((made["why_alone"] for made in sources.made if made.get("why_alone")), None),
        cost=SweepCost(
            steps=steps,
            cpu_seconds=sum(made["cpu_seconds"] for made in sources.made),
            wall_seconds_of_tiles=sum(made["wall_seconds"] for made in sources.made),
            tiles=len(sources.made),
            estimate_cpu_seconds=sum(made.get("estimate_cpu_seconds", 0.0) for made in sources.made),
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
            f'given {shown(out)}; a folder is allowed, such as "runs" or a temporary one: finished '
            "members are saved there, so that the sweep can be resumed"
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
        if workers is not None and workers.local:
            for _ in range(min(workers.count(), wanted.count)):
                workers.executor.submit(get_ready, text, source)  # while this process still reads and checks
        known = begun if begun is not None and begun.config_sha256 == wanted.experiment.sha256 else None
        if known is None:  # a sweep that was begun before had all its members checked
            check_sweep(wanted)
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
    # tiles are sent back by workers that don't see the folder
    compute: Callable[..., bytes | None] = leave_tile if workers is None or workers.local else sent_tile
    here = ((task, compute(*task)) for task in tasks())
    for task, image in here if workers is None else workers.each(compute, tasks()):
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
    sources.gather()
    summary = summary_of(wanted, sources, wall, cpu)
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
    digest = write_dataset(folder.dataset, wanted, sources, attributes)
    summary = summary.having(dataset_sha256=digest)
    folder.write_summary(summary)
    return SavedSweep(folder, summary)
