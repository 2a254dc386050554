"""Choice of the cheapest setting that keeps the attitude as accurate as ``[integrator] accuracy`` asks, and
of the most averaged model whose measured error is within ``accuracy_axis``.

Settings are tried over the motion's beginning, which is the whole of a short run, against a better one
(``rigidsim.accuracy.forecast``); what wasn't tried follows from what was: errors of rounding are in
proportion to the precision's epsilon, those of the series to the tolerance. A choice is a forecast: the
accuracy that the run really kept is certified afterwards (``rigidsim.accuracy.certificate``).

Choices depend on counts alone, never on a clock, so that a config always chooses the same.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from rigidsim.accuracy.forecast import Forecasts
from rigidsim.accuracy.models.modelling import measure_modelling
from rigidsim.accuracy.models.side_by_side import Unmeasured
from rigidsim.accuracy.motion import KnownMotion
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
from rigidsim.accuracy.trial import TrialProgress
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
from rigidsim.solve.problem import prepare

_DIGITS: dict[str | int, range] = {"single": range(4, 8), "double": range(4, 16), "extended": range(13, 19)}
"""Tolerances of each precision, as negative powers of ten; looser ones are no cheaper than the one before."""
_LADDER: tuple[str | int, ...] = ("double", "extended", "quadruple", 50, 75, 100, 150, 200, LARGEST_DIGITS)


_SAFETY, _OPTIMISTIC, _OPTIMISTIC_LONG, _PROGRESS = 3.0, 0.6, 3.0, 0.2
"""Ratio of the accuracy to the largest acceptable forecast; ratios of forecast to accuracy up to which a
setting is tried if the next precision costs ten times as much, of a short run, and of a long one, which
mostly does better than its beginning forecasts; ratio to a failed setting's forecast that the next one must
promise.

With these 199 of 200 random runs kept what they were asked for, and 96 of 100 cost at most twice the cheapest
setting of a full search (experiments/README.md).
"""


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
    told: TrialProgress | None = None,
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
        choice = choose(experiment, accuracy, loads=loads, beyond=beyond, told=told, key=key)
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
    told: TrialProgress | None = None,
    key: str = "accuracy",
) -> Choice:
    """The cheapest setting whose forecast keeps an attitude accuracy (rad, at the end), within what the
    config leaves open. Raises ``ConfigError`` if none does.
    """
    forecasts = Forecasts(experiment, accuracy, loads, told)
    motion = forecasts.motion

    def counted(setting: Setting) -> float:
        return cost(setting, motion.steps, forecasts.samples)

    candidates = sorted(_candidates(experiment, motion), key=counted)
    most = accuracy / _SAFETY
    optimistic_limit = accuracy * (_OPTIMISTIC_LONG if forecasts.part < 1 else _OPTIMISTIC)
    if beyond is not None:
        optimistic_limit = 0.0
        most = min(most, _PROGRESS * forecasts.error(beyond))
        spent = counted(beyond)
        candidates = [s for s in candidates if counted(s) > spent]
    while True:
        choice = _first(forecasts, candidates, most, optimistic_limit)
        if choice is None:
            reached = min(candidates, key=forecasts.error, default=None)
            raise ConfigError(Problem(f"[integrator] {key}", _unreachable(forecasts, reached, accuracy)))
        if not forecasts.measure(choice.setting):
            return choice  # it was tried, or is too dear to be


def _first(
    forecasts: Forecasts, candidates: list[Setting], most: float, optimistic_limit: float
) -> Choice | None:
    """The first candidate whose forecast is within ``most``, or within ``optimistic_limit`` if only another
    precision would do better; None if there is none.
    """
    motion = forecasts.motion
    for n, setting in enumerate(candidates):
        error = forecasts.error(setting)
        if error <= most:
            return Choice(setting, error, forecasts.why(setting), motion)
        dearer = all(s.precision != setting.precision for s in candidates[n + 1 :] if s.has_steps)
        if dearer and setting.has_steps and error <= optimistic_limit:
            why = f"{forecasts.why(setting)}; the next precision costs ten times as much"
            return Choice(setting, error, why, motion)
    return None


def _candidates(experiment: Experiment, motion: KnownMotion) -> list[Setting]:
    """All settings that the config leaves open."""
    integrator = experiment.config.integrator
    given = integrator.model_fields_set
    formulation = attitude_variables(integrator.formulation)
    precisions = (integrator.precision,) if "precision" in given else _LADDER
    found: list[Setting] = []
    if motion.exact and (integrator.method == motion.exact or "method" not in given):
        open_ = variables_named(formulation).in_closed_form and not experiment.config.events
        open_ = open_ and not (integrator.hold_invariants is True and "hold_invariants" in given)
        found += [Setting(p, method=motion.exact) for p in precisions if p != "extended" and open_]
    if not integrator.has_steps:
        return found
    plain = Setting(formulation=formulation, method=integrator.method)
    holds = [integrator.hold_invariants is True] if "hold_invariants" in given else [False, True]
    looser = 13
    for precision in precisions:
        finest = math.floor(-math.log10(epsilon(precision)))
        digits = _DIGITS.get(precision, range(looser, finest + 1))
        tolerances: list[float | None] = [None, *(float(f"1e-{d}") for d in digits)]
        if "tolerance" in given:
            tolerances = [setting_of(experiment).tolerance]
        looser = finest
        found += [
            replace(plain, precision=precision, tolerance=tolerance, hold_invariants=projected)
            for tolerance in tolerances
            for projected in holds
            if motion.holds or not projected or "hold_invariants" in given
        ]
    return found


def _unreachable(forecasts: Forecasts, best: Setting | None, accuracy: float) -> str:
    if best is None:
        return f"given {accuracy:.3g} rad, but the other keys of [integrator] leave no setting to choose from"
    motion = forecasts.motion
    seconds = cost(best, motion.steps, forecasts.samples) * STEP_SECONDS
    reached = forecasts.error(best)
    what = f"would be right to about {reached:.2g} rad" if reached < 1 else "would keep no digit"
    text = (
        f"given {accuracy:.3g} rad at the end, which no setting open to it reaches; the best, {best.title}, "
        f"{what}, in about {span_text(seconds, 2)}"
    )
    if (rate := motion.growth.growth_rate) > 0:
        text += f"; errors here grow e-fold every {span_text(1 / rate)}, so choose a nearer end"
    return text + "; ask for less, or leave precision, tolerance and method open"


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
