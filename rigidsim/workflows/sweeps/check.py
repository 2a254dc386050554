"""Checks that refuse a sweep before any of its members runs."""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.initial_values import check_start
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.scene import build_scene
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.session.dataset import refuse_taken_names
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.store.sweeps.dataset import RESERVED, SUFFIXES
from rigidsim.workflows.sweeps.batch import why_alone
from rigidsim.workflows.sweeps.members import batches_of, first_possible, markable

_ALL = 200
"""Up to this many members are all worked out, with their equations where numbers alone don't decide. Of more,
all are looked at by their numbers alone if these decide, and some are worked out: the corners and values of
each axis, ``_OF_AN_AXIS`` of them, or ``_FEW`` where the numbers of each member were accepted.
"""
_OF_AN_AXIS = 400
_FEW = 25
_MOST_CORNERS = 64
_MOST_TOLD = 10
_AT_ONCE = 4096
QUICK = 1_000_000
"""Up to this many members are all checked for a plan; a sweep checks all."""
Share = tuple[list[int], int]
Each = Callable[[Callable[[tuple[str, int, int]], Share], list[tuple[str, int, int]]], Iterable[Share]]


def check_sweep(sweep: Sweep, *, every: bool = True, each: Each = map) -> InitialValueProblem:
    """Refuse a sweep with a member that can't be run; returns the first that can, prepared.

    Args:
        every: check each member's numbers even if there are more than ``_ALL``: a second per million
            members of a product, most of a minute where each has values of its own.
        each: like ``map``; may have others look at shares of the members meanwhile.

    Raises:
        ConfigError: names members and keys.
    """
    _refuse_names(sweep)
    _refuse_what_none_has(sweep)
    first = prepare(sweep.worked_out(first_possible(sweep)))
    refuse_taken_names(first)
    if sweep.table.impossible == "mark":
        return first
    given = _shares(sweep, each) if every else []  # others begin with them at once
    problems = _worked_out(sweep, _FEW)
    if not problems:
        refused, accepted = _refused_or_accepted(given)
        if accepted < sweep.count and sweep.count > _ALL:
            problems = _worked_out(sweep, _OF_AN_AXIS)
        if refused and not problems:
            errors, _ = batches_of(sweep.experiment.text).refused(refused)
            told = [sweep.blamed(member, errors[member]) for member in refused if member in errors]
            problems = [problem for error in told for problem in error.problems]
        if not problems and accepted < sweep.count <= _ALL and every:
            problems = _worked_out(sweep, _FEW, equations=True)
    if len(problems) >= _MOST_TOLD:
        problems.append(Problem("[sweep]", "there may be more members of this kind; these came first"))
    if problems:
        raise ConfigError(markable(problems), sweep.experiment.source)
    return first


def _worked_out(sweep: Sweep, most: int, *, equations: bool = False) -> list[Problem]:
    """Problems of members worked out in full (``_tried``), with equations in ten times the time."""
    problems: list[Problem] = []
    for member in _tried(sweep, most):
        try:
            experiment = sweep.worked_out(member)
            if equations:
                prepare(experiment)
            else:
                check_start(build_scene(experiment))
        except ConfigError as error:
            problems += sweep.blamed(member, error).problems
            if len(problems) >= _MOST_TOLD:
                break
    return problems


def _shares(sweep: Sweep, each: Each) -> Iterable[Share]:
    """Which members no run accepts, if members share equations so that their numbers alone tell."""
    if why_alone(sweep, ()) not in ("", "wall_time", "asked"):
        return []
    edges = [*range(0, sweep.count, _AT_ONCE), sweep.count]
    return each(refused_of, [(sweep.experiment.text, *ends) for ends in itertools.pairwise(edges)])


def _refused_or_accepted(shares: Iterable[Share]) -> Share:
    """The first members that are refused, and how many are accepted, up to a share that tells of none."""
    known = 0
    for refused, accepted in shares:
        known += accepted
        if refused or not accepted:
            return refused, known
    return [], known


def refused_of(share: tuple[str, int, int]) -> Share:
    """Of a share (config, first, stop): members that no run accepts, and how many can be run together."""
    config, begin, end = share
    refused, accepted = batches_of(config).refused(range(begin, end), _MOST_TOLD)
    return sorted(refused)[:_MOST_TOLD], accepted


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
    states = [table.name for table in sweep.base.config.states]
    taken = RESERVED | {*OBSERVABLES, *states}
    problems = []
    for number, name in enumerate(states, start=1):
        if name in RESERVED or name.endswith(SUFFIXES):
            what = f'given "{name}", a name that the dataset of a sweep needs itself; rename it'
            problems.append(Problem(f"[[states]] number {number} name", what))
    for axis in sweep.axes:
        if axis.name in taken or axis.name.endswith(SUFFIXES) or axis.name.endswith("_drift"):
            what = f'is named "{axis.name}", a name that the dataset needs itself; give it another name'
            problems.append(Problem(f'[sweep] axes."{axis.key}"', what))
    if problems:
        raise ConfigError(problems, sweep.experiment.source)


def _refuse_what_none_has(sweep: Sweep) -> None:
    """Refuse items to be kept that need something the config doesn't have."""
    keep = sweep.table.keep
    for name in ("events", "section"):
        if name in keep and not sweep.base.config.events:
            what = f'given "{name}", but the config has no [[events]]; add one, or leave it out'
            raise ConfigError(Problem("[sweep] keep", what), sweep.experiment.source)
