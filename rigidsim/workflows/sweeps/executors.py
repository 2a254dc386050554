"""Computing tiles: in this process, in others of this machine, or by the workers of a Dask cluster.

No bit depends on which is used. A worker process that dies ends the session, and all tiles that are complete
stay. Dask computes the tiles of a worker that died with others.
"""

import itertools
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import RigidsimError, StoppedError, Wording
from rigidsim.scene.sweep import Sweep
from rigidsim.solve.compiled import quieten_engine
from rigidsim.store import atomic, provenance
from rigidsim.store.sweeps.tiles import Tile, plain
from rigidsim.workflows.sweeps.members import MemberResults, kernel_of_members, run_members, sweep_of

_LOOK_SECONDS = 0.5


def results_of(
    sweep: Sweep, members: Sequence[int], keep: Sequence[str], alone: bool | None, data: Path
) -> MemberResults:
    """Run or fit some members, see ``run_members``; ``data``: the folder of what they are fitted to."""
    if not sweep.fits:
        return run_members(sweep, members, keep, alone)
    from rigidsim.workflows.sweeps.fits import fit_members  # which few sweeps need

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
