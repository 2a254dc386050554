"""Tiles of a sweep: results of some members under their keys; sealed, written once, read with distrust.

A member's key is a number made of the experiment that all members share and of the name and value of each
axis. So a tile holds its members whatever sweep they belong to by now: what is missing of a sweep are the
wanted keys without those that are present.
"""

import hashlib
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rigidsim.errors import RESUME, RunFolderError
from rigidsim.scene.sweep_table import RANDOM, AxisTable
from rigidsim.scene.sweeps.axes import Axis
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.scene.toml_text import apply_overrides, parse_toml
from rigidsim.store.netcdf import writing
from rigidsim.store.seal import check_seal, refuse_special, sealed

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
    count = axis.values.count
    if table.way in RANDOM:  # values that take long to draw, and that seed, key and index decide
        drawn = repr((axis.key, table.way, getattr(table, table.way), table.grid, seed))
        return np.random.Philox(key=int(_hash(drawn)) % 2**64).random_raw(count).view(np.int64)
    return np.array([_hash(f"{axis.key}={axis.values.text(i)}") for i in range(count)])


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
