"""Everything drawn of one run, ready to be sent to a recording: picture, plots, states and pages."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rigidsim.look.clock import Clock, build_clock
from rigidsim.look.page import config_page, notes_page, summary_page
from rigidsim.look.plots import Plot, Series, plan_plots
from rigidsim.look.stages.bodies import Subject
from rigidsim.look.stages.parts import Picture, Plane
from rigidsim.look.stages.registry import build_picture
from rigidsim.look.states import States, charts_of, sections_of, states_of
from rigidsim.look.thinning import thinned_indices
from rigidsim.scene.readable_time import TimeWords

if TYPE_CHECKING:
    from rigidsim.look.rows import Table


@dataclass(frozen=True)
class DrawnRun:
    """Everything drawn of one dataset.

    Attributes:
        steps: (rows,), which rows of the dataset these are.
        pages: markdown by name.
        words: wording of its times.
    """

    picture: Picture
    subject: Subject
    plots: list[Plot]
    planes: list[Plane]
    states: list[States]
    clock: Clock
    seconds: NDArray[np.float64]
    steps: NDArray[np.int64]
    pages: dict[str, str]
    words: TimeWords
    turns: float
    strides: dict[str, dict[str, int]] = field(default_factory=dict)

    @classmethod
    def of(
        cls, dataset: Table, shown: Table, steps: NDArray[np.int64], clock: Clock | None = None
    ) -> DrawnRun:
        """The drawing of a dataset and its rows in memory.

        Args:
            steps: which rows of the dataset these are.
            clock: clock of their times; None for the one that suits them.

        Raises:
            ValueError: a time that isn't finite, or an unreadable ``drawing``.
        """
        seconds = np.asarray(shown["time"].values, dtype=np.float64)
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
        return cls(
            picture=picture,
            subject=subject,
            plots=plots,
            planes=[*picture.planes, *sections_of(dataset)],
            states=[*states_of(dataset, float(seconds[0]), float(seconds[-1])), *charts_of(told)],
            clock=clock,
            seconds=seconds,
            steps=steps,
            pages={name: text for name, text in pages.items() if text},
            words=TimeWords.of(dataset.attrs, float(seconds[0]), float(seconds[-1])),
            turns=_turns(shown, seconds),
        )

    def blueprint(self, *, following: bool = False) -> Any:
        """The page layout."""
        from rigidsim.look.blueprint import build_blueprint
        from rigidsim.look.plotting import legend_of

        return build_blueprint(
            self.picture.stages,
            self.plots,
            self.clock,
            self.turns,
            planes=self.planes,
            subject=self.subject,
            legend=legend_of(self.picture.stages),
            states=bool(self.states),
            pages=list(self.pages),
            following=following,
        )

    def draw_static(self, recording: Any, *, legend: bool = True) -> None:
        """Draw what holds for all times.

        Args:
            legend: whether the legend with its clock is wanted.
        """
        import rerun as rr

        from rigidsim.look import drawing, plotting

        for name, text in self.pages.items():
            document = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
            recording.log(f"/{name.lower()}", document, static=True)
        drawing.draw_static(recording, self.picture.stages)
        plotting.draw_plot_styles(recording, self.plots)
        ends = [0, len(self.seconds) - 1]
        plotting.draw_levels(recording, self.plots, self._times(self.clock.ticks[ends], self.steps[ends]))
        plotting.draw_planes(recording, self.planes)
        lanes = [self._times(self._ticks(lane.seconds)) for lane in self.states]
        plotting.draw_states(recording, self.states, lanes)
        if not legend:
            return
        plotting.draw_legend(recording, plotting.legend_of(self.picture.stages))
        told = thinned_indices(len(self.seconds), plotting.CLOCK_ROWS)
        words = [f"t = {text}" for text in self.words.coarse(self.seconds[told].tolist())]
        plotting.draw_clock(recording, words, self._times(self.clock.ticks[told], self.steps[told]))

    def draw_rows(self, recording: Any, rows: slice) -> None:
        """Draw what changes, for some rows."""
        from rigidsim.look import drawing, plotting
        from rigidsim.look.sending import send

        times = self._times(self.clock.ticks[rows], self.steps[rows])
        known = {(rows.start, rows.step or 1): times}
        for stage in self.picture.stages:
            if stage.root not in self.strides:
                self.strides[stage.root] = drawing.strides_of(stage)
            for path, picked, columns in drawing.stage_columns(stage, rows, self.strides[stage.root]):
                mine = known.get((picked.start, picked.step or 1))
                if mine is None:
                    mine = self._times(self.clock.ticks[picked], self.steps[picked])
                    known[picked.start, picked.step or 1] = mine
                send(recording, path, mine, columns)
        plotting.draw_plot_rows(recording, self.plots, times, rows)
        plotting.draw_plane_rows(recording, self.planes, times, rows)

    def draw_plots(self, recording: Any, plots: list[Plot]) -> None:
        """Draw additional plots over all rows, with their styles."""
        from rigidsim.look import plotting

        plotting.draw_plot_styles(recording, plots)
        rows = slice(0, len(self.seconds))
        plotting.draw_plot_rows(recording, plots, self._times(self.clock.ticks, self.steps), rows)

    def _ticks(self, seconds: NDArray[np.float64]) -> NDArray[np.int64]:
        return np.rint(seconds / self.clock.seconds_per_tick).astype(np.int64)

    def _times(self, ticks: NDArray[np.int64], steps: NDArray[np.int64] | None = None) -> list[Any]:
        import rerun as rr

        name = self.clock.name
        time = (
            rr.TimeColumn(name, duration=ticks.astype("timedelta64[ns]"))
            if self.clock.duration
            else rr.TimeColumn(name, sequence=ticks)
        )
        return [time] if steps is None else [time, rr.TimeColumn("step", sequence=steps)]


def _turns(dataset: Table, seconds: np.ndarray) -> float:
    """Turns of the body during the run, from its mean rate; 0 when the rate isn't known."""
    if "angular_velocity" not in dataset:
        return 0.0
    rates = np.asarray(dataset["angular_velocity"].values, dtype=float)
    rate = np.sqrt(np.einsum("ij,ij->i", rates, rates))
    mean = float(np.nanmean(rate)) if np.isfinite(rate).any() else 0.0
    return mean * float(abs(seconds[-1] - seconds[0])) / (2 * np.pi)
