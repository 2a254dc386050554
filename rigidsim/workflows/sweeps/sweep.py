"""Running a sweep: tiles of members until all are there, then the dataset; resumable whatever ends it."""

import json
import multiprocessing
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rigidsim.errors import FORCE, OUT, ConfigError, Problem, RunFolderError
from rigidsim.scene.scene import build_scene
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.scene.toml_text import apply_overrides, parse_toml
from rigidsim.scene.validation_messages import shown
from rigidsim.session.dataset import kernel_attributes
from rigidsim.store.outputs import refuse_inputs
from rigidsim.store.sweeps.dataset import write_dataset
from rigidsim.store.sweeps.folder import SweepFolder
from rigidsim.store.sweeps.run import SavedSweep, open_sweep
from rigidsim.store.sweeps.sources import TileReader, gather, sources_of
from rigidsim.store.sweeps.tiles import Generation
from rigidsim.store.variables import SCHEMA_VERSION
from rigidsim.workflows.fit.readings import folder_of
from rigidsim.workflows.read import Given, as_experiment, reads_kernels
from rigidsim.workflows.sweeps.batch import why_alone
from rigidsim.workflows.sweeps.cluster import Cluster
from rigidsim.workflows.sweeps.fits import given_files, keep_data, refuse_other_data
from rigidsim.workflows.sweeps.members import batches_of, recording, refuse_other_kernel, sweep_of
from rigidsim.workflows.sweeps.plan import check_sweep, refuse_untold_tiles, tile_length
from rigidsim.workflows.sweeps.summary import summary_of
from rigidsim.workflows.sweeps.ways import Way, Workers


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
    return run_sweep(
        recording(Sweep.of(given)),
        folder,
        force=force,
        way=_way(workers, scheduler),
        share=tiles,
        observer=observer or SweepObserver(),
        beside=folder_of(given),
    )


def resume_sweep(
    path: str | Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    observer: SweepObserver | None = None,
) -> SavedSweep:
    """Complete a sweep that was interrupted or killed."""
    folder = open_sweep(path).folder
    generations = folder.generations()
    if not generations:
        return open_sweep(path)
    return run_sweep(
        sweep_of(generations[-1].config), folder, way=_way(workers, scheduler),
        observer=observer or SweepObserver(),
    )  # fmt: skip


def _way(workers: int, scheduler: str | None) -> Way:
    if scheduler is not None:
        return Cluster(scheduler)
    if workers > 1 and getattr(multiprocessing.current_process(), "_inheriting", False):
        # this is a worker, which reads the caller's script again before it begins
        raise SystemExit(
            "rigidsim.sweep: workers read the script again that started them, and come upon the sweep "
            'itself: put what the script does under  if __name__ == "__main__":'
        )
    return Workers(workers) if workers > 1 else Way()


def run_sweep(
    wanted: Sweep,
    folder: SweepFolder,
    *,
    way: Way,
    observer: SweepObserver,
    force: bool = False,
    share: tuple[int, int] | None = None,
    beside: Path | None = None,
) -> SavedSweep:
    """See ``sweep``; ``beside``: where data of fits lie, None if the copies in the folder have to do."""
    if share is not None and force:
        raise RunFolderError(f"{FORCE} is for a sweep as a whole, and its tiles are computed by others, too")
    if share is not None and not folder.generations():
        refuse_untold_tiles(wanted)
    files = given_files(wanted) if wanted.fits else []
    refuse_other_data(files, beside, folder.data, anew=force)
    observer.checking(wanted)
    began, cpu = time.perf_counter(), time.process_time()
    if _complete(wanted, folder) and not force:
        with folder.locked(shared=share is not None):
            done = open_sweep(folder.path)
            done.refuse_damaged()
            observer.nothing_left()
            return done
    with way.ready_for(wanted):
        # a sweep that was begun before had all its members checked
        known = any(g.config_sha256 == wanted.experiment.sha256 for g in folder.generations()[-1:])
        check_sweep(wanted, every=not known, each=way.each)
        length = None if known else tile_length(wanted)
        with folder.locked(shared=share is not None):
            if share is None:
                folder.begin(force=force)
            _refuse_other(wanted, folder)
            if beside is not None and files:
                keep_data(files, beside, folder.data)
            way.data = str(folder.data.absolute())
            way.source = wanted.experiment.source
            for begun in folder.generations() if reads_kernels(wanted.base) else ():
                for tile in folder.present(begun).nonzero()[0][:1].tolist():
                    made = folder.read(begun, tile).made
                    refuse_other_kernel(wanted, made, folder.tile(begun, tile))
            generation = _generation(wanted, folder, length, exclusive=share is not None)
            interrupted = _run_tiles(folder, generation, way, share, observer)
            all_there = bool(folder.present(generation).all())
    if interrupted is not None:
        raise interrupted
    if not all_there:
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

    The config beside a finished dataset tells this, too: its tiles may have been deleted.
    """
    for config in [g.config for g in folder.generations()[-1:]] or folder.finished_config():
        try:
            same = identity(sweep_of(config, wanted.experiment.source)) == identity(wanted)
        except ConfigError:  # edited, or of a version that had other keys
            same = False
        if not same:
            raise RunFolderError(
                f"{folder.path}: holds a sweep of another experiment or of other keys; {FORCE} replaces it, "
                f"another {OUT} or name puts this one elsewhere"
            )


def identity(sweep: Sweep) -> str:
    """What members share: the config without swept values and without values that no number depends on."""
    tables = parse_toml(sweep.experiment.text, sweep.experiment.source)
    alone = not tables.get("sweep", {}).get("batch", True)
    for key in ("name", "description", "sweep"):
        tables.pop(key, None)
    for key in ("timeline", "timeline_rows"):
        tables.get("output", {}).pop(key, None)
    if not tables.get("output", True):
        del tables["output"]
    keys = sorted(axis.key for axis in sweep.axes)
    apply_overrides(tables, [f'{key}="swept"' for key in keys])
    return json.dumps([keys, tables, *(["alone"] if alone else [])], sort_keys=True, default=str)


def _generation(wanted: Sweep, folder: SweepFolder, length: int | None, *, exclusive: bool) -> Generation:
    """The latest generation if it is of this config and has all that is missing, otherwise a new one."""
    generations = folder.generations()
    latest = [g for g in generations[-1:] if g.config_sha256 == wanted.experiment.sha256]
    if latest and len(generations) == 1:
        return latest[0]
    known = [(g, sweep_of(g.config, wanted.experiment.source)) for g in generations]
    if latest and not sources_of(wanted, folder, known, to_come=latest[0]).works():
        return latest[0]  # otherwise tiles of an earlier one are gone
    works = sources_of(wanted, folder, known).works()
    number = generations[-1].number + 1 if generations else 0
    length = length or tile_length(wanted)
    made = Generation(number, wanted.experiment.text, length, works, _apart(wanted, generations))
    return folder.add(made, exclusive=exclusive)


def _apart(wanted: Sweep, generations: Sequence[Generation]) -> bool | None:
    """See ``Generation``: as it was found first, so that more members don't change those that are there."""
    if generations:
        return generations[0].apart
    return (
        None
        if why_alone(wanted, ())
        else batches_of(wanted.experiment.text, wanted.experiment.source).apart is not None
    )


def _run_tiles(
    folder: SweepFolder,
    generation: Generation,
    way: Way,
    share: tuple[int, int] | None,
    observer: SweepObserver,
) -> KeyboardInterrupt | None:
    """Compute the missing tiles; returns what interrupted the work, if anything."""
    present = folder.present(generation)
    first, stop = (0, generation.tiles) if share is None else share
    ours = range(max(first, 0), min(stop, generation.tiles))
    missing = [tile for tile in ours if not present[tile]]
    members = sum(len(generation.members_of(tile)) for tile in ours) if share else generation.members
    done = members - sum(len(generation.members_of(tile)) for tile in missing)
    observer.started(folder.path, members, done)
    os.utime(folder.generation_file(generation))
    try:
        for tile, image in way.images(generation, missing):
            folder.save(generation, tile, image)
            done += len(generation.members_of(tile))
            observer.progressed(done)
    except KeyboardInterrupt as interruption:
        return interruption
    return None


def _completed(wanted: Sweep, folder: SweepFolder, wall: float, cpu: float) -> SavedSweep:
    """Write dataset and summary once all tiles are there."""
    generations = folder.generations()
    sources = sources_of(
        wanted, folder, [(g, sweep_of(g.config, wanted.experiment.source)) for g in generations]
    )
    reader = TileReader(folder, generations)
    found = gather(sources, reader)
    summary = summary_of(wanted, sources, reader, found, wall, cpu)
    attributes = {
        "Conventions": "CF-1.11",
        "title": wanted.experiment.config.name,
        "comment": wanted.experiment.config.description,
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
    digest = write_dataset(folder.dataset, wanted, sources, reader, found, attributes)
    summary = summary.having(dataset_sha256=digest)
    folder.write_summary(summary)
    return SavedSweep(folder, summary)
