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
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rigidsim.errors import RESUME, RunFolderError
from rigidsim.scene.config import apply_overrides, parse_toml
from rigidsim.scene.schema import RANDOM, AxisTable
from rigidsim.scene.sweep import Axis, Sweep
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


class Sources:
    """Tiles, by their files in a sweep's folder (``place``), for a sweep's members.

    Attributes:
        keys: of the members.
        variables: what is kept, with the largest sizes of dimensions besides the members' and no numbers,
            once ``gather`` has read the tiles. times: samples that all members share, s; None if they
            differ, or aren't kept. reasons: by member why it failed. made: by what each tile was made.
    """

    def __init__(self, sweep: Sweep, place: Path, files: Sequence[Path]) -> None:
        self.keys, self._items, self._place, self._files = keys_of(sweep), items_of(sweep), place, files
        size = sum(path.stat().st_size for path in files)
        self.tile = lru_cache(int(_HELD * len(files) / max(size, 1)) + 1)(lambda n: read_tile(files[n]))
        self.variables: Kept = {}
        self.times: np.ndarray | None = None
        self.reasons: dict[int, str] = {}
        self.made: list[Mapping[str, Any]] = []

    @cached_property
    def places(self) -> dict[str, np.ndarray]:
        """Where everything kept is found, by item: (2, members), number of the tile and row there; -1 if
        nowhere.
        """
        heads = [read_tile(path, whole=False) for path in self._files]
        return {item: self._find(item, heads) for item in self._items}

    def _find(self, item: str, heads: Sequence[Tile]) -> np.ndarray:
        numbers = [number for number, one in enumerate(heads) if item in one.items]
        lengths = [len(heads[number].keys) for number in numbers]
        if not sum(lengths):
            return np.full((2, len(self.keys)), -1)
        known = np.concatenate([heads[number].keys for number in numbers])
        order = np.argsort(known, kind="stable")  # the oldest comes first
        at = order[np.minimum(np.searchsorted(known, self.keys, sorter=order), len(known) - 1)]
        rows = np.concatenate([np.arange(length) for length in lengths])
        return np.where(known[at] == self.keys, np.stack([np.repeat(numbers, lengths), rows])[:, at], -1)

    @cached_property
    def missing(self) -> np.ndarray:
        """Mask of the members that lack any item."""
        return np.logical_or.reduce([tiles < 0 for tiles, _ in self.places.values()])

    def wanted(self, block: range) -> tuple[np.ndarray, tuple[str, ...]]:
        """Of a block of members those to be computed, one for each key, and the items that any lacks."""
        some = block.start + np.flatnonzero(self.missing[block.start : block.stop])
        _, first = np.unique(self.keys[some], return_index=True)
        items = [item for item, (tiles, _) in self.places.items() if (tiles[some] < 0).any()]
        return some[np.sort(first)], tuple(items)

    def parts(self) -> Iterator[tuple[Tile, np.ndarray, np.ndarray]]:
        """All tiles in which members are found, with these and their rows there."""
        tiles, rows = self.places[ALWAYS]
        order = np.argsort(tiles, kind="stable")
        for group in np.split(order, np.flatnonzero(np.diff(tiles[order])) + 1):
            yield self.tile(int(tiles[group[0]])), group, rows[group]

    def gather(self) -> None:
        """Read once every tile that is used; RunFolderError if one is gone, damaged, or disagrees with
        others.
        """
        if gone := int(self.missing.sum()):
            raise RunFolderError(f"{self._place}: tiles of {gone:,} members are gone; {RESUME} computes them")
        common: np.ndarray | None = None
        alike = True
        wanted = {item: set(np.unique(tiles).tolist()) for item, (tiles, _) in self.places.items()}
        for number in sorted(set().union(*wanted.values())):
            tile = self.tile(number)
            self.made.append(tile.made)
            items = {plain(item) for item, numbers in wanted.items() if number in numbers}
            for name, one in tile.kept.items():
                if one.item not in items:
                    continue
                known = self.variables.get(name, one)
                if known.dims != one.dims:
                    raise RunFolderError(f"{self._place}: tiles disagree about {name}")
                extra = map(max, known.values.shape[1:], one.values.shape[1:])
                self.variables[name] = replace(known, values=np.empty((0, *extra), known.values.dtype))
            if "series" in items and alike and "time" in tile.kept and tile.kept["time"].values.size:
                common, alike = _common(common, tile.kept["time"].values)
        self.times = common if alike else None
        for tile, members, rows in self.parts():
            for member, row in zip(members.tolist(), rows.tolist(), strict=True) if tile.reasons else ():
                if row in tile.reasons:
                    self.reasons[member] = tile.reasons[row]


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
_SMALL = 512  # numbers of a variable that is stored in one piece
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


def write_dataset(path: Path, sweep: Sweep, sources: Sources, attributes: Mapping[str, Any]) -> str:
    """Write what was gathered atomically; returns the digest of the file."""
    with atomic.replacing(path) as temporary:
        with sink(temporary) as target, writing(target) as file:
            file.attributes(attributes)
            created = _declared(file, sweep, sources, _coordinates(file, sweep))
            for name, (target_variable, one) in created.items():
                item, extra = next(x for x in sources.places if plain(x) == one.item), one.values.shape[1:]
                for first, shape, flat in boxes(sweep.shape, math.prod(extra)):
                    values = _values(name, one.values, item, sources, slice(flat.start, flat.stop))
                    place = tuple(slice(i, i + n) for i, n in zip(first, shape, strict=True))
                    target_variable[place] = values.reshape(*shape, *extra)
            _write_reasons(file, sources.reasons)
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
            file.texts(axis.name, texts, dim, described)
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
    file: NetcdfFile, sweep: Sweep, sources: Sources, beside: str
) -> dict[str, tuple[Any, KeptVariable]]:
    created: dict[str, tuple[Any, KeptVariable]] = {}
    labelled = LABELS | {"rotor": [rotor.name for rotor in sweep.base.config.rotors]}
    samples = _SAMPLES
    if sources.times is not None:
        samples = "time"
        file.dimension("time", len(sources.times))
        labels = {"units": "s", "long_name": "time of the scene"}
        file.variable("time", ("time",), labels)[...] = sources.times
    for name, one in sorted(sources.variables.items()):
        if name == samples:
            continue
        dims, extra = [samples if dim == _SAMPLES else dim for dim in one.dims], one.values.shape[1:]
        known = {**labelled, **one.labels}
        for dim, size in zip(dims, extra, strict=True):
            if dim in known:
                file.texts(dim, known[dim])
            else:
                file.dimension(dim, size)
        attributes = {k: v for k, v in one.attributes.items() if v is not None}
        units = [label for label in one.labels if label.endswith(_UNIT)]
        for label in units:  # which are no dimensions
            file.texts(label, one.labels[label], label.removesuffix(_UNIT))
        if more := " ".join(filter(None, [beside, *units])):
            attributes["coordinates"] = more
        small = math.prod(sweep.shape) * math.prod(extra) < _SMALL
        variable = file.variable(
            name, (*sweep.dims, *dims), attributes, chunk=None if small else chunk_shape(sweep.shape, extra),
            gzip=None if small else _GZIP, whole=one.values.dtype.kind == "i",
        )  # fmt: skip
        created[name] = (variable, one)
    return created


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


def _values(name: str, like: np.ndarray, item: str, sources: Sources, part: slice) -> np.ndarray:
    tiles, rows = sources.places[item][:, part]
    values = np.full((len(tiles), *like.shape[1:]), 0 if like.dtype.kind == "i" else np.nan, like.dtype)
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
    file.texts("failed_reason", [reasons[m] for m in members], "failed", {"long_name": "why"})
