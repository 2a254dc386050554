"""The least model within an error: of those of which nothing more can be left out, the cheapest.

The cost of a model is its steps times the operations of its equations, both counted. Before a model is run,
they are expected to be those of the full model and the sum of the changes that its effects make one by one.
What a model errs by is about the sum, as vectors and at every sample, of what its effects do one by one, or
what was measured of a similar model and the difference. Where there are few models, all are run but those
whose sum, of small angles, is far beyond the error; where there are many, those that might be cheaper or
smaller than the least one known, unless their sum is beyond it by more than sums were seen to be wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from rigidsim.workflows.physics.models import ModelRun

_MOST_SETS = 300_000
FEW_SETS = 64
"""Models, up to which all are run: those of six effects."""
_SMALL = 0.5  # rad, up to which rotations add as vectors
_SUM_ERROR, _LEAST_SUM_ERROR = 0.1, 0.03
"""What sums are wrong by relative to that of their terms' sizes, at least: where there are few models, and
where there are many.
"""
_COST_ERROR = 0.02  # relative, of expected costs, at least
_SAFETY = 3.0  # times what sums, and costs, were wrong by
_PLACES = 64  # samples at which sums are looked at first
_AT_ONCE = 4096  # sets


@dataclass
class Candidates:
    """Sets of effects to leave out.

    Attributes:
        parts_of: wider effects of each, by code.
        full, alone: runs of the full model, and without one of them.
        error: rad.
    """

    parts_of: Mapping[str, Sequence[str]]
    full: ModelRun
    alone: Mapping[str, ModelRun]
    error: float

    @cached_property
    def codes(self) -> list[str]:
        """The effects, from the least worth on; of very many those worth most are always kept."""
        ordered = sorted(self.alone, key=lambda code: self.alone[code].largest)
        while len(_sets(ordered, self.parts_of)) > _MOST_SETS:
            ordered.pop()
        return ordered

    @cached_property
    def members(self) -> np.ndarray:
        """The sets (n, effects), from the model on that is expected to be cheapest; where two cost the same,
        the one that leaves out more first.
        """
        found = np.array(_sets(self.codes, self.parts_of), dtype=bool).reshape(-1, len(self.codes))
        return found[np.lexsort((-self._gone(found).sum(axis=1), self._costs(found)))]

    @cached_property
    def gone(self) -> np.ndarray:
        """The sets with the parts of what they leave out."""
        return self._gone(self.members)

    @cached_property
    def costs(self) -> np.ndarray:
        """What each model is expected to cost."""
        return self._costs(self.members)

    @property
    def few(self) -> bool:
        """Whether all can be run."""
        return len(self.members) <= FEW_SETS

    def _gone(self, members: np.ndarray) -> np.ndarray:
        parts = [[wide in self.parts_of[code] for code in self.codes] for wide in self.codes]
        return members | ((members.astype(int) @ np.array(parts, dtype=int)) > 0)

    def _costs(self, members: np.ndarray) -> np.ndarray:
        alone = [self.alone[code] for code in self.codes]
        steps = self.full.steps + members @ np.array([x.steps - self.full.steps for x in alone])
        size = self.full.operations + members @ np.array([x.operations - self.full.operations for x in alone])
        return np.maximum(steps, 1) * np.maximum(size, 1)

    def named(self, n: int) -> list[str]:
        """The codes of a set."""
        return [code for code, member in zip(self.codes, self.members[n], strict=True) if member]

    def sum_over(self, codes: Sequence[str]) -> np.ndarray:
        """Sum of what some effects do, rotation vectors (samples, 3)."""
        return sum((self.alone[code].rotations for code in codes), np.zeros_like(self.full.rotations))

    def size_of(self, codes: Sequence[str]) -> float:
        """Sum of the largest angles of some effects, rad."""
        return sum(self.alone[code].largest for code in codes)

    def sizes(self) -> np.ndarray:
        """Those of all sets."""
        return self.members @ np.array([self.alone[code].largest for code in self.codes])

    def least_sums(self) -> np.ndarray:
        """A lower bound of the largest angle of each set's sum, rad: at some of the samples."""
        last = len(self.full.rotations) - 1
        places = {*np.linspace(0, last, _PLACES).astype(int)}
        places |= {int(np.linalg.norm(x.rotations, axis=1).argmax()) for x in self.alone.values()}
        seen = np.array([self.alone[code].rotations[sorted(places)].ravel() for code in self.codes])
        found = np.zeros(len(self.members))
        for n in range(0, len(found), _AT_ONCE):
            sums = (self.members[n : n + _AT_ONCE].astype(float) @ seen).reshape(-1, len(places), 3)
            found[n : n + _AT_ONCE] = np.linalg.norm(sums, axis=2).max(axis=1)
        return found


def _sets(codes: Sequence[str], parts_of: Mapping[str, Sequence[str]]) -> list[list[bool]]:
    """All sets in which no effect is a part of another one."""
    found: list[list[bool]] = [[]]
    for n, code in enumerate(codes):
        wider = {m for m in range(n) if codes[m] in parts_of[code] or code in parts_of[codes[m]]}
        found = [
            [*members, more]
            for members in found
            for more in (False, True)
            if not (more and any(members[m] for m in wider))
        ]
        if len(found) > _MOST_SETS:
            break
    return found


@dataclass(frozen=True)
class SearchResult:
    """What a search found.

    Attributes:
        least: codes that the least model leaves out.
        tried: models that were run, in order, with the angle that their sum told.
        models: number of all models.
        ruled_out: of those that could be the least one, the number that wasn't run, being beyond the error.
    """

    least: list[str]
    tried: list[tuple[list[str], float]]
    models: int
    ruled_out: int


def search(candidates: Candidates, run: Callable[[list[str]], ModelRun | None]) -> SearchResult:
    """The least model within the error; ``run`` gives None for one that can't be run."""
    seeking = _Seeking(candidates, run)
    least = seeking.least()
    order = [(candidates.named(n), angle) for n, angle in seeking.tried.items()]
    return SearchResult(candidates.named(least), order, len(candidates.members), seeking.ruled_out)


@dataclass
class _Seeking:
    """What was run so far.

    Attributes:
        tried: places of the sets that were run, with the angles that were expected.
        measured: their runs.
        wrong: what sums were wrong by, relative to the sum of the sizes of their terms.
        cost_wrong: what expected costs were wrong by.
        ruled_out: number of sets that might be the least model, but are beyond the error.
    """

    candidates: Candidates
    run: Callable[[list[str]], ModelRun | None]
    tried: dict[int, float] = field(default_factory=dict)
    measured: dict[int, ModelRun] = field(default_factory=dict)
    wrong: float = _LEAST_SUM_ERROR
    cost_wrong: float = _COST_ERROR
    ruled_out: int = 0

    def __post_init__(self) -> None:
        if self.candidates.few:
            self.wrong = _SUM_ERROR
        self.sizes, self.least_sums = self.candidates.sizes(), self.candidates.least_sums()

    def least(self) -> int:
        """First the cheapest whose sum is within the error, and which is; then whatever may be better, again
        where sums turn out to be worse than thought.
        """
        error = self.candidates.error
        for n in map(int, np.nonzero(self.least_sums <= error)[0]):
            if _largest(self.candidates.sum_over(self.candidates.named(n))) <= error and self._attempt(n):
                break
        while True:
            believed, best, self.ruled_out = self.wrong, self._best(), 0
            for n in map(int, np.nonzero(self._worth_a_look(best))[0]):
                if n in self.tried:
                    continue
                if self._beyond(n):
                    self.ruled_out += 1
                elif self._attempt(n) and not self.candidates.few:
                    break
            if self._best() == best and self.wrong <= believed:
                return best

    def _best(self) -> int:
        """Of the models within the error: of those that aren't smaller by any effect than others of them."""
        within = [n for n, done in self.measured.items() if done.largest <= self.candidates.error]
        gone = self.candidates.gone
        most = [n for n in within if not any(_more(gone[m], gone[n]) for m in within)]
        return min(most, key=lambda n: (self.measured[n].cost, -gone[n].sum(), self.measured[n].largest))

    def _worth_a_look(self, best: int) -> np.ndarray:
        """Whether each set may be better than the best one known: it leaves out more, or may be cheaper."""
        if self.candidates.few:
            return np.ones(len(self.candidates.members), dtype=bool)
        gone = self.candidates.gone
        more = (gone >= gone[best]).all(axis=1)
        doubt = 1 + min(_SAFETY * self.cost_wrong, 1.0)
        return more | (self.candidates.costs <= self.measured[best].cost * doubt)

    def _beyond(self, n: int) -> bool:
        """Whether a set is beyond the error without doubt: by its sum, or by one that was run and what the
        two differ by.
        """
        known, error, codes = self.candidates, self.candidates.error, self.candidates.named(n)
        if known.few and any(known.alone[code].largest > _SMALL for code in codes):
            return False
        doubt = _SAFETY * self.wrong
        if self.least_sums[n] - doubt * self.sizes[n] > error:
            return True
        if _largest(known.sum_over(codes)) - doubt * self.sizes[n] > error:
            return True
        for m, done in self.measured.items():
            other = known.named(m)
            more, less = [x for x in codes if x not in other], [x for x in other if x not in codes]
            apart = doubt * known.size_of([*more, *less])
            if apart >= error:
                continue
            if _largest(done.rotations + known.sum_over(more) - known.sum_over(less)) - apart > error:
                return True
        return False

    def _attempt(self, n: int) -> bool:
        """Run a set; whether it is within the error."""
        codes = self.candidates.named(n)
        expected = self.candidates.sum_over(codes)
        self.tried[n] = _largest(expected)
        done = self.run(codes)
        if done is None:
            return False
        self.measured[n] = done
        if len(codes) > 1 and (size := self.candidates.size_of(codes)) > 0:
            self.wrong = max(self.wrong, _largest(done.rotations - expected) / size)
            self.cost_wrong = max(self.cost_wrong, abs(self.candidates.costs[n] / max(done.cost, 1) - 1))
        return done.largest <= self.candidates.error


def _more(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether one set leaves out all that the other does, and more."""
    return bool((one >= other).all() and (one != other).any())


def _largest(rotations: np.ndarray) -> float:
    return float(np.linalg.norm(rotations, axis=1).max())
