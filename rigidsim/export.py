"""``rigidsim export``: a run's dataset in the formats of other tools."""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigidsim.errors import RigidsimError, RunFolderError
from rigidsim.exchange.aem import write_aem
from rigidsim.exchange.ccsds import Naming
from rigidsim.exchange.csv import write_csv
from rigidsim.exchange.oem import write_oem
from rigidsim.exchange.parquet import write_parquet
from rigidsim.exchange.tables import Table, tables_of
from rigidsim.exchange.zarr import write_zarr
from rigidsim.store import netcdf

if TYPE_CHECKING:
    import xarray

    from rigidsim.archive import Run

FORMATS = ("csv", "parquet", "zarr", "aem", "oem")
_NEEDS = {"parquet": "pyarrow", "zarr": "zarr"}


def export(
    run: Run,
    file_format: str,
    out: str | Path | None = None,
    *,
    force: bool = False,
    naming: Naming | None = None,
) -> list[Path]:
    """Write a run, finished or partial, in another format; block by block, so that memory stays small.

    Args:
        run: from ``open_run``.
        file_format: one of ``FORMATS``.
        out: the file (for zarr the folder); ``NAME.FORMAT`` in the working folder by default. In csv and
            parquet, events and Lyapunov estimates go to files of their own beside it, ``NAME.flip.csv``.
        force: replace what is there.
        naming: epoch, names and frames, for aem and oem.

    Returns:
        What was written; the table along time first.

    Raises:
        RigidsimError: unknown format, a package is missing, or the format can't hold the run.
        RunFolderError: the run is damaged or empty.
    """
    if file_format not in FORMATS:
        raise RigidsimError(f'--format: given "{file_format[:40]}"; allowed: {", ".join(FORMATS)}')
    package = _NEEDS.get(file_format)
    if package and importlib.util.find_spec(package) is None:
        raise RigidsimError(
            f'{file_format} needs {package}, which is missing: pip install "rigidsim[export]"'
        )
    name = run.folder.path.resolve().name
    target = Path(f"{name}.{file_format}") if out is None else Path(out)
    with ExitStack() as stack:
        # sample times are not loaded as an index
        pieces = [stack.enter_context(run.opened(indexed=False))]
        tables = tables_of(pieces)
        bits = _bits(pieces[0])
        kept = tables if file_format in ("csv", "parquet") else tables[:1]
        targets = [_beside(target, table) for table in kept]
        for path in targets:
            _refuse_existing(path, force, folder=file_format == "zarr")
        attributes = dict(pieces[-1].attrs, status=run.status)
        for table, path in zip(kept, targets, strict=True):
            with _replacing(path) as temporary:
                if file_format == "csv":
                    write_csv(table, temporary, title=name, bits=bits)
                elif file_format == "parquet":
                    write_parquet(table, temporary, attributes=attributes)
                elif file_format == "zarr":
                    write_zarr(pieces, temporary, attributes=attributes)
                else:
                    write = write_aem if file_format == "aem" else write_oem
                    write(table, temporary, naming=naming or Naming(), title=name, bits=bits)
    return targets


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


def _refuse_existing(path: Path, force: bool, *, folder: bool) -> None:
    if not path.parent.is_dir():
        raise RigidsimError(
            f"{path}: there is no folder {path.parent}; make it first, or choose another --out"
        )
    if not (path.exists() or path.is_symlink()):
        return
    if folder and not (path / ".zgroup").is_file():
        raise RigidsimError(f"{path}: exists and is no Zarr store; choose another --out")
    if not folder and not path.is_file():
        raise RigidsimError(f"{path}: is no file; choose another --out")
    if not force:
        raise RigidsimError(f"{path}: exists; --force replaces it, --out PATH writes elsewhere")


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """A temporary path that takes the place of ``path`` when all went well; nothing is left otherwise."""
    temporary = path.with_name(f".{path.name}.partial")
    try:
        if temporary.is_dir():
            shutil.rmtree(temporary)
        with netcdf.atomic(path) if path.suffix != ".zarr" and not path.is_dir() else _folder(path) as place:
            yield place
    except OSError as error:
        why = error.strerror or error
        raise RigidsimError(f"{path}: can't be written: {why}; choose another --out") from None


@contextmanager
def _folder(path: Path) -> Iterator[Path]:
    """The same for a folder."""
    temporary, old = (path.with_name(f".{path.name}.{what}") for what in ("partial", "replaced"))
    for leftover in (temporary, old):
        shutil.rmtree(leftover, ignore_errors=True)
    try:
        yield temporary
        if path.exists():
            os.replace(path, old)
        os.replace(temporary, path)
    finally:
        for leftover in (temporary, old):
            shutil.rmtree(leftover, ignore_errors=True)
