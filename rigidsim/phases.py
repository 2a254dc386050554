"""Wall and CPU seconds of a run's phases: choose, build, integrate and record, dataset, timeline, certify."""

from __future__ import annotations

import time
from collections.abc import Iterable

NOT_KEPT = "attempts_not_kept"
ENGINE = "engine"
"""Beside the phases: what the engine alone took of integrating and recording, wall seconds."""


class Phases:
    """Seconds by phase, in the order in which the phases ended.

    Attributes:
        wall, cpu: seconds of each; the CPU's are those of all threads of this process.
    """

    def __init__(self) -> None:
        self.wall: dict[str, float] = {}
        self.cpu: dict[str, float] = {}
        self._since = time.perf_counter(), time.process_time()

    def next(self, finished: str) -> None:
        """Close the phase that was under way since the last one; a name given again adds up."""
        now = time.perf_counter(), time.process_time()
        for seconds, begin, end in zip((self.wall, self.cpu), self._since, now, strict=True):
            seconds[finished] = seconds.get(finished, 0.0) + end - begin
        self._since = now

    def begin_again(self, *, keep: Iterable[str] = ("choose",)) -> Phases:
        """For another attempt: what this one took is one phase of it, but for those to keep."""
        again = Phases()
        for old, new in ((self.wall, again.wall), (self.cpu, again.cpu)):
            kept = {name: old[name] for name in keep if name in old}
            new |= kept
            new[NOT_KEPT] = sum(v for name, v in old.items() if name not in kept and name != ENGINE)
        again._since = self._since
        return again
