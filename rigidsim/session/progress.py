"""Progress: a bar with rate and ETA on a terminal and in notebooks, plain lines where none can be drawn."""

from __future__ import annotations

import sys
import time
from importlib.util import find_spec
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    TaskID,
    TextColumn,
)
from rich.progress import (
    Progress as Bar,
)

from rigidsim.session.guards import Observer
from rigidsim.session.understood import time_words
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.sampler import Progress

_LINE_EVERY = 5.0  # seconds between plain lines
_TITLE = 24  # letters of a run's name beside the bar
_WIDE = 100  # columns from which simulated time has room
_NOTHING_LEFT = "nothing is left to do: {}; --until prolongs a finished run to a later end"
_PHASES = {
    "lyapunov": "Lyapunov exponents",
    "dataset": "writing dataset.h5",
    "timeline": "drawing timeline.rrd",
    "certify": "certifying",
}


class TerminalObserver(Observer):
    """Draws one line: a bar, steps per second and time left; simulated time too where there is room."""

    def __init__(self, console: Console | None = None) -> None:
        self._bar = Bar(
            TextColumn("[bold]{task.fields[title]}", markup=True),
            BarColumn(bar_width=None),
            TextColumn("{task.fields[said]}"),
            console=console or Console(stderr=True),
            transient=True,
            expand=True,
        )
        self._task: TaskID | None = None
        self._begin = time.perf_counter()

    def __enter__(self) -> TerminalObserver:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def started(self, prepared: InitialValueProblem, folder: Path | None) -> None:
        """See ``Observer``."""
        self._begin = time.perf_counter()
        last = float(prepared.scene.samples.last) - float(prepared.scene.start)
        self._start = float(prepared.scene.start)
        self._last = last
        self._words = time_words(prepared.scene)
        self._draw(_shortened(prepared.scene.name), 1.0)

    def progressed(self, progress: Progress) -> None:
        """See ``Observer``."""
        if self._task is None:
            return
        fraction = min(1.0, (progress.time - self._start) / self._last) if self._last else 1.0
        elapsed = time.perf_counter() - self._begin
        rate = _engineering(progress.steps / max(elapsed, 1e-9))
        said = f"{100 * fraction:5.1f} %  {rate:>6} steps/s  {_left(elapsed, fraction)}"
        if self._bar.console.width >= _WIDE:
            said += f"  t = {self._words.short(progress.time)}"
        self._bar.update(self._task, completed=fraction, said=said)

    def phase(self, name: str) -> None:
        """See ``Observer``."""
        if name in _PHASES:
            self._draw(_PHASES[name])

    def nothing_left(self, why: str) -> None:
        """See ``Observer``."""
        self._bar.console.print(_NOTHING_LEFT.format(why), highlight=False, markup=False)

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
        """One bar in place of the last; it runs to and fro where its end isn't known."""
        if self._task is not None:
            self._bar.remove_task(self._task)
        self._task = self._bar.add_task("", total=total, title=title, said="")


class LineObserver(Observer):
    """One plain line every few seconds."""

    def __init__(self) -> None:
        self._begin = self._latest = time.perf_counter()
        self._name = ""
        self._tried, self._verb = "", "trying"

    def __enter__(self) -> LineObserver:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def started(self, prepared: InitialValueProblem, folder: Path | None) -> None:
        """See ``Observer``."""
        self._begin = self._latest = time.perf_counter()
        self._name = prepared.scene.name
        self._start = float(prepared.scene.start)
        self._last = float(prepared.scene.samples.last) - self._start
        self._words = time_words(prepared.scene)
        self._say("integrating in memory" if folder is None else f"integrating into {folder}")

    def progressed(self, progress: Progress) -> None:
        """See ``Observer``."""
        now = time.perf_counter()
        if now - self._latest < _LINE_EVERY:
            return
        self._latest = now
        elapsed = now - self._begin
        fraction = (progress.time - self._start) / self._last if self._last else 1.0
        rate = _engineering(progress.steps / max(elapsed, 1e-9))
        reached = self._words.short(progress.time)
        print(
            f"{self._name}: {100 * min(fraction, 1):.1f} %, t = {reached}, {rate} steps/s, "
            f"{_left(elapsed, fraction)}",
            file=sys.stderr,
            flush=True,
        )

    def phase(self, name: str) -> None:
        """See ``Observer``."""
        if name in _PHASES:
            self._say(_PHASES[name])
        self._tried, self._verb = "", "comparing with" if name == "certify" else "trying"

    def nothing_left(self, why: str) -> None:
        """See ``Observer``."""
        print(_NOTHING_LEFT.format(why), file=sys.stderr, flush=True)

    def choosing(self, name: str) -> None:
        """See ``Observer``."""
        self._name = name
        self._say("choosing settings by short trials")

    def trying(self, title: str, fraction: float) -> None:
        """See ``Observer``."""
        now = time.perf_counter()
        if title != self._tried:
            self._tried, self._latest = title, now
            self._say(f"{self._verb} {title}")
        elif now - self._latest >= _LINE_EVERY:
            self._latest = now
            self._say(f"{self._verb} {title}: {100 * fraction:.1f} %")

    def _say(self, text: str) -> None:
        print(f"{self._name}: {text}", file=sys.stderr, flush=True)


def observer(*, notebook: bool = False) -> TerminalObserver | LineObserver:
    """The one that suits stderr, or a notebook; use it in a ``with``."""
    if notebook:  # the bar is a widget there
        widgets = find_spec("ipywidgets") is not None
        return TerminalObserver(Console(force_jupyter=True)) if widgets else LineObserver()
    return TerminalObserver() if sys.stderr.isatty() else LineObserver()


def _shortened(name: str) -> str:
    return name if len(name) <= _TITLE else name[: _TITLE - 1] + "…"


def _left(elapsed: float, fraction: float) -> str:
    """Time to go at the mean pace so far; a guess from the first moments would be far off."""
    if fraction >= 1:
        return "0:00:00 left"
    if fraction <= 0 or elapsed < 0.3:
        return "-:--:-- left"
    seconds = elapsed * (1 / fraction - 1)
    if seconds >= 360_000:
        return f"{seconds / 86400:.3g} days left"
    minutes, seconds = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d} left"


def _engineering(value: float) -> str:
    for factor, suffix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= factor:
            return f"{value / factor:.3g} {suffix}"
    return f"{value:.3g}"
