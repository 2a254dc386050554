"""Tiles computed by several processes of this machine; a worker that dies costs the tile that it was at."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from rigidsim.errors import StoppedError
from rigidsim.store.sweep_generation import Generation
from rigidsim.workflows.sweep_members import tile_image
from rigidsim.workflows.sweep_ways import task

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
        waiting = list(reversed(tiles))
        deaths: Counter[int] = Counter()
        while waiting:
            pool = self._pool(len(waiting))
            running: dict[Future[bytes], int] = {}
            try:
                while waiting or running:
                    while waiting and len(running) < 2 * self._count:  # one ahead for each
                        tile = waiting.pop()
                        running[pool.submit(tile_image, *task(generation, tile))] = tile
                    done, _ = wait(running, timeout=0.5, return_when=FIRST_COMPLETED)
                    if not done:
                        _refuse_dead(pool)
                    for future in done:
                        image = future.result()
                        yield running.pop(future), image
            except BrokenProcessPool:
                lost = list(running.values())
                deaths.update(lost)
                _refuse_deadly(generation, deaths)
                waiting += sorted(lost, reverse=True)
            finally:
                _end(pool)

    def _pool(self, tiles: int) -> ProcessPoolExecutor:
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(
            min(self._count, tiles), mp_context=context, initializer=_begin_worker, initargs=(os.getpid(),)
        )


def _processes(pool: ProcessPoolExecutor) -> list[Any]:
    return list((getattr(pool, "_processes", None) or {}).values())


def _refuse_dead(pool: ProcessPoolExecutor) -> None:
    """The pool itself doesn't notice a worker that dies while it sends a tile: it waits for the rest of it.

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


def _begin_worker(parent: int) -> None:
    """Ctrl-C is for the process that started the workers, and they end with it, however it does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCH_SECONDS)
        os._exit(1)

    threading.Thread(target=watch, name="rigidsim watch", daemon=True).start()
