"""Generations of a sweep: a config together with the members that were missing when it was given, in tiles.

A sweep begins with one generation; a longer axis or one more output adds another, whose tiles hold only what
was new. A tile holds the results of some members: sealed, written once, and read with distrust.
"""

import hashlib
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import h5py
import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from rigidsim.errors import FORCE, RunFolderError
from rigidsim.store.netcdf import writing
from rigidsim.store.seal import check_seal, refuse_special, sealed
from rigidsim.store.summary_parts import first_of

_FORMAT = 1
ALWAYS = "always"
"""The item that is kept for every member, asked for or not."""


@dataclass(frozen=True)
class Work:
    """Members, by ranges [first, stop), ascending, for which the same items are to be computed."""

    keep: tuple[str, ...]
    ranges: tuple[tuple[int, int], ...]

    @property
    def count(self) -> int:
        """Number of members."""
        return sum(stop - first for first, stop in self.ranges)

    def members(self, first: int, stop: int) -> np.ndarray:
        """The members at places first ... stop-1 in this work."""
        found, before = [np.zeros(0, dtype=np.int64)], 0
        for begin, end in self.ranges:
            low, high = max(first - before, 0), min(stop - before, end - begin)
            if low < high:
                found.append(np.arange(begin + low, begin + high))
            before += end - begin
        return np.concatenate(found)

    def places(self, members: np.ndarray) -> np.ndarray:
        """Places of the given members in this work; -1 for one that isn't in it."""
        begins = np.array([first for first, _ in self.ranges], dtype=np.int64)
        sizes = np.array([stop - first for first, stop in self.ranges], dtype=np.int64)
        before = np.concatenate([[0], np.cumsum(sizes)[:-1]])
        which = np.searchsorted(begins, members, side="right") - 1
        offset = members - begins[which]
        inside = (which >= 0) & (members >= 0) & (offset < sizes[which])
        return np.where(inside, before[which] + offset, -1)


def ranges_of(members: np.ndarray) -> tuple[tuple[int, int], ...]:
    """Ascending members as ranges [first, stop)."""
    if not len(members):
        return ()
    breaks = np.flatnonzero(np.diff(members) != 1)
    firsts = members[np.concatenate([[0], breaks + 1])]
    lasts = members[np.concatenate([breaks, [len(members) - 1]])]
    return tuple((int(a), int(b) + 1) for a, b in zip(firsts, lasts, strict=True))


@dataclass(frozen=True)
class Generation:
    """A config's text with the works that were to be done for it; tiles of ``length`` members are numbered
    through them. ``apart``: whether all members run one by one though some might share equations, as was
    found when the sweep was begun; None if that wasn't asked.
    """

    number: int
    config: str
    length: Annotated[int, Field(ge=1)]
    works: tuple[Work, ...]
    apart: bool | None = None

    @property
    def config_sha256(self) -> str:
        """SHA-256 of the TOML text."""
        return hashlib.sha256(self.config.encode()).hexdigest()

    @cached_property
    def tile_counts(self) -> tuple[int, ...]:
        """Number of tiles in each work."""
        return tuple(-(-work.count // self.length) for work in self.works)

    @property
    def tiles(self) -> int:
        """Number of tiles."""
        return sum(self.tile_counts)

    @property
    def members(self) -> int:
        """Number of members to be run."""
        return sum(work.count for work in self.works)

    def work_of(self, tile: int) -> tuple[Work, int]:
        """The work that a tile belongs to, and the tile's number within it."""
        for work, count in zip(self.works, self.tile_counts, strict=True):
            if tile < count:
                return work, tile
            tile -= count
        raise IndexError(tile)

    def members_of(self, tile: int) -> np.ndarray:
        """The members of a tile."""
        work, number = self.work_of(tile)
        return work.members(number * self.length, (number + 1) * self.length)

    def as_text(self) -> str:
        """JSON text for ``gNNN.json``."""
        return json.dumps({"format": _FORMAT, **asdict(self)}) + "\n"

    @classmethod
    def read(cls, path: Path, number: int) -> "Generation":
        """Read a ``gNNN.json``; RunFolderError if it is damaged."""
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            if content["format"] != _FORMAT:
                raise ValueError("another format")
            return TypeAdapter(cls).validate_python({**content, "number": number})
        except (OSError, ValueError, KeyError, TypeError) as error:
            why = first_of(error) if isinstance(error, ValidationError) else error
            raise RunFolderError(
                f"{path}: is damaged or of another version ({why}); a finished sweep does without tiles/, "
                f"{FORCE} runs another one again"
            ) from None


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
    """Results of some members of a config, whose indices are (n,) int64; by place in it, why they failed;
    engines, versions, seconds, ...: everything that differs between repetitions.
    """

    config_sha256: str
    members: np.ndarray
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
                    "config_sha256": self.config_sha256,
                    "variables": json.dumps(described),
                    "reasons": json.dumps({str(place): why for place, why in self.reasons.items()}),
                    "made": json.dumps(dict(self.made)),
                }
            )
            file.group("tile", {"members": self.members.astype(np.int64)})
            file.group("kept", {name: v.values for name, v in self.kept.items()})
        return bytes(sealed(buffer))


def read_tile(path: Path, config_sha256: str) -> Tile:
    """Read a tile; RunFolderError if it is torn, damaged, foreign, or of another config."""
    refuse_special(path)
    check_seal(path)
    try:
        with h5py.File(path, "r") as file:
            if int(file.attrs.get("tile_format", [0])[0]) != _FORMAT:
                raise RunFolderError(f"{path}: is no tile that this version of rigidsim reads")
            members, held = np.asarray(file["tile"]["members"][()]), file["kept"]
            kept: Kept = {}
            for name, v in json.loads(file.attrs["variables"]).items():
                empty = np.zeros((len(members), *(0 for _ in v["dims"])))
                values = np.asarray(held[name][()]) if name in held else empty
                labels = v.get("labels", {})
                kept[name] = KeptVariable(tuple(v["dims"]), values, v["attributes"], v["item"], labels)
            tile = Tile(
                str(file.attrs["config_sha256"]),
                members,
                kept,
                {int(place): str(why) for place, why in json.loads(file.attrs["reasons"]).items()},
                json.loads(file.attrs["made"]),
            )
    except (OSError, KeyError, ValueError, TypeError, IndexError) as error:
        raise RunFolderError(f"{path}: can't be read as a tile ({error})") from None
    if tile.config_sha256 != config_sha256:
        raise RunFolderError(f"{path}: belongs to another sweep")
    return tile
