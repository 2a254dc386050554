"""Tiles computed by several processes of this machine; a worker that dies costs the tile that it was at.

Workers leave tiles in files and send back no more than their sizes. A process that is killed while it writes
a long answer into the pipe of a ``ProcessPoolExecutor`` leaves half of it there, for whose other half the
pool waits for ever; what fits one write (``PIPE_BUF``, at least 512 bytes) arrives whole or not at all.
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
"""Workers that may die while a tile is in work; all tiles in work are blamed for each."""
_WATCH_SECONDS = 1.0


class Workers:
    """Processes that compute tiles; this one saves them.

    Args:
        count: of processes.
    """

    def __init__(self, count: int) -> None:
        self._count = count

    def images(self, generation: Generation, tiles: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """See ``Way``.

        Raises:
            StoppedError: workers die again and again at the same tile.
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
                    while waiting and len(running) < 2 * self._count:  # one ahead for each
                        tile = waiting[-1]  # waits on where the pool broke a moment ago and takes no more
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
    """Compute a tile (see ``tile_image``) and leave it in a file; its size in bytes."""
    return file.write_bytes(tile_image(*of))


def _processes(pool: ProcessPoolExecutor) -> list[Any]:
    return list((getattr(pool, "_processes", None) or {}).values())


def _refuse_dead(pool: ProcessPoolExecutor) -> None:
    """The pool looks for deaths among the workers that it had when it last looked up; this one among all.

    Raises:
        BrokenProcessPool: one has ended.
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
    """Nobody waits for what is in work."""
    processes = _processes(pool)
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.kill()
    for process in processes:
        process.join(5)


def _begin_worker(parent: int, between: Path) -> None:
    """Ctrl-C is for the process that started the workers, and they end with it, however it does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCH_SECONDS)
        shutil.rmtree(between, ignore_errors=True)  # it was killed, and can't do so itself
        os._exit(1)

    threading.Thread(target=watch, name="rigidsim watch", daemon=True).start()
