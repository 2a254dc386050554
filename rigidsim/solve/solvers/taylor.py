"""Taylor series of natural steps, by heyoka: the method of every config that names no other."""

from __future__ import annotations

from rigidsim.model.system import System
from rigidsim.scene.choices import DEFAULT_METHOD, METHODS
from rigidsim.solve.events import EventLog
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.solvers.algorithm import Algorithm, solves
from rigidsim.solve.switching.stepper import stepper_of
from rigidsim.solve.taylor_stepper import TaylorStepper


@solves(METHODS[DEFAULT_METHOD])
class Taylor(Algorithm):
    """Solves any scene."""

    title = "heyoka Taylor, natural steps, dense output"
    finds_events = sets_parameters = takes_series = True
    own_errors = False

    def stepper(
        self, system: System, precision: Precision, tolerance: Scalar | None, start: Scalar, log: EventLog
    ) -> TaylorStepper:
        return stepper_of(system, precision, tolerance, start, log)
