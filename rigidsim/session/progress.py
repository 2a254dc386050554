"""Progress of a run: plain lines, or on a terminal and in notebooks a bar with rate and ETA."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, TaskID, TextColumn
from rich.progress import Progress as Bar

from rigidsim.session.session import Observer
from rigidsim.session.understood import time_words
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.sampler import Progress

_LINE_EVERY = 5.0  # seconds between plain lines
_TITLE = 24  # letters of a run's name beside the bar
_WIDE = 100  # columns from which simulated time has room
_NOTHING_LEFT = "nothing is left to do: {}; --until prolongs a finished run to a later end"
_PHASES = {
    "lyapunov": "Lyapunov exponents",
    "modelling": "full model",
    "dataset": "writing dataset.h5",
    "timeline": "drawing timeline.rrd",
    "certify": "certifying",
}


def _left(elapsed: float, fraction: float) -> str:
    """Time to go at the mean pace so far; a guess from the first moments would be far off."""
    if fraction >= 1:
        return "0:00:00 left"
    if fraction <= 0 or elapsed < 0.3:
        return "-:--:-- left"
    return f"{clock_text(elapsed * (1 / fraction - 1))} left"


def clock_text(seconds: float | None) -> str:
    """A duration as h:mm:ss, a long one in days; dashes for one that isn't known."""
    if seconds is None:
        return "-:--:--"
    if seconds >= 360_000:
        return f"{seconds / 86400:.3g} days"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}"


def _rate(value: float) -> str:
    """A rate to three digits, with a prefix."""
    for factor, suffix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= 0.9995 * factor:  # what rounds to 1000 has the next prefix
            return f"{value / factor:.3g} {suffix}"
    return f"{value:.3g}"


class _Watching(Observer):
    """An observer that knows how far the run is, and the pace of this session."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock = clock
        self._begin = clock()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def started(self, prepared: InitialValueProblem, folder: Path | None) -> None:
        self._begin = self._clock()
        self._name = prepared.scene.name
        self._start = float(prepared.scene.start)
        self._span = float(prepared.scene.samples.last) - self._start
        self._words = time_words(prepared.scene)
        self._before = 0, 0.0

    def resumed(self, progress: Progress) -> None:
        self._before = progress.steps, self._fraction(progress)

    def _fraction(self, progress: Progress) -> float:
        return min(1.0, (progress.time - self._start) / self._span) if self._span else 1.0

    def _pace(self, progress: Progress) -> tuple[str, str]:
        """Steps per second of this session and the time left, in words."""
        steps, before = self._before
        elapsed, fraction = self._clock() - self._begin, self._fraction(progress)
        share = (fraction - before) / (1 - before) if before < 1 else 1.0
        return _rate((progress.steps - steps) / max(elapsed, 1e-9)), _left(elapsed, share)


class LineObserver(_Watching):
    """One plain line every few seconds."""

    def __init__(self) -> None:
        super().__init__()
        self._latest = self._begin
        self._tried, self._verb = "", "trying"

    def started(self, prepared: InitialValueProblem, folder: Path | None) -> None:
        super().started(prepared, folder)
        self._latest = self._begin
        self._say("integrating in memory" if folder is None else f"integrating into {folder}")

    def progressed(self, progress: Progress) -> None:
        if self._due():
            rate, to_go = self._pace(progress)
            reached = f"{100 * self._fraction(progress):.1f} %, t = {self._words.short(progress.time)}"
            self._say(f"{reached}, {rate} steps/s, {to_go}")

    def phase(self, name: str) -> None:
        if name in _PHASES:
            self._say(_PHASES[name])
        self._tried, self._verb = "", "comparing with" if name == "certify" else "trying"

    def nothing_left(self, why: str) -> None:
        print(_NOTHING_LEFT.format(why), file=sys.stderr, flush=True)

    def choosing(self, name: str) -> None:
        self._name = name
        self._say("choosing settings by short trials")

    def trying(self, title: str, fraction: float) -> None:
        if title != self._tried:
            self._tried, self._latest = title, self._clock()
            self._say(f"{self._verb} {title}")
        elif self._due():
            self._say(f"{self._verb} {title}: {100 * fraction:.1f} %")

    def _due(self) -> bool:
        now = self._clock()
        if now - self._latest < _LINE_EVERY:
            return False
        self._latest = now
        return True

    def _say(self, text: str) -> None:
        print(f"{self._name}: {text}", file=sys.stderr, flush=True)


class TerminalObserver(_Watching):
    """Draws one line: a bar, steps per second and time left, and simulated time if there is room."""

    def __init__(
        self, console: Console | None = None, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        super().__init__(clock)
        self._bar = Bar(
            TextColumn("[bold]{task.fields[title]}", markup=True),
            BarColumn(bar_width=None),
            TextColumn("{task.fields[said]}"),
            console=console or Console(stderr=True),
            transient=True,
            expand=True,
        )
        self._task: TaskID | None = None

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def started(self, prepared: InitialValueProblem, folder: Path | None) -> None:
        super().started(prepared, folder)
        self._draw(_shortened(self._name), 1.0)

    def progressed(self, progress: Progress) -> None:
        if self._task is None:
            return
        fraction = self._fraction(progress)
        rate, to_go = self._pace(progress)
        said = f"{100 * fraction:5.1f} %  {rate:>6} steps/s  {to_go}"
        if self._bar.console.width >= _WIDE:
            said += f"  t = {self._words.short(progress.time)}"
        self._bar.update(self._task, completed=fraction, said=said)

    def phase(self, name: str) -> None:
        if name in _PHASES:
            self._draw(_PHASES[name])

    def nothing_left(self, why: str) -> None:
        self._bar.console.print(_NOTHING_LEFT.format(why), highlight=False, markup=False)

    def choosing(self, name: str) -> None:
        self._draw(f"{_shortened(name)}: choosing")

    def trying(self, title: str, fraction: float) -> None:
        if self._task is not None:
            said = f"{100 * fraction:5.1f} %  {title}"
            self._bar.update(self._task, total=1.0, completed=fraction, said=said)

    def _draw(self, title: str, total: float | None = None) -> None:
        """Draw one bar in place of the last; it moves to and fro if its end isn't known."""
        if self._task is not None:
            self._bar.remove_task(self._task)
        self._task = self._bar.add_task("", total=total, title=title, said="")


def _shortened(name: str) -> str:
    return name if len(name) <= _TITLE else name[: _TITLE - 1] + "…"


def observer(*, notebook: bool = False) -> TerminalObserver | LineObserver:
    """The observer that suits stderr, or a notebook; use it in a ``with``."""
    if notebook:  # the bar is a widget there
        widgets = find_spec("ipywidgets") is not None
        return TerminalObserver(Console(force_jupyter=True)) if widgets else LineObserver()
    return TerminalObserver() if sys.stderr.isatty() else LineObserver()


@contextmanager
def watched(given: Observer | None, progress: bool | None) -> Iterator[Observer]:
    """The caller's own observer, or a new one if progress is to be shown; None: in notebooks only."""
    shell = sys.modules.get("IPython")
    notebook = shell is not None and hasattr(shell.get_ipython(), "kernel")
    if given is not None or not (notebook if progress is None else progress):
        yield given or Observer()
        return
    with observer(notebook=notebook) as bar:
        yield bar
