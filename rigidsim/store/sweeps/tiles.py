"""Tiles of a sweep, and the dataset that is gathered from them.

A tile holds results of some members under their keys; it is sealed, written once, and read with distrust.
A key is a number made of the experiment that all members share and of the name and value of each axis. So a
tile holds its members whatever sweep they belong to by now: what is missing of a sweep are the wanted keys
without those that are present.
"""

import hashlib
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rigidsim.errors import RESUME, RunFolderError
from rigidsim.scene.sweep import Axis, Sweep
from rigidsim.scene.sweep_table import RANDOM, AxisTable
from rigidsim.scene.toml_text import apply_overrides, parse_toml
from rigidsim.store import atomic
from rigidsim.store.atomic import sink
from rigidsim.store.netcdf import NetcdfFile, writing
from rigidsim.store.seal import check_seal, refuse_special, seal, sealed
from rigidsim.store.variables import LABELS, OF_THE_RUN

_FORMAT = 2
ALWAYS = "always"
"""The item that is kept for every member, asked for or not."""


# --- keys ---------------------------------------------------------------------------------------------------


def identity(sweep: Sweep) -> str:
    """What members share: the config without swept values and without values that no number depends on."""
    tables = parse_toml(sweep.experiment.text, sweep.experiment.source)
    alone = not tables.get("sweep", {}).get("batch", True)
    for key in ("name", "description", "sweep"):
        tables.pop(key, None)
    for key in ("timeline", "timeline_rows"):
        tables.get("output", {}).pop(key, None)
    if not tables.get("output", True):
        del tables["output"]
    keys = sorted(axis.key for axis in sweep.axes)
    apply_overrides(tables, [f'{key}="swept"' for key in keys])
    return json.dumps([keys, tables, *(["alone"] if alone else [])], sort_keys=True, default=str)


def keys_of(sweep: Sweep) -> np.ndarray:
    """Key of each member, (members,) int64: the sum of a random number for each axis and value, modulo 2^64.
    1e6 members share one by a chance of 3e-8.
    """
    keys = np.array(_hash(identity(sweep)))
    for axis, table in zip(sweep.axes, sweep.table.axes.values(), strict=True):
        numbers = _numbers(axis, table, sweep.table.seed)
        keys = np.add.outer(keys, numbers) if sweep.product else keys + numbers
    return keys.reshape(-1)


def _numbers(axis: Axis, table: AxisTable, seed: int) -> np.ndarray:
    count = axis.count
    if table.way in RANDOM:  # values that take long to draw, and that seed, key and index decide
        drawn = repr((axis.key, table.way, getattr(table, table.way), table.grid, seed))
        return np.random.Philox(key=int(_hash(drawn)) % 2**64).random_raw(count).view(np.int64)
    return np.array([_hash(f"{axis.key}={axis.text(i)}") for i in range(count)])


def _hash(text: str) -> np.int64:
    return np.frombuffer(hashlib.blake2b(text.encode(), digest_size=8).digest(), "<i8")[0]


def items_of(sweep: Sweep) -> tuple[str, ...]:
    """Items kept of a sweep's members, by the names under which they are known (the number of events kept is
    part of it).
    """
    counted = {name: f"{name}:{sweep.table.most_events}" for name in ("events", "section")}
    return (ALWAYS, *(counted.get(name, name) for name in sweep.table.keep))


def plain(item: str) -> str:
    """The item's name in ``[sweep] keep``."""
    return item.partition(":")[0]


# --- files --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class KeptVariable:
    """One variable for some members, (members, ...) float64 or int64: its dimensions besides theirs, and the
    item of ``[sweep] keep`` that it is of; labels of dimensions that no other variable has, by name, and
    as ``NAME_unit`` the units of what they name.
    """

    dims: tuple[str, ...]
    values: np.ndarray
    attributes: Mapping[str, Any] = field(default_factory=dict)
    item: str = ALWAYS
    labels: Mapping[str, Sequence[str]] = field(default_factory=dict)


Kept = dict[str, KeptVariable]
"""Kept variables by name."""


@dataclass(frozen=True)
class Tile:
    """Results of some members, whose keys are (n,) int64: their items; by place in it, why they failed;
    engines, versions, seconds, ...: everything that differs between repetitions.
    """

    keys: np.ndarray
    items: tuple[str, ...]
    kept: Kept
    reasons: Mapping[int, str] = field(default_factory=dict)
    made: Mapping[str, Any] = field(default_factory=dict)

    def image(self) -> bytes:
        """The sealed file's bytes."""
        described = {
            name: {"dims": list(v.dims), "attributes": dict(v.attributes), "item": v.item}
            | ({"labels": dict(v.labels)} if v.labels else {})
            for name, v in self.kept.items()
        }
        buffer = io.BytesIO()
        with writing(buffer) as file:
            file.attributes(
                {
                    "source": "rigidsim",
                    "tile_format": _FORMAT,
                    "items": " ".join(self.items),
                    "variables": json.dumps(described),
                    "reasons": json.dumps({str(place): why for place, why in self.reasons.items()}),
                    "made": json.dumps(dict(self.made)),
                }
            )
            file.group("tile", {"keys": self.keys})
            file.group("kept", {name: v.values for name, v in self.kept.items()})
        return bytes(sealed(buffer))


def read_tile(path: Path, *, whole: bool = True) -> Tile:
    """Read a tile and check its seal; without ``whole`` keys and items alone, unchecked.

    Raises:
        RunFolderError: it is torn, damaged or foreign.
    """
    kept: Kept = {}
    again = f"remove it, and {RESUME} computes it again"
    try:
        refuse_special(path)
        if whole:
            check_seal(path)
        with h5py.File(path, "r") as file:
            if int(file.attrs["tile_format"][0]) != _FORMAT:
                raise ValueError("of another version")
            keys, items = np.asarray(file["tile"]["keys"][()]), tuple(str(file.attrs["items"]).split())
            if not whole:
                return Tile(keys, items, kept)
            for name, v in json.loads(file.attrs["variables"]).items():
                empty = np.zeros((len(keys), *(0 for _ in v["dims"])))
                values = np.asarray(file["kept"][name][()]) if name in file["kept"] else empty
                labels = v.get("labels", {})
                kept[name] = KeptVariable(tuple(v["dims"]), values, v["attributes"], v["item"], labels)
            reasons = {int(place): str(why) for place, why in json.loads(file.attrs["reasons"]).items()}
            return Tile(keys, items, kept, reasons, json.loads(file.attrs["made"]))
    except RunFolderError as error:
        raise RunFolderError(f"{error}; {again}") from None
    except (OSError, KeyError, ValueError, TypeError, IndexError) as error:
        raise RunFolderError(f"{path}: can't be read as a tile ({error}); {again}") from None


_HELD = 256e6  # bytes of tiles that stay in memory: each is read once for every variable


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
    """Tiles, by their files in a sweep's folder (``place``), for a sweep's members."""

    def __init__(self, sweep: Sweep, place: Path, files: Sequence[Path]) -> None:
        self.keys, self._items, self._place, self._files = keys_of(sweep), items_of(sweep), place, files
        size = sum(path.stat().st_size for path in files)
        self.tile = lru_cache(int(_HELD * len(files) / max(size, 1)) + 1)(self._read)

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


_GZIP = 4
_BOX_NUMBERS = 1 << 22  # numbers of a variable that are gathered at once: 32 MB
_CHUNK_NUMBERS = 1 << 17
_SAMPLES = "sample"
_UNIT = "_unit"

RESERVED = {
    *LABELS,
    *OF_THE_RUN,
    *("time", "sample", "member", "status", "steps", "warnings", "time_reached", "drift_bound"),
    *(
        "attitude_error",
        "position_error",
        "modelling_error",
        "modelling_error_norm",
        "modelling_error_energy",
    ),
    *("failed", "failed_member", "failed_reason", "lyapunov", "megno", "fli", "line"),
}
"""Names that an axis can't have."""
OF_FITS = {
    *("parameter", "parameter_unit", "other_parameter", "value", "sigma", "scaled_sigma", "covariance"),
    *(
        "start",
        "converged",
        "undetermined",
        "chi_square",
        "freedom",
        "scale",
        "rows",
        "outliers",
        "evaluations",
    ),
}
"""Names that an axis can't have in a sweep of fits."""
SUFFIXES = ("_final", "_min", "_max", "_mean", "_largest", "_time", "_times", "_count", "_first", "_lo")
"""Suffixes of the names of variables that are kept."""


def write_dataset(
    path: Path,
    sweep: Sweep,
    sources: Sources,
    found: Gathered,
    attributes: Mapping[str, Any],
) -> str:
    """Write the dataset atomically; returns the digest of the file."""
    with atomic.replacing(path) as temporary:
        with sink(temporary) as target, writing(target) as file:
            file.attributes(attributes)
            beside = _coordinates(file, sweep)
            created = _declared(file, sweep, found, beside)
            for name, (target_variable, described) in created.items():
                item = next(item for item in sources.places if plain(item) == described.variable.item)
                for first, shape, flat in boxes(sweep.shape, math.prod(described.extra)):
                    values = _values(name, described, item, sources, flat)
                    place = tuple(slice(i, i + n) for i, n in zip(first, shape, strict=True))
                    target_variable[place] = values.reshape(*shape, *described.extra)
            _write_reasons(file, found.reasons)
        return seal(temporary)[1]


def _coordinates(file: NetcdfFile, sweep: Sweep) -> str:
    """Write the axes; returns the names of coordinates that aren't dimensions."""
    beside = []
    for dim, size in zip(sweep.dims, sweep.shape, strict=True):
        file.dimension(dim, size)
    for axis in sweep.axes:
        dim = axis.name if sweep.product else sweep.dims[0]
        described: dict[str, Any] = {"long_name": axis.key, "units": axis.unit, "swept_key": axis.key}
        if not axis.numeric:
            texts = [_bare(axis.text(i)) for i in range(axis.count)]
            del described["units"]
            file.texts(axis.name, dim, texts, described)
            beside += [] if dim == axis.name else [axis.name]
            continue
        numbers = label_numbers(axis)
        name = axis.name
        dims: tuple[str, ...] = (dim,)
        if axis.components:
            name = f"{axis.name}_value" if sweep.product else axis.name
            file.dimension(f"{axis.name}_component", axis.components)
            dims = (dim, f"{axis.name}_component")
        if dims != (name,):
            beside.append(name)
        file.variable(name, dims, described)[...] = numbers
    return " ".join(beside)


def label_numbers(axis: Axis) -> np.ndarray:
    """The values of an axis as doubles, (count,) or (count, components); their texts are exact."""
    found = np.array([[float(x) for x in axis.exact(i)] for i in range(axis.count)])
    return found if axis.components else found[:, 0]


def _bare(text: str) -> str:
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text


def _declared(
    file: NetcdfFile, sweep: Sweep, found: Gathered, beside: str
) -> dict[str, tuple[Any, Described]]:
    created = {}
    labelled = LABELS | {"rotor": [rotor.name for rotor in sweep.base.config.rotors]}
    samples = _SAMPLES
    if found.times is not None:
        samples = "time"
        file.dimension("time", len(found.times))
        labels = {"units": "s", "long_name": "time of the scene"}
        file.variable("time", ("time",), labels)[...] = found.times
    for name, described in sorted(found.variables.items()):
        if name == "time" and found.times is not None:
            continue
        dims = [samples if dim == _SAMPLES else dim for dim in described.variable.dims]
        known = {**labelled, **described.variable.labels}
        for dim, size in zip(dims, described.extra, strict=True):
            if dim in known:
                file.labels(dim, known[dim])
            else:
                file.dimension(dim, size)
        attributes = {k: v for k, v in described.variable.attributes.items() if v is not None}
        if more := " ".join(filter(None, [beside, *_labels(file, described)])):
            attributes["coordinates"] = more
        chunk = chunk_shape(sweep.shape, described.extra)
        small = math.prod(sweep.shape) * math.prod(described.extra) < 512
        variable = file.variable(
            name, (*sweep.dims, *dims), attributes,
            chunk=None if small else chunk, gzip=None if small else _GZIP, whole=described.whole,
        )  # fmt: skip
        created[name] = (variable, described)
    return created


def _labels(file: NetcdfFile, described: Described) -> list[str]:
    """Write a variable's own labels; returns the names of those that are no dimensions."""
    own = described.variable.labels
    for name, texts in own.items():
        if name.endswith(_UNIT):
            file.texts_once(name, name.removesuffix(_UNIT), texts)
    return [name for name in own if name.endswith(_UNIT)]


def chunk_shape(members: Sequence[int], extra: Sequence[int]) -> tuple[int, ...]:
    """Shape of chunks: whole trailing dimensions, and as much of the one before them as makes a megabyte."""
    left = max(1, _CHUNK_NUMBERS // max(1, math.prod(extra)))
    chunk = []
    for size in reversed(members):
        taken = max(1, min(size, left))
        chunk.append(taken)
        left = max(1, left // taken) if taken == size else 1
    return (*reversed(chunk), *(max(1, n) for n in extra))


def boxes(
    members: Sequence[int], extra: int, numbers: int = _BOX_NUMBERS
) -> Iterator[tuple[tuple[int, ...], tuple[int, ...], range]]:
    """Cut consecutive members into boxes of their dimensions: first corner, shape, and the members' range.
    Each has ``extra`` numbers; a box of more than one has at most ``numbers``.
    """
    most = max(1, numbers // max(1, extra))
    axis, within = len(members) - 1, 1
    while axis > 0 and within * members[axis] <= most:
        within *= members[axis]
        axis -= 1
    step = max(1, min(members[axis], most // within))
    block = within * members[axis]
    for number in range(math.prod(members[:axis])):
        leading = np.unravel_index(number, members[:axis]) if axis else ()
        for low in range(0, members[axis], step):
            high = min(low + step, members[axis])
            first = (*(int(i) for i in leading), low, *(0 for _ in members[axis + 1 :]))
            shape = (*(1 for _ in leading), high - low, *members[axis + 1 :])
            begin = number * block + low * within
            yield first, shape, range(begin, begin + (high - low) * within)


def _values(name: str, described: Described, item: str, sources: Sources, flat: range) -> np.ndarray:
    places, part = sources.places[item], slice(flat.start, flat.stop)
    tiles, rows = places.tile[part], places.row[part]
    kind, lacking = (np.int64, 0) if described.whole else (np.float64, np.nan)
    values = np.full((len(tiles), *described.extra), lacking, dtype=kind)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(tiles)) + 1, [len(tiles)]])
    for low, high in pairwise(edges):
        held = sources.tile(int(tiles[low])).kept.get(name)
        if held is not None:
            place = (slice(low, high), *(slice(0, n) for n in held.values.shape[1:]))
            values[place] = held.values[rows[low:high]]
    return values


def _write_reasons(file: NetcdfFile, reasons: Mapping[int, str]) -> None:
    if not reasons:
        return
    members = sorted(reasons)
    file.dimension("failed", len(members))
    numbers = file.variable(
        "failed_member", ("failed",), {"long_name": "which members didn't end well, the last axis fastest"},
        chunk=None, gzip=None, whole=True,
    )  # fmt: skip
    numbers[...] = members
    file.texts("failed_reason", "failed", [reasons[m] for m in members], {"long_name": "why"})
