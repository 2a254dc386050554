"""Output for sweeps: progress over members, and how they ended."""

from __future__ import annotations

import shlex
import sys
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

from rigidsim.cli.screens.page import Page
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.store.sweeps.run import SavedSweep, SweepCost
from rigidsim.workflows.sweeps.plan import SweepPlan
from rigidsim.workflows.sweeps.sweep import SweepObserver

_LINE_EVERY = 5.0  # seconds between plain lines


class SweepProgress(SweepObserver):
    """One bar, or a plain line every few seconds if none can be drawn."""

    def __init__(self) -> None:
        self._bar: Progress | None = None
        if sys.stderr.isatty():
            self._bar = Progress(
                TextColumn("[bold]{task.description}"),
                BarColumn(bar_width=None),
                TextColumn("{task.fields[said]}"),
                console=Console(stderr=True),
                transient=True,
                expand=True,
            )
        self._task: Any = None
        self._name = ""
        self._members = self._before = 0
        self._begin = self._latest = time.perf_counter()

    def __enter__(self) -> SweepProgress:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def checking(self, sweep: Sweep) -> None:
        """See ``SweepObserver``."""
        self._name = sweep.experiment.config.name
        self._say(f"{sweep.count:,} members: trying out what they are made of")

    def started(self, folder: Path, members: int, done: int) -> None:
        """See ``SweepObserver``."""
        self._members, self._before = members, done
        self._begin = self._latest = time.perf_counter()
        there = f", {done:,} are there already" if done else ""
        self._say(f"running {members:,} members into {folder}{there}")
        if self._bar is not None:
            self._task = self._bar.add_task(self._name, total=members, completed=done, said="")

    def progressed(self, done: int) -> None:
        """See ``SweepObserver``."""
        now = time.perf_counter()
        rate = (done - self._before) / max(now - self._begin, 1e-9)
        said = f"{done:,} of {self._members:,} members, {rate:.3g} a second, "
        said += f"{duration((self._members - done) / rate if rate else None)} left"
        if self._bar is not None:
            self._bar.update(self._task, completed=done, said=said)
        elif now - self._latest >= _LINE_EVERY:
            self._latest = now
            self._say(said)

    def completing(self) -> None:
        """See ``SweepObserver``."""
        self._say("writing dataset.h5")

    def nothing_left(self) -> None:
        """See ``SweepObserver``."""
        self._say("nothing is left to do: all members were run before", always=True)

    def _say(self, text: str, *, always: bool = False) -> None:
        if self._bar is None:
            print(f"{self._name}: {text}", file=sys.stderr, flush=True)
        elif always:
            self._bar.console.print(f"{self._name}: {text}", highlight=False, markup=False)


def observer() -> SweepProgress:
    """The observer that suits stderr; use it in a ``with``."""
    return SweepProgress()


def duration(seconds: float | None) -> str:
    """A duration as h:mm:ss."""
    if seconds is None:
        return "-:--:--"
    if seconds >= 360_000:
        return f"{seconds / 86400:.3g} days"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}"


_INTEGRATED = "momentum's direction (attitude in full models), of its integration alone"
_ERRORS = {
    "modelling": "axes of averaged models from the full model's",
    "modelling_norm": "size of the angular momentum in averaged models, relative",
    "modelling_energy": "energy of rotation in averaged models, relative",
}


def _of_errors(cost: SweepCost) -> str:
    seconds = cost.estimate_cpu_seconds
    return f", {seconds:.3g} s of them for errors" if seconds else ""


def print_sweep(result: SavedSweep) -> None:
    """Print how a sweep's members ended."""
    told, screen = result.outcome, Page().console
    screen.print(f"[bold]{told.name}[/] ({result.place}): {told.message}", highlight=False)
    if not result.finished:
        rate = told.members_per_second
        if rate:
            left = duration(told.seconds_left)
            screen.print(
                f"tiles    {told.tiles_done:,} of {told.tiles:,}; {rate:.3g} members a second, {left} left",
                highlight=False,
            )
        elif told.tiles is not None:
            screen.print(f"tiles    {told.tiles_done:,} of {told.tiles:,}", highlight=False)
        if result.status == "interrupted":
            screen.print(escape(f"next     rigidsim resume {shlex.quote(result.place)}"), highlight=False)
        return
    shape = " x ".join(f"{name} {size:,}" for name, size in told.shape.items())
    screen.print(f"axes     {shape}", highlight=False)
    table = Table("ended", "members", box=None, pad_edge=False)
    for status, number in told.outcomes.items():
        table.add_row(status, f"{number:,}")
    screen.print(table)
    cost = told.cost
    assert cost is not None
    engines = ", ".join(f"{number:,} {engine}" for engine, number in told.engines.items())
    screen.print(
        f"cost     {cost.steps:,} steps, {cost.cpu_seconds:.3g} s of CPU in {cost.tiles:,} tiles "
        f"({engines})" + _of_errors(cost),
        highlight=False,
    )
    errors = told.estimated_errors
    for name, error in errors.items():
        words = _INTEGRATED if name == "attitude" and "modelling" in errors else _ERRORS.get(name, name)
        units = "" if error.units == "1" else f" {error.units}"
        screen.print(
            f"error    {words}: {error.median:.2g}{units} in the median, at most "
            f"{error.largest:.2g}, estimated of {error.members:,} members",
            highlight=False,
        )
    for name, drift in told.largest_drifts.items():
        screen.print(f"drift    {name.removesuffix('_drift')}: at most {drift:.2g}", highlight=False)
    for text in told.warnings:
        screen.print(f"[yellow]warning[/]  {escape(text)}", highlight=False)
    place = shlex.quote(result.place)
    screen.print(escape(f"next     rigidsim plot {place}"), highlight=False)
    screen.print(escape(f"         rigidsim view {place} --member 0"), highlight=False)
    screen.print(escape(f"         rigidsim export {place} --format csv"), highlight=False)


def print_sweep_plan(made: SweepPlan) -> None:
    """Print what a sweep would run, and what it would cost."""
    screen = Page().console
    screen.print(f"[bold]{made.name}[/]: {made.members:,} members ({made.mode})", highlight=False)
    table = Table("axis", "key", "values", "from", "to", box=None, pad_edge=False)
    for axis in made.axes:
        unit = axis.unit if axis.unit not in (None, "1") else ""
        table.add_row(
            axis.name, axis.key, f"{axis.count:,}", _brief(axis.first),
            f"{_brief(axis.last)} {unit}",
        )  # fmt: skip
    screen.print(table)
    predicted = made.predicted
    screen.print(
        f"keep     {', '.join(made.keep)}\n"
        f"tiles    {made.tiles:,} of {made.tile:,} members\n"
        f"time     {duration(predicted.total_seconds)} on one core, "
        f"{predicted.seconds_per_member:.2g} s a member\n"
        f"disk     about {predicted.dataset_bytes / 1e6:.3g} MB, and as much for the tiles\n\n"
        "one member:",
        highlight=False,
    )


def _brief(text: str) -> str:
    return text if len(text) <= 24 else text[:21] + "..."
