"""Assembly of what solves a prepared scene: stepper, effects, evaluation."""

from rigidsim.solve.compiled import interruptible
from rigidsim.solve.corrected_stepper import CorrectedStepper
from rigidsim.solve.driver import Driver
from rigidsim.solve.effects.angle_wrapping import AngleWrapping
from rigidsim.solve.effects.charts import Charts
from rigidsim.solve.effects.effect import Effect, registered_effects
from rigidsim.solve.effects.held_invariants import HeldInvariants
from rigidsim.solve.effects.waypoints import Waypoints
from rigidsim.solve.effects.whole_time import WholeTime
from rigidsim.solve.evaluate import Evaluator
from rigidsim.solve.events import EventLog
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.projection import Projection, steps_between
from rigidsim.solve.sampler import MEASURED, Check, Pacing, Progress, SampleReceiver
from rigidsim.solve.solvers.algorithm import Algorithm
from rigidsim.solve.solvers.taylor import Taylor
from rigidsim.solve.stepper import Mark
from rigidsim.solve.taylor_stepper import TaylorStepper


class Assembly:
    """The parts of an integration; ``corrected`` stands at the start where the algorithm takes no steps."""

    def __init__(self, prepared: InitialValueProblem) -> None:
        system, precision = prepared.system, prepared.precision
        self.prepared = prepared
        self.wrapping = AngleWrapping(
            system.angle_states, precision, prepared.scene.context, system.angle_unit
        )
        self.log = EventLog(system.crossings, lambda: self.wrapping.angles)
        self.corrected = self._stepping(prepared.algorithm)
        self.stepper = self.corrected.stepper
        self.evaluator = Evaluator(system, precision, self.wrapping, has_steps=prepared.has_steps)

    def steps(self) -> CorrectedStepper:
        """What takes steps, by Taylor series where the algorithm has none, for pilots."""
        return self.corrected if self.prepared.has_steps else interruptible(lambda: self._stepping(Taylor()))

    @property
    def order(self) -> int | None:
        """Order of the Taylor series; None without one."""
        return int(self.stepper.integrator.order) if isinstance(self.stepper, TaylorStepper) else None

    def driver(
        self,
        receiver: SampleReceiver,
        check: Check = lambda _: None,
        start: Mark | None = None,
        pacing: Pacing = MEASURED,
        most_steps: int | None = None,
        progress: Progress | None = None,
    ) -> Driver:
        """What takes the scene through its samples."""
        clock, angles = self.prepared.clock, self.evaluator.angles
        return Driver(self.corrected, clock, angles, receiver, check, start, pacing, most_steps, progress)

    def _stepping(self, algorithm: Algorithm) -> CorrectedStepper:
        prepared = self.prepared
        system, precision, start = prepared.system, prepared.precision, prepared.clock.start
        stepper = algorithm.stepper(system, precision, prepared.tolerance, start, self.log)
        # in the order in which they are applied
        effects: list[Effect] = []
        whole = WholeTime() if WholeTime.suits(stepper) else None
        if whole is not None:
            effects.append(whole)
        if self.wrapping.positions:
            effects.append(self.wrapping)
        if prepared.holds_invariants:
            late = prepared.holds_late
            projection = Projection(system, precision, start, late=late)
            effects.append(HeldInvariants(projection, steps_between(precision, late=late)))
        if system.partner is not None and stepper.changes_charts:
            charts = Charts(system, system.partner, precision, self.wrapping, whole)
            charts.watch(stepper)
            effects.append(charts)
        effects += registered_effects(system, precision)
        return CorrectedStepper(stepper, [*effects, Waypoints()])


def assemble(prepared: InitialValueProblem) -> Assembly:
    """Compile everything that a prepared scene needs from its start; Ctrl-C is heeded meanwhile."""
    return interruptible(lambda: Assembly(prepared))
