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
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from rigidsim.errors import StoppedError
from rigidsim.store.sweeps.generation import Generation
from rigidsim.workflows.sweeps.members import tile_image
from rigidsim.workflows.sweeps.ways import task

_MOST_DEATHS = 5
"""Deaths of workers after which a tile is given up; each counts against all tiles in work."""
_WATCH_SECONDS = 1.0


class Workers:
    """Worker processes that compute tiles, which this process saves.

    Args:
        count: number of processes.
    """

    def __init__(self, count: int) -> None:
        self._count = count

    def images(self, generation: Generation, tiles: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """See ``Way``.

        Raises:
            StoppedError: workers die repeatedly at the same tile.
        """
        with tempfile.TemporaryDirectory(prefix="rigidsim-tiles-") as between:
            yield from self._images(generation, tiles, Path(between))

    def _images(
        self, generation: Generation, tiles: Sequence[int], between: Path
    ) -> Iterator[tuple[int, bytes]]:
        waiting = list(reversed(tiles))
        deaths: Counter[int] = Counter()
        while waiting:
            pool = self._pool(len(waiting), between)
            running: dict[Future[int], int] = {}
            try:
                while waiting or running:
                    while waiting and len(running) < 2 * self._count:  # one task ahead for each worker
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

    def _pool(self, tiles: int, between: Path) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            min(self._count, tiles),
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_begin_worker,
            initargs=(os.getpid(), between),
        )


def leave_tile(file: Path, *of: Any) -> int:
    """Compute a tile (see ``tile_image``) and leave it in a file; returns its size in bytes."""
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
