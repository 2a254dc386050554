"""Everything drawn of one run, ready to be sent to a recording: clock, picture, plots, states and pages."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import cycle
from typing import Any, Self

import numpy as np
import pyarrow as pa
import rerun as rr
import xarray
from numpy.typing import NDArray

from rigidsim.look import signals
from rigidsim.look.curves import CURVES, Plot, drift_plot, other_plots, screen
from rigidsim.look.pages import config_page, leading, notes_page, summary_page
from rigidsim.look.paths import PATHS, Path, sections
from rigidsim.look.record import events_of
from rigidsim.look.signals import OVER_TIME, joined, need, optional
from rigidsim.look.solids import Array, Color, rotation_matrix
from rigidsim.look.stages.parts import (
    NEAR,
    PALE,
    PULL,
    Columns,
    Part,
    Picture,
    Rows,
    Stage,
    moving,
    points_wide,
)  # fmt: skip
from rigidsim.look.stages.registry import build_picture
from rigidsim.look.thinning import Thinning, thin_with_extremes, thinned_indices
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
MOST_EVENTS = 2000  # largest number of events of one kind in a lane; of more, the first are shown
CHART_LEFT = 0.5  # singular factor below which the solver leaves a chart of Euler angles
_SHADES: tuple[Color, Color] = ((92, 148, 235), (240, 190, 60))
CLOCK_ROWS = 2000  # largest number of rows of the clock on the screen
_INK: Color = (205, 210, 218)
_FAINT: Color = (90, 96, 108)
LEGEND_COLUMNS = 3
LEGEND_LINE = 0.78
"""Height of a line of the legend, which is 30 units wide: about 24 of 950 points of the screen."""
MOST_LEADING = 3  # plots next to the scene
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

    def column(self, ticks: NDArray[np.int64]) -> rr.TimeColumn:
        """Times for the viewer."""
        values: Any = {self.kind: ticks.astype(_DTYPES[self.kind])}
        return rr.TimeColumn(self.name, **values)


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


Lane = tuple[str, Array, list[str], dict[str, Color]]
"""One lane of states: its name, when they begin (changes,), s, their names, and colours by name."""


@dataclass(frozen=True)
class _Cut:
    """Rows of a column for the viewer, in Arrow already; it has the names of the column."""

    of: Any
    rows: pa.Array

    def __getattr__(self, name: str) -> Any:
        return getattr(self.of, name)

    def as_arrow_array(self) -> pa.Array:
        """The rows."""
        return self.rows


@dataclass(frozen=True)
class DrawnRun:
    """Everything drawn of one dataset: of its `rows` in memory, numbered by `steps`, with pages of markdown
    by name.
    """

    rows: xarray.Dataset
    steps: NDArray[np.int64]
    picture: Picture
    plots: list[Plot]
    paths: list[Path]
    states: list[Lane]
    clock: Clock
    seconds: Array
    pages: dict[str, str]

    @classmethod
    def of(cls, dataset: xarray.Dataset, most: int, known: Thinning | None = None) -> Self:
        """The drawing of at most so many rows of a dataset, possibly lazy, on the clock that suits them."""
        rows, curves = (x.assign_attrs(dataset.attrs) for x in thin_with_extremes(dataset, most, known))
        seconds = signals.seconds(rows)
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
            states=lanes_of(dataset, rows),
            clock=clock,
            seconds=seconds,
            pages={name: text for name, text in pages.items() if text},
        )

    def entities(self, legend: Sequence[Stage] | None = None) -> list[tuple[str, Part]]:
        """Everything that is drawn by its path; with the clock and the legend of its own stages, or of those
        given, but of none neither.
        """
        found = [
            (f"/{stage.root}/{part.path}", part) for stage in self.picture.stages for part in stage.parts
        ]
        flat = [part for plot in self.plots for part in plot_parts(plot)]
        flat += [part for plane in self.paths for part in plane_parts(plane)]
        explained = self.picture.stages if legend is None else legend
        if explained:
            rows = thinned_indices(len(self.seconds), CLOCK_ROWS)
            times = TimeWords.of(self.rows.attrs, float(self.seconds[0]), float(self.seconds[-1]))
            words = [f"t = {text}" for text in times.coarse(self.seconds[rows].tolist())]
            flat += legend_parts(legend_of(explained), words, rows)
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
        chunks; before each entity the function gets how many rows of all entities that still makes.
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
            draw_lane(recording, lane, self.clock)
        count, moved = len(self.seconds), [(path, part) for path, part in shown if part.columns is not None]
        for number, (path, part) in enumerate(moved):
            before((count - first) * (len(moved) - number) // len(moved))
            picked = part.picked(slice(first, count))
            # converted once, and then cut
            whole = [
                [(one, one.as_arrow_array()) for one in found]
                for found in (self._times(picked), need(part.columns)(picked))
            ]
            for start in range(0, len(self.steps[picked]), CHUNK):
                sent: list[list[Any]]
                sent = [[_Cut(one, rows.slice(start, CHUNK)) for one, rows in found] for found in whole]
                recording.send_columns(path, indexes=sent[0], columns=sent[1])

    def _times(self, rows: Rows) -> list[rr.TimeColumn]:
        return [self.clock.column(self.clock.ticks[rows]), rr.TimeColumn("step", sequence=self.steps[rows])]


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


# ---- parts in planes


def plot_path(plot: Plot) -> str:
    """Entity of a plot."""
    return "plots/" + rr.escape_entity_path_part(plot.name)


def plot_parts(plot: Plot) -> list[Part]:
    """Curves with their names and colours, and lines for values that hold for the whole run, at its ends."""
    path, shown = plot_path(plot), plot.values
    count = shown.shape[1]
    if plot.log:  # the logarithms, and gaps for zeros
        shown = np.log10(shown, where=shown > 0, out=np.full_like(shown, np.nan))
    style: dict[str, Any] = {
        "names": [label or plot.title for label in plot.labels],
        "colors": [screen(hue) for hue, _ in zip(cycle(plot.hues), plot.labels, strict=False)],
    }
    widths = [1.5] * len(plot.labels)

    def banded(rows: Rows) -> Columns:
        # a band of their uncertainty: the viewer draws the root of a variance
        values, variances = shown[rows], np.repeat(need(plot.error)[rows] ** 2, count)
        found = rr.Measurements.columns(values=values.ravel(), variances=variances)
        return found.partition([count] * len(values))

    # of rows that fall into one pixel the extremes, as an average would show a fast rotation with a vanishing
    # amplitude; of a drift only the largest counts
    policies = rr.components.AggregationPolicy
    policy = policies.Max if plot.place == "drift" else policies.MinMax
    look: Any = rr.SeriesLines(**style, widths=widths, aggregation_policy=policy)
    # lines through samples far apart would draw a pattern; recorded values may be extremes of many rows
    if plot.sparse or not (plot.recorded or plot.log or all(joined(column, OVER_TIME) for column in shown.T)):
        look = rr.SeriesPoints(**style, marker_sizes=widths)
    found = [Part(path, [look], moving(rr.Scalars, scalars=shown))]
    if plot.error is not None:
        found = [Part(path, [rr.Measurements.from_fields(**style, widths=widths)], banded)]
    for number, (label, value) in enumerate(plot.levels.items()):
        line = rr.SeriesLines(names=[label], colors=[screen("grey")], widths=[1.0])
        level = moving(rr.Scalars, scalars=np.full(len(shown), np.log10(value) if plot.log else value))
        ends = np.array([0, len(shown) - 1])
        found.append(Part(f"{path}/level{number}", [line], level, only=ends))
    return found


def plane_parts(plane: Path) -> list[Part]:
    """A plane figure: the whole path, circles, axes, and the moving point."""
    points, root, bright = flipped(plane.points), f"planes/{plane.name}", screen(plane.hue)
    dim = tuple(round(0.5 * x) for x in bright)
    finite = points[np.isfinite(points).all(axis=1)]
    whole = finite[:: max(len(finite) // 4000, 1)]
    drawn: Any = rr.Points2D(whole, colors=[dim if plane.moves else bright], radii=points_wide(1.6))
    if len(whole) > 1 and plane.moves and not plane.sparse and joined(whole, NEAR):
        drawn = rr.LineStrips2D([whole], colors=[dim], radii=points_wide(0.9), draw_order=1.0)
    ends = 1.1 * plane.reach * np.array([[1, 0], [0, -1]])
    found = [
        Part(f"{root}/whole", [drawn]),
        Part(f"{root}/axes", [_faint([[-end, end] for end in ends])]),
        Part(f"{root}/axes/names", [_texts(ends * [[0.86], [1.0]], plane.labels)]),  # within a narrow view
    ]
    angle = np.linspace(0, 2 * np.pi, 121)
    power = 10.0 ** np.floor(np.log10(plane.reach))
    step = next(s for s in (5, 2, 1, 0.5) if s * power <= 0.75 * plane.reach) * power
    for number in (1, 2):
        radius, at = number * step, 0.9 - 0.35 * (number % 2)  # neighbours' labels lie apart
        ring, label = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1), f"{radius:.3g} {plane.unit}"
        place = radius * np.array([[np.cos(at), np.sin(at)]])
        found.append(Part(f"{root}/rings/{number}", [_faint([ring])]))
        found.append(Part(f"{root}/rings/{number}/label", [_texts(place, [label.strip()])]))
    if plane.moves:
        dot = rr.Points2D.from_fields(colors=[bright], radii=points_wide(5.0), draw_order=3.0)
        now = moving(rr.Points2D, positions=points.astype(np.float32))
        found.append(Part(f"{root}/now", [dot], now))
    return found


def _faint(strips: Any) -> rr.LineStrips2D:
    return rr.LineStrips2D(strips, colors=[_FAINT], radii=points_wide(0.5), draw_order=-1.0)


def _texts(places: Any, labels: Sequence[str], colors: Sequence[Color] = (_INK,)) -> rr.Points2D:
    return rr.Points2D(places, labels=list(labels), colors=list(colors), radii=0.0, show_labels=True)


def flipped(points: Array) -> Array:
    """Plane points for the viewer, whose second axis points down."""
    return points * np.array([1.0, -1.0])


def legend_of(stages: Sequence[Stage]) -> dict[str, Color]:
    """Colours of parts by what they mean."""
    found: dict[str, Color] = {}
    for part in (part for stage in stages for part in stage.parts if part.words):
        found.setdefault(part.words, part.color)
    return found


def legend_parts(entries: Mapping[str, Color], times: Sequence[str], rows: NDArray[np.int64]) -> list[Part]:
    """The legend as a plane figure, 30 units wide, and before it the scene's time in words at some rows."""
    width = 30.0 / LEGEND_COLUMNS
    places = [
        (width * (number % LEGEND_COLUMNS + 0.5), LEGEND_LINE * (number // LEGEND_COLUMNS + 0.06))
        for number in range(1 + len(entries))
    ]
    texts = [f"■ {words}" for words in entries]
    style = rr.Points2D.from_fields(colors=[_INK], radii=[0.0], show_labels=True)
    numbers = dict(zip(rows.tolist(), times, strict=True))

    def clock(picked: Rows) -> Columns:
        labels = [numbers[row] for row in np.asarray(picked).tolist()]
        return rr.Points2D.columns(positions=places[:1] * len(labels), labels=labels)

    words = [Part("legend/words", [_texts(places[1:], texts, list(entries.values()))])] if entries else []
    return [*words, Part("legend/clock", [style], clock, only=rows)]


def lanes_of(dataset: xarray.Dataset, rows: xarray.Dataset) -> list[Lane]:
    """Lanes: one for each event, which changes colour when it happens, one for a run that was stopped, from
    the first to the last sample's time, s, and one for the chart of Euler angles; of a dataset and its rows.
    """
    lanes, ends = list[Lane](), signals.seconds(rows)[[0, -1]]
    for name in events_of(dataset):
        times = np.asarray(dataset[f"{name}_time"].values, dtype=np.float64)[:MOST_EVENTS]
        values = [f"before {name}", *(f"{name} {k + 1}" for k in range(len(times)))]
        colors = {value: PALE if k == 0 else _SHADES[k % 2] for k, value in enumerate(values)}
        lanes.append((name, np.append(ends[0], times), values, colors))
    status = str(dataset.attrs.get("status", ""))
    if status and status not in ("finished", "running"):
        colors = {"running": _SHADES[0], status.replace("_", " "): PULL}
        lanes.append(("run", ends, list(colors), colors))
    chart = _chart_of(rows)
    return lanes if chart is None else [*lanes, chart]


@optional
def _chart_of(dataset: xarray.Dataset) -> Lane:
    """A lane for a run in Euler angles that shows which of its two sequences carried it.

    A chart is left at the first step after which its singular factor is below ``CHART_LEFT``. Of steps a
    dataset knows nothing: a change is shown at the first sample from which it is certain, and one that lies
    between two sparse samples isn't seen.
    """
    names = [str(need(dataset.attrs.get(f"euler_{word}"))) for word in ("sequence", "partner_sequence")]
    need(all(names))
    turned = rotation_matrix(need(signals.values(dataset, "quaternion")))
    # of an intrinsic sequence i j k the entry (i, k) is the cosine or sine that its middle angle leaves
    entries = [turned[:, "xyz".index(name[0]), "xyz".index(name[2])] for name in names]
    near = [np.sqrt(np.maximum(1 - entry**2, 0.0)) < CHART_LEFT for entry in entries]
    first = int(near[0][0])
    chart, changes = first, [0]
    for row in np.flatnonzero(near[0] | near[1]):
        if near[chart][row]:
            chart = 1 - chart
            changes.append(int(row))
    begins = signals.seconds(dataset)[np.array(changes[: MOST_EVENTS + 1])]
    values = [names[(first + k) % 2] for k in range(len(begins))]
    return "chart", begins, values, dict(zip(names, _SHADES, strict=True))


def draw_lane(recording: rr.RecordingStream, lane: Lane, clock: Clock) -> None:
    """Draw a lane of states over time."""
    name, seconds, states, colors = lane
    path, known = f"/states/{rr.escape_entity_path_part(name)}", sorted(set(states))
    shades = [colors[value] for value in known]
    recording.log(path, rr.StateConfiguration(values=known, labels=known, colors=shades), static=True)
    ticks = np.rint(seconds / clock.seconds_per_tick).astype(np.int64) + clock.since
    recording.send_columns(path, indexes=[clock.column(ticks)], columns=rr.StateChange.columns(state=states))
