"""Where each kept item of each member of a sweep is found, over all of its generations, and what the tiles
there hold: variables, their sizes, and times.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from rigidsim.errors import RESUME, RunFolderError
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.store.sweeps.folder import SweepFolder
from rigidsim.store.sweeps.tiles import ALWAYS, Generation, KeptVariable, Tile, Work, ranges_of

_NOWHERE = -1
_TILES_IN_MEMORY = 96


def items_of(sweep: Sweep) -> tuple[str, ...]:
    """Items kept of a sweep's members, by the names under which they are known (the number of events kept is
    part of it).
    """
    counted = {name: f"{name}:{sweep.table.most_events}" for name in ("events", "section")}
    return tuple(counted.get(name, name) for name in sweep.table.keep)


def plain(item: str) -> str:
    """The item's name in ``[sweep] keep``."""
    return item.partition(":")[0]


@dataclass(frozen=True)
class ItemPlaces:
    """Where each member's item is found, (members,): ``key_of`` its tile, and place in the tile; -1 if
    nowhere.
    """

    tile: np.ndarray
    row: np.ndarray

    @property
    def missing(self) -> np.ndarray:
        """Mask of the members that lack the item."""
        return self.tile == _NOWHERE


def key_of(generation: int, tile: Any) -> Any:
    """One number for a tile of a generation, or an array of them for several."""
    return generation << 32 | tile


def tile_of(key: int) -> tuple[int, int]:
    """Generation and number of a tile."""
    return key >> 32, key & 0xFFFFFFFF


@dataclass(frozen=True)
class Sources:
    """Where everything kept of a sweep's members is found, by item, including ``ALWAYS``."""

    found: dict[str, ItemPlaces] = field(default_factory=dict)

    @property
    def missing(self) -> np.ndarray:
        """Members that lack any item, ascending."""
        return np.flatnonzero(np.logical_or.reduce([source.missing for source in self.found.values()]))

    def works(self) -> tuple[Work, ...]:
        """What is still to be computed; members that lack the same items go together."""
        missing = [source.missing.astype(np.int64) for source in self.found.values()]
        pattern = np.sum([lacks << bit for bit, lacks in enumerate(missing)], axis=0)
        works = []
        for value in sorted(set(np.unique(pattern).tolist()) - {0}, reverse=True):
            keep = tuple(item for bit, item in enumerate(self.found) if value >> bit & 1 and item != ALWAYS)
            works.append(Work(keep, ranges_of(np.flatnonzero(pattern == value))))
        return tuple(works)


def sources_of(
    sweep: Sweep,
    folder: SweepFolder,
    generations: Sequence[tuple[Generation, Sweep]],
    to_come: Generation | None = None,
) -> Sources:
    """Find all that a sweep asks for in its folder's generations, or ``to_come``; the oldest counts."""
    found = {
        item: ItemPlaces(
            np.full(sweep.count, _NOWHERE, dtype=np.int64), np.full(sweep.count, _NOWHERE, dtype=np.int32)
        )
        for item in (ALWAYS, *items_of(sweep))
    }
    for generation, then in generations:
        old = positions(sweep, then)
        present = folder.present(generation)
        if to_come is not None and generation.number == to_come.number:
            present[:] = True
        before = 0
        for work, count in zip(generation.works, generation.tile_counts, strict=True):
            places = work.places(old)
            tiles = np.where(places >= 0, before + places // generation.length, 0)
            there = (places >= 0) & present[tiles] if len(present) else np.zeros(len(old), dtype=bool)
            for item, source in found.items():
                if item == ALWAYS or item in work.keep:
                    new = there & source.missing
                    source.tile[new] = key_of(generation.number, tiles[new])
                    source.row[new] = places[new] % generation.length
            before += count
    return Sources(found)


def positions(sweep: Sweep, then: Sweep) -> np.ndarray:
    """Index, in another sweep, of each member of a sweep; -1 if it isn't there."""
    if _same_axes(sweep, then):
        return np.arange(sweep.count)
    keys, old_keys = [axis.key for axis in sweep.axes], [axis.key for axis in then.axes]
    if sorted(keys) != sorted(old_keys):
        return np.full(sweep.count, _NOWHERE)
    order = [old_keys.index(key) for key in keys]  # the other's axes in the order of this one's
    if sweep.product and then.product:
        strides = np.array([int(np.prod(then.shape[i + 1 :])) for i in range(len(then.axes))], dtype=np.int64)
        flat = np.zeros(sweep.shape, dtype=np.int64)
        absent = np.zeros(sweep.shape, dtype=bool)
        for place, number in enumerate(order):
            known = {then.axes[number].values.text(i): i for i in range(then.axes[number].values.count)}
            values = sweep.axes[place].values
            index = np.array([known.get(values.text(i), _NOWHERE) for i in range(values.count)])
            index = index.reshape([-1 if i == place else 1 for i in range(len(keys))])
            absent |= index == _NOWHERE
            flat += np.where(index == _NOWHERE, 0, index) * strides[number]
        return np.where(absent, _NOWHERE, flat).reshape(-1)
    known_members: dict[tuple[str, ...], int] = {}
    for member in range(then.count):
        texts = then.texts(member)
        known_members.setdefault(tuple(texts[number] for number in order), member)
    return np.array([known_members.get(sweep.texts(m), _NOWHERE) for m in range(sweep.count)], dtype=np.int64)


def _same_axes(sweep: Sweep, then: Sweep) -> bool:
    return (
        sweep.table.axes == then.table.axes
        and list(sweep.table.axes) == list(then.table.axes)
        and (sweep.table.mode, sweep.table.seed) == (then.table.mode, then.table.seed)
    )


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
        for name, variable in tile.kept.items():
            if variable.item not in wanted:
                continue
            values = variable.values
            known = found.variables.get(name)
            if known is None:
                whole = values.dtype.kind == "i"
                found.variables[name] = Described(variable, whole, values.shape[1:])
            elif known.variable.dims != variable.dims:
                raise RunFolderError(f"{reader.place}: tiles disagree about {name}")
            else:
                known.extra = tuple(map(max, known.extra, values.shape[1:]))
        if "time" in tile.kept and tile.kept["time"].values.size and "series" in wanted and alike:
            common, alike = _common(common, tile.kept["time"].values)
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
