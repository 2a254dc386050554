"""Progress on a terminal and in notebooks: a bar with rate and ETA."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, TaskID, TextColumn
from rich.progress import Progress as Bar

from rigidsim.session.guards import Observer
from rigidsim.session.progress.words import NOTHING_LEFT, PHASES, Pace
from rigidsim.session.understood import time_words
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.sampler import Progress

_TITLE = 24  # letters of a run's name beside the bar
_WIDE = 100  # columns from which simulated time has room


class TerminalObserver(Observer):
    """Draws one line: a bar, steps per second and time left, and simulated time if there is room.

    Args:
        console: console to draw on; stderr by default.
        clock: returns the time, s.
    """

    def __init__(
        self, console: Console | None = None, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self._clock = clock
        self._bar = Bar(
            TextColumn("[bold]{task.fields[title]}", markup=True),
            BarColumn(bar_width=None),
            TextColumn("{task.fields[said]}"),
            console=console or Console(stderr=True),
            transient=True,
            expand=True,
        )
        self._task: TaskID | None = None
        self._begin = self._clock()

    def __enter__(self) -> TerminalObserver:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def started(self, prepared: InitialValueProblem, folder: Path | None) -> None:
        """See ``Observer``."""
        self._begin = self._clock()
        last = float(prepared.scene.samples.last) - float(prepared.scene.start)
        self._start = float(prepared.scene.start)
        self._last = last
        self._words = time_words(prepared.scene)
        self._pace = Pace()
        self._draw(_shortened(prepared.scene.name), 1.0)

    def resumed(self, progress: Progress) -> None:
        """See ``Observer``."""
        self._pace = Pace(progress.steps, self._fraction(progress))

    def _fraction(self, progress: Progress) -> float:
        return min(1.0, (progress.time - self._start) / self._last) if self._last else 1.0

    def progressed(self, progress: Progress) -> None:
        """See ``Observer``."""
        if self._task is None:
            return
        fraction = self._fraction(progress)
        rate, to_go = self._pace.words(self._clock() - self._begin, progress.steps, fraction)
        said = f"{100 * fraction:5.1f} %  {rate:>6} steps/s  {to_go}"
        if self._bar.console.width >= _WIDE:
            said += f"  t = {self._words.short(progress.time)}"
        self._bar.update(self._task, completed=fraction, said=said)

    def phase(self, name: str) -> None:
        """See ``Observer``."""
        if name in PHASES:
            self._draw(PHASES[name])

    def nothing_left(self, why: str) -> None:
        """See ``Observer``."""
        self._bar.console.print(NOTHING_LEFT.format(why), highlight=False, markup=False)

    def choosing(self, name: str) -> None:
        """See ``Observer``."""
        self._draw(f"{_shortened(name)}: choosing")

    def trying(self, title: str, fraction: float) -> None:
        """See ``Observer``."""
        if self._task is not None:
            self._bar.update(
                self._task, total=1.0, completed=fraction, said=f"{100 * fraction:5.1f} %  {title}"
            )

    def _draw(self, title: str, total: float | None = None) -> None:
        """Draw one bar in place of the last; it moves to and fro if its end isn't known."""
        if self._task is not None:
            self._bar.remove_task(self._task)
        self._task = self._bar.add_task("", total=total, title=title, said="")


def _shortened(name: str) -> str:
    return name if len(name) <= _TITLE else name[: _TITLE - 1] + "…"
