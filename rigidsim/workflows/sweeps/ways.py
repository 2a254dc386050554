"""Ways to compute tiles: in this process, in others, or on a cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

from rigidsim.store.sweeps.generation import Generation
from rigidsim.workflows.sweeps.members import tile_image


class Way(Protocol):
    """Computes tiles; no bit depends on which way is used."""

    def images(self, generation: Generation, tiles: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """Numbers and sealed files of tiles, in any order.

        Raises:
            KeyboardInterrupt: the work was interrupted.
            RigidsimError: no more tiles can be computed.
        """


class OneProcess:
    """Computes tiles in this process, one after the other."""

    def images(self, generation: Generation, tiles: Sequence[int]) -> Iterator[tuple[int, bytes]]:
        """See ``Way``."""
        for tile in tiles:
            yield tile, tile_image(*task(generation, tile))


def task(generation: Generation, tile: int) -> tuple[str, list[int], tuple[str, ...]]:
    """Arguments of ``tile_image`` for a tile."""
    work, _ = generation.work_of(tile)
    return generation.config, generation.members_of(tile).tolist(), work.keep
