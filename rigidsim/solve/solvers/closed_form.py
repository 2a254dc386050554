"""Samples straight from a closed form: no steps, and the same cost at any horizon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidsim.model.system import System
from rigidsim.scene.choices import METHODS
from rigidsim.scene.scene import Scene
from rigidsim.solve.closed_form import ClosedForm, NoClosedForm, closed_form_of
from rigidsim.solve.corrected_stepper import CorrectedStepper, StepBoundary
from rigidsim.solve.events import EventLog
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.sampler import Pacing
from rigidsim.solve.solvers.algorithm import Algorithm, Unsuitable, solves
from rigidsim.solve.solvers.solver import Solver
from rigidsim.solve.status import Status
from rigidsim.solve.stepper import Mark, Stepper

_WIDE_ROWS = 64  # at once beyond double precision, where one takes about a millisecond


class AtStart(Stepper):
    """Stands at the start of a motion that is solved without steps."""

    def __init__(self, system: System, precision: Precision, start: Scalar) -> None:
        super().__init__(system, precision)
        self._time, self._state = start, precision.array(system.initial)

    @property
    def time(self) -> Scalar:
        return self._time

    @property
    def state(self) -> np.ndarray:
        return self._state

    def back_to(self, mark: Mark) -> None:
        """See ``Stepper``: it never left."""


class ClosedFormSolver(Solver):
    """Evaluates a closed form at the samples; its only boundary is the start."""

    def __init__(self, form: ClosedForm, corrected: CorrectedStepper, pacing: Pacing) -> None:
        self._form, self._corrected, self._rows = form, corrected, pacing.rows_at_once
        self._start = corrected.boundary()

    def boundary(self) -> StepBoundary:
        return self._start

    def back_to(self, boundary: StepBoundary) -> None:
        pass

    def advance(self, boundary: StepBoundary, most: int | None) -> Status | None:
        begin, buffer = self._corrected.stepper, self.buffer
        narrow, last = begin.precision.narrow, self.clock.at(self.clock.count - 1)
        times = buffer.until(last, self._rows if narrow else min(self._rows, _WIDE_ROWS))
        states = self._form.states(begin.system, begin.precision, times, begin.time)
        buffer.take(self._corrected.samples(buffer.count, times, states), boundary)
        self.settle(boundary, times[-1])
        return Status.FINISHED if buffer.complete else None

    def settle(self, boundary: StepBoundary, moment: Scalar) -> None:
        self.progress.time = float(moment) * self.clock.unit


@solves(METHODS["closed_form"])
@dataclass(frozen=True)
class InClosedForm(Algorithm):
    """Solves a free body or a heavy symmetric top in theta functions."""

    form: ClosedForm
    own_errors = False

    @classmethod
    def of(cls, scene: Scene, system: System, *, driven: bool) -> InClosedForm:
        integrator = scene.config.integrator
        try:
            form = closed_form_of(scene, driven=driven)
        except NoClosedForm as none:
            raise Unsuitable(f'but {none}; allowed here: "taylor"') from None
        if integrator.hold_invariants is True:
            raise Unsuitable("which holds its invariants by itself; set hold_invariants = false")
        if not system.formulation.variables.in_closed_form:
            given = integrator.formulation
            raise Unsuitable(f'which gives rates and quaternions, not {given}; set formulation = "auto"')
        return cls(form)

    @property
    def title(self) -> str:
        return self.form.title

    def stepper(
        self, system: System, precision: Precision, tolerance: Scalar | None, start: Scalar, log: EventLog
    ) -> Stepper:
        return AtStart(system, precision, start)

    def solver(self, corrected: CorrectedStepper, pacing: Pacing) -> Solver:
        return ClosedFormSolver(self.form, corrected, pacing)
