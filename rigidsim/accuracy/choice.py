"""Choice of the cheapest setting that keeps the attitude as accurate as ``[integrator] accuracy`` asks, and
of the most averaged model whose measured error is within ``accuracy_axis``.

Settings are tried over the motion's beginning, which is the whole of a short run, against a better one; what
wasn't tried follows from what was: errors of rounding are in proportion to the precision's epsilon, those of
the series to the tolerance. The end follows from the beginning by laws: errors of rounding grow like t^1.5
(Brouwer 1937), or t with projected invariants; errors of the series at most like t^2; both times the motion's
own growth. A choice is a forecast: the accuracy that the run really kept is certified afterwards
(``rigidsim.accuracy.certificate``).

Choices depend on counts alone, never on a clock, so that a config always chooses the same.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from rigidsim.accuracy.comparison import angles_between, spread_times
from rigidsim.accuracy.error_law import CLOSED_FORM
from rigidsim.accuracy.modelling import Unmeasured, measure_modelling
from rigidsim.accuracy.motion import PILOT_STEPS, KnownMotion, motion_of, stepped_reference
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
from rigidsim.accuracy.trial import TrialProgress, finished_trial
from rigidsim.errors import ConfigError, Problem
from rigidsim.model.load import Load
from rigidsim.scene.choices import (
    AUTO,
    FULL,
    ORBIT_AVERAGED,
    SPIN_AVERAGED,
    attitude_variables,
    variables_named,
)
from rigidsim.scene.config import Experiment
from rigidsim.scene.integrator_table import LARGEST_DIGITS
from rigidsim.scene.readable import span_text
from rigidsim.scene.scene import build_scene
from rigidsim.solve.problem import prepare

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
_CLEARLY = 20.0  # ratio of accuracy to round-off law from which rounding needn't be measured
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
    keys = choice.setting.overrides(without=integrator.model_fields_set)
    return experiment.having(keys), choice


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


def _unreachable(forecasts: "_Forecasts", best: Setting | None, accuracy: float) -> str:
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
        self._samples = build_scene(experiment).samples.count
        self.part = min(1.0, PILOT_STEPS / self.motion.steps)
        times = spread_times(experiment, _TIMES, self.part)
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
        return self.motion.rounding(setting.precision) * _CLEARLY <= self._accuracy

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
        other = experiment.having([f'model.level="{level}"'])
        why_not = "its measured error was larger than asked for" if level in without else ""
        try:
            found = None if why_not else measure_modelling(prepare(other, loads=loads))
        except ConfigError as error:
            found, why_not = None, "; ".join(p.what for p in error.problems)
        except Unmeasured as why:
            found, why_not = None, str(why)
        if found is None:
            considered.append(Considered(level, None, why_not))
            continue
        kept = found.worst <= asked
        why_not = "" if kept else "more than asked for"
        considered.append(Considered(level, found.worst, why_not, found.seconds_of_run))
        if kept:
            return LevelChoice(other, level, considered)
    considered.append(Considered(FULL, 0.0, ""))
    return LevelChoice(fully(experiment), FULL, considered)


def fully(experiment: Experiment) -> Experiment:
    """An experiment with its open level set to the full model; others unchanged. Raises ``ConfigError``."""
    if experiment.config.model.level != AUTO:
        return experiment
    _asked(experiment)
    return experiment.having([f'model.level="{FULL}"'])


def _asked(experiment: Experiment) -> float:
    asked = experiment.config.integrator.accuracy_axis
    if asked is None:
        what = (
            'given "auto", but [integrator] accuracy_axis says no error to hold; give it, or choose a level'
        )
        raise ConfigError(Problem("[model] level", what), experiment.source)
    return float(asked)
