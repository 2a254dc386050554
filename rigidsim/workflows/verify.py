"""Verifying a run bit for bit: integrated again from its config and compared number by number."""

import json
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from pydantic import BaseModel

from rigidsim.accuracy.reversal import Reversal, there_and_back
from rigidsim.errors import RESUME, RigidsimError, RunFolderError, run_again
from rigidsim.session.session import Observer
from rigidsim.solve.status import Status
from rigidsim.store import provenance
from rigidsim.store.folder import RunFolder, find_run
from rigidsim.store.netcdf import root_attributes
from rigidsim.store.provenance import SETTING, changed, platform_of, read_attributes
from rigidsim.store.reader import open_dataset
from rigidsim.store.run import open_run
from rigidsim.store.seal import check_seal
from rigidsim.store.summary import Brief, Reproducible, Summary
from rigidsim.workflows.again import experiment_again
from rigidsim.workflows.read import text_difference
from rigidsim.workflows.run import run

_ROWS_AT_ONCE = 65536
_AS_STORED: Any = {"indexed": False, "decoded": False}


@dataclass(frozen=True)
class Difference:
    """The first place where two datasets differ: sample, and both values there."""

    variable: str
    sample: int
    saved: float
    again: float

    @property
    def size(self) -> float:
        """Absolute difference."""
        return abs(self.saved - self.again)


@dataclass(frozen=True)
class Verdict:
    """Result of a verification: identical if every number of every variable agrees in every bit, the files
    are whole, and the summary's claims hold; ``environment``: what changed since, which may explain the rest;
    ``reversal``: how close the motion comes back to its start, if that was asked for.
    """

    path: str
    identical: bool
    problems: list[str] = field(default_factory=list)
    difference: Difference | None = None
    differing: list[str] = field(default_factory=list)
    environment: list[str] = field(default_factory=list)
    samples: int = 0
    reversal: Reversal | None = None

    def as_dict(self) -> dict[str, Any]:
        """Values for JSON."""
        first = self.difference
        report = asdict(self) | {"first_difference": first and asdict(first) | {"size": first.size}}
        report["differing_variables"] = report.pop("differing")
        back = self.reversal
        report["reversal"] = back and asdict(back) | {"words": back.words}
        del report["difference"]
        return report


def verify(path: str | Path, *, reversed: bool = False, observer: Observer | None = None) -> Verdict:
    """Integrate a run's embedded config again and compare all recorded numbers and the summary's claims.

    Args:
        path: run folder with a dataset, or a dataset alone.
        reversed: whether the motion is integrated to its end and back, too. A difference of more than ten
            times both ways' announced errors counts as a problem.
        observer: receives the integration's progress.

    Raises:
        RunFolderError: there is no dataset, or one that no config can reproduce.
        ConfigError: the embedded config isn't valid.
        KeyboardInterrupt: the integration was interrupted; nothing was compared.
    """
    dataset, folder = _dataset(Path(path))
    broken: list[str] = []
    try:
        check_seal(dataset)
    except RunFolderError as error:
        broken.append(str(error))
    try:
        experiment = experiment_again(dataset)
        open_dataset(dataset, **_AS_STORED).close()
    except RigidsimError:
        if not broken:
            raise
        raise RunFolderError(f"{broken[0]}; {run_again(dataset.parent)}") from None
    problems = broken + _file_problems(dataset, folder)
    saved = read_attributes(dataset)
    with _scratch() as scratch:
        again = run(experiment, out=scratch, observer=observer)
        if again.status == Status.INTERRUPTED.value:
            raise KeyboardInterrupt
        if not again.folder.dataset.exists():
            raise RunFolderError(f"{dataset}: the second run {again.outcome.message}; nothing was compared")
        differing, first, samples = _compare(dataset, again.folder.dataset)
        now = read_attributes(again.folder.dataset)
    if folder is not None and not folder.summary.exists():
        problems.append(f"{folder.summary}: is missing; it was written with the dataset")
    elif folder is not None:
        claimed = folder.read_summary()
        problems += _summary_problems(claimed, again.outcome, folder)
        problems += _timeline_problems(claimed, folder)
    for name, then, value in changed(SETTING, saved, now):
        problems.append(f"{name} is {then} in the dataset, {value} when run again")
    others = changed(platform_of(saved), saved, now)
    environment = [f"{name} {then} -> {value}" for name, then, value in others]
    reversal = there_and_back(experiment) if reversed else None
    if reversal is not None and reversal.beyond:
        problems.append(f"{dataset}: {reversal.words}")
    if mixed := saved.get("mixed_provenance"):
        environment.append(f"the run itself was put together on different machines: {mixed}")
    identical = not problems and not differing
    return Verdict(str(dataset), identical, problems, first, differing, environment, samples, reversal)


def _scratch() -> tempfile.TemporaryDirectory[str]:
    try:
        return tempfile.TemporaryDirectory(prefix="rigidsim-verify-")
    except OSError as error:
        why = error.strerror or error
        raise RunFolderError(
            f"{error.filename or 'the temporary folder'}: can't be written: {why}; set TMPDIR to a folder "
            "with room for the run again"
        ) from None


def _dataset(path: Path) -> tuple[Path, RunFolder | None]:
    if path.is_file() and path.name != "dataset.h5":
        return path, None
    folder = find_run(path)
    if not folder.dataset.exists():
        raise RunFolderError(f"{path}: holds no finished dataset; {RESUME} completes it")
    alone = path.is_file() and not folder.config.exists()
    return folder.dataset, None if alone else folder


def _file_problems(dataset: Path, folder: RunFolder | None) -> list[str]:
    """Faults besides the seal's that the files themselves show, before anything is integrated."""
    problems: list[str] = []
    if folder is None:
        return problems
    claimed = open_run(folder.path).outcome.dataset_digest
    if claimed is not None and claimed != provenance.file_sha256(dataset):
        problems.append(f"{folder.summary}: was written for another dataset than this one")
    try:
        text = folder.config.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        return [*problems, f"{folder.config}: can't be read ({error})"]
    if text != root_attributes(dataset).get("config"):
        line = text_difference(text, str(root_attributes(dataset).get("config")))
        problems.append(f"{folder.config}: isn't the config that the dataset was made by ({line})")
    return problems


def _compare(saved: Path, again: Path) -> tuple[list[str], Difference | None, int]:
    """Names of the variables that differ, the earliest difference, and the number of samples."""
    found: dict[str, Difference | None] = {}
    with open_dataset(saved, **_AS_STORED) as one, open_dataset(again, **_AS_STORED) as other:
        names = {str(n) for file in (one, other) for n, v in file.variables.items() if v.dtype.kind == "f"}
        for name in sorted(names):
            comparable = name in one.variables and name in other.variables
            comparable = comparable and one[name].shape == other[name].shape
            first = None
            try:
                first = _first_difference(name, one[name], other[name]) if comparable else None
            except OSError:  # rows that can't be unpacked; the seal has shown that the file is damaged
                comparable = False
            if first is not None or not comparable:
                found[name] = first
        earliest = min(filter(None, found.values()), key=lambda one: one.sample, default=None)
        return list(found), earliest, one.sizes["time"]


def _first_difference(name: str, one: xarray.DataArray, other: xarray.DataArray) -> Difference | None:
    for first in range(0, one.shape[0] if one.ndim else 1, _ROWS_AT_ONCE):
        rows: Any = slice(first, first + _ROWS_AT_ONCE) if one.ndim else ()
        a, b = (np.atleast_1d(np.asarray(of[rows].values, dtype="<f8")) for of in (one, other))
        unequal = first_unequal(a, b)
        if unequal is not None:
            row, saved, again = unequal
            return Difference(name, first + row, saved, again)
    return None


def first_unequal(one: np.ndarray, other: np.ndarray) -> tuple[int, float, float] | None:
    """The first row in which any bit of two arrays (rows, ...) of eight bytes differs, and both numbers."""
    a, b = (np.ascontiguousarray(x).reshape(len(x), -1) for x in (one, other))
    unequal = np.argwhere(a.view(np.int64) != b.view(np.int64))
    if not len(unequal):
        return None
    row, column = unequal[0].tolist()
    return row, float(a[row, column]), float(b[row, column])


def _summary_problems(saved: Brief, again: Brief, folder: RunFolder) -> list[str]:
    """The first claim of a summary that running again doesn't confirm, in words; empty if all hold.

    A claim that a part of the summary lacks isn't made; but an invariant has its part.
    """
    if not isinstance(saved, Summary):
        return []  # a run that was killed claims nothing
    # once there is a dataset, an interruption can only have hit its timeline or its segments' removal
    ended = saved.status != Status.INTERRUPTED.value
    claims, now = (dict(_claims(summary, ended)) for summary in (saved, again))
    tables, parts = ({key.rpartition(".")[0] for key in made} for made in (claims, now))
    found = [
        f"there is no {part}, which there is when run again"
        for part in sorted(parts - tables)
        if "." in part and part.partition(".")[0] in {table.partition(".")[0] for table in tables}
    ]
    found += [
        f"{key} is {value[:120]}, {now.get(key, 'which there is not')[:120]} when run again"
        for key, value in claims.items()
        if value != now.get(key, "null")
    ]
    more = f" (and {len(found) - 1} more of its claims don't hold)" if len(found) > 1 else ""
    return [f"{folder.summary}: says that {found[0]}{more}"] if found else []


def _claims(part: BaseModel, ended: bool, where: str = "") -> Iterator[tuple[str, str]]:
    """The fields marked as reproducible, in this part and in parts within, as dotted names with JSON."""
    given = part.model_dump(mode="json", exclude_unset=True)
    for name, field_info in type(part).model_fields.items():
        value, key = getattr(part, name), f"{where}{name}"
        claim = next((mark for mark in field_info.metadata if isinstance(mark, Reproducible)), None)
        if claim is not None:
            if name in given and (ended or not claim.of_end):
                yield key, json.dumps(given[name], sort_keys=True)
        elif isinstance(value, BaseModel):
            yield from _claims(value, ended, f"{key}.")
        elif isinstance(value, dict):
            for inner, item in value.items():
                yield from _claims(item, ended, f"{key}.{inner}.") if isinstance(item, BaseModel) else ()


def _timeline_problems(saved: Brief, folder: RunFolder) -> list[str]:
    """Problems with the timeline that a summary names, if it is missing or changed."""
    if not isinstance(saved, Summary) or saved.timeline_sha256 is None:
        return []
    if not folder.timeline.is_file() or folder.timeline.is_symlink():
        return [f"{folder.timeline}: is missing; rigidsim view draws it again"]
    if provenance.file_sha256(folder.timeline) != saved.timeline_sha256:
        return [f"{folder.timeline}: was damaged or changed since it was drawn; rigidsim view draws it again "
                "once it is removed"]  # fmt: skip
    return []
