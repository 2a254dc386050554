"""The four ways through the samples, and the choice of the cheapest for the next chunk of steps.

All give the same bits (``rigidsim.solve.taylor_stepper``), so that whatever is chosen here changes cost
alone. Each earns its place: without grids runs with a sample every 16 steps take 1.4 to 9 times as long,
without blocks those with events 1.4 to 2.5, and with a sample every step 10 to 15; without skips those with a
sample every 20,000 steps 3.5 to 5 (CPU time of a free asymmetric body, double and 80 bits, two shared cores).
Where steps end at the blocks of a kernel, grids take 0.8 of what single steps take.

Single steps are what remains between the others, and all that pays beyond 80 bits, where a step is dear.
"""

import math
from dataclasses import dataclass
from enum import Enum

from rigidsim.solve.corrected_stepper import STRIDE, CorrectedStepper
from rigidsim.solve.precision import Scalar
from rigidsim.solve.sampler import Pacing
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.taylor_stepper import TaylorStepper

_SPARE = 4  # steps that a skip of steps of mean length ends early: a few are far from the mean


class SampleWay(Enum):
    """A way through the samples."""

    SKIP = "many steps towards a sample, without dense output"
    GRID = "whole strides, or steps to given times, and the states at sample times known beforehand"
    BLOCK = "many steps with dense output"
    STEP = "single steps with dense output"


@dataclass(frozen=True)
class Ways:
    """Parameters of the choice; the defaults cost least where they were measured."""

    grid_rows: int = 65536  # most samples in a stride, which can't be cut short: 8 MB in double precision
    grid_strides: float = 4.0  # per sample, up to which grids (20 us each) cost less than skips (85 us)
    least_grid_steps: int = 8  # fewer are cheaper one by one
    block_steps: int = 4096  # most steps in a block
    block_spacing: float = 64.0  # steps per sample up to which blocks (1 ms each, 0.8 us a step) beat skips
    least_block_steps: int = 64  # fewer are cheaper one by one
    look_ahead: int = 16  # samples over which their spacing is measured
    skip_from: float = 12.0  # steps to a sample from which skipping costs less than single steps
    skip_margin: float = 0.9  # of the steps to the next sample, if as long as the longest recent one, skipped
    even_margin: float = 0.97  # the same by the latest skip's mean length, if that is no more than that skip
    fading: float = 0.98  # factor per chunk by which the longest recent step fades


class WayFinder:
    """Chooses the way for each chunk from the recent steps, of which ``longest`` is 0 before the first."""

    def __init__(
        self, corrected: CorrectedStepper, stepper: TaylorStepper, clock: SampleClock, pacing: Pacing
    ) -> None:
        self._corrected, self._stepper = corrected, stepper
        self._clock = clock
        self._cheap = stepper.precision.cheap
        self._pacing, self.numbers = pacing, pacing.solver or Ways()
        self._last = float(clock.at(clock.count - 1))
        self._paces: dict[SampleWay, float] = {}  # steps per second, as measured last
        self._skipped, self._mean = 0, math.inf  # steps of the latest skip, and their mean length
        self._even = True  # whether skips by the mean length have never gone past their sample
        self.longest = 0.0

    def measured(self, way: SampleWay, steps: int, seconds: float) -> None:
        """Learn the duration of so many steps."""
        self._paces[way] = max(steps, 1) / max(seconds, 1e-9)

    def _most(self, way: SampleWay) -> int:
        """Number of steps in a chunk; one while nothing is known."""
        pace = self._paces.get(way, self._paces.get(SampleWay.STEP, 0.0))
        return max(1, int(pace * self._pacing.chunk_seconds))

    def skipped(self, steps: int, span: float) -> None:
        """Learn the length of so many steps from the time that they took the motion ahead."""
        self._skipped, self._mean = steps, span / max(steps, 1)

    def went_past(self) -> None:
        """Note that a skip passed its sample: steps are longer than they seemed."""
        self.longest = 1.5 * max(self.longest, self._stepper.largest)
        self._even = False

    def choose(self, following: int, upcoming: Scalar) -> tuple[SampleWay, int]:
        """How to continue, and for how many steps at most; the last sample is only ever skipped to."""
        corrected, stepper, ways = self._corrected, self._stepper, self.numbers
        # steps of a tumbling body vary a lot: predict with the longest recent one, which fades slowly
        self.longest = size = max(stepper.largest, ways.fading * self.longest)
        if size <= 0 or stepper.single_steps:
            return SampleWay.STEP, self._most(SampleWay.STEP)
        limit = 2**62
        if self._cheap:
            left = int(min((self._last - float(stepper.time)) / size, limit))
            spacing = self._spacing(following)
            if self._suits_grids(spacing) and following < self._clock.count - 1:
                if stepper.at_whole_time and left >= ways.least_grid_steps:
                    return SampleWay.GRID, self._grid_steps(left)
                limit = corrected.left  # steps to where a grid can start
            if spacing <= ways.block_spacing:
                if min(left, corrected.left, self._to_stop(size)) >= ways.least_block_steps:
                    wanted = max(1, int(self._pacing.rows_at_once * spacing), ways.least_block_steps)
                    return SampleWay.BLOCK, min(ways.block_steps, wanted, corrected.left, left)
                limit = corrected.left  # steps to where a block is worth it again
                if self._gathers(spacing) and following < self._clock.count - 1:
                    most = min(self._most(SampleWay.GRID), int(self._pacing.rows_at_once * spacing))
                    if min(most, limit, left) >= ways.least_grid_steps:
                        return SampleWay.GRID, min(most, limit, left)
        rest = float(upcoming) - float(stepper.time)
        expected = rest / size
        if expected > ways.skip_from:
            steps = ways.skip_margin * expected - 2
            if self._even and self._mean > 0:
                likely = ways.even_margin * rest / self._mean - _SPARE
                steps = max(steps, likely) if likely <= self._skipped else steps
            return SampleWay.SKIP, max(1, int(min(steps, self._most(SampleWay.SKIP), limit)))
        return SampleWay.STEP, min(self._most(SampleWay.STEP), limit)

    def _to_stop(self, size: float) -> float:
        """Steps of a size to where one must end, the edge of a table's rows or a block of an ephemeris."""
        end = self._stepper.end
        return math.inf if end is None else (float(end) - float(self._stepper.time)) / size

    def _spacing(self, following: int) -> float:
        """Steps per sample, over the next samples."""
        ahead = min(following + self.numbers.look_ahead, self._clock.count - 1)
        end = self._last if ahead == self._clock.count - 1 else float(self._clock.at(ahead))
        span = end - float(self._stepper.time)
        return span / self.longest / max(ahead - following, 1)

    def _gathers(self, spacing: float) -> bool:
        """Whether the samples of several steps are taken together although some end at given times."""
        corrected, stepper = self._corrected, self._stepper
        among = corrected.acts_anywhere or stepper.has_events  # what may happen between these steps
        return stepper.end is not None and spacing <= self.numbers.skip_from and not among

    def _suits_grids(self, spacing: float) -> bool:
        stride, ways = self._corrected.stride, self.numbers
        fits = spacing * ways.grid_rows >= stride
        # the last one goes past the last sample, and back: no more of it than of the others
        near = spacing <= ways.grid_strides * min(stride, STRIDE)
        return self._corrected.whole_times and self._stepper.until is None and fits and near

    def _grid_steps(self, left: int) -> int:
        """Whole strides, or all remaining steps and more: a grid's remainder would go step by step."""
        stride = self._corrected.stride
        most = self._most(SampleWay.GRID)
        if 2 * most >= stride:  # the rest of a stride goes step by step
            most = max(most, stride)
        count = min(most, left + left // 2 + self.numbers.least_grid_steps)
        return count - count % stride if count > stride else count
