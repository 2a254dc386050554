"""Verifying bit for bit: a run, some members of a sweep, or a fit is made again, and compared by number."""

import json
import random
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from rigidsim.accuracy.reversal import Reversal, there_and_back
from rigidsim.errors import RESUME, ConfigError, Problem, Remedy, RigidsimError, RunFolderError, run_again
from rigidsim.scene.sweep import Sweep
from rigidsim.session.session import Observer
from rigidsim.solve.status import Status
from rigidsim.store import provenance
from rigidsim.store.folder import FitFolder, RunFolder, SweepFolder, find_run, folder_at
from rigidsim.store.netcdf import root_attributes
from rigidsim.store.provenance import SETTING, changed, platform_of, read_attributes
from rigidsim.store.reader import open_dataset
from rigidsim.store.seal import check_seal
from rigidsim.store.summary import Brief, Summary
from rigidsim.workflows.read import load, text_difference
from rigidsim.workflows.run import experiment_again, run

MEMBERS = 100
"""Number of members of a sweep that are run again by default."""
_ROWS_AT_ONCE = 65536
_HELD = 64e6  # bytes of a variable of a sweep that are read at once; larger ones are read member by member
_AS_STORED: Any = {"indexed": False, "decoded": False}
_OF_THE_END = frozenset(("status", "message", "exit_code"))
_CLAIMS = _OF_THE_END | {
    *("name", "description", "samples", "samples_planned", "time_reached", "engine_time", "formulation"),
    *("states", "precision", "tolerance", "method", "hold_invariants", "hold_from_step", "body", "start"),
    *("time", "events", "event_times", "chart_changes", "undefined_samples", "invariants", "cost.steps"),
    *("modelling.level", "modelling.short_period", "modelling.requested", "lyapunov.chaotic"),
    *("lyapunov.largest_exponent", "lyapunov.moved_over_second_half", "lyapunov.exponents"),
}
"""Parts of a summary that follow from the config alone, so that running it again must confirm them; what says
how the run ended is no claim of one that was interrupted.
"""


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
    ``samples``: of a sweep members, of a fit variables; ``reversal``: how close the motion comes back to its
    start, if that was asked for.
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


def verify(
    path: str | Path,
    *,
    reversed: bool = False,
    members: int | None = None,
    seed: int | None = None,
    observer: Observer | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> Verdict:
    """Make a run, a sweep or a fit again from its embedded config, and compare all numbers and claims.

    Args:
        path: its folder with a dataset, or a run's dataset alone.
        reversed: whether a run's motion is integrated to its end and back, too. A difference of more than ten
            times both ways' announced errors counts as a problem.
        members: number of members of a sweep to run again, in other batches than before, ``MEMBERS`` by
            default; they are drawn at random unless a ``seed`` is given.
        observer: receives the progress of a run's integration. report: lines on a fit's.

    Raises:
        RunFolderError: there is no dataset, or one that no config can reproduce.
        ConfigError: the embedded config isn't valid.
        RigidsimError: an option of runs or of sweeps is given for something else.
        KeyboardInterrupt: the integration was interrupted; nothing was compared.
    """
    folder = folder_at(path)
    if members is not None and not isinstance(folder, SweepFolder):
        option = Remedy("--members", "members")
        raise RigidsimError(f"{option}: is for sweeps; {path} is compared as a whole; leave it out")
    if reversed and isinstance(folder, SweepFolder | FitFolder):
        option = Remedy("--reversed", "reversed")
        raise RigidsimError(f"{option}: is for single runs, and {path} is none; leave it out")
    if isinstance(folder, FitFolder):
        return _verified_fit(folder, report)
    if isinstance(folder, SweepFolder):
        return _verified_sweep(folder, MEMBERS if members is None else members, seed)
    return _verified_run(path, reversed, observer)


def _judged(
    place: str | Path, problems: list[str], found: Mapping[str, Difference | None], *rest: Any
) -> Verdict:
    """The verdict on variables that differ, and where they do so first."""
    first = min(filter(None, found.values()), key=lambda one: one.sample, default=None)
    return Verdict(str(place), not problems and not found, problems, first, sorted(found), *rest)


def _differing(saved: Mapping[Any, Any], again: Mapping[Any, Any]) -> dict[str, Difference | None]:
    """Variables of which any bit differs, and the first row where it does; None if they aren't comparable."""
    found: dict[str, Difference | None] = {}
    for name in sorted({str(name) for name in (*saved, *again)}):
        one, other = saved.get(name), again.get(name)
        if one is None or other is None or one.shape != other.shape:
            found[name] = None
            continue
        for first in range(0, one.shape[0] if one.ndim else 1, _ROWS_AT_ONCE):
            rows: Any = slice(first, first + _ROWS_AT_ONCE) if one.ndim else ...
            try:
                a, b = (np.atleast_1d(np.asarray(of[rows])) for of in (one, other))
            except OSError:  # rows that can't be unpacked; the seal has shown that the file is damaged
                found[name] = None
                break
            a, b = (x.reshape(len(x), -1) for x in (a, b))
            doubles = a.dtype.kind == b.dtype.kind == "f"
            unequal = np.argwhere(_bits(a) != _bits(b) if doubles else a != b)
            if len(unequal):
                row, column = unequal[0].tolist()
                numbers = a.dtype.kind in "fiu"
                both = (float(x[row, column]) if numbers else np.nan for x in (a, b))
                found[name] = Difference(name, first + row, *both)
                break
    return found


def _bits(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values, dtype="<f8").view(np.int64)


def _changes(names: Iterable[str], then: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    return [f"{name} {before} -> {value}" for name, before, value in changed(names, then, now)]


# --- runs ---------------------------------------------------------------------------------------------------


def _verified_run(path: str | Path, reversed: bool, observer: Observer | None) -> Verdict:
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
    problems = broken + ([] if folder is None else _file_problems(folder))
    saved = read_attributes(dataset)
    with _scratch() as scratch:
        again = run(experiment, out=scratch, observer=observer)
        if again.status == Status.INTERRUPTED.value:
            raise KeyboardInterrupt
        if not again.folder.dataset.exists():
            raise RunFolderError(f"{dataset}: the second run {again.outcome.message}; nothing was compared")
        with (
            open_dataset(dataset, **_AS_STORED) as one,
            open_dataset(again.folder.dataset, **_AS_STORED) as other,
        ):
            found, samples = _differing(one.variables, other.variables), one.sizes["time"]
        now = read_attributes(again.folder.dataset)
    if folder is not None:
        problems += _summary_problems(folder, again.outcome)
    for name, then, value in changed(SETTING, saved, now):
        problems.append(f"{name} is {then} in the dataset, {value} when run again")
    environment = _changes(platform_of(saved), saved, now)
    reversal = there_and_back(experiment) if reversed else None
    if reversal is not None and reversal.beyond:
        problems.append(f"{dataset}: {reversal.words}")
    if mixed := saved.get("mixed_provenance"):
        environment.append(f"the run itself was put together on different machines: {mixed}")
    return _judged(dataset, problems, found, environment, samples, reversal)


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


def _file_problems(folder: RunFolder) -> list[str]:
    """Faults besides the seal's that the files themselves show, before anything is integrated."""
    problems: list[str] = []
    claimed = folder.read_summary().dataset_digest
    if claimed is not None and claimed != provenance.file_sha256(folder.dataset):
        problems.append(f"{folder.summary}: was written for another dataset than this one")
    try:
        text = folder.config.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        return [*problems, f"{folder.config}: can't be read ({error})"]
    embedded = str(root_attributes(folder.dataset).get("config"))
    if text != embedded:
        line = text_difference(text, embedded)
        problems.append(f"{folder.config}: isn't the config that the dataset was made by ({line})")
    return problems


def _summary_problems(folder: RunFolder, again: Brief) -> list[str]:
    """The first claim of a summary that running again doesn't confirm, and what is wrong with the timeline
    that it names.
    """
    if not folder.summary.exists():
        return [f"{folder.summary}: is missing; it was written with the dataset"]
    saved, problems = folder.read_summary(), list[str]()
    if not isinstance(saved, Summary):
        return []  # a run that was killed claims nothing
    # once there is a dataset, an interruption can only have hit its timeline or its segments' removal
    claims = _CLAIMS - (_OF_THE_END if saved.status == Status.INTERRUPTED.value else set())
    found = [*_unconfirmed(saved.as_dict(), again.as_dict(), claims)]
    more = f" (and {len(found) - 1} more of its claims don't hold)" if len(found) > 1 else ""
    if found:
        problems.append(f"{folder.summary}: says that {found[0]}{more}")
    if saved.timeline_sha256 is not None:
        if not folder.timeline.is_file() or folder.timeline.is_symlink():
            problems.append(f"{folder.timeline}: is missing; rigidsim view draws it again")
        elif provenance.file_sha256(folder.timeline) != saved.timeline_sha256:
            problems.append(
                f"{folder.timeline}: was damaged or changed since it was drawn; remove it, and rigidsim view "
                "draws it again"
            )
    return problems


def _unconfirmed(
    saved: Mapping[str, Any], again: Mapping[str, Any], claims: Collection[str], table: str = ""
) -> Iterator[str]:
    """Claims that running again doesn't confirm, in words. One that a table lacks isn't made; but each
    invariant, say, has its own table. The name of a scale is wording, which versions may change.
    """
    claimed = table.partition(".")[0] in claims
    for key in again.keys() - saved.keys() if claimed else ():
        if isinstance(again[key], dict):
            yield f"there is no {table}{key}, which there is when run again"
    for key, then in saved.items():
        name, now = f"{table}{key}", again.get(key)
        if isinstance(then, dict) and isinstance(now, dict):
            yield from _unconfirmed(then, now, claims, f"{name}.")
        elif (claimed or name in claims) and key != "scale_name" and then != now:
            others = "which there is not" if now is None else json.dumps(now)
            yield f"{name} is {json.dumps(then)[:120]}, {others[:120]} when run again"


# --- sweeps -------------------------------------------------------------------------------------------------


def _verified_sweep(folder: SweepFolder, members: int, seed: int | None) -> Verdict:
    from rigidsim.store.sweeps.saved import open_sweep  # which single runs don't need
    from rigidsim.workflows.sweeps.members import refuse_other_kernel, sweep_of
    from rigidsim.workflows.sweeps.sweep import results_of

    if members < 1:
        raise ConfigError(Problem("--members", f"given {members}; one or more are allowed"))
    saved = open_sweep(folder.path)
    if not saved.finished:
        raise RunFolderError(f"{saved.place}: is {saved.status}; {RESUME} completes it")
    outcome, problems = saved.outcome, []
    with saved.dataset as dataset:
        sweep = sweep_of(str(dataset.attrs["config"]))
        refuse_other_kernel(sweep, outcome.provenance, folder.dataset)
        if dataset.attrs.get("config_sha256") != sweep.experiment.sha256:
            problems.append(f"{folder.dataset}: embeds another config than its config_sha256 says")
        if outcome.members != sweep.count:
            problems.append(
                f"{saved.place}: the summary has {outcome.members} members, the config of {sweep.count}"
            )
        if outcome.dataset_sha256 is None:
            problems.append(f"{saved.place}: the summary doesn't say which dataset it was written for")
        chosen = sorted(random.Random(seed).sample(range(sweep.count), min(members, sweep.count)))
        alone = None if (begun := folder.begun) is None else begun.alone
        kept = results_of(sweep, chosen, sweep.table.keep, alone, folder.data).kept
        again = {name: variable.values for name, variable in kept.items()}
        there = {x: _of_members(dataset[x], sweep, chosen, again[x]) for x in again if x in dataset}
    found = {
        name: first and replace(first, sample=chosen[first.sample])
        for name, first in _differing(there, again).items()
    }
    now = {f"version_{name}": version for name, version in provenance.versions().items()}
    now["cpu_model"] = provenance.cpu_model()
    environment = _changes(now, outcome.provenance, now)
    if outcome.mixed_provenance:
        environment.append(f"the sweep itself was computed with different {outcome.mixed_provenance}")
    return _judged(saved.place, problems, found, environment, len(chosen))


def _of_members(
    variable: xarray.DataArray, sweep: Sweep, members: Sequence[int], again: np.ndarray
) -> np.ndarray:
    """Saved values of members, (members, ...), as many of each as there are ``again``."""
    if variable.dims[: len(sweep.dims)] != sweep.dims:  # times that all members share
        values = np.broadcast_to(variable.values, (len(members), *variable.shape))
    elif variable.nbytes <= _HELD:
        values = variable.values.reshape(sweep.count, *variable.shape[len(sweep.dims) :])[list(members)]
    else:
        places = ([int(i) for i in np.unravel_index(member, sweep.shape)] for member in members)
        rows = (variable.isel(dict(zip(sweep.dims, place, strict=True))).values for place in places)
        values = np.stack(list(rows))
    return values[(slice(None), *(slice(0, size) for size in again.shape[1:]))].astype(again.dtype)


# --- fits ---------------------------------------------------------------------------------------------------


def _verified_fit(folder: FitFolder, report: Callable[[str], None]) -> Verdict:
    from rigidsim.workflows.fit import fitting  # which single runs don't need

    saved, experiment = fitting.read_dataset(folder), load(folder.config)
    copies = fitting.copies(folder, experiment)
    begun = json.loads(folder.begun.read_text(encoding="utf-8"))
    now, versions = fitting.identity(experiment, copies), begun.pop("versions")
    problems = [
        f"{key.removesuffix('_sha256')}: not the bytes that the fit was made from"
        for key, known in begun.items()
        if known != now.get(key)
    ]
    again = fitting.fit_to(experiment, copies, report=report)
    if again.experiment.text != folder.fitted.read_text(encoding="utf-8"):
        problems.append(f"{folder.fitted.name}: other values than those fitted again")
    found = _differing(saved.variables, again.dataset.variables)
    environment = _changes(versions, versions, now["versions"])
    return _judged(folder.path, problems, dict.fromkeys(found), environment, len(again.dataset.variables))
