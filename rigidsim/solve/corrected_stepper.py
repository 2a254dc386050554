"""Corrections of the state at fixed counts of natural steps, so that bits depend on no clock or sampling.

A step is never clamped to a sample, but some corrections have to be made along the way: angles are brought
back into one turn, and the engine's time, which is a sum of two numbers, is put back on a single one. They
happen at fixed counts of natural steps: on whichever path a run goes through these counts, skipping,
recording or resumed, it does the same there. A chart of Euler angles is changed at the first step boundary
whose state asks for it, likewise.

That time is a single number at each stride's start is what lets whole strides be recorded by the engine's own
grid output, which starts at such a time only. The move back to it is a step of some 1e-16 of the time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigidsim.solve.angle_wrapping import STEPS_BETWEEN, AngleState, AngleWrapping
from rigidsim.solve.building import interruptible
from rigidsim.solve.charts import Charts
from rigidsim.solve.precision import Scalar
from rigidsim.solve.projection import LATE, NOTED, Projection
from rigidsim.solve.sample_block import SampleBlock
from rigidsim.solve.stepper import Mark, Stepper
from rigidsim.solve.trail import Waypoints

STRIDE = 1024
"""Natural steps between corrections if only time is corrected: half a millisecond, so that the calls cost
less than a hundredth of it.
"""

_NOTHING = np.zeros(0)


@dataclass(frozen=True)
class StepBoundary:
    """A natural step boundary of a run, with everything the integration needs to resume with the same bits.

    Attributes:
        mark: the engine's time and state, and counts.
        angles: what the angle states stand for.
        chart_changes: number of chart changes so far.
        projection: a copy of ``Projection.memory``; (0,) if nothing is projected.
    """

    mark: Mark
    angles: AngleState
    chart_changes: int
    projection: np.ndarray


_NEAR = 3
"""Number of steps (with its next guess) below which they are sooner taken one by one than together."""


class CorrectedStepper:
    """Takes steps and makes corrections when they are due.

    Attributes:
        projection: puts invariants back, if requested.
        whole_times: whether time is a single number at each stride's start. Not where events or switching
            surfaces are looked for: a step back could cross one twice; nor where steps are cut short.
        charts: charts of a run in Euler angles; None for others.
        collapsed: whether steps have become too small to ever arrive.
        waypoints: some of the boundaries after corrections.

    Args:
        stride: largest number of natural steps between corrections; affects results within rounding.
        projection_interval: largest number of natural steps between projections.
    """

    def __init__(
        self,
        stepper: Stepper,
        wrapping: AngleWrapping,
        projection: Projection | None = None,
        *,
        stride: int = STRIDE,
        projection_interval: int = STRIDE,
    ) -> None:
        self.stepper = stepper
        self.wrapping = wrapping
        self.projection = projection
        self._plain_stride = min(stride, STEPS_BETWEEN) if wrapping.positions else stride
        self._held_stride = min(self._plain_stride, projection_interval)
        self._projection_interval = max(projection_interval // self._held_stride, 1) * self._held_stride
        self.whole_times = not (stepper.has_events or stepper.single_steps or stepper.cuts_steps)
        self._stuck = False
        self.waypoints = Waypoints()
        self.charts: Charts | None = None
        system = stepper.system
        if system.partner is not None:
            self.charts = stepper.watcher = Charts(system, system.partner, stepper.precision, wrapping)
            if self.charts.near(stepper.state):  # no change on the way: it begins there
                self._change_chart(self.charts)
                self.charts.changes = 0
                stepper.bound_first_step()

    @property
    def stride(self) -> int:
        """Natural steps between corrections."""
        holding = self.projection is not None and self.projection.holding
        return self._held_stride if holding else self._plain_stride

    @property
    def left(self) -> int:
        """Steps until the next corrections, at least 1."""
        return self.stride - self.stepper.steps % self.stride

    @property
    def collapsed(self) -> bool:
        """Whether steps have become too small to ever arrive, even at the next whole time."""
        return self._stuck or self.stepper.collapsed

    def boundary(self) -> StepBoundary:
        """Remember this boundary."""
        return StepBoundary(
            self.stepper.mark(),
            self.wrapping.angles,
            0 if self.charts is None else self.charts.changes,
            _NOTHING if self.projection is None else self.projection.memory.copy(),
        )

    def back_to(self, boundary: StepBoundary) -> None:
        """Return to a boundary."""
        self._stuck = False
        self.wrapping.angles = boundary.angles
        if self.projection is not None:
            self.projection.memory[...] = boundary.projection
        if self.charts is not None:
            self.charts.changes = boundary.chart_changes
            self.stepper.use(self.charts.chart)
            if self.projection is not None:
                self.projection.use(self.charts.chart)
        self.stepper.back_to(boundary.mark)

    def arrive(self, boundary: StepBoundary, moment: Scalar) -> StepBoundary:
        """Go back to a boundary before a moment, and on by the same steps to the first boundary at or past
        it, without corrections there; returns the boundary before that.
        """
        most = self.stepper.steps - boundary.mark.steps  # within which it lies, where they reach it
        end, goal, slow = float(self.stepper.time), float(moment), False
        self.back_to(boundary)
        while most > 1:
            here, begin, whole = self.boundary(), float(self.stepper.time), most
            part, size = most // 2, (end - begin) / most
            if not slow and begin < goal < end:  # where steps of equal size would end
                part = min(max(int((goal - begin) / size), 1), most - 1)
            self.skip(part)
            if self.stepper.time >= moment:
                most, end = part, float(self.stepper.time)
                self.back_to(here)
            else:
                most -= part
                if goal - float(self.stepper.time) < _NEAR * size:
                    break
            slow = not slow and 2 * most > whole
        while True:
            before = self.boundary()
            self.stepper.step()
            if self.stepper.time >= moment:
                return before
            self.correct()

    def skip(self, count: int) -> bool:
        """Take ``count`` steps without dense output, fewer if they collapse; False if the state is no longer
        finite. The stepper's smallest and largest step then refer to all of them.
        """
        stepper, smallest, largest = self.stepper, math.inf, 0.0
        while count > 0 and not self.collapsed:
            before, stride = stepper.steps, self.stride
            if not stepper.skip(min(count, stride - before % stride)):
                return False
            smallest, largest = min(smallest, stepper.smallest), max(largest, stepper.largest)
            stepper.smallest, stepper.largest = smallest, largest
            count -= stepper.steps - before
            self.correct()
        return True

    def samples(self, first: int, times: np.ndarray, states: np.ndarray) -> SampleBlock:
        """Samples within the steps of the latest call, taken before the corrections that follow it.

        Args:
            first: index of the first sample.
            times, states: those of each sample, as in ``SampleBlock``.
        """
        reference = None if self.charts is None else self.charts.references(times)
        # corrections put back before a sample: by all corrections before its own step
        put_back = _NOTHING if self.projection is None else self.projection.corrections
        return SampleBlock.of(first, times, states, self.wrapping.angles, put_back, reference)

    def correct(self) -> None:
        """Make the corrections if they are due; dense output of the latest step is then void."""
        due = self.stepper.steps % self.stride == 0
        change = self.charts is not None and self.charts.near(self.stepper.state)
        if not (due or change):
            return
        if self.whole_times and not self.stepper.to_whole_time():
            self._stuck = True
            return
        if due and self.wrapping.positions:
            self.wrapping.wrap(self.stepper.state)
        if due and self.projection is not None:
            self._project(self.projection)
        if change and self.charts is not None:
            self._change_chart(self.charts)
        if due:
            self._note()

    def _project(self, projection: Projection) -> None:
        state, time, steps = self.stepper.state, self.stepper.time, self.stepper.steps
        if projection.holding:
            if not projection.late or steps % self._projection_interval == 0:
                projection.project(state, time)
        elif steps >= LATE:
            interruptible(projection.load)
            projection.begin(state, time)
        elif steps % NOTED == 0:
            projection.note(state, time, steps // NOTED - 1)

    def _note(self) -> None:
        stepper, chart = self.stepper, 0 if self.charts is None else self.charts.chart
        number = stepper.steps // self.stride
        self.waypoints.note(number, stepper.steps, stepper.time, stepper.state, chart)

    def _change_chart(self, charts: Charts) -> None:
        state = charts.change(self.stepper.state)
        self.stepper.use(charts.chart)
        if self.projection is not None:
            self.projection.use(charts.chart)
        self.stepper.state[:] = state
