"""Interface of a solver, which takes a motion along and finds its samples."""

from rigidsim.solve.corrected_stepper import StepBoundary
from rigidsim.solve.precision import Scalar
from rigidsim.solve.sampler import Progress, SampleBuffer
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.status import Status
from rigidsim.solve.stepper import OwnErrors


class Solver:
    """Takes a motion along, as ``rigidsim.solve.driver.Driver`` asks it to.

    Attributes:
        clock: times of the samples.
        buffer: where samples go as they are found.
        progress: the run's one record of how far it is, which the solver keeps.
    """

    clock: SampleClock
    buffer: SampleBuffer
    progress: Progress

    def begin(
        self, clock: SampleClock, buffer: SampleBuffer, progress: Progress, start: StepBoundary | None
    ) -> None:
        """Get ready, at a boundary or, without one, where it stands."""
        self.clock, self.buffer, self.progress = clock, buffer, progress

    def boundary(self) -> StepBoundary:
        """A boundary past which all samples are still to be found; after the last sample, one before it."""
        raise NotImplementedError

    def back_to(self, boundary: StepBoundary) -> None:
        """Return to an earlier boundary; samples found past it have been dropped."""
        raise NotImplementedError

    @property
    def pending(self) -> bool:
        """Whether steps have been taken whose samples aren't all found yet."""
        return False

    def advance(self, boundary: StepBoundary, most: int | None) -> Status | None:
        """Go on for about the time of a chunk, or until the buffer is full.

        Args:
            most: natural steps that are allowed; None for any number.

        Returns:
            The status if the motion ends here: FINISHED once the last sample is found.
        """
        raise NotImplementedError

    def settle(self, boundary: StepBoundary, moment: Scalar) -> None:
        """Go back to a boundary before a moment and on to the first at or past it, so that where a run ends
        follows from the samples and the motion alone.
        """
        raise NotImplementedError

    def stop(self) -> None:
        """Give up steps whose samples aren't all found: a run that is resumed takes them again."""

    def errors(self) -> OwnErrors | None:
        """Its own estimate of the errors made so far; None if it has none, and then none is announced."""
        return None
