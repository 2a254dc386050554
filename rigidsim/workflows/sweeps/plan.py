"""What is known of a sweep before any of its members runs: whether all can be run, the cost, and tiles."""

import itertools
import math
from collections.abc import Iterator
from pathlib import Path

from rigidsim.errors import ConfigError, Problem, Remedy
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.scene import build_scene, check_start
from rigidsim.scene.sweep import Sweep
from rigidsim.session.dataset import dataset_variables, refuse_taken_names
from rigidsim.solve.lanes import recommended_width
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.store.summary import SummaryPart
from rigidsim.store.sweeps.tiles import OF_FITS, RESERVED, SUFFIXES
from rigidsim.workflows.fit.observations import FitKeys
from rigidsim.workflows.plan import RunPlan, plan
from rigidsim.workflows.sweeps.members import (
    BatchTiles,
    batches_of,
    first_possible,
    markable,
    recording,
    why_alone,
)

_ALL = 200
"""Up to this many members are all worked out, with their equations where numbers alone don't decide. Of more,
all are looked at by their numbers alone if these decide, and some are worked out: the corners and values of
each axis, ``_OF_AN_AXIS`` of them, or ``_FEWER`` where the numbers of each member were accepted.
"""
_OF_AN_AXIS = 400
_FEWER = 25
_MOST_CORNERS = 64
_MOST_SHOWN = 10
_AT_ONCE = 4096
QUICK = 1_000_000
"""Up to this many members are all checked for a plan; a sweep checks all."""

_SECONDS_OF_A_TILE, _LEAST_SECONDS = 5.0, 2.0
_SHARE_OF_A_TILE = 32
"""A tile takes at most this part of a sweep (or ``_LEAST_SECONDS``): at the end of a sweep workers wait for
whoever has the last one. A tile itself, with its file, costs about 10 ms.
"""
_LARGEST_TILE = 8192
_FEW = 64
_TILES_OF_FEW = 16
_TILES_OF_FITS = 1000  # at most twice as many: each fit takes a second or more
_RUNS_OF_A_FIT = 15  # so long a fit takes, in runs (docs/fits.md)
_LARGEST_TILE_BYTES = 64e6
_BUILD_SECONDS = 0.2  # seconds to compile equations for each member that runs by itself
_BATCH_SECONDS = 2e-5  # seconds of overhead per member of a batch besides its integration
_GAINED = 8.0  # what lanes gain along a table, of which each row takes as long for one as for all
_ESTIMATED = 2.5  # cost ratio of a batch member with estimated errors to one without


def check_sweep(sweep: Sweep, *, most: float = math.inf) -> InitialValueProblem:
    """Refuse a sweep with a member that can't be run, by ``ConfigError`` with members and keys; returns the
    first that can, prepared. To check the numbers of more than ``_ALL`` takes a second per million members of
    a product, most of a minute where each has different values. Of more than ``most`` members some are
    checked.
    """
    _refuse_names(sweep)
    first = prepare(sweep.worked_out(first_possible(sweep)))
    refuse_taken_names(first)
    problems = _problems(sweep, most) if sweep.table.impossible != "mark" else []
    if len(problems) >= _MOST_SHOWN:
        problems.append(Problem("[sweep]", "there may be more members of this kind; these came first"))
    if problems:
        raise ConfigError(markable(problems), sweep.experiment.source)
    return first


def _problems(sweep: Sweep, most: float) -> list[Problem]:
    # members that share equations are judged by their numbers alone, up to a block of which none does
    shared = sweep.count <= most and why_alone(sweep, ()) in ("", "wall_time", "asked")
    if not (shared and _batches(sweep).lanes_of_a_table) and (problems := _worked_out(sweep, _FEWER)):
        return problems
    accepted = 0
    for first in range(0, sweep.count if shared else 0, _AT_ONCE):
        block = range(first, min(first + _AT_ONCE, sweep.count))
        refused, some = _batches(sweep).refused(block, _MOST_SHOWN)
        if refused:
            blamed = [sweep.with_member_named(one, refused[one]) for one in sorted(refused)[:_MOST_SHOWN]]
            return [problem for error in blamed for problem in error.problems]
        accepted += some
        if not some:
            break
    if accepted == sweep.count:
        return []
    return _worked_out(sweep, _OF_AN_AXIS, equations=sweep.count <= _ALL and not sweep.fits)


def _worked_out(sweep: Sweep, most: int, *, equations: bool = False) -> list[Problem]:
    """Problems of members worked out in full (``_tried``), with equations in ten times the time."""
    problems: list[Problem] = []
    for member in _tried(sweep, most):
        try:
            experiment = sweep.worked_out(member)
            if sweep.fits:
                FitKeys(experiment)
            elif equations:
                prepare(experiment)
            else:
                check_start(build_scene(experiment))
        except ConfigError as error:
            problems += sweep.with_member_named(member, error).problems
            if len(problems) >= _MOST_SHOWN:
                break
    return problems


def _tried(sweep: Sweep, most: int) -> Iterator[int]:
    """Members that are worked out in full before anything runs; ``most``: of the values of a long axis."""
    if sweep.count <= _ALL:
        yield from range(1, sweep.count)
        return
    if not sweep.product:
        step = max(1, sweep.count // most)
        yield from range(step, sweep.count, step)
        yield sweep.count - 1
        return
    strides = [math.prod(sweep.shape[place + 1 :]) for place in range(len(sweep.shape))]
    for size, stride in zip(sweep.shape, strides, strict=True):
        step = max(1, size // most)
        yield from (index * stride for index in range(step, size, step))
    ends = [(0, (size - 1) * stride) for size, stride in zip(sweep.shape, strides, strict=True)]
    yield from (sum(corner) for corner in itertools.islice(itertools.product(*ends), 1, _MOST_CORNERS))


def _refuse_names(sweep: Sweep) -> None:
    """Refuse names that the dataset needs itself, and what is to be kept of events where there are none."""
    states = [table.name for _, _, table in sweep.base.config.every_state]
    taken = RESERVED | {*OBSERVABLES, *states} | (OF_FITS if sweep.fits else set())
    problems = []
    for number, name in enumerate(states, start=1):
        if name in RESERVED or name.endswith(SUFFIXES):
            what = f'given "{name}", a name that the dataset of a sweep needs itself; rename it'
            problems.append(Problem(f"[[states]] number {number} name", what))
    for axis in sweep.axes:
        if axis.name in taken or axis.name.endswith(SUFFIXES) or axis.name.endswith("_drift"):
            what = f'is named "{axis.name}", a name that the dataset needs itself; give it another name'
            problems.append(Problem(f'[sweep] axes."{axis.key}"', what))
    for name in {"events", "section"} & {*sweep.table.keep} if not sweep.base.config.events else ():
        what = f'given "{name}", but the config has no [[events]]; add one, or leave it out'
        problems.append(Problem("[sweep] keep", what))
    if problems:
        raise ConfigError(problems, sweep.experiment.source)


def refuse_unknown_tiles(sweep: Sweep) -> None:
    """Refuse shares of tiles whose number depends on how fast a machine is."""
    if sweep.table.tile is None and sweep.count > _FEW and not sweep.fits:
        length = max(_FEW, sweep.count // 1000)
        what = (
            f"missing, and {Remedy('--tiles needs', 'tiles=(...) needs')} it: otherwise the number of tiles "
            "depends on how fast a machine is, and shares could miss some; give the number of members of a "
            f"tile, such as tile = {length}"
        )
        raise ConfigError(Problem("[sweep] tile", what), sweep.experiment.source)


def tile_length(sweep: Sweep, made: RunPlan | None = None) -> int:
    """Number of members computed and saved at once: some seconds of work; ``made``: the plan of one."""
    if sweep.table.tile is not None:
        return sweep.table.tile
    if sweep.fits:
        return max(1, sweep.count // _TILES_OF_FITS)
    if not why_alone(sweep, sweep.table.keep) and (lanes := _batches(sweep).lanes_of_a_table):
        return min(lanes, sweep.count)
    if sweep.count <= _FEW:
        return max(1, -(-sweep.count // _TILES_OF_FEW))
    first = first_possible(sweep)
    seconds = _member_seconds(sweep, made or plan(sweep.experiment_of(first), pilot_seconds=0.05))
    size = bytes_of_member(sweep, prepare(sweep.worked_out(first)))
    longest = min(max(seconds * sweep.count / _SHARE_OF_A_TILE, _LEAST_SECONDS), _SECONDS_OF_A_TILE)
    most, length = min(longest / seconds, _LARGEST_TILE_BYTES / size), 8
    while length < _LARGEST_TILE and 2 * length <= most and 32 * length < sweep.count:
        length *= 2
    return length


def _batches(sweep: Sweep) -> BatchTiles:
    return batches_of(sweep.experiment.text, sweep.experiment.source)


def _member_seconds(sweep: Sweep, made: RunPlan) -> float:
    predicted = made.predicted
    seconds = predicted.integration_seconds + predicted.recording_seconds
    if (fit := sweep.base.config.fit) is not None:
        return fit.starts * _RUNS_OF_A_FIT * seconds + max(predicted.building_seconds, _BUILD_SECONDS)
    alone = why_alone(sweep, sweep.table.keep)
    if alone or _batches(sweep).alone is not None:
        beside = predicted.choosing_seconds + predicted.modelling_seconds
        return seconds + max(predicted.building_seconds, _BUILD_SECONDS) + beside
    if _batches(sweep).lanes_of_a_table:
        return seconds / _GAINED
    each = _ESTIMATED if sweep.base.config.output.estimate else 1.0
    # half of what lanes could gain
    return each * seconds / max(1.0, recommended_width() / 2) + _BATCH_SECONDS


def bytes_of_member(sweep: Sweep, prepared: InitialValueProblem) -> float:
    """Bytes of a member in the dataset before compression."""
    if (fit := sweep.base.config.fit) is not None:
        return 8.0 * (3 * len(fit.parameters) + 4) ** 2  # vectors among them, and what is said of each
    keep = sweep.table.keep
    variables = [v for v in dataset_variables(prepared) if v.name != "time"]
    recorded = [v for v in variables if "drift_of" not in v.attributes]
    numbers = 6.0 + 2 * (len(variables) - len(recorded))
    for variable in recorded:
        components = math.prod(variable.shape)
        numbers += components * (
            ("final" in keep) * variable.parts + 4 * ("extremes" in keep) + ("means" in keep)
        )
    if "series" in keep:
        row = sum(v.parts * math.prod(v.shape) for v in variables)
        numbers += prepared.clock.count * row
    points = len(prepared.system.crossings) * sweep.table.most_events
    numbers += points * ("events" in keep)
    numbers += points * ("section" in keep) * sum(math.prod(v.shape) for v in recorded)
    return 8 * numbers


class PlannedAxis(SummaryPart):
    """An axis of a sweep: its key, the number of its values, and the first and the last as they are written;
    ``unit`` is None for texts.
    """

    name: str
    key: str
    unit: str | None
    count: int
    first: str
    last: str


class PredictedSweep(SummaryPart):
    """The forecast cost of all members, on one core."""

    seconds_per_member: float
    total_seconds: float
    memory_bytes: float
    dataset_bytes: float


class SweepPlan(SummaryPart):
    """What a sweep would run, in tiles of so many members, the plan of the first that can be run, and what
    all would cost; ``as_dict`` gives what ``--json`` prints.
    """

    kind: str = "sweep"
    name: str
    members: int
    mode: str
    axes: list[PlannedAxis]
    keep: list[str]
    tile: int
    tiles: int
    member: RunPlan
    predicted: PredictedSweep

    def __repr__(self) -> str:
        seconds = self.predicted.total_seconds
        return f"<Plan of the sweep {self.name!r}: {self.members:,} members, about {seconds:.3g} s>"


def plan_sweep(sweep: Sweep, *, out: str | Path = "runs") -> SweepPlan:
    """Explain and predict a sweep; integrates for about half a second and writes nothing. ``out``: as for
    ``plan``.
    """
    sweep = recording(sweep)
    first = check_sweep(sweep, most=QUICK)
    made = plan(sweep.experiment_of(first_possible(sweep)), out=out)
    seconds, size = _member_seconds(sweep, made), bytes_of_member(sweep, first)
    length = tile_length(sweep, made)
    axes = [
        PlannedAxis(
            name=axis.name,
            key=axis.key,
            unit=axis.unit if axis.numeric else None,
            count=axis.count,
            first=axis.text(0),
            last=axis.text(axis.count - 1),
        )
        for axis in sweep.axes
    ]
    return SweepPlan(
        kind="sweep",
        name=sweep.experiment.config.name,
        members=sweep.count,
        mode=sweep.table.mode,
        axes=axes,
        keep=list(sweep.table.keep),
        tile=length,
        tiles=-(-sweep.count // length),
        member=made,
        predicted=PredictedSweep(
            seconds_per_member=seconds,
            total_seconds=seconds * sweep.count,
            memory_bytes=made.predicted.memory_bytes,
            dataset_bytes=size * sweep.count,
        ),
    )
