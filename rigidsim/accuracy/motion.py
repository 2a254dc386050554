"""Forecast of a whole motion from its beginning: its steps, their cost, and the growth of its errors."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rigidsim.accuracy.error_law import attitude_error, closed_form_if_any
from rigidsim.accuracy.estimates.estimate import Estimate, estimate_errors
from rigidsim.accuracy.setting import Setting, epsilon
from rigidsim.accuracy.trial import compactly, trial_scene
from rigidsim.model.load import Load
from rigidsim.scene.config import Experiment
from rigidsim.solve.problem import InitialValueProblem, prepare_scene
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.stepper import Stepper
from rigidsim.solve.switching.stepper import stepper_of
from rigidsim.solve.taylor_stepper import TaylorStepper

PILOT_STEPS = 20_000
"""Pilot steps in double precision at its epsilon: some tens of milliseconds."""
_FOLLOWED = 900
"""Steps whose errors are followed to see how the motion amplifies them: so many need no code of their own."""
_FEWEST_STEPS = 16  # for the law of rounding, which is one of many steps


@dataclass(frozen=True)
class Pilot:
    """A motion's first steps: those taken, their mean length (internal time), those that the whole motion
    will take, and the CPU time of each.
    """

    taken: int
    step: float
    whole: float
    seconds_per_step: float


def run_pilot(
    stepper: Stepper,
    clock: SampleClock,
    skip: Callable[[int], bool] | None = None,
    *,
    steps: int = PILOT_STEPS,
    seconds: float = math.inf,
    chunk: int = 64,
    largest_chunk: int = 64,
    warming: int = 0,
) -> Pilot:
    """Take the first steps of a motion, chunk by chunk, each twice as long up to the largest; ``steps`` are
    the most, give or take a chunk, and none come after the last sample. ``skip`` takes steps with what is
    done between.
    """
    # past the last of its pieces a motion may be one in which nothing happens, with steps of any length
    near_end = skip is not None and stepper.system.pieces is not None
    chunk, skip = 1 if near_end else chunk, skip or stepper.skip
    begin, end = float(clock.start), float(clock.at(clock.count - 1))
    going = not warming or skip(warming)
    warm, spent = stepper.steps, 0.0
    while going:
        started = time.process_time()
        going = skip(chunk) and stepper.largest > 0
        spent += time.process_time() - started
        going = going and spent < seconds and stepper.steps < steps and float(stepper.time) < end
        chunk = min(2 * chunk, largest_chunk)
        if near_end and going:
            left = (end - float(stepper.time)) / (float(stepper.time) - begin)
            chunk = min(chunk, max(1, math.ceil(left * stepper.steps)))
    done = max(float(stepper.time) - begin, 1e-300)
    taken = max(stepper.steps, 1)
    return Pilot(
        taken=taken,
        step=done / taken,
        whole=max(1.0, stepper.steps * (end - begin) / done),
        seconds_per_step=spent / max(stepper.steps - warm, 1),
    )


def growth_of(prepared: InitialValueProblem, step: float, stepper: TaylorStepper | None = None) -> Estimate:
    """How a motion amplifies errors: their estimate over its first steps, of a mean length in internal units
    (takes some 30 ms).

    Args:
        stepper: one of the motion in double precision, if there is one.
    """
    clock = prepared.clock
    steps = min(_FOLLOWED, math.ceil((float(clock.at(clock.count - 1)) - float(clock.start)) / step))
    begin, last = float(prepared.scene.start), float(prepared.scene.samples.last)
    reached = begin + math.copysign(min(abs(steps * step * clock.unit), abs(last - begin)), last - begin)
    found = estimate_errors(prepared, steps, reached, stepper=stepper)
    assert found is not None
    return found


@dataclass(frozen=True)
class KnownMotion:
    """What is known of a motion before its long run; ``rate`` is the bound of its angular velocity, rad/s."""

    steps: float
    rate: float
    seconds: float
    growth: Estimate
    holds: bool
    exact: str

    def error(self, level: float) -> float:
        """Attitude error at the end, rad, for random errors of size ``level`` at each step, which the motion
        amplifies.
        """
        steps = max(int(self.steps), _FEWEST_STEPS)
        return attitude_error(level, steps, self.rate, self.seconds, self.growth.amplified(self.seconds))

    def rounding(self, precision: str | int) -> float:
        """Attitude error at the end from rounding, rad."""
        return self.error(epsilon(precision))

    def labels(self, precision: str | int) -> float:
        """How far the body turns, rad, in the rounding of the last sample's time."""
        return epsilon(precision) / 2 * self.rate * self.seconds


def motion_of(experiment: Experiment, *, loads: Sequence[Load] = ()) -> KnownMotion:
    """Examine the beginning of a motion (some tens of milliseconds)."""
    scene = trial_scene(experiment, Setting())
    prepared = compactly(prepare_scene(experiment, scene, loads=loads))
    stepper = stepper_of(prepared.system, prepared.precision, None, prepared.clock.start)
    pilot = run_pilot(stepper, prepared.clock)
    form, _ = closed_form_if_any(scene, driven=bool(loads))
    return KnownMotion(
        steps=pilot.whole,
        rate=float(prepared.system.rate_bound),
        seconds=abs(float(scene.samples.last - scene.start)),
        growth=growth_of(prepared, pilot.step, stepper),
        holds=any(i.name != "energy_balance" for i in prepared.system.invariants),
        exact=form.method if form else "",
    )
