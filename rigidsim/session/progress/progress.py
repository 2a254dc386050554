"""Progress: plain lines, or a bar with rate and ETA (``progress_bar``) on a terminal and in notebooks."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from rigidsim.session.guards import Observer
from rigidsim.session.progress.words import NOTHING_LEFT, PHASES, Pace
from rigidsim.session.understood import time_words
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.sampler import Progress

if TYPE_CHECKING:
    from rigidsim.session.progress.bar import TerminalObserver

_LINE_EVERY = 5.0  # seconds between plain lines


class LineObserver(Observer):
    """One plain line every few seconds.

    Args:
        clock: returns the time, s.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock = clock
        self._begin = self._latest = clock()
        self._name = ""
        self._tried, self._verb = "", "trying"

    def __enter__(self) -> LineObserver:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def started(self, prepared: InitialValueProblem, folder: Path | None) -> None:
        """See ``Observer``."""
        self._begin = self._latest = self._clock()
        self._name = prepared.scene.name
        self._start = float(prepared.scene.start)
        self._last = float(prepared.scene.samples.last) - self._start
        self._words = time_words(prepared.scene)
        self._pace = Pace()
        self._say("integrating in memory" if folder is None else f"integrating into {folder}")

    def resumed(self, progress: Progress) -> None:
        """See ``Observer``."""
        self._pace = Pace(progress.steps, self._fraction(progress))

    def _fraction(self, progress: Progress) -> float:
        return (progress.time - self._start) / self._last if self._last else 1.0

    def progressed(self, progress: Progress) -> None:
        """See ``Observer``."""
        now = self._clock()
        if now - self._latest < _LINE_EVERY:
            return
        self._latest = now
        elapsed = now - self._begin
        fraction = self._fraction(progress)
        rate, to_go = self._pace.words(elapsed, progress.steps, fraction)
        reached = self._words.short(progress.time)
        print(
            f"{self._name}: {100 * min(fraction, 1):.1f} %, t = {reached}, {rate} steps/s, {to_go}",
            file=sys.stderr,
            flush=True,
        )

    def phase(self, name: str) -> None:
        """See ``Observer``."""
        if name in PHASES:
            self._say(PHASES[name])
        self._tried, self._verb = "", "comparing with" if name == "certify" else "trying"

    def nothing_left(self, why: str) -> None:
        """See ``Observer``."""
        print(NOTHING_LEFT.format(why), file=sys.stderr, flush=True)

    def choosing(self, name: str) -> None:
        """See ``Observer``."""
        self._name = name
        self._say("choosing settings by short trials")

    def trying(self, title: str, fraction: float) -> None:
        """See ``Observer``."""
        now = self._clock()
        if title != self._tried:
            self._tried, self._latest = title, now
            self._say(f"{self._verb} {title}")
        elif now - self._latest >= _LINE_EVERY:
            self._latest = now
            self._say(f"{self._verb} {title}: {100 * fraction:.1f} %")

    def _say(self, text: str) -> None:
        print(f"{self._name}: {text}", file=sys.stderr, flush=True)


def observer(*, notebook: bool = False) -> TerminalObserver | LineObserver:
    """The observer that suits stderr, or a notebook; use it in a ``with``."""
    if notebook:  # the bar is a widget there
        widgets = find_spec("ipywidgets") is not None
        if not widgets:
            return LineObserver()
    elif not sys.stderr.isatty():
        return LineObserver()
    from rich.console import Console

    from rigidsim.session.progress.bar import TerminalObserver

    return TerminalObserver(Console(force_jupyter=True) if notebook else None)


@contextmanager
def watched(given: Observer | None, progress: bool | None) -> Iterator[Observer]:
    """The observer of a run.

    Args:
        progress: whether to show a bar if no observer is given; None: only in notebooks.
    """
    if given is not None or not (in_notebook() if progress is None else progress):
        yield given or Observer()
        return
    with observer(notebook=in_notebook()) as bar:
        yield bar


def in_notebook() -> bool:
    """Whether a Jupyter kernel runs this."""
    shell = sys.modules.get("IPython")
    return shell is not None and hasattr(shell.get_ipython(), "kernel")
