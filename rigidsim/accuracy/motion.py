"""Forecast of a whole motion from its beginning: its steps, their cost, and the growth of its errors."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rigidsim.accuracy.error_law import attitude_error, exact_method
from rigidsim.accuracy.setting import Setting, epsilon
from rigidsim.accuracy.trial import compactly, trial_scene
from rigidsim.model.load import Load
from rigidsim.scene.config import Experiment
from rigidsim.solve.error_growth import Growth, measure_growth
from rigidsim.solve.problem import double_twin, prepare_scene
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.stepper import Stepper
from rigidsim.solve.switching.stepper import stepper_of

PILOT_STEPS = 20_000
"""Pilot steps in double precision at its epsilon: some tens of milliseconds."""
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


@dataclass(frozen=True)
class KnownMotion:
    """What is known of a motion before its long run; ``rate`` is the bound of its angular velocity, rad/s."""

    steps: float
    rate: float
    seconds: float
    growth: Growth
    holds: bool
    exact: str

    def error(self, level: float) -> float:
        """Attitude error at the end, rad, for random errors of size ``level`` at each step, which the motion
        amplifies.
        """
        steps = max(int(self.steps), _FEWEST_STEPS)
        return attitude_error(1.0, steps, self.rate, self.seconds, self.growth) * level

    def rounding(self, precision: str | int) -> float:
        """Attitude error at the end from rounding, rad."""
        return self.error(epsilon(precision))


def motion_of(
    experiment: Experiment, *, loads: Sequence[Load] = (), pilot_steps: int = PILOT_STEPS
) -> KnownMotion:
    """Examine the beginning of a motion (some tens of milliseconds)."""
    scene = trial_scene(experiment, Setting())
    prepared = compactly(prepare_scene(experiment, scene, loads=loads))
    clock, precision = prepared.clock, prepared.precision
    begin, end = float(clock.start), float(clock.at(clock.count - 1))
    pilot = run_pilot(stepper_of(prepared.system, precision, None, clock.start), clock, steps=pilot_steps)
    return KnownMotion(
        steps=pilot.whole,
        rate=float(prepared.system.rate_bound),
        seconds=float(scene.samples.last - scene.start),
        growth=measure_growth(double_twin(prepared), precision, begin, end),
        holds=any(i.name != "energy_balance" for i in prepared.system.invariants),
        exact=exact_method(scene, driven=bool(loads))[0],
    )
