"""``rigidsim export``: the dataset of a run or a sweep in other tools' formats."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import xarray

from rigidsim.errors import RESUME, RigidsimError, RunFolderError
from rigidsim.formats import FOR_SWEEPS
from rigidsim.formats.digits import angle_unit_named
from rigidsim.formats.registry import Naming, TableSource, format_named, format_of
from rigidsim.formats.tables import BLOCK_NUMBERS, tables_of
from rigidsim.scene.arithmetic import working_bits
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.store.outputs import FILE, refuse_loss, writing
from rigidsim.store.run import SavedRun
from rigidsim.store.sweeps.saved import SavedSweep, open_saved
from rigidsim.workflows.read import parse
from rigidsim.workflows.run import MotionAgain

_PART_BITS = 53  # bits of a double: a value held by n of them has at most n times as many


def export(
    saved: SavedRun | SavedSweep | str | Path,
    file_format: str | None = None,
    out: str | Path | None = None,
    *,
    force: bool = False,
    naming: Naming | None = None,
    angle_unit: str | None = None,
    variables: Sequence[str] = (),
    block_numbers: int = BLOCK_NUMBERS,
) -> list[Path]:
    """Write a run, finished or partial, or the members of a finished sweep in another format, block by block
    so that memory stays small; returns the files written, the table along time, or of the members, first.

    Args:
        saved: a run or a sweep, or the path of one.
        file_format: one of ``rigidsim.formats.FORMATS``, by default from the suffix of ``out``; csv,
            parquet or zarr of a sweep.
        out: the file (for zarr the folder); ``NAME.FORMAT`` in the working folder by default (``NAME.bc`` and
            its clock ``NAME.tsc`` for ck, ``NAME.bpc`` and its frame ``NAME.tf`` for pck). In csv and
            parquet, events and Lyapunov estimates go to further files next to it, ``NAME.flip.csv``; of a
            sweep the file has a row per member, and whole series, occurrences of an event and spectral lines
            go to long tables next to it: ``NAME.time.csv``, ``NAME.flip_occurrence.csv``, ``NAME.line.csv``.
        naming: epoch, axes and names that the run's config leaves open, for
            aem, oem, ck and pck; empty for sweeps.
        angle_unit: one of ``rigidsim.scene.readable.ANGLE_UNITS``; rad by default. For csv, parquet and zarr.
        variables: names of the variables to write; all by default. For the same formats.
        block_numbers: numbers of a sweep held in memory at once; no digit depends on it.
    """
    file_format = file_format or format_of(out)
    found = format_named(file_format)
    if isinstance(saved, str | Path):
        saved = open_saved(saved)
    for name, value in vars(naming or Naming()).items():
        if value != getattr(Naming(), name) and name not in found.names:
            raise RigidsimError(
                f"--{name.replace('_', '-')}: {file_format} has no place for it; leave it out"
            )
    unit = None if angle_unit is None else angle_unit_named(angle_unit)
    for option, given in (("--variable", ", ".join(variables)), ("--angle-unit", angle_unit)):
        if given and not found.angles:
            raise RigidsimError(
                f"{option}: given {given}, but {file_format} has prescribed contents; choose csv, parquet "
                "or zarr"
            )
    name = saved.folder.path.resolve().name
    target = Path(f"{name}{found.suffix or f'.{file_format}'}") if out is None else Path(out)
    if isinstance(saved, SavedRun):
        opened = saved.opened(indexed=False)  # sample times are not loaded as an index
    else:
        _refuse_for_sweeps(saved, file_format, naming)
        opened = saved.dataset
    with opened as dataset:
        dataset = _chosen(dataset, variables)
        if found.ascending and dataset.sizes.get("time", 0) > 1 and dataset["time"][0] > dataset["time"][-1]:
            dataset = dataset.isel(time=slice(None, None, -1))
        bits = _bits(dataset) if isinstance(saved, SavedRun) else _bits_of_members(dataset)
        first, *others = tables_of(dataset, unit, bits, block_numbers)
        attributes = dict(dataset.attrs, status=saved.status)
        if found.between and isinstance(saved, SavedRun) and not saved.folder.dataset.exists():
            raise RunFolderError(f"{saved.place}: the run is {saved.status}; {RESUME} completes it")
        motion = MotionAgain(saved.folder.dataset) if found.between and isinstance(saved, SavedRun) else None
        source = TableSource(name, bits, attributes, naming or Naming(), unit, motion)
        kept = {target: (first, found.write)}
        if found.side_tables:
            for table in others:
                path = target.with_name(f"{target.stem}.{table.dim}{target.suffix}")
                kept[path] = table, found.write
        for suffix, write in found.beside.items():
            if target.suffix == suffix:
                raise RigidsimError(f"--out: given {target}, but {suffix} is the suffix of a file next to it")
            kept[target.with_suffix(suffix)] = first, write
        refuse_loss(kept, saved.files, force=force, kind=found.folder or FILE)
        for path, (table, write) in kept.items():
            with writing(path, folder=found.folder is not None) as new:
                write(table, new, source)
        return list(kept)


def _chosen(dataset: xarray.Dataset, names: Sequence[str]) -> xarray.Dataset:
    """Only these variables, with the parts that hold their digits; all if none is named."""
    if not names:
        return dataset
    allowed = [str(n) for n, variable in dataset.data_vars.items() if "residual_of" not in variable.attrs]
    for name in names:
        if name not in allowed:
            raise RigidsimError(f"--variable: given {name[:60]}; allowed: {', '.join(allowed)}")
    time = parts_in(dataset, "time")[1:] if "time" in dataset.variables else []
    return dataset[[*time, *(part for name in dict.fromkeys(names) for part in parts_in(dataset, name))]]


def _refuse_for_sweeps(sweep: SavedSweep, file_format: str, naming: Naming | None) -> None:
    """Refuse formats that hold a single motion, naming for one, and unfinished sweeps."""
    if file_format not in FOR_SWEEPS:
        raise RigidsimError(
            f"--format: given {file_format}, which holds a single motion, but {sweep.place} is a sweep; "
            f"allowed: {', '.join(FOR_SWEEPS)}. rigidsim run {sweep.folder.config} --member N runs one "
            f"member by itself, which {file_format} can hold"
        )
    if naming not in (None, Naming()):
        raise RigidsimError(
            "--epoch, --axes, --object-name and --object-id are for single runs: tables of a sweep have "
            "times in s and no dates; leave them out"
        )
    if not sweep.finished:
        raise RunFolderError(f"{sweep.place}: the sweep is {sweep.status}; {RESUME} completes it")


def _bits(dataset: xarray.Dataset) -> int:
    """Bits of the run's precision."""
    bits: Any = dataset.attrs.get("precision_bits")
    bits = bits.item() if hasattr(bits, "item") else bits
    if not isinstance(bits, int) or not 1 <= bits <= 2000:
        raise RunFolderError("the dataset's attribute precision_bits is missing or no number of bits")
    return bits


def _bits_of_members(dataset: xarray.Dataset) -> int:
    """Bits that distinguish all members' numbers: the bits of the config's precision, if all share one.

    If precision is swept, or left to ``accuracy``, as many as the dataset's residuals can hold.
    """
    config = parse(str(dataset.attrs["config"]), source="the sweep's config").config
    integrator, axes = config.integrator, config.sweep.axes if config.sweep else {}
    chosen = integrator.accuracy is not None or integrator.accuracy_axis is not None
    if chosen or any(key.startswith("integrator") for key in axes):
        return _PART_BITS * max(len(parts_in(dataset, str(name))) for name in dataset.data_vars)
    return working_bits(integrator.precision)
