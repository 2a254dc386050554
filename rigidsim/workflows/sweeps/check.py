"""Checks that refuse a sweep before any of its members runs."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.initial_values import check_start
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.scene import build_scene
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.session.event_variables import refuse_taken_names
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.store.sweeps.dataset import RESERVED, SUFFIXES
from rigidsim.workflows.sweeps.batch import why_alone
from rigidsim.workflows.sweeps.members import batches_of

_ALL = 200
"""Up to this many members are all worked out. Of more, each value of each axis is tried once, plus the
corners, and all members by their numbers alone if these decide.
"""
_OF_AN_AXIS = 400
_MOST_CORNERS = 64
_MOST_TOLD = 10
_AT_ONCE = 16_384
QUICK = 1_000_000
"""Up to this many members are all checked for a plan; a sweep checks all."""


def check_sweep(sweep: Sweep, *, every: bool = True) -> InitialValueProblem:
    """Refuse a sweep with a member that can't be run; returns the first member, prepared.

    Args:
        every: check each member's numbers even if there are more than ``_ALL``: 20 s per million members.

    Raises:
        ConfigError: names members and keys.
    """
    _refuse_names(sweep)
    _refuse_what_none_has(sweep)
    try:
        first = prepare(sweep.worked_out(0))
        refuse_taken_names(first)
    except ConfigError as error:
        raise sweep.blamed(0, error) from None
    problems: list[Problem] = []
    for member in _tried(sweep):
        try:
            experiment = sweep.worked_out(member)
            check_start(build_scene(experiment))
        except ConfigError as error:
            problems += sweep.blamed(member, error).problems
            if len(problems) >= _MOST_TOLD:
                break
    if not problems and every and sweep.count > _ALL:
        problems = _of_families(sweep)
    if problems:
        raise ConfigError(problems, sweep.experiment.source)
    return first


def _of_families(sweep: Sweep) -> list[Problem]:
    """Problems of any member, if members share equations so that their numbers alone tell."""
    if why_alone(sweep, ()) not in ("", "wall_time", "asked"):
        return []
    batches = batches_of(sweep.experiment.text)
    for begin in range(0, sweep.count, _AT_ONCE):
        refused, shared = batches.refused(range(begin, min(begin + _AT_ONCE, sweep.count)), _MOST_TOLD)
        if refused:
            errors = [sweep.blamed(member, refused[member]) for member in sorted(refused)]
            return [problem for error in errors for problem in error.problems]
        if not shared:
            break
    return []


def _tried(sweep: Sweep) -> Iterator[int]:
    """Members that are worked out in full before anything runs."""
    if sweep.count <= _ALL:
        yield from range(1, sweep.count)
        return
    if not sweep.product:
        step = max(1, sweep.count // _OF_AN_AXIS)
        yield from range(step, sweep.count, step)
        yield sweep.count - 1
        return
    strides: list[int] = []
    stride = 1
    for size in reversed(sweep.shape):
        strides.insert(0, stride)
        stride *= size
    for size, stride in zip(sweep.shape, strides, strict=True):
        step = max(1, size // _OF_AN_AXIS)
        yield from (index * stride for index in range(step, size, step))
    ends = [(0, (size - 1) * stride) for size, stride in zip(sweep.shape, strides, strict=True)]
    yield from (sum(corner) for corner in itertools.islice(itertools.product(*ends), 1, _MOST_CORNERS))


def _refuse_names(sweep: Sweep) -> None:
    taken = RESERVED | set(OBSERVABLES)
    problems = []
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
