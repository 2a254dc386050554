"""Everything drawn of one run, ready to be sent to a recording: picture, plots, states and pages."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np
import rerun as rr
import xarray
from numpy.typing import NDArray

from rigidsim.look import signals
from rigidsim.look.clock import Clock, build_clock
from rigidsim.look.page import config_page, notes_page, summary_page
from rigidsim.look.plots import Plot, Series, plan_plots
from rigidsim.look.solids import Array
from rigidsim.look.stages.bodies import Subject
from rigidsim.look.stages.parts import Picture, Plane
from rigidsim.look.stages.registry import build_picture
from rigidsim.look.states import States, charts_of, sections_of, states_of
from rigidsim.look.thinning import thinned_indices
from rigidsim.look.timeline import drawing, plotting
from rigidsim.scene.readable import TimeWords


@dataclass(frozen=True)
class DrawnRun:
    """Everything drawn of one dataset: of its rows `steps`, with pages of markdown by name, the turns of the
    body (0 if its rate isn't known), and strides of arrows and trails by the stage's root and their entity.
    """

    picture: Picture
    subject: Subject
    plots: list[Plot]
    planes: list[Plane]
    states: list[States]
    clock: Clock
    seconds: Array
    steps: NDArray[np.int64]
    pages: dict[str, str]
    words: TimeWords
    turns: float
    strides: dict[str, dict[str, int]] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        dataset: xarray.Dataset,
        shown: xarray.Dataset,
        steps: NDArray[np.int64],
        clock: Clock | None = None,
    ) -> Self:
        """The drawing of a dataset from those of its rows that are in memory, on the clock that suits them.

        Raises:
            ValueError: a time that isn't finite, or an unreadable ``drawing``.
        """
        seconds = signals.seconds(shown)
        start, end = float(seconds[0]), float(seconds[-1])
        clock = clock or build_clock(seconds)
        told = shown.assign_attrs(dataset.attrs)
        picture, subject = build_picture(told)
        plots = plan_plots(told, picture.leading)
        notes = list(picture.notes)
        if not clock.duration:
            notes.append(f"the run doesn't fit nanoseconds: its timeline is `{clock.name}`")
            series = Series("time_seconds", ["time"], [(170, 170, 175)], seconds[:, None])
            plots.append(Plot("time_seconds", "Time [s]", "more", [series]))
        pages = {
            "Summary": summary_page(dataset, shown),
            "Picture": notes_page(picture.kind, notes),
            "Config": config_page(dataset),
        }
        rates = signals.values(told, "angular_velocity")
        rate = signals.norms(rates) if rates is not None else np.empty(0)
        mean = float(np.nanmean(rate)) if np.isfinite(rate).any() else 0.0
        return cls(
            picture=picture,
            subject=subject,
            plots=plots,
            planes=[*picture.planes, *sections_of(dataset)],
            states=[*states_of(dataset, start, end), *charts_of(told)],
            clock=clock,
            seconds=seconds,
            steps=steps,
            pages={name: text for name, text in pages.items() if text},
            words=TimeWords.of(dataset.attrs, start, end),
            turns=mean * abs(end - start) / (2 * np.pi),
        )

    def draw_static(self, recording: rr.RecordingStream, *, legend: bool = True) -> None:
        """Draw what holds for all times; with the legend and its clock, if wanted."""
        for name, text in self.pages.items():
            document = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
            recording.log(f"/{name.lower()}", document, static=True)
        drawing.draw_static(recording, self.picture.stages)
        plotting.draw_plot_styles(recording, self.plots)
        plotting.draw_levels(recording, self.plots, self._times(np.array([0, len(self.seconds) - 1])))
        plotting.draw_planes(recording, self.planes)
        for lane in self.states:
            ticks = np.rint(lane.seconds / self.clock.seconds_per_tick).astype(np.int64)
            plotting.draw_states(recording, lane, [self._clock_column(ticks)])
        if not legend:
            return
        told = thinned_indices(len(self.seconds), plotting.CLOCK_ROWS)
        words = [f"t = {text}" for text in self.words.coarse(self.seconds[told].tolist())]
        plotting.draw_legend(recording, plotting.legend_of(self.picture.stages), words, self._times(told))

    def draw_rows(self, recording: rr.RecordingStream, rows: slice) -> None:
        """Draw what changes, for some rows."""
        times = self._times(rows)
        for stage in self.picture.stages:
            if stage.root not in self.strides:
                self.strides[stage.root] = drawing.strides_of(stage)
            for path, picked, columns in drawing.stage_columns(stage, rows, self.strides[stage.root]):
                mine = times if picked == rows else self._times(picked)
                recording.send_columns(path, indexes=mine, columns=columns)
        plotting.draw_plot_rows(recording, self.plots, times, rows)
        plotting.draw_plane_rows(recording, self.planes, times, rows)

    def draw_plots(self, recording: rr.RecordingStream, plots: list[Plot]) -> None:
        """Draw additional plots over all rows, with their styles."""
        plotting.draw_plot_styles(recording, plots)
        rows = slice(0, len(self.seconds))
        plotting.draw_plot_rows(recording, plots, self._times(rows), rows)

    def _times(self, rows: slice | NDArray[np.int64]) -> list[rr.TimeColumn]:
        return [self._clock_column(self.clock.ticks[rows]), rr.TimeColumn("step", sequence=self.steps[rows])]

    def _clock_column(self, ticks: NDArray[np.int64]) -> rr.TimeColumn:
        if self.clock.duration:
            return rr.TimeColumn(self.clock.name, duration=ticks.astype("timedelta64[ns]"))
        return rr.TimeColumn(self.clock.name, sequence=ticks)
