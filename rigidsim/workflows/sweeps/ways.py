"""Ways to compute tiles: in this process, in others, or on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol, TypeVar

from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.store.sweeps.generation import Generation
from rigidsim.workflows.sweeps.members import tile_image

S = TypeVar("S")
T = TypeVar("T")


class Way(Protocol):
    """Computes tiles; no bit depends on which way is used."""

    def ready_for(self, sweep: Sweep) -> AbstractContextManager[object]:
        """Get ready for a sweep's tiles, beside whatever is still to be looked at before any is computed; at
        the end of the context whatever was started is ended.
        """

    def each(self, function: Callable[[S], T], tasks: Sequence[S]) -> Iterable[T]:
        """Like ``map``, beside whatever this process does meanwhile where others can."""

    def images(self, generation: Generation, tiles: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """Numbers and sealed files of tiles, in any order.

        Raises:
            KeyboardInterrupt: the work was interrupted.
            RigidsimError: no more tiles can be computed.
        """


class OneProcess:
    """Computes tiles in this process, one after the other."""

    def ready_for(self, sweep: Sweep) -> AbstractContextManager[object]:
        """See ``Way``."""
        return nullcontext()

    def each(self, function: Callable[[S], T], tasks: Sequence[S]) -> Iterable[T]:
        """See ``Way``."""
        return map(function, tasks)

    def images(self, generation: Generation, tiles: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """See ``Way``."""
        for tile in tiles:
            yield tile, tile_image(*task(generation, tile))


def task(generation: Generation, tile: int) -> tuple[str, list[int], tuple[str, ...], bool | None]:
    """Arguments of ``tile_image`` for a tile."""
    work, _ = generation.work_of(tile)
    return generation.config, generation.members_of(tile).tolist(), work.keep, generation.apart
