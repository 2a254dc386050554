"""Checks that refuse a sweep before any of its members runs."""

from __future__ import annotations

import itertools
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
    """Refuse a sweep with a member that can't be run; returns the first member, prepared.

    Args:
        every: check each member's numbers even if there are more than ``_ALL``: 10 s per million members.
        each: like ``map``; may have others look at shares of the members meanwhile.

    Raises:
        ConfigError: names members and keys.
    """
    check = SweepCheck(sweep, every=every, each=each)
    check.finish()
    return check.first


class SweepCheck:
    """A check that others may have a part in: it begins at once, and ``finish`` tells what was found.

    Args:
        every, each: see ``check_sweep``.

    Attributes:
        first: the first member that can be run, prepared; the first of all unless others may be marked.

    Raises:
        ConfigError: the first member can't be run, or nothing can that all members share.
    """

    def __init__(self, sweep: Sweep, *, every: bool, each: Each) -> None:
        _refuse_names(sweep)
        _refuse_what_none_has(sweep)
        self._sweep = sweep
        self.first = prepare(sweep.worked_out(first_possible(sweep)))
        refuse_taken_names(self.first)
        every = every and sweep.table.impossible == "refuse"
        self._every = every
        self._shares = _of_families(sweep, each) if every else []

    def finish(self) -> None:
        """Look at members that are worked out in full, and wait for the shares of others.

        Raises:
            ConfigError: names members and keys.
        """
        sweep = self._sweep
        if sweep.table.impossible == "mark":
            return
        problems = self._worked_out(_FEW)
        if not problems:
            shares = list(_as_far_as_told(self._shares))
            known = sum(accepted for _, accepted in shares) == sweep.count
            if not known and sweep.count > _ALL:
                problems = self._worked_out(_OF_AN_AXIS)
            problems = problems or self._found(shares)
            if not (problems or known) and self._every and sweep.count <= _ALL:
                problems = self._worked_out(_FEW, equations=True)
        if len(problems) >= _MOST_TOLD:
            problems.append(Problem("[sweep]", "there may be more members of this kind; these came first"))
        if problems:
            raise ConfigError(markable(problems), sweep.experiment.source)

    def _worked_out(self, most: int, *, equations: bool = False) -> list[Problem]:
        """Problems of members that are worked out in full, see ``_tried``.

        Args:
            equations: also build their equations, which takes some ten times as long.
        """
        problems: list[Problem] = []
        for member in _tried(self._sweep, most):
            try:
                experiment = self._sweep.worked_out(member)
                if equations:
                    prepare(experiment)
                else:
                    check_start(build_scene(experiment))
            except ConfigError as error:
                problems += self._sweep.blamed(member, error).problems
                if len(problems) >= _MOST_TOLD:
                    break
        return problems

    def _found(self, shares: Iterable[Share]) -> list[Problem]:
        """Problems of the first share that has any."""
        sweep = self._sweep
        for refused, _ in shares:
            if refused:
                errors, _ = batches_of(sweep.experiment.text).refused(refused)
                told = [sweep.blamed(member, errors[member]) for member in refused if member in errors]
                return [problem for error in told for problem in error.problems]
        return []


def _as_far_as_told(shares: Iterable[Share]) -> Iterator[Share]:
    """Shares up to the first that is refused, or that tells nothing."""
    for refused, accepted in shares:
        yield refused, accepted
        if refused or not accepted:
            return


def _of_families(sweep: Sweep, each: Each) -> Iterable[Share]:
    """Which members no run accepts, if members share equations so that their numbers alone tell."""
    if why_alone(sweep, ()) not in ("", "wall_time", "asked"):
        return []
    edges = [*range(0, sweep.count, _AT_ONCE), sweep.count]
    return each(refused_of, [(sweep.experiment.text, *ends) for ends in itertools.pairwise(edges)])


def refused_of(share: tuple[str, int, int]) -> Share:
    """Members of a share of a sweep that no run accepts, at most ``_MOST_TOLD``, and how many can be run and
    share their equations with others.

    Args:
        share: the sweep's config, the first member, and the one after the last.
    """
    config, begin, end = share
    refused, accepted = batches_of(config).refused(range(begin, end), _MOST_TOLD)
    return sorted(refused)[:_MOST_TOLD], accepted


def _tried(sweep: Sweep, most: int) -> Iterator[int]:
    """Members that are worked out in full before anything runs.

    Args:
        most: number of values of an axis that are tried of many.
    """
    if sweep.count <= _ALL:
        yield from range(1, sweep.count)
        return
    if not sweep.product:
        step = max(1, sweep.count // most)
        yield from range(step, sweep.count, step)
        yield sweep.count - 1
        return
    strides: list[int] = []
    stride = 1
    for size in reversed(sweep.shape):
        strides.insert(0, stride)
        stride *= size
    for size, stride in zip(sweep.shape, strides, strict=True):
        step = max(1, size // most)
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
