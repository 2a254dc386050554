"""Tiles of a sweep, read once and checked: which variables they hold, of which sizes, at which times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from rigidsim.errors import RESUME, RunFolderError
from rigidsim.store.sweeps.folder import SweepFolder
from rigidsim.store.sweeps.generation import Generation
from rigidsim.store.sweeps.sources import ALWAYS, Sources, plain, tile_of
from rigidsim.store.sweeps.tile import Tile, TileVariable

_TILES_IN_MEMORY = 96


@dataclass
class Described:
    """A variable as tiles describe it; ``extra``: largest sizes of dimensions besides the members'."""

    variable: TileVariable
    whole: bool
    extra: tuple[int, ...]


@dataclass
class Gathered:
    """What the tiles hold, known before their numbers are read again.

    Attributes:
        times: sample times that all members share; None if they differ, or aren't kept.
        reasons: why each failed member ended, by member.
        made: how each tile was made, see ``Tile``.
    """

    variables: dict[str, Described] = field(default_factory=dict)
    times: np.ndarray | None = None
    reasons: dict[int, str] = field(default_factory=dict)
    made: list[Mapping[str, Any]] = field(default_factory=list)


class TileReader:
    """Reads tiles of a folder and keeps the latest in memory."""

    def __init__(self, folder: SweepFolder, generations: Sequence[Generation]) -> None:
        self._folder = folder
        self._generations = {generation.number: generation for generation in generations}
        self.tile = lru_cache(_TILES_IN_MEMORY)(self._read)

    @property
    def place(self) -> str:
        """Path of the sweep's folder."""
        return str(self._folder.path)

    def _read(self, key: int) -> Tile:
        """A tile, by its ``key_of``; RunFolderError if it is damaged."""
        generation, number = tile_of(key)
        return self._folder.read(self._generations[generation], number)


def gather(sources: Sources, reader: TileReader) -> Gathered:
    """Read once every tile that is used; RunFolderError if one is gone, damaged, or disagrees with others."""
    found = Gathered()
    if len(sources.missing):
        gone = len(sources.missing)
        raise RunFolderError(f"{reader.place}: tiles of {gone:,} members are gone; {RESUME} computes them")
    common: np.ndarray | None = None
    alike = True
    always = sources.found[ALWAYS]
    for key, wanted in _tiles(sources).items():
        tile = reader.tile(key)
        found.made.append(tile.made)
        for name, variable in tile.variables.items():
            if variable.item not in wanted:
                continue
            values = tile.arrays.get(name, np.zeros((len(tile.members), *(0 for _ in variable.dims))))
            known = found.variables.get(name)
            if known is None:
                whole = values.dtype.kind == "i"
                found.variables[name] = Described(variable, whole, values.shape[1:])
            elif known.variable.dims != variable.dims:
                raise RunFolderError(f"{reader.place}: tiles disagree about {name}")
            else:
                known.extra = tuple(map(max, known.extra, values.shape[1:]))
        if "time" in tile.arrays and "series" in wanted and alike:
            common, alike = _common(common, tile.arrays["time"])
        if tile.reasons:
            for member in np.flatnonzero(always.tile == key):
                why = tile.reasons.get(int(always.row[member]))
                if why is not None:
                    found.reasons[int(member)] = why
    found.times = common if alike else None
    return found


def _common(known: np.ndarray | None, rows: np.ndarray) -> tuple[np.ndarray | None, bool]:
    """The longest row of times, and whether all others are its beginning."""
    counts = (~np.isnan(rows)).sum(axis=1)
    longest = rows[int(np.argmax(counts)), : int(counts.max())]
    if known is None or len(longest) > len(known):
        known, longest = longest, known if known is not None else longest
    width = min(rows.shape[1], len(known))
    agree = np.isnan(rows[:, :width]) | (rows[:, :width] == known[:width])
    return known, bool(agree.all()) and np.array_equal(known[: len(longest)], longest)


def _tiles(sources: Sources) -> dict[int, set[str]]:
    """All tiles in which something is found, with the items found there, in order."""
    found: dict[int, set[str]] = {}
    for item, source in sources.found.items():
        for key in np.unique(source.tile[~source.missing]).tolist():
            found.setdefault(key, set()).add(plain(item))
    return dict(sorted(found.items()))
