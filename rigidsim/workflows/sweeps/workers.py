"""Tiles computed by several processes of this machine; a worker that dies costs only the tile it worked on.

Workers leave tiles in files and send back only their sizes. A process that is killed while it writes
a long answer into the pipe of a ``ProcessPoolExecutor`` leaves half of it there, and the pool waits for the
rest for ever; what fits one write (``PIPE_BUF``, at least 512 bytes) arrives whole or not at all.
"""

from __future__ import annotations

import itertools
import multiprocessing
import os
import shutil
import signal
import tempfile
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from multiprocessing import forkserver
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
_IMPORTED = "rigidsim.workflows.sweeps.members"
"""What the server imports, so that its copies have it."""


class Workers:
    """Worker processes that compute tiles, which this process saves.

    What they need is imported from when the context is entered, beside this process's own imports, and traced
    and compiled while this process still checks; this module itself imports next to nothing.

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
        self._ended.callback(self._end_unused)
        forkserver.set_forkserver_preload([_IMPORTED])
        forkserver.ensure_running()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.close()
        self._between = None

    def _end_unused(self) -> None:
        pool, self._ahead = self._ahead, None
        if pool is not None:
            _end(pool)

    @contextmanager
    def ready_for(self, sweep: Sweep) -> Iterator[None]:
        """See ``Way``."""
        with nullcontext() if self._between is not None else self:
            assert self._between is not None
            count = min(self.count, sweep.count)
            self._ahead = self._pool(count, self._between)
            with suppress(BrokenProcessPool):  # whatever goes wrong is told when tiles need it
                for _ in range(count):
                    self._ahead.submit(get_ready, sweep.experiment.text)
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

        names = itertools.count()
        waiting = list(reversed(tiles))
        deaths: Counter[int] = Counter()
        while waiting:
            pool, self._ahead = self._ahead or self._pool(min(self.count, len(waiting)), between), None
            running: dict[Future[int], tuple[int, Path]] = {}
            try:
                while waiting or running:
                    while waiting and len(running) < 2 * self.count:  # one task ahead for each worker
                        tile = waiting[-1]  # keeps waiting if the pool broke just now and takes no more
                        file = between / str(next(names))  # given to nobody else, whoever still lives
                        running[pool.submit(leave_tile, file, *task(generation, tile))] = tile, file
                        waiting.pop()
                    done, _ = wait(running, timeout=0.5, return_when=FIRST_COMPLETED)
                    if not done:
                        _refuse_dead(pool)
                    for future in done:
                        future.result()
                        tile, file = running.pop(future)
                        yield tile, file.read_bytes()
                        file.unlink()
            except BrokenProcessPool:
                lost = [tile for tile, _ in running.values()]
                deaths.update(lost or waiting[-1:])
                _refuse_deadly(generation, deaths)
                waiting += sorted(lost, reverse=True)
            finally:
                _end(pool)

    def _pool(self, count: int, between: Path) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            count,
            mp_context=multiprocessing.get_context("forkserver"),
            initializer=_begin_worker,
            initargs=(between,),
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
    """Workers whose imports have begun, for commands that have yet to import; 1 if one process is enough."""
    return Workers(count) if count > 1 else nullcontext(1)


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


def _begin_worker(between: Path) -> None:
    """Initialize a worker: ignore Ctrl-C, which is for the parent, and end when parent or server end,
    however it does.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent, server = multiprocessing.parent_process(), os.getppid()
    assert parent is not None

    def watch() -> None:
        while parent.is_alive() and os.getppid() == server:
            parent.join(_WATCH_SECONDS)
        if not parent.is_alive():
            shutil.rmtree(between, ignore_errors=True)  # a parent that was killed can't do this itself
        os._exit(1)

    threading.Thread(target=watch, name="rigidsim watch", daemon=True).start()
