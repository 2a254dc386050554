"""``rigidsim export``: a run's dataset in the formats of other tools."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigidsim.errors import RigidsimError, RunFolderError
from rigidsim.formats.angles import angle_unit_named
from rigidsim.formats.naming import Naming
from rigidsim.formats.registry import Format, Source, format_named
from rigidsim.formats.tables import Table, tables_of
from rigidsim.store import atomic

if TYPE_CHECKING:
    import xarray

    from rigidsim.store.run import SavedRun


def export(
    run: SavedRun,
    file_format: str,
    out: str | Path | None = None,
    *,
    force: bool = False,
    naming: Naming | None = None,
    angle_unit: str | None = None,
) -> list[Path]:
    """Write a run, finished or partial, in another format; block by block, so that memory stays small.

    Args:
        run: from ``open_run``.
        file_format: one of ``rigidsim.formats.FORMATS``.
        out: the file (for zarr the folder); ``NAME.FORMAT`` in the working folder by default. In csv and
            parquet, events and Lyapunov estimates go to files of their own beside it, ``NAME.flip.csv``.
        force: replace what is there.
        naming: what the run's config leaves open of epoch, axes and names, for aem and oem.
        angle_unit: that angles are written in, one of ``rigidsim.look.angle_units.ANGLE_UNITS``; rad by
            default. For csv, parquet and zarr.

    Returns:
        What was written; the table along time first.

    Raises:
        RigidsimError: unknown format or unit, a package is missing, or the format can't hold the run.
        RunFolderError: the run is damaged or empty.
    """
    found = format_named(file_format)
    unit = None if angle_unit is None else angle_unit_named(angle_unit)
    if unit is not None and not found.angles:
        raise RigidsimError(
            f"--angle-unit: given {angle_unit}, but {file_format} prescribes its units; leave it out"
        )
    name = run.folder.path.resolve().name
    target = Path(f"{name}.{file_format}") if out is None else Path(out)
    with run.opened(indexed=False) as dataset:  # sample times are not loaded as an index
        bits = _bits(dataset)
        tables = tables_of(dataset, unit, bits)
        kept = {_beside(target, table): table for table in (tables if found.side_tables else tables[:1])}
        for path in kept:
            _refuse_existing(path, found, force)
        attributes = dict(dataset.attrs, status=run.status)
        source = Source(name, bits, attributes, naming or Naming(), unit)
        for path, table in kept.items():
            with _replacing(path, found) as new:
                found.write(table, new, source)
    return list(kept)


def _bits(dataset: xarray.Dataset) -> int:
    """Of the run's precision."""
    bits: Any = dataset.attrs.get("precision_bits")
    bits = bits.item() if hasattr(bits, "item") else bits
    if not isinstance(bits, int) or not 1 <= bits <= 2000:
        raise RunFolderError("the dataset's attribute precision_bits is missing or no number of bits")
    return bits


def _beside(target: Path, table: Table) -> Path:
    """The file of a table: that of samples has the name itself."""
    return target if table.dim == "time" else target.with_name(f"{target.stem}.{table.dim}{target.suffix}")


def _refuse_existing(path: Path, found: Format, force: bool) -> None:
    if not path.parent.is_dir():
        raise RigidsimError(
            f"{path}: there is no folder {path.parent}; make it first, or choose another --out"
        )
    if not (path.exists() or path.is_symlink()):
        return
    if found.folder is not None:
        kind, mark = found.folder
        if not (path / mark).is_file():
            raise RigidsimError(f"{path}: exists and is no {kind}; choose another --out")
    elif not path.is_file():
        raise RigidsimError(f"{path}: is no file; choose another --out")
    if not force:
        raise RigidsimError(f"{path}: exists; --force replaces it, --out PATH writes elsewhere")


@contextmanager
def _replacing(path: Path, found: Format) -> Iterator[Path]:
    """A temporary path that takes the place of ``path`` when all went well; nothing is left otherwise."""
    try:
        with (atomic.replacing if found.folder is None else atomic.replacing_folder)(path) as new:
            yield new
    except OSError as error:
        why = error.strerror or error
        raise RigidsimError(f"{path}: can't be written: {why}; choose another --out") from None
