"""Tiles computed by the workers of a Dask cluster; their files come back here and are saved here.

The workers need rigidsim and nothing of this machine's disk. A few tiles for each of their threads are out at
any time, so that nobody ever holds many. A finished one stays on its worker until it is fetched; if that dies
first, the tile is computed again, and whoever fetches it waits meanwhile, for ever if no worker is left: so a
thread fetches, while this one keeps checking whether there are workers.
"""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from concurrent.futures import wait as wait_for
from threading import Thread
from typing import Any

from rigidsim.errors import RigidsimError, StoppedError
from rigidsim.store.sweeps.tiles import Generation
from rigidsim.workflows.sweeps.members import tile_image
from rigidsim.workflows.sweeps.ways import Way, task

_AHEAD = 2  # tiles out for each thread
_MOST_DEATHS = 5  # times that Dask may give a tile up, after several workers died at it each time
_LOOK_SECONDS = 5
_TELL_SECONDS = 0.2


class Cluster(Way):
    """Workers of a Dask scheduler (``tcp://10.0.0.1:8786``), which must answer within ``patience`` seconds
    and may be without workers for ``alone`` seconds; they have nothing to do for a sweep before its first
    tile.
    """

    def __init__(self, address: str, patience: float = 20.0, alone: float = 120.0) -> None:
        self._address, self._patience, self._alone = address, patience, alone
        self._without_since: float | None = None

    def images(self, generation: Generation, tiles: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """See ``Way``; StoppedError if workers die repeatedly at the same tile, or the scheduler is gone."""
        distributed = _distributed()
        try:
            client = distributed.Client(self._address, timeout=self._patience, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise RigidsimError(
                f"--scheduler {self._address}: no Dask scheduler answers ({error or type(error).__name__}); "
                "start one with: dask scheduler"
            ) from None
        with client:
            try:
                yield from self._stream(distributed, client, generation, list(reversed(tiles)))
            except (OSError, RuntimeError) as error:  # what Dask raises if a connection is gone
                if client.status == "running":
                    raise
                raise StoppedError(
                    f"--scheduler {self._address}: the scheduler is gone; start it again, with its workers, "
                    "and give the command again; the tiles that are complete are kept"
                ) from error

    def _stream(
        self, distributed: Any, client: Any, generation: Generation, waiting: list[int]
    ) -> Iterator[tuple[int, bytes]]:
        self._without_since = None
        deaths: Counter[int] = Counter()
        running: dict[Any, int] = {}
        while waiting or running:
            ahead = _AHEAD * max(1, self._threads(client))
            while waiting and len(running) < ahead:
                tile = waiting.pop()
                future = client.submit(
                    tile_image, *task(generation, tile, self.source, self.data), pure=False, retries=2
                )
                running[future] = tile
            done = _first_done(distributed, client, list(running))
            if done is None:
                continue
            future, tile = done, running.pop(done)
            try:
                image = _fetched(future, lambda: self._threads(client))
            except distributed.KilledWorker:
                deaths[tile] += 1
                if deaths[tile] >= _MOST_DEATHS:
                    members = generation.members_of(tile)
                    raise StoppedError(
                        f"workers died again and again while members {members[0]} to {members[-1]} were in "
                        "work; give workers more memory, or take a smaller [sweep] tile"
                    ) from None
                waiting.append(tile)
                continue
            except distributed.CancelledError:  # the scheduler lost it with the worker that had it
                waiting.append(tile)
                continue
            yield tile, image

    def _threads(self, client: Any) -> int:
        """Total number of workers' threads; StoppedError if there has been no worker for too long."""
        threads = sum(client.nthreads().values())
        now = time.monotonic()
        self._without_since = None if threads else self._without_since or now
        if self._without_since is not None and now - self._without_since > self._alone:
            raise StoppedError(
                f"--scheduler {self._address}: no worker is left there; start some with: dask worker "
                f"{self._address}, and give the command again; the tiles that are complete are kept"
            )
        return int(threads)


def _fetched(future: Any, look: Callable[[], object]) -> bytes:
    """Bytes of a finished tile; if its worker is gone, the tile is computed again first."""
    fetched: Future[bytes] = Future()

    def fetch() -> None:
        try:
            fetched.set_result(future.result())
        except BaseException as error:  # passed on to the waiting thread
            fetched.set_exception(error)

    Thread(target=fetch, name="rigidsim fetch", daemon=True).start()  # ends with the client at the latest
    while not wait_for([fetched], timeout=_LOOK_SECONDS).done:
        look()
    return fetched.result()


def _first_done(distributed: Any, client: Any, futures: list[Any]) -> Any:
    """A future that has ended; None if none does within some seconds."""
    try:
        with client.as_current():
            found = distributed.wait(futures, timeout=_LOOK_SECONDS, return_when="FIRST_COMPLETED")
    except TimeoutError:
        return None
    except distributed.CancelledError:  # one of them was lost with the worker that had it
        lost = next((future for future in futures if future.status == "cancelled"), None)
        if lost is None:  # which one isn't known yet
            time.sleep(_TELL_SECONDS)
        return lost
    return next(iter(found.done), None)


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise RigidsimError(
            "--scheduler needs Dask, which isn't installed; pip install 'rigidsim[cluster]'"
        ) from None
    return distributed
