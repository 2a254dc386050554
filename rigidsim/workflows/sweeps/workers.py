"""Tiles computed by several processes of this machine; a worker that dies costs only the tile it worked on.

Workers leave tiles in files and send back only their sizes. A process that is killed while it writes
a long answer into the pipe of a ``ProcessPoolExecutor`` leaves half of it there, and the pool waits for the
rest for ever; what fits one write (``PIPE_BUF``, at least 512 bytes) arrives whole or not at all.
"""

from __future__ import annotations

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
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from rigidsim.errors import StoppedError

if TYPE_CHECKING:
    from rigidsim.scene.sweeps.sweep import Sweep
    from rigidsim.store.sweeps.generation import Generation

S = TypeVar("S")
T = TypeVar("T")
_MOST_DEATHS = 5
"""Deaths of workers after which a tile is given up; each counts against all tiles in work."""
_WATCH_SECONDS = 1.0


class Workers:
    """Worker processes that compute tiles, which this process saves.

    They are started as soon as the context is entered, and import, trace and compile while this process still
    imports, reads and checks; this module itself imports next to nothing.

    Args:
        count: number of processes.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._ended = ExitStack()
        self._between: Path | None = None
        self._ahead: ProcessPoolExecutor | None = None

    def __enter__(self) -> Workers:
        folder = tempfile.TemporaryDirectory(prefix="rigidsim-tiles-")
        self._between = Path(self._ended.enter_context(folder))
        self._ahead = self._pool(self.count, self._between)
        self._ended.callback(self._end_unused)
        self._submit_ahead(min(self.count, os.cpu_count() or 1), get_imported)
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.close()
        self._between = None

    def _submit_ahead(self, times: int, function: Callable[..., None], *of: Any) -> None:
        """Have each worker do what tiles will need; whatever goes wrong is told when they need it."""
        with suppress(BrokenProcessPool):
            for _ in range(times):
                if self._ahead is not None:
                    self._ahead.submit(function, *of)

    def _end_unused(self) -> None:
        pool, self._ahead = self._ahead, None
        if pool is not None:
            _end(pool)

    @contextmanager
    def ready_for(self, sweep: Sweep) -> Iterator[None]:
        """See ``Way``."""
        with nullcontext() if self._between is not None else self:
            self._submit_ahead(min(self.count, sweep.count), get_ready, sweep.experiment.text)
            yield

    def each(self, function: Callable[[S], T], tasks: Sequence[S]) -> Iterable[T]:
        """See ``Way``; answers have to be short, see the module."""
        given: Iterable[T] = ()
        with suppress(BrokenProcessPool):
            given = self._ahead.map(function, tasks) if self._ahead is not None else ()
        return _rest_here(function, tasks, given)

    def images(self, generation: Generation, tiles: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """See ``Way``.

        Raises:
            StoppedError: workers die repeatedly at the same tile.
        """
        with nullcontext() if self._between is not None else self:
            assert self._between is not None
            yield from self._images(generation, tiles, self._between)

    def _images(
        self, generation: Generation, tiles: Sequence[int], between: Path
    ) -> Iterator[tuple[int, bytes]]:
        from rigidsim.workflows.sweeps.ways import task

        waiting = list(reversed(tiles))
        deaths: Counter[int] = Counter()
        while waiting:
            pool, self._ahead = self._ahead or self._pool(min(self.count, len(waiting)), between), None
            running: dict[Future[int], int] = {}
            try:
                while waiting or running:
                    while waiting and len(running) < 2 * self.count:  # one task ahead for each worker
                        tile = waiting[-1]  # keeps waiting if the pool broke just now and takes no more
                        file = between / str(tile)
                        running[pool.submit(leave_tile, file, *task(generation, tile))] = tile
                        waiting.pop()
                    done, _ = wait(running, timeout=0.5, return_when=FIRST_COMPLETED)
                    if not done:
                        _refuse_dead(pool)
                    for future in done:
                        future.result()
                        tile = running.pop(future)
                        file = between / str(tile)
                        yield tile, file.read_bytes()
                        file.unlink()
            except BrokenProcessPool:
                lost = list(running.values())
                deaths.update(lost or waiting[-1:])
                _refuse_deadly(generation, deaths)
                waiting += sorted(lost, reverse=True)
            finally:
                _end(pool)

    def _pool(self, count: int, between: Path) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            count,
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_begin_worker,
            initargs=(os.getpid(), between),
        )


def _rest_here(function: Callable[[S], T], tasks: Sequence[S], given: Iterable[T]) -> Iterator[T]:
    """What others found, and of tasks whose worker died the rest."""
    known = 0
    with suppress(BrokenProcessPool):
        for found in given:
            yield found
            known += 1
    yield from map(function, tasks[known:])


def started(count: int) -> AbstractContextManager[Workers | int]:
    """Workers that are started already, for commands that have yet to import; 1 if one process is enough."""
    return Workers(count) if count > 1 else nullcontext(1)


def get_imported() -> None:
    """Import what tiles need."""
    import rigidsim.workflows.sweeps.members  # noqa: F401


def get_ready(config: str) -> None:
    """Trace and compile what tiles need (see ``rigidsim.workflows.sweeps.members.get_ready``)."""
    from rigidsim.workflows.sweeps import members

    members.get_ready(config)


def leave_tile(file: Path, *of: Any) -> int:
    """Compute a tile (see ``tile_image``) and leave it in a file; returns its size in bytes."""
    from rigidsim.workflows.sweeps.members import tile_image

    return file.write_bytes(tile_image(*of))


def _processes(pool: ProcessPoolExecutor) -> list[Any]:
    return list((getattr(pool, "_processes", None) or {}).values())


def _refuse_dead(pool: ProcessPoolExecutor) -> None:
    """Raise if any worker has died; the pool itself watches only the workers it had when it last looked.

    Raises:
        BrokenProcessPool: a worker has ended.
    """
    if not all(process.is_alive() for process in _processes(pool)):
        raise BrokenProcessPool("a worker died")


def _refuse_deadly(generation: Generation, deaths: Counter[int]) -> None:
    tile, count = deaths.most_common(1)[0]
    if count >= _MOST_DEATHS:
        members = generation.members_of(tile)
        raise StoppedError(
            f"workers died {count} times while members {members[0]} to {members[-1]} were in work (memory "
            "that ran out ends a process so); take fewer workers, a smaller [sweep] tile, or fewer samples"
        )


def _end(pool: ProcessPoolExecutor) -> None:
    """End the workers at once; their results are no longer needed."""
    processes = _processes(pool)
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.kill()
    for process in processes:
        process.join(5)


def _begin_worker(parent: int, between: Path) -> None:
    """Initialize a worker: ignore Ctrl-C, which is for the parent, and end when the parent ends, however it
    does.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCH_SECONDS)
        shutil.rmtree(between, ignore_errors=True)  # a parent that was killed can't do this itself
        os._exit(1)

    threading.Thread(target=watch, name="rigidsim watch", daemon=True).start()
