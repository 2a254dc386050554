"""Assembly of what solves a prepared scene: stepper, effects, evaluation."""

from dataclasses import dataclass

from rigidsim.solve.compiled import interruptible
from rigidsim.solve.corrected_stepper import STRIDE, CorrectedStepper
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
from rigidsim.solve.stepper import Mark, Stepper
from rigidsim.solve.taylor_stepper import TaylorStepper


@dataclass
class Assembly:
    """The parts of an integration; ``corrected`` stands at the start where the algorithm takes no steps."""

    prepared: InitialValueProblem
    stride: int
    wrapping: AngleWrapping
    log: EventLog
    corrected: CorrectedStepper
    evaluator: Evaluator

    def steps(self) -> CorrectedStepper:
        """What takes steps, by Taylor series where the algorithm has none, for pilots."""
        if self.prepared.has_steps:
            return self.corrected
        return interruptible(lambda: _stepping(self.prepared, Taylor(), self.wrapping, self.log, self.stride))

    @property
    def stepper(self) -> Stepper:
        """The stepper within ``corrected``."""
        return self.corrected.stepper

    @property
    def order(self) -> int | None:
        """Order of the Taylor series; None without one."""
        return int(self.stepper.integrator.order) if isinstance(self.stepper, TaylorStepper) else None


def assemble(prepared: InitialValueProblem, *, stride: int = STRIDE) -> Assembly:
    """Compile everything that a prepared scene needs from its start; Ctrl-C is heeded meanwhile."""
    return interruptible(lambda: _assembled(prepared, stride))


def _assembled(prepared: InitialValueProblem, stride: int) -> Assembly:
    system, precision = prepared.system, prepared.precision
    wrapping = AngleWrapping(system.angle_states, precision, prepared.scene.context, system.angle_unit)
    log = EventLog(
        [c.stop for c in system.crossings],
        [c.impossible for c in system.crossings],
        [c.leaves_range for c in system.crossings],
        lambda: wrapping.angles,
    )
    corrected = _stepping(prepared, prepared.algorithm, wrapping, log, stride)
    evaluator = Evaluator(system, precision, wrapping, has_steps=prepared.has_steps)
    return Assembly(prepared, stride, wrapping, log, corrected, evaluator)


def _stepping(
    prepared: InitialValueProblem, algorithm: Algorithm, wrapping: AngleWrapping, log: EventLog, stride: int
) -> CorrectedStepper:
    system, precision, start = prepared.system, prepared.precision, prepared.clock.start
    stepper = algorithm.stepper(system, precision, prepared.tolerance, start, log)
    # in the order in which they are applied
    effects: list[Effect] = []
    whole = WholeTime() if WholeTime.suits(stepper) else None
    if whole is not None:
        effects.append(whole)
    if wrapping.positions:
        effects.append(wrapping)
    if prepared.holds_invariants:
        late = prepared.holds_late
        projection = Projection(system, precision, start, late=late)
        effects.append(HeldInvariants(projection, steps_between(precision, late=late)))
    if system.partner is not None and stepper.changes_charts:
        charts = Charts(system, system.partner, precision, wrapping, whole)
        charts.watch(stepper)
        effects.append(charts)
    effects += registered_effects(system, precision)
    return CorrectedStepper(stepper, [*effects, Waypoints()], stride=stride)


def sampler(
    prepared: InitialValueProblem,
    parts: Assembly,
    receiver: SampleReceiver,
    check: Check = lambda _: None,
    start: Mark | None = None,
    pacing: Pacing = MEASURED,
    most_steps: int | None = None,
    progress: Progress | None = None,
) -> Driver:
    """What takes a prepared scene through its samples."""
    corrected, angles = parts.corrected, parts.evaluator.angles
    return Driver(corrected, prepared.clock, angles, receiver, check, start, pacing, most_steps, progress)
