"""Which stepper a system needs."""

from __future__ import annotations

from rigidsim.model.system import System
from rigidsim.solve.events import EventLog
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.stepper import Stepper
from rigidsim.solve.switching_stepper import SwitchingStepper


def stepper_of(
    system: System,
    precision: Precision,
    tolerance: Scalar | None,
    start: Scalar,
    log: EventLog | None = None,
) -> Stepper:
    """The stepper of a system: a plain one, unless the system switches.

    Args:
        tolerance: None for the precision's epsilon.
        start: internal units.
        log: of events; without one none are looked for.
    """
    kind = SwitchingStepper if system.switches else Stepper
    return kind(system, precision, tolerance, start, log)
