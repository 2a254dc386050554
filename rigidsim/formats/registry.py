"""Formats: their description, their lookup by name, and what they know of a run beyond its numbers."""

import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

from rigidsim.errors import RigidsimError
from rigidsim.formats import FORMATS
from rigidsim.scene.epochs import Epoch, parse_epoch
from rigidsim.scene.readable import AngleUnit


@dataclass(frozen=True)
class Naming:
    """Values that a run's config may have left open.

    Attributes:
        epoch: time zero of the scene, as in ``[time] epoch``; empty for the config's.
        axes: the scene's space axes, as in ``[frame] axes``, or another name that sender and receiver agree
            on (capitals, digits and underscores); empty for the config's.
        object_name: name of the body; empty for the run's name.
        message: options of attitude messages, by key: type, sequence, from, time, segment (AEM), at (APM).
    """

    epoch: str = ""
    axes: str = ""
    object_name: str = ""
    object_id: str = ""
    center: str = "UNKNOWN"
    message: Mapping[str, str] = field(default_factory=dict)


def named_epoch(naming: Naming, attributes: Mapping[str, Any]) -> Epoch:
    """Date of time 0, from the run or from an option."""
    given, known = naming.epoch, str(attributes.get("epoch", ""))
    try:
        epoch = parse_epoch(given) if given else None
    except ValueError as error:
        raise RigidsimError(f"--epoch: {error}") from None
    if not known and epoch is None:
        raise RigidsimError(
            "the run doesn't say what its time 0 is, which this format needs: give [time] epoch in the "
            'config, or --epoch "2029-04-13T21:46:00 TDB" here (scales TDB, TT, TAI, GPS and UTC)'
        )
    if known and epoch is not None and str(epoch) != known:
        raise RigidsimError(f"--epoch: given {epoch}, but time 0 of the run is {known}; leave the option out")
    return epoch or parse_epoch(known)


@dataclass(frozen=True)
class TableSource:
    """The run, or the sweep, that a table comes from; ``motion`` is a run's, as of
    ``rigidsim.workflows.run``, for formats that ask.
    """

    title: str
    bits: int
    attributes: dict[str, Any]
    naming: Naming
    angle_unit: AngleUnit | None = None
    motion: Any = None


@dataclass(frozen=True)
class Format:
    """A format of another tool.

    Attributes:
        write: writes a ``Table`` to a path that doesn't exist yet.
        angles: whether it takes angles in any unit.
        side_tables: whether tables along other dimensions than time get separate files.
        suffix: of its files; by default the format's name.
        beside: files that it needs beside, by their suffixes, and what writes them.
        between: whether it holds the motion between the samples, too.
        ascending: whether its times have to ascend: samples of a run into the past are reversed.
        names: fields of ``Naming`` that it has a place for.
        folder: what such a folder is called, and a file that identifies one; None if it writes a file.
    """

    write: Callable[[Any, Path, TableSource], None]
    angles: bool = False
    side_tables: bool = False
    folder: tuple[str, str] | None = None
    suffix: str = ""
    beside: Mapping[str, Callable[[Any, Path, TableSource], None]] = field(default_factory=dict)
    between: bool = False
    ascending: bool = False
    names: tuple[str, ...] = ("epoch", "axes", "object_name", "object_id", "center")


_PLACES = {
    "csv": ("tables", "CSV", "", ""),
    "parquet": ("tables", "PARQUET", "pyarrow", "export"),
    "zarr": ("tables", "ZARR", "zarr", "export"),
    "aem": ("ccsds", "AEM", "", ""),
    "apm": ("ccsds", "APM", "", ""),
    "oem": ("ccsds", "OEM", "", ""),
    "ck": ("spice", "CK", "spiceypy", "spice"),
    "pck": ("spice", "PCK", "spiceypy", "spice"),
    "snvec": ("climate", "SNVEC", "", ""),
    "la2004": ("climate", "LA2004", "", ""),
}
"""Module and name of each ``Format``, and a package that it needs besides rigidsim's own requirements, with
the extra that brings it.
"""


_SUFFIXES = {".bc": "ck", ".bpc": "pck", ".pqt": "parquet"}


def format_of(out: str | Path | None) -> str:
    """The name of the format that a file's suffix asks for."""
    suffix = Path(out or "").suffix.lower()
    name = _SUFFIXES.get(suffix, suffix[1:])
    if name not in FORMATS:
        given = f'given "{out}", whose suffix is no format' if out is not None else "missing"
        raise RigidsimError(f"--format: {given}; allowed: {', '.join(FORMATS)}, or --out with such a suffix")
    return name


def format_named(name: str) -> Format:
    """A format by its name; its module, and the package that it needs, are loaded."""
    if name not in FORMATS:
        raise RigidsimError(f'--format: given "{name[:40]}"; allowed: {", ".join(FORMATS)}')
    module, attribute, package, extra = _PLACES[name]
    if package and importlib.util.find_spec(package) is None:
        raise RigidsimError(f'{name} needs {package}, which is missing: pip install "rigidsim[{extra}]"')
    found: Format = getattr(import_module(f"rigidsim.formats.{module}"), attribute)
    return found
