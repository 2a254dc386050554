"""Computing members of a sweep tile by tile: in batches if possible, otherwise one by one."""

import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.errors import ConfigError, MemberError, Problem, RigidsimError
from rigidsim.model.tangents import GROWTH
from rigidsim.scene.config import Experiment
from rigidsim.scene.scene import build_scene
from rigidsim.scene.sweep_table import INDICATORS
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.session.dataset import kernel_attributes
from rigidsim.session.members import MemberResults, naming_member, run_alone
from rigidsim.solve.problem import prepare
from rigidsim.store import provenance
from rigidsim.store.run import MemoryRun
from rigidsim.store.sweeps.tiles import Kept, KeptVariable, Tile, plain
from rigidsim.workflows.analyse import analyse
from rigidsim.workflows.read import parse, reads_kernels, refuse_others
from rigidsim.workflows.run import run
from rigidsim.workflows.sweeps.batch import BatchTiles, Part, why_alone

_MOST_TRIED = 1000  # members among which there has to be one that can be run
_LINES = 5  # of each signal's spectrum


@lru_cache(maxsize=4)
def sweep_of(config: str, source: str = "the sweep's config") -> Sweep:
    """The sweep of a config's text, worked out once per process; ``source``: where its kernels are found."""
    return recording(Sweep.of(parse(config, source=source)))


@lru_cache(maxsize=4)
def kernel_of_members(config: str, source: str) -> dict[str, Any]:
    """What tells the kernels of a config's members; empty without one."""
    sweep = sweep_of(config, source)
    if not reads_kernels(sweep.base):
        return {}
    return kernel_attributes(build_scene(sweep.worked_out(first_possible(sweep))))


def refuse_other_kernel(sweep: Sweep, begun: Mapping[str, Any], place: Path) -> None:
    """Refuse to go on with members that were begun with another kernel than the one that is found now.

    Raises:
        RunFolderError: its bytes differ.
    """
    refuse_others(begun, kernel_of_members(sweep.experiment.text, sweep.experiment.source), place)


def first_possible(sweep: Sweep) -> int:
    """The first member that can be run: the first of all, unless ``impossible = "mark"``."""
    marking = sweep.table.impossible == "mark"
    refused: ConfigError | None = None
    for member in range(min(sweep.count, _MOST_TRIED) if marking else 1):
        try:
            prepare(sweep.worked_out(member))
        except ConfigError as error:
            refused = refused or sweep.blamed(member, error)
        else:
            return member
    assert refused is not None
    raise refused if marking else MemberError(markable(refused.problems), refused.source)


def markable(problems: Sequence[Problem]) -> list[Problem]:
    """Problems of members, the last with how the others can be run all the same."""
    *others, last = problems
    hint = '[sweep] impossible = "mark" marks such members, with the reason, and runs the others'
    return [*others, Problem(last.where, f"{last.what}; {hint}")]


def recording(sweep: Sweep) -> Sweep:
    """The sweep with its members recording everything that is to be kept."""
    output = sweep.base.config.output
    if not set(sweep.table.keep) & set(INDICATORS) or GROWTH in (output.record or ()):
        return sweep
    recorded = output.record
    if not recorded:
        recorded = [v.name for v in prepare(sweep.worked_out(first_possible(sweep))).system.recorded]
    names = ", ".join(f'"{name}"' for name in [*recorded, GROWTH])
    return replace(sweep, base=sweep.base.having([f"output.record=[{names}]"]), added=GROWTH)


def tile_image(
    config: str, source: str, members: np.ndarray, keys: np.ndarray, items: tuple[str, ...],
    alone: bool | None, data: str,
) -> bytes:  # fmt: skip
    """Run members of a sweep's config and keep items (``items_of``): the sealed file of their tile; ``data``:
    the folder of what members are fitted to.
    """
    began, cpu = time.perf_counter(), time.process_time()
    results = run_members(
        sweep_of(config, source), members.tolist(), [plain(item) for item in items], alone, Path(data)
    )
    made = {
        "engines": dict(results.engines),
        "why_alone": results.why_alone,
        "estimate_cpu_seconds": results.estimating,
        "wall_seconds": time.perf_counter() - began,
        "cpu_seconds": time.process_time() - cpu,
        "finished_at": provenance.now(),
        "cpu_model": provenance.cpu_model(),
        **{f"version_{name}": version for name, version in provenance.versions().items()},
        **kernel_of_members(config, source),
    }
    return Tile(keys, items, results.kept, results.reasons, made).image()


def run_members(
    sweep: Sweep,
    members: Sequence[int],
    keep: Sequence[str],
    alone: bool | None = None,
    data: Path | None = None,
) -> MemberResults:
    """Run some members of a sweep and keep the items asked for; ``alone``: see ``Begun``; ``data``: the
    folder of what they are fitted to, if they are.
    """
    if sweep.fits:
        from rigidsim.workflows.sweeps.fits import fit_members  # which few sweeps need

        assert data is not None
        return fit_members(sweep, members, data)
    events = [event.name for event in sweep.base.config.events]
    more = frequencies_of if "frequencies" in keep else None
    parts: list[Part] = []
    left, why = list(range(len(members))), why_alone(sweep, keep)
    if not why:
        parts, left, why = batches_of(sweep.experiment.text, sweep.experiment.source).run(
            members, keep, alone
        )
    for place in left:
        member = partial(lambda member: run(sweep.experiment_of(member), out=None), members[place])
        with naming_member(members[place]):
            found = run_alone(member, keep, sweep.table.most_events, events, more, sweep.added)
        parts.append((np.array([place]), found))
    return MemberResults.together(parts, why)


@lru_cache(maxsize=4)
def batches_of(config: str, source: str) -> BatchTiles:
    """The families of a config's sweep, traced once per process."""
    sweep = sweep_of(config, source)
    return BatchTiles(sweep)


def get_ready(config: str, source: str) -> None:
    """Trace and compile in this process what most members of a config's sweep need; nothing is integrated."""
    sweep = sweep_of(config, source)
    if not why_alone(sweep, sweep.table.keep):
        batches_of(config, source).compile()


def single_member(experiment: Experiment, member: int) -> Experiment:
    """A member of a config's ``[sweep]`` as a run of its own, named after the sweep and its number."""
    sweep = Sweep.of(experiment)
    if not 0 <= member < sweep.count:
        what = f"given {member}; its members are 0 to {sweep.count - 1}, the last axis runs fastest"
        raise ConfigError(Problem("--member", what), experiment.source)
    name = f"{experiment.config.name}_{member}"
    return sweep.experiment_of(member).having([f'name="{name}"'])


def frequencies_of(result: MemoryRun) -> Kept:
    """The strongest lines of each signal, and its secular rate; empty if it can't be analysed."""
    try:
        found = analyse(result, lines=_LINES)
    except RigidsimError:
        return {}
    kept: Kept = {}
    for signal in found.signals:
        name = re.sub(r"\W+", "_", signal.name).strip("_")
        for what, units in (("frequency", "rad/s"), ("amplitude", signal.units)):
            table = np.full((1, _LINES), np.nan)
            values = [float(getattr(line, what)) for line in signal.lines[:_LINES]]
            table[0, : len(values)] = values
            labels: dict[str, Any] = {"units": units, "long_name": f"{what} of the lines of {signal.name}"}
            kept[f"{name}_{what}"] = KeptVariable(("line",), table, labels, "frequencies")
        rate = np.array([np.nan if signal.rate is None else float(signal.rate)])
        labels = {"units": f"{signal.units}/s", "long_name": f"secular rate of {signal.name}"}
        kept[f"{name}_rate"] = KeptVariable((), rate, labels, "frequencies")
    return kept
