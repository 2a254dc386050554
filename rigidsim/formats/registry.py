"""What a format is, and how the one that is asked for is found."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from rigidsim.errors import RigidsimError
from rigidsim.formats import FORMATS
from rigidsim.formats.naming import Naming
from rigidsim.formats.tables import Table
from rigidsim.look.angle_units import AngleUnit
from rigidsim.scene.records import dataclass


@dataclass(frozen=True)
class TableSource:
    """The run, or the sweep, that a table is of.

    Attributes:
        title: its name.
        bits: of its precision.
        attributes: of its dataset.
        naming: what the dataset may not know of itself.
        angle_unit: that angles are written in; None for rad.
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
        package: that it needs beside what rigidsim always has.
        angles: whether it takes angles in any unit.
        side_tables: whether tables along other dimensions than time get files of their own.
        folder: what such a folder is called, and a file by which one is known; None: it is a file.
    """

    write: Callable[[Table, Path, TableSource], None]
    package: str = ""
    angles: bool = False
    side_tables: bool = False
    folder: tuple[str, str] | None = None


def format_named(name: str) -> Format:
    """The format ``rigidsim.formats.NAME.FORMAT``.

    Raises:
        RigidsimError: there is none of that name, or the package that it needs is missing.
    """
    if name not in FORMATS:
        raise RigidsimError(f'--format: given "{name[:40]}"; allowed: {", ".join(FORMATS)}')
    found: Format = import_module(f"rigidsim.formats.{name}").FORMAT
    if found.package and importlib.util.find_spec(found.package) is None:
        raise RigidsimError(f'{name} needs {found.package}, which is missing: pip install "rigidsim[export]"')
    return found
