"""Verifying a sweep bit for bit: some members, drawn at random, are run again and compared."""

import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from rigidsim.errors import RESUME, ConfigError, Problem, RunFolderError
from rigidsim.scene.sweep import Sweep
from rigidsim.store import provenance
from rigidsim.store.sweeps.folder import SavedSweep, open_sweep
from rigidsim.store.sweeps.tiles import Kept
from rigidsim.workflows.sweeps.executors import results_of
from rigidsim.workflows.sweeps.members import refuse_other_kernel, sweep_of
from rigidsim.workflows.verify import Difference, Verdict, first_unequal

MEMBERS = 100
"""Number of members that are run again by default."""
_HELD = 64e6  # bytes of a variable that are read at once; larger ones are read member by member


def verify_sweep(path: str | Path, *, members: int = MEMBERS, seed: int | None = None) -> Verdict:
    """Run some members of a finished sweep again, in other company than before, and compare everything that
    was kept; the verdict's samples are members. They are drawn anew each time unless a seed is given. Raises
    ``ConfigError``, and ``RunFolderError`` as ``verify`` does.
    """
    if members < 1:
        raise ConfigError(Problem("--members", f"given {members}; one or more are allowed"))
    saved = open_sweep(path)
    if not saved.finished:
        raise RunFolderError(f"{saved.place}: is {saved.status}; {RESUME} completes it")
    with saved.dataset as dataset:
        sweep = sweep_of(str(dataset.attrs["config"]))
        refuse_other_kernel(sweep, saved.outcome.provenance, saved.folder.dataset)
        problems = _problems(saved, dataset, sweep)
        chosen = sorted(random.Random(seed).sample(range(sweep.count), min(members, sweep.count)))
        alone = None if (begun := saved.folder.begun) is None else begun.alone
        again = results_of(sweep, chosen, sweep.table.keep, alone, saved.folder.data).kept
        found = _differences(dataset, sweep, chosen, again)
    changed = _environment(saved.outcome.provenance)
    if saved.outcome.mixed_provenance:
        changed.append(f"the sweep itself was computed with different {saved.outcome.mixed_provenance}")
    first = min(found, key=lambda one: one.sample, default=None)
    names = sorted({one.variable for one in found})
    return Verdict(saved.place, not problems and not found, problems, first, names, changed, len(chosen))


def _problems(saved: SavedSweep, dataset: xarray.Dataset, sweep: Sweep) -> list[str]:
    """False statements of dataset and summary about themselves."""
    problems = []
    if dataset.attrs.get("config_sha256") != sweep.experiment.sha256:
        problems.append(f"{saved.folder.dataset}: embeds another config than its config_sha256 says")
    if saved.outcome.members != sweep.count:
        problems.append(f"{saved.place}: the summary has {saved.outcome.members} members, "
                        f"the config of {sweep.count}")  # fmt: skip
    if saved.outcome.dataset_sha256 is None:
        problems.append(f"{saved.place}: the summary doesn't say which dataset it was written for")
    return problems


def _differences(
    dataset: xarray.Dataset, sweep: Sweep, members: Sequence[int], again: Kept
) -> list[Difference]:
    """For each variable the first member in which any bit differs, and both numbers."""
    found = []
    for name, variable in sorted(again.items()):
        here = variable.values
        if name not in dataset:
            found.append(Difference(name, members[0], float("nan"), float(here.reshape(-1)[0])))
            continue
        there = _saved(dataset[name], sweep, members)
        there = there[(slice(None), *(slice(0, size) for size in here.shape[1:]))].astype(here.dtype)
        unequal = first_unequal(there, here)
        if unequal is not None:
            place, *both = unequal
            found.append(Difference(name, members[place], *both))
    return found


def _saved(variable: xarray.DataArray, sweep: Sweep, members: Sequence[int]) -> np.ndarray:
    """Saved values of members, (members, ...)."""
    if variable.dims[: len(sweep.dims)] != sweep.dims:  # times that all members share
        return np.broadcast_to(variable.values, (len(members), *variable.shape))
    if variable.nbytes <= _HELD:
        values = variable.values.reshape(sweep.count, *variable.shape[len(sweep.dims) :])
        return np.asarray(values[list(members)])
    places = ([int(i) for i in np.unravel_index(member, sweep.shape)] for member in members)
    return np.stack([variable.isel(dict(zip(sweep.dims, place, strict=True))).values for place in places])


def _environment(then: dict[str, Any]) -> list[str]:
    """Versions and processor features that differ from the sweep's."""
    now = {f"version_{name}": version for name, version in provenance.versions().items()}
    now["cpu_model"] = provenance.cpu_model()
    changed = {name: value for name, value in now.items() if then.get(name) not in (None, value)}
    return [f"{name} {then[name]} -> {value}" for name, value in changed.items()]
