"""Samples straight from a closed form: no steps, and the same cost at any horizon."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigidsim.model.system import System
from rigidsim.scene.choices import METHODS
from rigidsim.scene.scene import Scene
from rigidsim.solve.closed_form import ClosedForm, NoClosedForm, closed_form_of
from rigidsim.solve.events import EventLog
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.solvers.algorithm import Algorithm, Unsuitable, solves
from rigidsim.solve.stepper import Mark, SamplesWithin, Stepper


class ClosedFormStepper(Stepper):
    """Takes samples of a motion whose states are known at all times; it counts no steps, and goes on from
    its start alone.
    """

    def __init__(self, form: ClosedForm, system: System, precision: Precision, start: Scalar) -> None:
        super().__init__(system, precision)
        self._form, self._start, self._time = form, start, start
        self._state = precision.array(system.initial)
        self.smallest = math.inf

    @property
    def time(self) -> Scalar:
        return self._time

    @property
    def state(self) -> np.ndarray:
        return self._state

    def step(self) -> bool:
        length = (self.destination or 0.0) - float(self._start)
        self._time = self._time + self.precision.of_double(length or 1.0)
        return True

    def take(self, count: int, samples: SamplesWithin | None = None) -> bool:
        if samples is None:
            return self.step()
        samples.states = self._form.states(self.system, self.precision, samples.times, self._start)
        self._time = samples.times[-1]
        return True

    def mark(self) -> Mark:
        return Mark((self._start, self.precision.of_double(0.0)), self._state)

    def back_to(self, mark: Mark) -> None:
        self._time = self._start


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
        return ClosedFormStepper(self.form, system, precision, start)
