"""Ways to compute tiles: here, in other processes, or on a cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

from rigidsim.store.sweeps.generation import Generation
from rigidsim.workflows.sweeps.members import tile_image


class Way(Protocol):
    """Computes tiles; no bit of them depends on which way it is."""

    def images(self, generation: Generation, tiles: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """Numbers and sealed files of tiles, in whatever order they come.

        Raises:
            KeyboardInterrupt: it was interrupted.
            RigidsimError: no more of them can be computed.
        """


class OneProcess:
    """In this process, one after the other."""

    def images(self, generation: Generation, tiles: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """See ``Way``."""
        for tile in tiles:
            yield tile, tile_image(*task(generation, tile))


def task(generation: Generation, tile: int) -> tuple[str, list[int], tuple[str, ...]]:
    """What ``tile_image`` takes."""
    work, _ = generation.work_of(tile)
    return generation.config, generation.members_of(tile).tolist(), work.keep
