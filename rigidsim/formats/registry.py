"""Formats: their description, and the lookup by name."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from rigidsim.errors import RigidsimError
from rigidsim.formats import FORMATS
from rigidsim.formats.naming import Naming
from rigidsim.formats.tables import Table
from rigidsim.scene.readable import AngleUnit


@dataclass(frozen=True)
class TableSource:
    """The run, or the sweep, that a table comes from."""

    title: str
    bits: int
    attributes: dict[str, Any]
    naming: Naming
    angle_unit: AngleUnit | None = None


@dataclass(frozen=True)
class Format:
    """A format of another tool.

    Attributes:
        write: writes a table to a path that doesn't exist yet.
        angles: whether it takes angles in any unit.
        side_tables: whether tables along other dimensions than time get files of their own.
        folder: what such a folder is called, and a file that identifies one; None if it writes a file.
    """

    write: Callable[[Table, Path, TableSource], None]
    angles: bool = False
    side_tables: bool = False
    folder: tuple[str, str] | None = None


_PLACES = {
    "csv": ("csv", "FORMAT", ""),
    "parquet": ("parquet", "FORMAT", "pyarrow"),
    "zarr": ("zarr", "FORMAT", "zarr"),
    "aem": ("ccsds", "AEM", ""),
    "oem": ("ccsds", "OEM", ""),
}
"""Module and name of each ``Format``, and a package that it needs besides rigidsim's own requirements."""


def format_named(name: str) -> Format:
    """A format by its name; its module, and the package that it needs, are loaded."""
    if name not in FORMATS:
        raise RigidsimError(f'--format: given "{name[:40]}"; allowed: {", ".join(FORMATS)}')
    module, attribute, package = _PLACES[name]
    if package and importlib.util.find_spec(package) is None:
        raise RigidsimError(f'{name} needs {package}, which is missing: pip install "rigidsim[export]"')
    found: Format = getattr(import_module(f"rigidsim.formats.{module}"), attribute)
    return found
