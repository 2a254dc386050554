"""An ``accuracy`` that a config asks for: the cheapest setting that keeps it is chosen before the run, or the
most averaged model within ``accuracy_axis``, and what the run really kept is certified after it.

Settings are tried over the motion's beginning, which is the whole of a short run, against a better one; what
wasn't tried follows from what was: errors of rounding are in proportion to the precision's epsilon, those of
the series to the tolerance. The end follows from the beginning by laws: errors of rounding grow like t^1.5
(Brouwer 1937), or t with projected invariants; errors of the series at most like t^2; both times the motion's
own growth. A choice is a forecast. Choices depend on counts alone, never on a clock, so that a config always
chooses the same.

A certificate compares the run with an independent, better solution: the certified error is the largest
difference found, plus a margin for the times between those compared, plus the reference's own error.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import mpmath
import numpy as np

from rigidsim.accuracy.comparison import (
    TrialProgress,
    angles_between,
    compactly,
    compared_names,
    distances_between,
    exact_times,
    finished_trial,
    parts_of,
    rows_to_compare,
    side_by_side,
    trial_scene,
    try_setting,
)
from rigidsim.accuracy.estimates import CLOSED_FORM, Estimate, closed_form_if_any, estimate_errors, stable_law
from rigidsim.accuracy.modelling import Unmeasured, measure_modelling
from rigidsim.accuracy.setting import (
    STEP_SECONDS,
    Setting,
    asked_of_attitude,
    cost,
    epsilon,
    leaves_choice,
    setting_of,
    wanted,
)
from rigidsim.errors import ConfigError, Problem
from rigidsim.model.load import Load
from rigidsim.scene.arithmetic import working_bits
from rigidsim.scene.choices import (
    AUTO,
    DEFAULT_FORMULATION,
    FULL,
    ORBIT_AVERAGED,
    SPIN_AVERAGED,
    attitude_variables,
    variables_named,
)
from rigidsim.scene.config import Experiment
from rigidsim.scene.readable import span_text
from rigidsim.scene.scene import build_scene
from rigidsim.scene.schema import LARGEST_DIGITS
from rigidsim.solve.assembly import assemble
from rigidsim.solve.corrected_stepper import CorrectedStepper
from rigidsim.solve.problem import InitialValueProblem, prepare, prepare_scene

if TYPE_CHECKING:
    import xarray

# --- a motion as its beginning shows it ---------------------------------------------------------------------

PILOT_STEPS = 20_000
"""Pilot steps in double precision at its epsilon: some tens of milliseconds."""
_FOLLOWED = 900
"""Steps whose errors are followed to see how the motion amplifies them; this many need no separate code."""
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
    prepared: InitialValueProblem,
    corrected: CorrectedStepper,
    *,
    steps: int = PILOT_STEPS,
    seconds: float = math.inf,
    chunk: int = 64,
    largest_chunk: int = 64,
) -> Pilot:
    """Take the first steps of a motion, chunk by chunk, each twice as long up to the largest; ``steps`` are
    the most, give or take a chunk, and none come after the last sample. Those taken before aren't timed.
    """
    stepper, clock = corrected.stepper, prepared.clock
    # past the last of its pieces a motion may be one in which nothing happens, with steps of any length
    near_end = stepper.system.pieces is not None
    begin, end = float(clock.start), float(clock.at(clock.count - 1))
    warm, spent, going, chunk = stepper.steps, 0.0, True, 1 if near_end else chunk
    while going:
        started = time.process_time()
        going = corrected.skip(chunk) and stepper.largest > 0
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
    pilot = run_pilot(prepared, corrected)
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
_FINER = 0.01  # error of a reference with many digits, over the accuracy or the run's errors per step


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
    tolerance = _FINER * accuracy / max(1.0, motion.error(1.0))
    tolerance /= scatter_of(replace(reference, tolerance=1.0), motion.steps)
    tolerance = min(tolerance, _FINER * setting.level)
    return replace(reference, tolerance=tolerance) if tolerance > epsilon(reference.precision) else reference


# --- the choice ---------------------------------------------------------------------------------------------

_LADDER: tuple[str | int, ...] = ("double", "extended", "quadruple", 50, 75, 100, 150, 200, LARGEST_DIGITS)
_LOOSEST = 4  # negative power of ten of the loosest tolerance

# With these 199 of 200 random runs kept what they were asked for, and 96 of 100 cost at most twice the
# cheapest setting of a full search (experiments/README.md).
_SAFETY, _OPTIMISTIC, _OPTIMISTIC_LONG, _PROGRESS = 3.0, 0.6, 3.0, 0.2
"""Ratio of the accuracy to the largest acceptable forecast; ratios of forecast to accuracy up to which a
setting is tried if the next precision costs ten times as much, of a short run, and of a long one, which
mostly does better than its beginning forecasts; ratio to a failed setting's forecast that the next one must
promise.
"""
_TIMES = 200  # compared
_BASE_TOLERANCE = 1e-8  # of the trial that all other tolerances are first forecast from
_SATURATED = 0.05  # rad: past which errors are no longer small, and don't scale
_NEGLIGIBLE = 20.0  # ratio of accuracy to round-off law from which rounding needn't be measured
_EXPONENTIAL, _POWER = 5.0, 2.0  # powers of time: past which growth is exponential; largest of any other
_SERIES, _PROJECTED, _ROUNDING = 1.2, 1.0, 1.5
"""Least powers of time for errors of series, and of rounding with projected invariants and without."""
_LARGEST_EXPONENT = 600.0  # keeps products within doubles


@dataclass(frozen=True)
class Choice:
    """A chosen setting and the attitude error that is forecast for its end, rad."""

    setting: Setting
    forecast: float
    why: str
    known: KnownMotion


def chosen(
    experiment: Experiment,
    *,
    loads: Sequence[Load] = (),
    beyond: Setting | None = None,
    report: TrialProgress | None = None,
) -> tuple[Experiment, Choice | None]:
    """The experiment with the settings that its ``accuracy`` asks for written into its text, so that it means
    the same run again, and the choice: beyond one that was run and missed the accuracy only more costly ones
    are considered. Keys that the config gives stay; where these are precision, tolerance and method, the run
    is only certified. Raises ``ConfigError``, with what can be reached.
    """
    integrator = experiment.config.integrator
    accuracy = wanted(experiment)
    if accuracy is None or not leaves_choice(experiment):
        return experiment, None
    key, _ = asked_of_attitude(experiment) or ("accuracy", accuracy)
    try:
        choice = choose(experiment, accuracy, loads=loads, beyond=beyond, report=report, key=key)
    except ConfigError as error:
        raise error.at(experiment.source) from None
    keys, given = choice.setting.keys(), integrator.model_fields_set
    return experiment.with_overrides(
        [f"integrator.{k}={v}" for k, v in keys.items() if k not in given]
    ), choice


def choose(
    experiment: Experiment,
    accuracy: float,
    *,
    loads: Sequence[Load] = (),
    beyond: Setting | None = None,
    report: TrialProgress | None = None,
    key: str = "accuracy",
) -> Choice:
    """The cheapest setting whose forecast keeps an attitude accuracy (rad, at the end), within what the
    config leaves open. Raises ``ConfigError`` if none does.
    """
    forecasts = _Forecasts(experiment, accuracy, loads, report)
    candidates = sorted(_candidates(experiment, forecasts.motion), key=forecasts.cost)
    most = accuracy / _SAFETY
    optimistic = accuracy * (_OPTIMISTIC_LONG if forecasts.part < 1 else _OPTIMISTIC)
    if beyond is not None:
        optimistic, most = 0.0, min(most, _PROGRESS * forecasts.error(beyond))
        candidates = [s for s in candidates if forecasts.cost(s) > forecasts.cost(beyond)]
    last = {s.precision: s for s in candidates if s.has_steps}  # past which only another precision is better
    while True:
        limits = ((s, optimistic if s in last.values() else most) for s in candidates)
        found = next((s for s, limit in limits if forecasts.error(s) <= max(limit, most)), None)
        if found is None:
            reached = min(candidates, key=forecasts.error, default=None)
            raise ConfigError(Problem(f"[integrator] {key}", _unreachable(forecasts, reached, accuracy)))
        if not forecasts.measure(found):  # it was tried, or is too dear to be
            why = forecasts.why(found)
            if (error := forecasts.error(found)) > most:
                why += "; the next precision costs ten times as much"
            return Choice(found, error, why, forecasts.motion)


def _candidates(experiment: Experiment, motion: KnownMotion) -> list[Setting]:
    """All settings that the config leaves open."""
    integrator = experiment.config.integrator
    given = integrator.model_fields_set
    formulation = attitude_variables(integrator.formulation)
    precisions = (integrator.precision,) if "precision" in given else _LADDER
    held = [integrator.hold_invariants is True] if "hold_invariants" in given else [False, motion.holds]
    found: list[Setting] = []
    if motion.exact and (integrator.method == motion.exact or "method" not in given):
        open_ = variables_named(formulation).in_closed_form and not experiment.config.events
        open_ = open_ and not ("hold_invariants" in given and held[0])
        found += [Setting(p, method=motion.exact) for p in precisions if p != "extended" and open_]
    if not integrator.has_steps:
        return found
    loosest = _LOOSEST
    for precision in precisions:
        finest = math.floor(-math.log10(epsilon(precision)))
        tolerances = [None, *(float(f"1e-{d}") for d in range(loosest, finest + 1))]
        if "tolerance" in given:
            tolerances = [setting_of(experiment).tolerance]
        loosest = finest - 2  # what is looser costs less in the precision before
        every = ((tolerance, hold) for tolerance in tolerances for hold in dict.fromkeys(held))
        found += [Setting(precision, t, formulation, hold, integrator.method) for t, hold in every]
    return found


def _unreachable(forecasts: _Forecasts, best: Setting | None, accuracy: float) -> str:
    if best is None:
        return f"given {accuracy:.3g} rad, but the other keys of [integrator] leave no setting to choose from"
    reached = forecasts.error(best)
    what = f"would be right to about {reached:.2g} rad" if reached < 1 else "would keep no digit"
    text = (
        f"given {accuracy:.3g} rad at the end, which no setting open to it reaches; the best, {best.title}, "
        f"{what}, in about {span_text(forecasts.cost(best) * STEP_SECONDS, 2)}"
    )
    if (rate := forecasts.motion.growth.growth_rate) > 0:
        text += f"; errors here grow e-fold every {span_text(1 / rate)}, so choose a nearer end"
    return text + "; ask for less, or leave precision, tolerance and method open"


class _Forecasts:
    """Errors of settings at a run's end, rad, measured if that is cheap, otherwise forecast from what was
    measured over the first ``part`` of the run.
    """

    def __init__(
        self,
        experiment: Experiment,
        accuracy: float,
        loads: Sequence[Load],
        report: TrialProgress | None,
    ) -> None:
        self._accuracy, self.motion = accuracy, motion_of(experiment, loads=loads)
        self.part, scene = min(1.0, PILOT_STEPS / self.motion.steps), build_scene(experiment)
        start, self._samples = float(scene.start), scene.samples.count
        # each is a double, so that every precision from double on means the same moment by it
        grid = start + (float(scene.samples.last) - start) * self.part * np.arange(1, _TIMES + 1) / _TIMES
        times = [mpmath.mpf(float(t)) for t in grid]
        self._trial = cache(lambda setting: finished_trial(experiment, setting, times, loads, report))
        self._measured: dict[Setting, float] = {}

    def cost(self, setting: Setting) -> float:
        """See ``rigidsim.accuracy.setting``."""
        return cost(setting, self.motion.steps, self._samples)

    def error(self, setting: Setting) -> float:
        """Forecast error; measures what it needs."""
        if not setting.has_steps:
            return CLOSED_FORM * epsilon(setting.precision) + self.motion.labels(setting.precision)
        rounding = self.motion.rounding(setting.precision)
        if not self._obvious(setting):
            base = replace(setting, precision="double", tolerance=None)
            rounding = self._tried(base) * epsilon(setting.precision) / epsilon(base.precision)
        return rounding if setting.tolerance is None else max(rounding, self._series(setting))

    def measure(self, setting: Setting) -> bool:
        """Try a setting itself, if worthwhile; False if nothing new can be learnt."""
        loose = setting.has_steps and setting.tolerance is not None
        if not loose or setting in self._measured or setting.bits > 53:
            return False
        self._tried(setting)
        return True

    def why(self, setting: Setting) -> str:
        """Origin of the forecast, for the summary."""
        if not setting.has_steps:
            return "its solution in closed form costs less than its steps"
        if setting.tolerance is None and self._obvious(setting):
            return "by the law of rounding errors"
        extent = "whole run" if self.part >= 1 else f"first {span_text(self.part * self.motion.seconds)}"
        if setting.bits <= 53:
            return f"tried over the {extent} against a better solution"
        return f"from trials in double precision over the {extent}, whose errors shrink with epsilon"

    def _obvious(self, setting: Setting) -> bool:
        """Whether rounding is clearly negligible."""
        return self.motion.rounding(setting.precision) * _NEGLIGIBLE <= self._accuracy

    def _series(self, setting: Setting) -> float:
        """Error of a tolerance: measured, or in proportion to the nearest one measured."""
        if setting in self._measured:
            return self._measured[setting]
        self._tried(replace(setting, precision="double", tolerance=_BASE_TOLERANCE))
        alike = [s for s in self._measured if s.tolerance and s.hold_invariants == setting.hold_invariants]
        step = setting.step_tolerance
        nearest = min(alike, key=lambda s: abs(math.log(s.step_tolerance / step)))
        return self._measured[nearest] * step / nearest.step_tolerance

    def _tried(self, setting: Setting) -> float:
        """Error at the run's end, from that over the part tried, against a better setting: in double
        precision if rounding is negligible.
        """
        if setting not in self._measured:
            precision = "double" if self._obvious(setting) else "extended"
            steps = self.motion.steps * self.part
            better = stepped_reference(precision, self.motion, steps, setting.formulation)
            trial, reference = self._trial(setting), self._trial(better)
            self._measured[setting] = math.inf
            if trial is not None and reference is not None:
                errors = angles_between(trial.attitudes, reference.attitudes)
                self._measured[setting] = self._at_end(errors, setting)
        return self._measured[setting]

    def _at_end(self, errors: np.ndarray, setting: Setting) -> float:
        """Error from the largest over the first quarter of a trial and over all of it."""
        late, early = float(errors.max()), float(errors[: len(errors) // 4].max())
        if late > _SATURATED:  # only the law says how large it would be
            return max(late, self.motion.error(setting.level))
        late = max(late, epsilon(setting.precision))
        if self.part >= 1:
            return late
        growth, longer = math.log(late / max(early, late * 1e-300)), 1 / self.part
        power = growth / math.log(4)
        if power > _EXPONENTIAL:
            return late * math.exp(min((longer - 1) / 0.75 * growth, _LARGEST_EXPONENT))
        law = _SERIES if setting.tolerance else _PROJECTED if setting.hold_invariants else _ROUNDING
        return late * longer ** max(law, min(power, _POWER))


# --- the certificate ----------------------------------------------------------------------------------------

# With these no certificate of 300 random scenes was exceeded by the true error, and 199 of 200 runs were
# certified as they asked (``experiments/accuracy_certificates.py``).
_CERTIFIED_TIMES, _CLOSED_TIMES = 4096, 129
"""Largest number of times compared; the latter for a closed form, which takes milliseconds per sample."""
_MARGIN, _PICKED_MARGIN, _PEER_MARGIN = 1.25, 2.0, 5.0
"""Factors on the largest difference: if all samples were compared; if only the fastest of each stretch, since
errors along the motion are largest where it is fastest; if the reference is no better than the run.
"""
_INCOMPARABLE = 0.5  # difference (rad) past which all digits are gone
_AS_BAD = 3.0  # error of a reference no better than the run, over the difference


@dataclass(frozen=True)
class Certificate:
    """Result of a certification: bound of the attitude error (rad) at the times compared, the difference
    found at the end, and a bound of the position error (m); None if no accuracy of it was asked for.
    """

    error: float
    end: float
    how: str
    times: int
    place: float | None = None

    def as_dict(self) -> dict[str, float | str | int]:
        """Values for the summary."""
        return {
            **({} if self.place is None else {"certified_position": self.place}),
            "certified": self.error,
            "difference_at_end": self.end,
            "how": self.how,
            "times_compared": self.times,
        }


def certify(
    dataset: xarray.Dataset,
    experiment: Experiment,
    *,
    accuracy: float,
    accuracy_position: float | None = None,
    loads: Sequence[Load] = (),
    known: KnownMotion | None = None,
    report: TrialProgress | None = None,
) -> Certificate | None:
    """Compare a finished run with an independent solution, as good as the accuracies asked for need (rad; m,
    None if the path need not be compared); None if the run recorded too little to be compared.
    """
    if dataset.sizes["time"] == 0:
        return None
    motion, setting = known or motion_of(experiment, loads=loads), setting_of(experiment)
    of_attitude, of_path = compared_names(experiment)

    @cache
    def run_at(most: int) -> tuple[list[mpmath.mpf], list[np.ndarray], list[np.ndarray]]:
        """Times, attitudes and places of the run; what it hasn't recorded, of the same run again."""
        rows = rows_to_compare(dataset, most)
        times = exact_times(dataset, rows)
        if all(name in dataset for name in of_attitude + of_path):
            attitudes = side_by_side([parts_of(dataset, name, rows) for name in of_attitude])
            places = [part.reshape(-1, 3) for name in of_path for part in parts_of(dataset, name, rows)]
            return times, attitudes, places
        again = try_setting(experiment, setting, times, loads=loads, repeating=True)
        return times, again.attitudes, again.places

    found: list[Certificate] = []
    for reference in references(setting, motion, accuracy):
        times, attitudes, places = run_at(_CERTIFIED_TIMES if reference.has_steps else _CLOSED_TIMES)
        better = finished_trial(experiment, reference, times, loads, report)
        if better is None:
            continue
        apart = angles_between(attitudes, better.attitudes)
        largest = float(apart.max())
        own = _own_share(reference, setting, motion, largest)
        margin = _MARGIN if len(times) == dataset.sizes["time"] else _PICKED_MARGIN
        how = f"against {reference.title}"
        if reference.has_steps and setting.has_steps and reference.level >= setting.level:
            margin, how = _PEER_MARGIN, f"{how}, which is independent but no more accurate"
        # recorded values can't be compared more closely than a quaternion's last bit; what is almost exact
        # errs by the rounding of its sample times
        floor = 2.0 ** (2 - setting.bits) + (0.0 if setting.has_steps else motion.labels(setting.precision))
        error = (margin + own) * largest + floor if largest < _INCOMPARABLE else math.pi
        place = None
        if of_path:
            off = float(distances_between(places, better.places).max())
            place = (margin + own) * off + floor * max(float(np.abs(part).max()) for part in better.places)
        found.append(Certificate(min(error, math.pi), float(apart[-1]), how, len(times), place))
        settled = (1 - own) * largest > accuracy and largest < _INCOMPARABLE
        if settled or verdict(found[-1], accuracy, accuracy_position) is None:
            break
    return min(found, key=lambda one: one.error, default=None)


def _own_share(reference: Setting, setting: Setting, motion: KnownMotion, largest: float) -> float:
    """Bound of a reference's own error, over the largest difference from it: the motion amplifies both errors
    alike, however strongly. A run that is far better than its reference has no part in the difference.
    """
    if not reference.has_steps:
        return 0.0  # dozens of digits more than the run
    if not setting.has_steps:
        return _AS_BAD
    share = min(_AS_BAD, reference.level * scatter_of(reference, motion.steps) / setting.level)
    if reference.bits <= setting.bits:  # rounded coefficients and initial values are the same in both
        share = max(share, motion.rounding(reference.precision) / max(largest, 1e-300))
    return share


def verdict(
    certificate: Certificate,
    accuracy: float | None,
    accuracy_position: float | None = None,
    *,
    key: str = "accuracy",
) -> str | None:
    """Warning if the requested accuracies (rad, by a key of ``[integrator]``, and m of the path) weren't
    certified.
    """
    remedy = f"could be certified ({certificate.how}); choose a higher precision or a nearer end"
    if accuracy is not None and certificate.error > accuracy:
        found = f"only {min(certificate.error, math.pi):.2g} rad"
        return f"{key} = {accuracy:.3g} rad was asked for, but {found} {remedy}"
    place = certificate.place
    if accuracy_position is None or (place is not None and place <= accuracy_position):
        return None
    found = "nothing" if place is None else f"only {place:.2g} m"
    return f"accuracy_position = {accuracy_position:.3g} m was asked for, but {found} {remedy}"


# --- the model ----------------------------------------------------------------------------------------------

CHEAPEST_FIRST = (ORBIT_AVERAGED, SPIN_AVERAGED)


@dataclass(frozen=True)
class Considered:
    """A model level that was considered: its modelling error, rad, forecast from the beginning of the span,
    and the CPU time, s, of measuring that after a run; None if there is none.
    """

    level: str
    error: float | None
    why_not: str
    seconds: float | None = None


@dataclass(frozen=True)
class LevelChoice:
    """Result of ``level = "auto"``."""

    experiment: Experiment
    level: str
    considered: Sequence[Considered]


def choose_level(
    experiment: Experiment, *, loads: Sequence[Load] = (), without: Sequence[str] = ()
) -> LevelChoice | None:
    """Choose the model for the requested accuracy of axes, each level measured over the beginning of the
    span; None if the level is given. Raises ``ConfigError`` if no accuracy is asked for. What no average
    provides, such as a quaternion, leaves the full model, whose attitude is held to the same accuracy.
    """
    config = experiment.config
    if config.model.level != AUTO:
        return None
    asked = _asked(experiment)
    considered: list[Considered] = []
    for level in CHEAPEST_FIRST:
        other = experiment.with_overrides([f'model.level="{level}"'])
        found, why_not = None, "its measured error was larger than asked for" if level in without else ""
        try:
            found = None if why_not else measure_modelling(prepare(other, loads=loads))
        except (ConfigError, Unmeasured) as error:
            problems = error.problems if isinstance(error, ConfigError) else []
            why_not = "; ".join(problem.what for problem in problems) or str(error)
        if found is None:
            considered.append(Considered(level, None, why_not))
            continue
        why_not = "" if found.worst <= asked else "more than asked for"
        considered.append(Considered(level, found.worst, why_not, found.seconds_of_run))
        if not why_not:
            return LevelChoice(other, level, considered)
    considered.append(Considered(FULL, 0.0, ""))
    return LevelChoice(fully(experiment), FULL, considered)


def fully(experiment: Experiment) -> Experiment:
    """An experiment with its open level set to the full model; others unchanged. Raises ``ConfigError``."""
    if experiment.config.model.level != AUTO:
        return experiment
    _asked(experiment)
    return experiment.with_overrides([f'model.level="{FULL}"'])


def _asked(experiment: Experiment) -> float:
    asked = experiment.config.integrator.accuracy_axis
    if asked is None:
        what = (
            'given "auto", but [integrator] accuracy_axis says no error to hold; give it, or choose a level'
        )
        raise ConfigError(Problem("[model] level", what), experiment.source)
    return float(asked)
