"""Everything drawn of one run, ready to be sent to a recording: clock, picture, plots, states and pages."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Self

import numpy as np
import rerun as rr
import xarray
from numpy.typing import NDArray

from rigidsim.look import signals
from rigidsim.look.curves import CURVES, Plot, drift_plot, other_plots
from rigidsim.look.pages import config_page, leading, notes_page, summary_page
from rigidsim.look.paths import PATHS, Path, sections
from rigidsim.look.solids import Array
from rigidsim.look.stages.parts import Part, Picture, Rows, Stage, screen_seconds
from rigidsim.look.stages.registry import build_picture
from rigidsim.look.states import States, charts_of, states_of
from rigidsim.look.thinning import thin_with_extremes, thinned_indices
from rigidsim.look.timeline import entities
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.readable import DAY, YEAR, TimeWords, epoch_of

_LARGEST = 2.0**62  # int64 with room for differences and for the viewer's own sentinels
_LARGEST_NANOSECONDS = 9.2e18  # 291.5 years, just below 2**63 ns
_UNITS = {0: "s", -3: "ms", -6: "µs", -9: "ns", -12: "ps", -15: "fs", -18: "as"}
_WHOLE = (("yr", YEAR), ("d", DAY))
_EXACT = 4 * np.finfo(np.float64).eps
_UNIX_EPOCH = Fraction(4881175, 2)  # Julian date of 1970-01-01
_DATED_NANOSECONDS = 8.5e18  # from 1970, 270 years: what the viewer's calendar surely holds
_RESOLUTION = 1e-3  # of the smallest step: what a tick of the timeline may be at most
_DTYPES = {"duration": "timedelta64[ns]", "timestamp": "datetime64[ns]", "sequence": "int64"}
MOST_LEADING = 3  # plots beside the scene
CHUNK = 4096  # rows per chunk: larger ones make the viewer slow, smaller ones heavy


@dataclass(frozen=True)
class Clock:
    """Times of the rows as integers (rows,) of a viewer timeline: nanoseconds of a "duration", or of a
    "timestamp" (from 1970; time 0 is ``since``), or ticks of a "sequence", whose name has the unit.
    """

    name: str
    ticks: NDArray[np.int64]
    seconds_per_tick: float
    kind: str
    since: int = 0

    @property
    def in_nanoseconds(self) -> bool:
        """Whether the viewer knows how long a tick is."""
        return self.kind != "sequence"


def dated(clock: Clock, epoch: Epoch | None) -> Clock:
    """The clock with dates in the epoch's scale (TT for UTC) in place of durations, if they are those of a
    calendar that the viewer has (1700 to 2240); the same clock otherwise.
    """
    if epoch is None or clock.kind != "duration":
        return clock
    epoch = epoch.uniform()  # leap seconds of UTC have no place on an axis
    days = epoch.julian_date() - _UNIX_EPOCH
    since = round(days * 86_400_000_000_000)
    first, last = since + int(clock.ticks.min()), since + int(clock.ticks.max())
    if not all(abs(x) < _DATED_NANOSECONDS for x in (first, last)):
        return clock
    return Clock(f"date ({epoch.scale})", clock.ticks + since, clock.seconds_per_tick, "timestamp", since)


def build_clock(seconds: NDArray[np.float64]) -> Clock:
    """The clock for sample times `seconds` (rows,); ``ValueError`` for one that isn't finite.

    Nanoseconds are taken when the run stays within 291 years and either every time is a whole number of
    nanoseconds or the smallest step has at least 1000 of them. Otherwise, where every time is a whole number
    of years or days, the tick is that: the viewer's axes are read then. Else it is the power of 1000 seconds
    that resolves the smallest step to 1e-3, or as close to that as 62 bits allow.
    """
    times = np.asarray(seconds, dtype=np.float64)
    if not np.isfinite(times).all():
        raise ValueError("time: every sample time must be finite")
    largest = float(np.abs(times).max(initial=0.0))
    steps = np.abs(np.diff(times))
    steps = steps[steps > 0]
    smallest = float(steps.min()) if len(steps) else max(largest, 1.0)

    if largest < _LARGEST_NANOSECONDS * 1e-9 and smallest >= 1e-9 * (1 - 1e-6):
        # Whole seconds apart, so that t*1e9 isn't rounded to float64 once more beyond 104 days.
        floor = np.floor(times)
        part = np.rint((times - floor) * 1e9)
        ticks = floor.astype(np.int64) * 1_000_000_000 + part.astype(np.int64)
        exact = bool((np.abs(ticks * 1e-9 - times) <= _EXACT * np.abs(times)).all())
        if smallest * _RESOLUTION >= 1e-9 or exact:
            return Clock("time", ticks, 1e-9, "duration")

    for symbol, unit in _WHOLE:
        whole = np.rint(times / unit)
        exact = bool((np.abs(times - whole * unit) <= _EXACT * np.abs(times)).all())
        if exact and unit <= smallest and largest / unit < 2.0**53:
            return Clock(f"time [{symbol}]", whole.astype(np.int64), unit, "sequence")
    exponent = 3 * math.floor(math.log10(smallest * _RESOLUTION * (1 + 1e-9)) / 3)
    while largest / 10.0**exponent > _LARGEST:
        exponent += 3
    # Powers of ten to 22 are exact in float64, their reciprocals aren't: multiply or divide.
    scaled = times * 10.0**-exponent if exponent < 0 else times / 10.0**exponent
    name = f"time [{_UNITS.get(exponent, f'1e{exponent} s')}]"
    return Clock(name, np.rint(scaled).astype(np.int64), 10.0**exponent, "sequence")


@dataclass(frozen=True)
class DrawnRun:
    """Everything drawn of one dataset: of its `rows` in memory, numbered by `steps`, with pages of markdown
    by name, and the seconds on the screen in which it is played.
    """

    rows: xarray.Dataset
    steps: NDArray[np.int64]
    picture: Picture
    plots: list[Plot]
    paths: list[Path]
    states: list[States]
    clock: Clock
    seconds: Array
    pages: dict[str, str]
    words: TimeWords
    screen_seconds: float

    @classmethod
    def of(cls, dataset: xarray.Dataset, most: int) -> Self:
        """The drawing of at most so many rows of a dataset, possibly lazy, on the clock that suits them."""
        rows, curves = (x.assign_attrs(dataset.attrs) for x in thin_with_extremes(dataset, most))
        seconds = signals.seconds(rows)
        start, end = float(seconds[0]), float(seconds[-1])
        clock = dated(build_clock(seconds), epoch_of(rows.attrs))
        picture, _ = build_picture(rows)
        plots, paths = _about(rows, curves, picture)
        notes = list(picture.notes)
        if not clock.in_nanoseconds:
            notes.append(f"the run doesn't fit nanoseconds: its timeline is `{clock.name}`")
            plots.append(Plot("time_seconds", "Time", seconds[:, None], unit="s", place="more"))
        pages = {
            "Summary": summary_page(dataset, rows),
            "Picture": notes_page(picture.kind, notes),
            "Config": config_page(dataset),
        }
        return cls(
            rows=rows,
            steps=thinned_indices(dataset.sizes["time"], most),
            picture=picture,
            plots=plots,
            paths=[*paths, *sections(dataset)],
            states=[*states_of(dataset, start, end), *charts_of(rows)],
            clock=clock,
            seconds=seconds,
            pages={name: text for name, text in pages.items() if text},
            words=TimeWords.of(dataset.attrs, start, end),
            screen_seconds=screen_seconds(rows),
        )

    def entities(self, legend: Sequence[Stage] | None = None) -> list[tuple[str, Part]]:
        """Everything that is drawn by its path; with the clock and the legend of its own stages, or of those
        given, but of none neither.
        """
        found = [
            (f"/{stage.root}/{part.path}", part) for stage in self.picture.stages for part in stage.parts
        ]
        flat = [part for plot in self.plots for part in entities.plot_parts(plot)]
        flat += [part for plane in self.paths for part in entities.plane_parts(plane)]
        explained = self.picture.stages if legend is None else legend
        if explained:
            rows = thinned_indices(len(self.seconds), entities.CLOCK_ROWS)
            words = [f"t = {text}" for text in self.words.coarse(self.seconds[rows].tolist())]
            flat += entities.legend_parts(entities.legend_of(explained), words, rows)
        return [*found, *((f"/{part.path}", part) for part in flat)]

    def draw(
        self,
        recording: rr.RecordingStream,
        first: int = 0,
        *,
        legend: Sequence[Stage] | None = None,
        before: Callable[[int], None] = lambda rows: None,
    ) -> None:
        """Draw what holds for all times, and what changes from the first of the rows to be drawn on, in
        chunks; before each the function gets the number of rows that are still to come.
        """
        shown = self.entities(legend)
        for name, text in self.pages.items():
            document = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
            recording.log(f"/{name.lower()}", document, static=True)
        for stage in self.picture.stages:
            recording.log(f"/{stage.root}", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for path, part in shown:
            if part.static:
                recording.log(path, *part.static, static=True)
        for lane in self.states:
            ticks = np.rint(lane.seconds / self.clock.seconds_per_tick).astype(np.int64)
            entities.draw_states(recording, lane, [self._clock_column(ticks + self.clock.since)])
        count = len(self.seconds)
        for start in range(first, count, CHUNK):
            before(count - start)
            rows = slice(start, min(start + CHUNK, count))
            times = self._times(rows)
            for path, part in shown:
                if part.columns is not None:
                    picked = part.picked(rows)
                    if len(self.steps[picked]):
                        plain = part.stride == 1 and part.only is None
                        indexes, columns = times if plain else self._times(picked), part.columns(picked)
                        recording.send_columns(path, indexes=indexes, columns=columns)

    def _times(self, rows: Rows) -> list[rr.TimeColumn]:
        return [self._clock_column(self.clock.ticks[rows]), rr.TimeColumn("step", sequence=self.steps[rows])]

    def _clock_column(self, ticks: NDArray[np.int64]) -> rr.TimeColumn:
        values: Any = {self.clock.kind: ticks.astype(_DTYPES[self.clock.kind])}
        return rr.TimeColumn(self.clock.name, **values)


def _about(rows: xarray.Dataset, extremes: xarray.Dataset, picture: Picture) -> tuple[list[Plot], list[Path]]:
    """Plots, what the scene is about first, and paths in planes; of what was recorded with extremes."""
    curves, planes = leading(rows)
    planes = [name for name in planes if name in PATHS and name != "herpolhode"]  # which a stage has
    found = [plot for name in curves if (plot := CURVES[name](rows)) is not None]
    first = [*found[:1], *picture.plots, *found[1:]][:MOST_LEADING]
    first = [
        replace(plot, values=extremes[plot.name].values.reshape(plot.values.shape) / plot.recorded)
        if plot.recorded
        else plot
        for plot in first
    ]
    drift = drift_plot(extremes)
    others = other_plots(extremes, [plot.name for plot in first])
    paths = [path for name in planes if (path := PATHS[name](rows)) is not None]
    return [*first, *others, *([drift] if drift else [])], paths
