"""Where each kept item of each member of a sweep is found, and what the tiles there hold: variables, their
sizes, and times.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from rigidsim.errors import RESUME, RunFolderError
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.store.sweeps.folder import SweepFolder
from rigidsim.store.sweeps.tiles import ALWAYS, KeptVariable, Tile, items_of, keys_of, plain, read_tile

_TILES_IN_MEMORY = 96


@dataclass(frozen=True)
class Places:
    """Where each member's item is found, (members,) each: number of the tile, row there; -1 if nowhere."""

    tile: np.ndarray
    row: np.ndarray


@dataclass
class Described:
    """A variable as tiles describe it; ``extra``: largest sizes of dimensions besides the members'."""

    variable: KeptVariable
    whole: bool
    extra: tuple[int, ...]


@dataclass
class Gathered:
    """What the tiles hold, known before their numbers are read again: among it sample times that all members
    share (None if they differ, or aren't kept), and by member why it failed.
    """

    variables: dict[str, Described] = field(default_factory=dict)
    times: np.ndarray | None = None
    reasons: dict[int, str] = field(default_factory=dict)
    made: list[Mapping[str, Any]] = field(default_factory=list)


class Sources:
    """The tiles of a folder, as they were when this was made, for a sweep's members."""

    def __init__(self, sweep: Sweep, folder: SweepFolder) -> None:
        self.keys, self._items, self._place = keys_of(sweep), items_of(sweep), folder.path
        self._files = folder.tile_files()
        self.tile = lru_cache(_TILES_IN_MEMORY)(self._read)

    def _read(self, number: int) -> Tile:
        return read_tile(self._files[number])

    @cached_property
    def places(self) -> dict[str, Places]:
        """Where everything kept is found, by item."""
        heads = [read_tile(path, whole=False) for path in self._files]
        return {item: self._find(item, heads) for item in self._items}

    def _find(self, item: str, heads: Sequence[Tile]) -> Places:
        numbers = [number for number, one in enumerate(heads) if item in one.items]
        lengths = [len(heads[number].keys) for number in numbers]
        if not sum(lengths):
            nowhere = np.full(len(self.keys), -1)
            return Places(nowhere, nowhere)
        known = np.concatenate([heads[number].keys for number in numbers])
        order = np.argsort(known, kind="stable")  # the oldest comes first
        at = order[np.minimum(np.searchsorted(known, self.keys, sorter=order), len(known) - 1)]
        there = known[at] == self.keys
        rows = np.concatenate([np.arange(length) for length in lengths])
        tiles = np.repeat(numbers, lengths)
        return Places(np.where(there, tiles[at], -1), np.where(there, rows[at], -1))

    @cached_property
    def missing(self) -> np.ndarray:
        """Mask of the members that lack any item."""
        return np.logical_or.reduce([places.tile < 0 for places in self.places.values()])

    def wanted(self, block: range) -> tuple[np.ndarray, tuple[str, ...]]:
        """Of a block of members those to be computed, one for each key, and the items that any lacks."""
        some = block.start + np.flatnonzero(self.missing[block.start : block.stop])
        _, first = np.unique(self.keys[some], return_index=True)
        items = [item for item, places in self.places.items() if (places.tile[some] < 0).any()]
        return some[np.sort(first)], tuple(items)

    def parts(self) -> Iterator[tuple[Tile, np.ndarray, np.ndarray]]:
        """All tiles in which members are found, with these and their rows there."""
        always = self.places[ALWAYS]
        order = np.argsort(always.tile, kind="stable")
        for group in np.split(order, np.flatnonzero(np.diff(always.tile[order])) + 1):
            yield self.tile(int(always.tile[group[0]])), group, always.row[group]

    def gather(self) -> Gathered:
        """Read once every tile that is used; RunFolderError if one is gone, damaged, or disagrees with
        others.
        """
        if gone := int(self.missing.sum()):
            raise RunFolderError(f"{self._place}: tiles of {gone:,} members are gone; {RESUME} computes them")
        found = Gathered()
        common: np.ndarray | None = None
        alike = True
        wanted = {item: set(np.unique(places.tile).tolist()) for item, places in self.places.items()}
        for number in sorted(set().union(*wanted.values())):
            tile = self.tile(number)
            found.made.append(tile.made)
            items = {plain(item) for item, numbers in wanted.items() if number in numbers}
            for name, variable in tile.kept.items():
                if variable.item in items:
                    self._describe(found.variables, name, variable)
            if "series" in items and alike and "time" in tile.kept and tile.kept["time"].values.size:
                common, alike = _common(common, tile.kept["time"].values)
        found.times = common if alike else None
        for tile, members, rows in self.parts():
            for member, row in zip(members.tolist(), rows.tolist(), strict=True) if tile.reasons else ():
                if row in tile.reasons:
                    found.reasons[member] = tile.reasons[row]
        return found

    def _describe(self, known: dict[str, Described], name: str, variable: KeptVariable) -> None:
        sizes = variable.values.shape[1:]
        one = known.setdefault(name, Described(variable, variable.values.dtype.kind == "i", sizes))
        if one.variable.dims != variable.dims:
            raise RunFolderError(f"{self._place}: tiles disagree about {name}")
        one.extra = tuple(map(max, one.extra, sizes))


def _common(known: np.ndarray | None, rows: np.ndarray) -> tuple[np.ndarray | None, bool]:
    """The longest row of times, and whether all others are its beginning."""
    counts = (~np.isnan(rows)).sum(axis=1)
    longest = rows[int(np.argmax(counts)), : int(counts.max())]
    if known is None or len(longest) > len(known):
        known, longest = longest, known if known is not None else longest
    width = min(rows.shape[1], len(known))
    agree = np.isnan(rows[:, :width]) | (rows[:, :width] == known[:width])
    return known, bool(agree.all()) and np.array_equal(known[: len(longest)], longest)
