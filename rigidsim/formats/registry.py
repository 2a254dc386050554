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
from rigidsim.scene.readable_units import AngleUnit


@dataclass(frozen=True)
class TableSource:
    """The run, or the sweep, that a table comes from.

    Attributes:
        naming: what the dataset may not say about itself.
        angle_unit: unit of angles; None for rad.
    """

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
        package: package that it needs besides rigidsim's own requirements.
        angles: whether it takes angles in any unit.
        side_tables: whether tables along other dimensions than time get files of their own.
        folder: what such a folder is called, and a file that identifies one; None if it writes a file.
    """

    write: Callable[[Table, Path, TableSource], None]
    package: str = ""
    angles: bool = False
    side_tables: bool = False
    folder: tuple[str, str] | None = None


def format_named(name: str) -> Format:
    """The format ``rigidsim.formats.NAME.FORMAT``."""
    if name not in FORMATS:
        raise RigidsimError(f'--format: given "{name[:40]}"; allowed: {", ".join(FORMATS)}')
    found: Format = import_module(f"rigidsim.formats.{name}").FORMAT
    if found.package and importlib.util.find_spec(found.package) is None:
        raise RigidsimError(f'{name} needs {found.package}, which is missing: pip install "rigidsim[export]"')
    return found
