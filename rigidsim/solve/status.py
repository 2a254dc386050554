"""The statuses with which a run can end, each with its message for the user."""

from enum import Enum


class Status(Enum):
    """How a run ended; ``value`` stands in datasets and summaries."""

    RUNNING = "running"
    FINISHED = "finished"
    EVENT = "finished: event"
    INTERRUPTED = "interrupted"
    WALL_TIME = "stopped: wall_time"
    MAX_STEPS = "stopped: max_steps"
    MAX_DRIFT = "stopped: max_drift"
    NON_FINITE = "stopped: non-finite state"
    COLLAPSED = "stopped: step size collapsed"
    UNRESOLVED = "stopped: switching unresolved"
    IMPOSSIBLE = "stopped: impossible body"
    OUT_OF_RANGE = "stopped: out of range"
    CONTACT = "stopped: contact"

    @property
    def message(self) -> str:
        """One sentence for the user."""
        return _MESSAGES[self]

    @property
    def exit_code(self) -> int:
        """Exit code of the command line."""
        if self in (Status.FINISHED, Status.EVENT):
            return 0
        return 130 if self is Status.INTERRUPTED else 3

    @property
    def final(self) -> bool:
        """True if resuming couldn't help, so that the dataset is completed as it is."""
        return self in (Status.FINISHED, Status.EVENT, *_BROKEN)


ENDED = (Status.IMPOSSIBLE, Status.OUT_OF_RANGE, Status.CONTACT)
"""Where the motion came to something that no body can pass."""
_BROKEN = (Status.NON_FINITE, Status.COLLAPSED, Status.UNRESOLVED, *ENDED)
_MESSAGES = {
    Status.RUNNING: "the run is under way, or was killed",
    Status.FINISHED: "the run reached its last sample",
    Status.EVENT: "the run ended at an event, as asked",
    Status.INTERRUPTED: "the run was interrupted; what was integrated is kept",
    Status.WALL_TIME: "the guard [limits] wall_time was reached; what was integrated is kept",
    Status.MAX_STEPS: "the guard [limits] max_steps was reached; what was integrated is kept",
    Status.MAX_DRIFT: "an invariant drifted past the guard [limits] max_drift; what was integrated is kept",
    Status.NON_FINITE: "the state stopped being finite; the samples before it are kept",
    Status.COLLAPSED: "the steps became too small to ever arrive; the samples so far are kept",
    Status.UNRESOLVED: "the motion can't be continued past a switching surface; the samples so far are kept",
    Status.IMPOSSIBLE: "the values became impossible for a body; the samples so far are kept",
    Status.CONTACT: "two bodies touch; the samples so far are kept",
    Status.OUT_OF_RANGE: "the motion left the range in which a model is known; the samples so far are kept",
}
