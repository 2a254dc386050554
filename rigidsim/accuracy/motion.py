"""A whole motion as its beginning shows it: its steps, their cost, and the growth of its errors; and the
references against which its solutions are held.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from rigidsim.accuracy.error_law import closed_form_if_any, stable_law
from rigidsim.accuracy.estimates.estimate import Estimate, estimate_errors
from rigidsim.accuracy.setting import Setting, epsilon
from rigidsim.accuracy.trial import compactly, trial_scene
from rigidsim.model.load import Load
from rigidsim.scene.arithmetic import working_bits
from rigidsim.scene.choices import DEFAULT_FORMULATION, variables_named
from rigidsim.scene.config import Experiment
from rigidsim.solve.assembly import assemble
from rigidsim.solve.corrected_stepper import CorrectedStepper
from rigidsim.solve.problem import InitialValueProblem, prepare_scene
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.stepper import Stepper

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
    chunk, skip = 1 if near_end else chunk, skip or stepper.take
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


def growth_of(prepared: InitialValueProblem, step: float, corrected: CorrectedStepper) -> Estimate:
    """How a motion amplifies errors: their estimate over its first steps, of a mean length in internal units
    (takes some 30 ms in double precision).
    """
    clock = prepared.clock
    steps = min(_FOLLOWED, math.ceil((float(clock.at(clock.count - 1)) - float(clock.start)) / step))
    begin, last = float(prepared.scene.start), float(prepared.scene.samples.last)
    reached = begin + math.copysign(min(abs(steps * step * clock.unit), abs(last - begin)), last - begin)
    found = estimate_errors(prepared, steps, reached, corrected=corrected)
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
        return stable_law(level, steps, self.rate, self.seconds) * self.growth.amplified(self.seconds)

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
    corrected = assemble(prepared).steps()
    pilot = run_pilot(corrected.stepper, prepared.clock, corrected.skip)
    form, _ = closed_form_if_any(scene, driven=bool(loads))
    return KnownMotion(
        steps=pilot.whole,
        rate=float(prepared.system.rate_bound),
        seconds=abs(float(scene.samples.last - scene.start)),
        growth=growth_of(prepared, pilot.step, corrected),
        holds=any(i.name != "energy_balance" for i in prepared.system.invariants),
        exact=form.method if form else "",
    )


# --- references ---------------------------------------------------------------------------------------------
#
# A reference never shares the arithmetic of what it judges. It is the closed form with more digits, or an
# integration with more digits, or, where both would take too long, an equal in other variables. All solutions
# go along the same motion, which amplifies their errors alike, however strongly: the error of one is to its
# difference from another as their errors per step are, but for scatter.

LEAST_DIGITS = 50
"""Least digits of a multi-precision reference: 16 beyond quadruple precision."""
_SPARE_DIGITS = 20  # of a reference for digits, beyond theirs
MANY_STEPS = 1e5
"""Steps that take a second in extended precision, and a minute in quadruple."""
_CLEARLY = 0.01  # error of a reference with many digits, over the accuracy or the run's errors per step


def scatter_of(setting: Setting, steps: float) -> float:
    """Ratio of two settings' errors over the ratio per step, after so many steps: more per square
    root of these if truncation errors add up while rounding errors walk at random.
    """
    return 100.0 if setting.tolerance is None else 100.0 + 10.0 * math.sqrt(steps)


def references(setting: Setting, motion: KnownMotion, accuracy: float) -> list[Setting]:
    """References for a whole run, from cheap to costly, as good as an accuracy (rad) needs."""
    many = motion.steps > MANY_STEPS
    found: list[str | int] = []
    if setting.bits <= 53 and setting.has_steps and setting.tolerance is not None and many:
        found.append("double")
    if setting.bits <= 53 and not (many and motion.exact):
        found.append("extended")
    costly: list[Setting] = []
    if motion.exact and (setting.has_steps or many):
        # it costs the same at any horizon; a closed form too long for steps is checked with many more digits
        digits = "quadruple" if setting.bits <= 64 and setting.has_steps else digits_beyond(setting.precision)
        costly.append(Setting(digits, method=motion.exact))
    elif not many:
        found += ["quadruple"] * (setting.bits <= 64)
        found.append(digits_beyond(setting.precision))
    else:
        other = variables_named(setting.formulation).checked_by
        costly.append(replace(setting, formulation=other, tolerance=None))
    finer = [stepped_reference(precision, motion, motion.steps) for precision in found]
    return [*(_only_as_good(one, setting, motion, accuracy) for one in finer), *costly]


def digits_beyond(precision: str | int) -> int:
    """Digits of a reference for a precision."""
    return max(LEAST_DIGITS, int(working_bits(precision) * 0.302) + _SPARE_DIGITS)


def stepped_reference(
    precision: str | int,
    motion: KnownMotion,
    steps: float,
    formulation: str = DEFAULT_FORMULATION,
) -> Setting:
    """An integration at a precision's epsilon. Invariants are projected where that is right: with more digits
    than 64 bits rounding doesn't matter, nor does it over a short way in double precision.
    """
    projected = working_bits(precision) <= 64 and (precision != "double" or steps > MANY_STEPS)
    return Setting(precision, formulation=formulation, hold_invariants=projected and motion.holds)


def _only_as_good(reference: Setting, setting: Setting, motion: KnownMotion, accuracy: float) -> Setting:
    """A multi-precision reference with no more accuracy than needed."""
    if reference.bits <= 64:
        return reference
    tolerance = _CLEARLY * accuracy / max(1.0, motion.error(1.0))
    tolerance /= scatter_of(replace(reference, tolerance=1.0), motion.steps)
    tolerance = min(tolerance, _CLEARLY * setting.level)
    return replace(reference, tolerance=tolerance) if tolerance > epsilon(reference.precision) else reference
