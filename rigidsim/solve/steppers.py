"""Choice of the stepper that a system needs."""

from __future__ import annotations

from rigidsim.model.system import System
from rigidsim.solve.events import EventLog
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.taylor_stepper import TaylorStepper


def stepper_of(
    system: System,
    precision: Precision,
    tolerance: Scalar | None,
    start: Scalar,
    log: EventLog | None = None,
) -> TaylorStepper:
    """The stepper of a system: a plain one, unless the system switches sides; tolerance None stands for the
    precision's epsilon, and without a log no events are looked for.
    """
    if not system.switches:
        return TaylorStepper(system, precision, tolerance, start, log)
    from rigidsim.solve.switching.stepper import SwitchingStepper

    return SwitchingStepper(system, precision, tolerance, start, log)
