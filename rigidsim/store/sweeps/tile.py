"""Tiles: results of some members of a sweep, sealed, written once, and read with distrust."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rigidsim.errors import RunFolderError
from rigidsim.store.netcdf import writing
from rigidsim.store.seal import check_seal, refuse_special, sealed

_FORMAT = 1


@dataclass(frozen=True)
class TileVariable:
    """A variable in a tile: dimensions besides the members', and the item of ``keep`` that it is of."""

    dims: tuple[str, ...]
    attributes: Mapping[str, Any]
    item: str


@dataclass(frozen=True)
class Tile:
    """Results of some members.

    Attributes:
        config_sha256: SHA-256 of the config that the members belong to.
        members: indices of the members, (n,) int64.
        arrays: arrays by name, (n, ...) float64 or int64; empty ones are left out.
        variables: descriptions of the arrays.
        reasons: by place in the tile, why members failed.
        made: engines, versions, seconds, ...: everything that differs between repetitions.
    """

    config_sha256: str
    members: np.ndarray
    arrays: Mapping[str, np.ndarray]
    variables: Mapping[str, TileVariable]
    reasons: Mapping[int, str] = field(default_factory=dict)
    made: Mapping[str, Any] = field(default_factory=dict)

    def image(self) -> bytes:
        """The sealed file's bytes."""
        described = {
            name: {"dims": list(v.dims), "attributes": dict(v.attributes), "item": v.item}
            for name, v in self.variables.items()
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
            file.group("kept", self.arrays)
        return bytes(sealed(buffer))


def read_tile(path: Path, config_sha256: str) -> Tile:
    """Read a tile; RunFolderError if it is torn, damaged, foreign, or of another config."""
    refuse_special(path)
    check_seal(path)
    try:
        with h5py.File(path, "r") as file:
            if int(file.attrs.get("tile_format", [0])[0]) != _FORMAT:
                raise RunFolderError(f"{path}: is no tile that this version of rigidsim reads")
            described = json.loads(file.attrs["variables"])
            tile = Tile(
                str(file.attrs["config_sha256"]),
                np.asarray(file["tile"]["members"][()]),
                {name: np.asarray(data[()]) for name, data in file["kept"].items()},
                {
                    name: TileVariable(tuple(v["dims"]), v["attributes"], v["item"])
                    for name, v in described.items()
                },
                {int(place): str(why) for place, why in json.loads(file.attrs["reasons"]).items()},
                json.loads(file.attrs["made"]),
            )
    except (OSError, KeyError, ValueError, TypeError, IndexError) as error:
        raise RunFolderError(f"{path}: can't be read as a tile ({error})") from None
    if tile.config_sha256 != config_sha256:
        raise RunFolderError(f"{path}: belongs to another sweep")
    return tile
