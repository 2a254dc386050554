"""``[integrator] accuracy``: the cheapest setting that keeps the attitude as right as was asked for.

Errors follow known laws: of rounding like the steps to the 3/2 (Brouwer 1937), of the tolerance like time to
some power between 1 and 2, both times the motion's own growth of errors. Short motions are simply tried
with every setting; long ones are tried over their beginning, and the laws say how it goes on. A choice is
a forecast: what the run really kept is certified afterwards (``rigidsim.certify``).

Choices depend on counts alone, never on a clock, so that a config always chooses the same.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.prepare import Prepared, motion_growth, prepare_scene
from rigidsim.scene.context import working_bits
from rigidsim.scene.reading import Experiment, parse_saved
from rigidsim.scene.schema import LARGEST_DIGITS
from rigidsim.solve.growth import Growth
from rigidsim.summary import round_off_law
from rigidsim.trial import Setting, Trial, angles_between, spread_times, trial_scene, try_setting

_SAFETY = 3.0  # between a forecast and what was asked for
_OPTIMISM = 100.0  # over the law's verdict, where the next setting costs ten times as much
_PILOT_STEPS = 4000  # of double precision at its epsilon: some milliseconds
_PILOT_TIMES = 24
_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14)
_LADDER: tuple[str | int, ...] = ("double", "extended", "quadruple", 50, 75, 100, 150, 200, LARGEST_DIGITS)
_STEP_COST = {"double": 1.0, "extended": 12.0, "quadruple": 700.0}
_DIGITS_STEP = 1500.0
_CLOSED_SAMPLE = 6.0
_WIDE_CLOSED_SAMPLE = 4000.0
"""Measured (experiments/README.md), in steps of double precision."""
_SECONDS_PER_STEP = {"double": 8e-7, "extended": 1e-5, "quadruple": 5e-4}
"""Of a free body on one core; a scene's own is in proportion. For the message about cost only."""


@dataclass(frozen=True)
class Choice:
    """A setting and what is forecast of it.

    Attributes:
        forecast: attitude error at the end, rad.
        steps: natural steps, roughly.
        why: one sentence for the summary.
    """

    setting: Setting
    forecast: float
    steps: int
    why: str


@dataclass(frozen=True)
class Forecast:
    """What is known of a motion before its long run.

    Attributes:
        steps: of double precision at its epsilon, over the whole run.
        rate: bound of the angular velocity, rad/s.
        seconds: the run's length.
        growth: of errors by the motion itself.
        holds: whether it has invariants to hold.
        closed: whether it has a closed form.
    """

    steps: float
    rate: float
    seconds: float
    growth: Growth | None
    holds: bool
    closed: bool

    def amplification(self, seconds: float | None = None) -> float:
        """Of errors, over the linear growth of a stable motion."""
        return 1.0 if self.growth is None else self.growth.at(self.seconds if seconds is None else seconds)

    def rounding(self, precision: str | int, *, held: bool) -> float:
        """Attitude error of rounding at the end, rad."""
        epsilon = 2.0 ** max(1 - working_bits(precision), -1000)
        if held and self.closed:
            # held frequencies leave a random walk of the attitude itself, a few roundings a step
            return 4 * epsilon * math.sqrt(max(self.steps, 1.0)) * self.amplification()
        return round_off_law(epsilon, int(self.steps), self.rate, self.seconds) * self.amplification()


def chosen(
    experiment: Experiment, *, loads: Sequence[Any] = (), beyond: Setting | None = None
) -> tuple[Experiment, Choice | None]:
    """The experiment with the settings that its ``accuracy`` asks for written into it.

    Keys that the config gives stay as they are; where it gives precision, tolerance and method, nothing is
    chosen and the run is only certified. The text says what was chosen in ``#:set`` lines, so that it
    means the same run again.

    Raises:
        ConfigError: no setting reaches the accuracy; says what can be reached.
    """
    integrator = experiment.config.integrator
    if integrator.accuracy is None:
        return experiment, None
    given = integrator.model_fields_set
    if {"precision", "tolerance", "method"} <= given:
        return experiment, None
    accuracy = float(integrator.accuracy.rational)
    choice = choose(experiment, accuracy, loads=loads, beyond=beyond)
    keys = [text for text in choice.setting.overrides() if text[11:].partition("=")[0] not in given]
    return parse_saved(experiment.text, source=experiment.source, overrides=keys), choice


def choose(
    experiment: Experiment, accuracy: float, *, loads: Sequence[Any] = (), beyond: Setting | None = None
) -> Choice:
    """The cheapest setting whose forecast keeps an accuracy, within what the config leaves open.

    Args:
        accuracy: rad, at the end.
        beyond: a setting that was tried and didn't keep it; only dearer ones are looked at.

    Raises:
        ConfigError: none does.
    """
    candidates = [s for s in _candidates(experiment) if _allowed(experiment, s)]
    if beyond in candidates:
        candidates = candidates[candidates.index(beyond) + 1 :]
    known = forecast(experiment, loads=loads)
    closed = _closed_choice(experiment, known, candidates, accuracy)
    open_ = [s for s in candidates if s.method == "taylor"]
    try:
        stepped = _try_tolerances(experiment, known, open_, accuracy, loads) or _by_the_law(
            known, open_, accuracy
        )
    except ConfigError:
        if closed is None:
            raise
        return closed
    samples = _samples(experiment)
    if closed is not None and cost(closed, samples) < cost(stepped, samples):
        return closed
    return stepped


def cost(choice: Choice, samples: int) -> float:
    """In steps of double precision at its epsilon, roughly: a count, so that no clock decides.

    A step's work goes with the square of the Taylor order, which falls with the tolerance's digits.
    """
    setting = choice.setting
    if setting.method == "closed_form":
        return samples * (_CLOSED_SAMPLE if setting.precision == "double" else _WIDE_CLOSED_SAMPLE)
    step = _STEP_COST.get(str(setting.precision), _DIGITS_STEP)
    if setting.tolerance is not None:
        step *= (1 - math.log(setting.tolerance) / 2) ** 2 / 20**2
    return choice.steps * step * (1.2 if setting.hold_invariants else 1.0)


def _closed_choice(
    experiment: Experiment, known: Forecast, candidates: list[Setting], accuracy: float
) -> Choice | None:
    if not known.closed:
        return None
    for setting in candidates:
        if setting.method == "closed_form":
            # its own few roundings; times are exact, and so are the turns up to them
            error = 16 * 2.0 ** (1 - working_bits(setting.precision))
            if error * _SAFETY <= accuracy:
                return Choice(setting, error, 0, "its solution in closed form costs less than its steps")
    return None


def is_open(experiment: Experiment, choice: Choice, loads: Sequence[Any] = ()) -> bool:
    """Whether a dearer setting than the one chosen is left to try."""
    assert experiment.config.integrator.accuracy is not None
    try:
        choose(
            experiment,
            float(experiment.config.integrator.accuracy.rational),
            loads=loads,
            beyond=choice.setting,
        )
    except ConfigError:
        return False
    return True


def forecast(experiment: Experiment, *, loads: Sequence[Any] = ()) -> Forecast:
    """Look at the beginning of a motion (some tens of milliseconds)."""
    from rigidsim.solve.closed import closed_form_of

    prepared = _prepared(experiment, Setting(), loads)
    scene = prepared.scene
    seconds = float(scene.samples.last - scene.start)
    steps = _steps(prepared)
    closed = not isinstance(closed_form_of(scene, driven=bool(loads)), str)
    return Forecast(
        steps=steps,
        rate=float(prepared.system.rate_bound),
        seconds=seconds,
        growth=motion_growth(prepared),
        holds=any(i.name not in ("quaternion_norm", "energy_balance") for i in prepared.system.invariants),
        closed=closed,
    )


def _prepared(experiment: Experiment, setting: Setting, loads: Sequence[Any]) -> Prepared:
    return prepare_scene(experiment, trial_scene(experiment, setting), loads=loads)


def _steps(prepared: Prepared) -> float:
    """Natural steps of the whole run, from its first thousands."""
    from rigidsim.solve.stepper import Stepper

    clock = prepared.clock
    begin, end = float(clock.at(0)), float(clock.at(clock.count - 1))
    stepper = Stepper(prepared.system, prepared.precision, None, clock.at(0))
    while stepper.steps < _PILOT_STEPS and float(stepper.time) < end and stepper.skip(64):
        pass
    done = max(float(stepper.time) - begin, 1e-300)
    return max(1.0, stepper.steps * (end - begin) / done)


def _samples(experiment: Experiment) -> int:
    from rigidsim.scene.scene import build_scene

    return build_scene(experiment).samples.count


def _candidates(experiment: Experiment) -> list[Setting]:
    """From cheap to costly."""
    formulation = experiment.config.integrator.formulation
    if formulation in ("auto", "rates"):
        formulation = "quaternion"
    plain = Setting(formulation=formulation)
    closed = [Setting(precision, method="closed_form") for precision in _LADDER if precision != "extended"]
    loose = [replace(plain, tolerance=tolerance) for tolerance in _TOLERANCES]
    tight = [
        replace(plain, precision=precision, hold_invariants=held)
        for precision in _LADDER
        for held in (False, True)
    ]
    return [*closed, *loose, *tight]


def _allowed(experiment: Experiment, setting: Setting) -> bool:
    """Whether a setting agrees with the keys that the config gives."""
    integrator = experiment.config.integrator
    given = integrator.model_fields_set
    if "precision" in given and setting.precision != integrator.precision:
        return False
    if "hold_invariants" in given and setting.hold_invariants != integrator.hold_invariants:
        return False
    if "method" in given and setting.method != integrator.method:
        return False
    if setting.method == "closed_form":
        formulation = integrator.formulation
        return not experiment.config.events and formulation in ("auto", "quaternion", "rates")
    if "tolerance" in given:
        return setting.tolerance is None  # stands for the config's own
    return True


def _try_tolerances(
    experiment: Experiment, known: Forecast, candidates: list[Setting], accuracy: float, loads: Sequence[Any]
) -> Choice | None:
    """Double precision at loosened tolerances, tried over the motion's beginning or the whole of it."""
    loose = [s for s in candidates if s.tolerance is not None]
    if not loose or known.rounding("double", held=False) * _SAFETY > accuracy:
        return None
    part = min(1.0, _PILOT_STEPS / known.steps)
    times = spread_times(experiment, _PILOT_TIMES, part)
    tight = replace(loose[0], tolerance=None)
    reference = try_setting(experiment, tight, times, loads=loads)
    for setting in loose:
        trial = try_setting(experiment, setting, times, loads=loads)
        if trial.rows != reference.rows:
            continue
        error = _grown(trial, reference, known, part)
        if error * _SAFETY <= accuracy:
            why = f"tried over the first {part * known.seconds:.3g} s against a tolerance of epsilon"
            return Choice(setting, error, int(trial.steps / part), why)
    return None


def _grown(trial: Trial, reference: Trial, known: Forecast, part: float) -> float:
    """Error at the run's end from that over its first ``part``: as the quarter's growth goes on, at least
    like t^1.2 and at most like t^2, times what the motion itself adds.
    """
    errors = angles_between(trial.attitudes, reference.attitudes)
    early = float(errors[: max(1, len(errors) // 4)].max())
    late = float(errors.max())
    if part >= 1.0 or late == 0.0:
        return late
    power = math.log(late / early) / math.log(4) + 0.3 if early > 0 else 2.0
    power = min(2.0, max(1.2, power))
    added = known.amplification() / known.amplification(part * known.seconds)
    return late * (1 / part) ** power * max(1.0, added)


def _by_the_law(known: Forecast, candidates: list[Setting], accuracy: float) -> Choice:
    tight = [s for s in candidates if s.tolerance is None and s.method == "taylor"]
    tight = [s for s in tight if known.holds or not s.hold_invariants]
    reached = math.inf
    best = None
    for n, setting in enumerate(tight):
        error = known.rounding(setting.precision, held=setting.hold_invariants)
        if error < reached:
            reached, best = error, setting
        if error * _SAFETY <= accuracy:
            return Choice(setting, error, int(known.steps), "by the law of rounding errors")
        dearer = n + 1 == len(tight) or tight[n + 1].precision != setting.precision
        if setting.hold_invariants and dearer and error <= accuracy * _OPTIMISM and not known.closed:
            why = "the law is in doubt where invariants are held; the next setting costs ten times as much"
            return Choice(setting, error, int(known.steps), why)
    raise ConfigError(Problem("[integrator] accuracy", _unreachable(known, best, reached, accuracy)))


def _unreachable(known: Forecast, best: Setting | None, reached: float, accuracy: float) -> str:
    if best is None:
        return f"given {accuracy:.3g} rad, but the other keys of [integrator] leave no setting to choose from"
    seconds = known.steps * _SECONDS_PER_STEP.get(str(best.precision), 2e-3)
    text = (
        f"given {accuracy:.3g} rad at the end, which no setting open to it reaches; the best, {best.title}, "
        f"would be right to about {min(reached, math.pi):.2g} rad, in about {seconds:.2g} s"
    )
    if known.growth is not None and known.growth.rate > 0:
        text += f"; errors here grow e-fold every {1 / known.growth.rate:.3g} s, so choose a nearer end"
    return text + "; ask for less, or leave precision and tolerance open"
