"""Ways to compute tiles: in this process, or in several of this machine; see ``cluster`` for others.

A worker that dies costs only the tile it worked on. Workers leave tiles in files and send back only their
sizes: a process that is killed while it writes a long answer into the pipe of a ``ProcessPoolExecutor``
leaves half of it there, and the pool waits for the rest for ever; what fits one write (``PIPE_BUF``, at least
512 bytes) arrives whole or not at all.
"""

import multiprocessing
import os
import shutil
import signal
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any, TypeVar

from rigidsim.errors import StoppedError, Wording
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.solve.compiled import quieten_engine
from rigidsim.store.sweeps.tiles import Generation
from rigidsim.workflows.sweeps.members import get_ready, tile_image

S = TypeVar("S")
T = TypeVar("T")
_MOST_DEATHS = 5
"""Deaths of workers after which a tile is given up; each counts against all tiles in work."""
_WATCH_SECONDS = 1.0


def task(
    generation: Generation, tile: int, source: str, data: str
) -> tuple[str, str, list[int], tuple[str, ...], bool | None, str]:
    """Arguments of ``tile_image`` for a tile."""
    work, _ = generation.work_of(tile)
    members = generation.members_of(tile).tolist()
    return generation.config, source, members, work.keep, generation.apart, data


class Way:
    """Computes tiles; no bit depends on which way is used. This one does in this process, one by one.

    Attributes:
        source: where the config is from, by which its kernels are found.
        data: folder of what members are fitted to, where they are fits.
    """

    source = ""
    data = ""

    def ready_for(self, sweep: Sweep) -> AbstractContextManager[object]:
        """Get ready for a sweep's tiles, beside whatever is still to be looked at before any is computed; at
        the end of the context whatever was started is ended.
        """
        return nullcontext()

    def each(self, function: Callable[[S], T], tasks: Sequence[S]) -> Iterable[T]:
        """Like ``map``, beside whatever this process does meanwhile where others can."""
        return map(function, tasks)

    def images(self, generation: Generation, tiles: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """Numbers and sealed files of tiles, in any order, within the context of ``ready_for``; RigidsimError
        if no more can be computed.
        """
        for tile in tiles:
            yield tile, tile_image(*task(generation, tile, self.source, self.data))


class Workers(Way):
    """``count`` worker processes that compute tiles, which this process saves."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._between = Path()
        self._pool: ProcessPoolExecutor | None = None

    @contextmanager
    def ready_for(self, sweep: Sweep) -> Iterator[None]:
        """See ``Way``: workers trace and compile while this process still reads and checks."""
        with tempfile.TemporaryDirectory(prefix="rigidsim-tiles-") as folder:
            self._between = Path(folder)
            self._pool = self._started()
            try:
                with suppress(BrokenProcessPool):  # whatever goes wrong is told when tiles need it
                    for _ in range(min(self._count, sweep.count)):
                        self._pool.submit(get_ready, sweep.experiment.text, sweep.experiment.source)
                yield
            finally:
                self._end()

    def each(self, function: Callable[[S], T], tasks: Sequence[S]) -> Iterable[T]:
        """See ``Way``; answers have to be short, see the module."""
        given: Iterable[T] = ()
        with suppress(BrokenProcessPool):
            given = () if self._pool is None else self._pool.map(function, tasks)
        return _rest_here(function, tasks, given)

    def images(self, generation: Generation, tiles: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """See ``Way``; StoppedError if workers die repeatedly at the same tile."""
        waiting = list(reversed(tiles))
        deaths: Counter[int] = Counter()
        while waiting:
            self._pool = self._pool or self._started()
            running: dict[Future[int], int] = {}
            try:
                yield from self._images(self._pool, generation, waiting, running)
            except BrokenProcessPool:
                self._end()
                lost = list(running.values())
                deaths.update(lost or waiting[-1:])
                _refuse_deadly(generation, deaths)
                waiting += sorted(lost, reverse=True)

    def _images(
        self,
        pool: ProcessPoolExecutor,
        generation: Generation,
        waiting: list[int],
        running: dict[Future[int], int],
    ) -> Iterator[tuple[int, bytes]]:
        while waiting or running:
            while waiting and len(running) < 2 * self._count:  # one task ahead for each worker
                tile = waiting[-1]  # keeps waiting if the pool broke just now and takes no more
                running[
                    pool.submit(
                        leave_tile, self._between / str(tile), *task(generation, tile, self.source, self.data)
                    )
                ] = tile
                waiting.pop()
            done, _ = wait(running, timeout=0.5, return_when=FIRST_COMPLETED)
            if not done and not all(process.is_alive() for process in _processes(pool)):
                raise BrokenProcessPool("a worker died")  # the pool itself watches only those it knew
            for future in sorted(done, key=lambda one: one.exception() is not None):  # raised last
                future.result()
                tile = running.pop(future)
                file = self._between / str(tile)
                yield tile, file.read_bytes()
                file.unlink()

    def _started(self) -> ProcessPoolExecutor:
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(
            self._count, context, _begin_worker, (os.getpid(), self._between, Wording.commands)
        )

    def _end(self) -> None:
        """End the workers at once; their results are no longer needed."""
        pool, self._pool = self._pool, None
        if pool is not None:
            processes = _processes(pool)
            pool.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                process.kill()
            for process in processes:
                process.join(5)


def _rest_here(function: Callable[[S], T], tasks: Sequence[S], given: Iterable[T]) -> Iterator[T]:
    """What others found, and of tasks whose worker died the rest."""
    known = 0
    with suppress(BrokenProcessPool):
        for found in given:
            yield found
            known += 1
    yield from map(function, tasks[known:])


def leave_tile(file: Path, *of: Any) -> int:
    """Compute a tile (see ``tile_image``) and leave it in a file; returns its size in bytes."""
    return file.write_bytes(tile_image(*of))


def _processes(pool: ProcessPoolExecutor) -> list[Any]:
    return list((getattr(pool, "_processes", None) or {}).values())


def _refuse_deadly(generation: Generation, deaths: Counter[int]) -> None:
    tile, count = deaths.most_common(1)[0]
    if count >= _MOST_DEATHS:
        members = generation.members_of(tile)
        raise StoppedError(
            f"workers died {count} times while members {members[0]} to {members[-1]} were in work (memory "
            "that ran out ends a process so); take fewer workers, a smaller [sweep] tile, or fewer samples"
        )


def _begin_worker(parent: int, between: Path, commands: bool) -> None:
    """Initialize a worker: ignore Ctrl-C, which is for the parent, and end when the parent ends, however it
    does.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Wording.commands = commands
    quieten_engine()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCH_SECONDS)
        shutil.rmtree(between, ignore_errors=True)  # a parent that was killed can't do this itself
        os._exit(1)  # by which alone a thread ends the whole process, whatever the others do

    threading.Thread(target=watch, name="rigidsim watch", daemon=True).start()
