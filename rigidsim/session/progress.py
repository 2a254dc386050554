"""Progress of runs and sweeps: a bar on a terminal and in notebooks, otherwise plain lines."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, TaskID, TextColumn
from rich.progress import Progress as Bar

from rigidsim.session.session import Observer
from rigidsim.session.understood import time_words
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.sampler import Progress

_LINE_EVERY = 5.0  # seconds between plain lines
_TITLE = 24  # letters of a name next to the bar
_PHASES = {
    "lyapunov": "Lyapunov exponents",
    "modelling": "full model",
    "dataset": "writing dataset.h5",
    "timeline": "drawing timeline.rrd",
    "certify": "certifying",
}


class Meter:
    """A named bar that shows a fraction and a text; or lines with the text alone."""

    def __init__(self, bar: Bar | None) -> None:
        self.name = ""
        self._bar, self._task = bar, TaskID(0)
        self._latest = 0.0

    def phase(self, text: str) -> None:
        """Begin something whose end isn't known yet."""
        self._latest = time.perf_counter()
        if self._bar is None:
            print(f"{self.name}: {text}", file=sys.stderr, flush=True)
            return
        if self._bar.tasks:
            self._bar.remove_task(self._task)
        title = self.name if len(self.name) <= _TITLE else self.name[: _TITLE - 1] + "…"
        self._task = self._bar.add_task("", total=None, title=title, said=text)

    def update(self, fraction: float, text: str) -> None:
        """Show how far it is."""
        if self._bar is not None and self._bar.tasks:
            self._bar.update(self._task, total=1.0, completed=fraction, said=text)
        elif self._bar is None and time.perf_counter() - self._latest >= _LINE_EVERY:
            self.phase(text)

    def note(self, text: str) -> None:
        """Print what is to stay."""
        print(text, file=sys.stderr, flush=True)


@contextmanager
def meter(*, notebook: bool = False) -> Iterator[Meter]:
    """The meter that suits stderr, or a notebook, where the bar is a widget."""
    if not (find_spec("ipywidgets") is not None if notebook else sys.stderr.isatty()):
        yield Meter(None)
        return
    console = Console(force_jupyter=True) if notebook else Console(stderr=True)
    title = TextColumn("[bold]{task.fields[title]}", markup=True)
    columns = (title, BarColumn(bar_width=None), TextColumn("{task.fields[said]}"))
    with Bar(*columns, console=console, transient=True, expand=True) as bar:
        yield Meter(bar)


def clock_text(seconds: float | None) -> str:
    """A duration as h:mm:ss, a long one in days; dashes for one that isn't known."""
    if seconds is None:
        return "-:--:--"
    if seconds >= 360_000:
        return f"{seconds / 86400:.3g} days"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}"


def left_text(elapsed: float, share: float) -> str:
    """Time to go at the mean pace so far; a guess from the first moments would be far off."""
    known = share >= 1 or (share > 0 and elapsed >= 0.3)
    return f"{clock_text(elapsed * (1 / share - 1) if known else None)} left"


class RunProgress(Observer):
    """Shows a run on a meter: how far it is, and the pace of this session."""

    def __init__(self, meter: Meter) -> None:
        self._meter, self._tried, self._verb = meter, "", "trying"

    def started(self, prepared: InitialValueProblem, folder: Path | None) -> None:
        self._begin, self._before = time.perf_counter(), (0, 0.0)
        self._start = float(prepared.scene.start)
        self._span = float(prepared.scene.samples.last) - self._start
        self._words = time_words(prepared.scene)
        self._meter.name = prepared.scene.name
        self._meter.phase("integrating in memory" if folder is None else f"integrating into {folder}")

    def resumed(self, progress: Progress) -> None:
        self._before = progress.steps, self._fraction(progress)

    def _fraction(self, progress: Progress) -> float:
        return min(1.0, (progress.time - self._start) / self._span) if self._span else 1.0

    def progressed(self, progress: Progress) -> None:
        steps, before = self._before
        elapsed, fraction = time.perf_counter() - self._begin, self._fraction(progress)
        share = (fraction - before) / (1 - before) if before < 1 else 1.0
        rate = (progress.steps - steps) / max(elapsed, 1e-9)
        reached = f"{100 * fraction:.1f} %, t = {self._words.short(progress.time)}"
        self._meter.update(fraction, f"{reached}, {rate:,.0f} steps/s, {left_text(elapsed, share)}")

    def phase(self, name: str) -> None:
        if name in _PHASES:
            self._meter.phase(_PHASES[name])
        self._tried, self._verb = "", "comparing with" if name == "certify" else "trying"

    def nothing_left(self, why: str) -> None:
        self._meter.note(f"nothing is left to do: {why}; --until prolongs a finished run to a later end")

    def choosing(self, name: str) -> None:
        self._meter.name = name
        self._meter.phase("choosing settings by short trials")

    def trying(self, title: str, fraction: float) -> None:
        if title != self._tried:
            self._tried = title
            self._meter.phase(f"{self._verb} {title}")
        self._meter.update(fraction, f"{self._verb} {title}: {100 * fraction:.1f} %")


@contextmanager
def watched(given: Observer | None, progress: bool | None) -> Iterator[Observer]:
    """The caller's own observer, or a new one if progress is to be shown; None: in notebooks only."""
    shell = sys.modules.get("IPython")
    notebook = shell is not None and hasattr(shell.get_ipython(), "kernel")
    if given is not None or not (notebook if progress is None else progress):
        yield given or Observer()
        return
    with meter(notebook=notebook) as shown:
        yield RunProgress(shown)
