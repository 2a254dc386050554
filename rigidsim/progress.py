"""Progress on stderr: a bar with rate and ETA on a terminal, plain lines when piped."""

from __future__ import annotations

import sys
import time
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import (
    Progress as Bar,
)

from rigidsim.prepare import Prepared
from rigidsim.run import Observer
from rigidsim.solve.advance import Progress

_LINE_EVERY = 5.0  # seconds between plain lines
_PHASES = {"dataset": "writing dataset.h5", "timeline": "drawing timeline.rrd"}


class TerminalObserver(Observer):
    """Draws a bar that shows simulated time, steps per second and time left."""

    def __init__(self) -> None:
        self._bar = Bar(
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=None),
            TextColumn("{task.percentage:5.1f} %"),
            TextColumn("{task.fields[rate]}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        self._task: TaskID | None = None
        self._begin = time.perf_counter()

    def __enter__(self) -> TerminalObserver:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def started(self, prepared: Prepared, folder: Path) -> None:
        """See ``Observer``."""
        self._begin = time.perf_counter()
        last = float(prepared.scene.samples.last) - float(prepared.scene.start)
        self._start = float(prepared.scene.start)
        self._last = last
        self._task = self._bar.add_task(prepared.scene.name, total=1.0, rate="")

    def progressed(self, progress: Progress) -> None:
        """See ``Observer``."""
        if self._task is None:
            return
        fraction = min(1.0, (progress.time - self._start) / self._last) if self._last else 1.0
        rate = progress.steps / max(time.perf_counter() - self._begin, 1e-9)
        self._bar.update(
            self._task, completed=fraction, rate=f"{_engineering(rate)} steps/s  t = {progress.time:.6g} s"
        )

    def phase(self, name: str) -> None:
        """See ``Observer``."""
        if name in _PHASES and self._task is not None:
            self._bar.update(self._task, description=_PHASES[name], rate="")


class LineObserver(Observer):
    """One plain line every few seconds."""

    def __init__(self) -> None:
        self._begin = self._latest = time.perf_counter()
        self._name = ""

    def __enter__(self) -> LineObserver:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def started(self, prepared: Prepared, folder: Path) -> None:
        """See ``Observer``."""
        self._begin = self._latest = time.perf_counter()
        self._name = prepared.scene.name
        self._start = float(prepared.scene.start)
        self._last = float(prepared.scene.samples.last) - self._start
        print(f"{self._name}: integrating into {folder}", file=sys.stderr, flush=True)

    def progressed(self, progress: Progress) -> None:
        """See ``Observer``."""
        now = time.perf_counter()
        if now - self._latest < _LINE_EVERY:
            return
        self._latest = now
        elapsed = now - self._begin
        fraction = (progress.time - self._start) / self._last if self._last else 1.0
        left = f", {elapsed * (1 / fraction - 1):.0f} s left" if 0 < fraction < 1 else ""
        rate = _engineering(progress.steps / max(elapsed, 1e-9))
        print(
            f"{self._name}: {100 * min(fraction, 1):.1f} %, t = {progress.time:.6g} s, {rate} steps/s{left}",
            file=sys.stderr,
            flush=True,
        )

    def phase(self, name: str) -> None:
        """See ``Observer``."""
        if name in _PHASES:
            print(f"{self._name}: {_PHASES[name]}", file=sys.stderr, flush=True)


def observer() -> TerminalObserver | LineObserver:
    """The one that suits stderr; use it in a ``with``."""
    return TerminalObserver() if sys.stderr.isatty() else LineObserver()


def _engineering(value: float) -> str:
    for factor, suffix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= factor:
            return f"{value / factor:.3g} {suffix}"
    return f"{value:.3g} "
