"""``[integrator] accuracy``: the cheapest setting that keeps the attitude as right as was asked for.

Settings are tried over the motion's beginning, which is the whole of a short run, against a better one
(``rigidsim.pilots``); what wasn't tried follows from what was: errors of rounding are in proportion to the
precision's epsilon, those of the series to the tolerance. A choice is a forecast: what the run really kept
is certified afterwards (``rigidsim.certify``).

Choices depend on counts alone, never on a clock, so that a config always chooses the same.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.guards import Observer
from rigidsim.pilots import Forecast, Pilots, epsilon, forecast
from rigidsim.prepare import auto_tolerance
from rigidsim.scene.context import working_bits
from rigidsim.scene.reading import Experiment, parse_saved
from rigidsim.scene.schema import LARGEST_DIGITS
from rigidsim.trial import Setting

__all__ = ["Choice", "Forecast", "choose", "chosen", "cost", "forecast", "taylor_order"]

_SAFETY = 3.0  # between a forecast and what was asked for
_HOPE = 0.6  # of what was asked for: worth a try where the next precision costs ten times as much
_HOPE_LONG = 3.0  # the same of a long run, which mostly does better than forecast from its beginning
_PROGRESS = 0.2  # of the error forecast of a setting that failed: what the next must promise
_DIGITS: dict[str | int, range] = {"single": range(4, 8), "double": range(4, 16), "extended": range(13, 19)}
"""Tolerances of each precision, as negative powers of ten; looser ones are no cheaper than the one before."""
_LADDER: tuple[str | int, ...] = ("double", "extended", "quadruple", 50, 75, 100, 150, 200, LARGEST_DIGITS)
_STEP_COST: dict[str | int, float] = {"single": 1.25, "double": 1.0, "extended": 9.0, "quadruple": 135.0}
_DIGITS_STEP = 155.0  # at 50 digits
_HELD = 1.05
_CLOSED_START = 800.0
_CLOSED_SAMPLE = 0.4
_WIDE_CLOSED_SAMPLE = 1400.0
_DIGITS_CLOSED_SAMPLE = 1900.0  # at 50 digits
"""Measured (experiments/accuracy_certificates.py --calibrate): a step over the square of its Taylor order, in
that of double precision; the closed form's first sample and each further one, in steps of double precision at
its epsilon, which take about a microsecond."""
_SECONDS_PER_STEP = 1e-6  # of double precision, a free body on one core: for the message about cost only


@dataclass(frozen=True)
class Choice:
    """A setting and what is forecast of it.

    Attributes:
        forecast: attitude error at the end, rad.
        steps: natural steps, roughly.
        why: one sentence for the summary.
        known: of the motion.
    """

    setting: Setting
    forecast: float
    steps: int
    why: str
    known: Forecast


def chosen(
    experiment: Experiment,
    *,
    loads: Sequence[Any] = (),
    beyond: Setting | None = None,
    observer: Observer | None = None,
) -> tuple[Experiment, Choice | None]:
    """The experiment with the settings that its ``accuracy`` asks for written into it.

    Keys that the config gives stay as they are; where it gives precision, tolerance and method, nothing is
    chosen and the run is only certified. The text says what was chosen in ``#:set`` lines, so that it
    means the same run again.

    Args:
        loads: given from Python.
        beyond: a setting that was run and didn't keep the accuracy; only dearer ones are looked at.
        observer: is told of the trials.

    Raises:
        ConfigError: no setting reaches the accuracy; says what can be reached.
    """
    integrator = experiment.config.integrator
    if integrator.accuracy is None:
        return experiment, None
    given = integrator.model_fields_set
    if {"precision", "tolerance", "method"} <= given:
        return experiment, None
    observer = observer or Observer()
    observer.choosing(experiment.config.name)
    accuracy = float(integrator.accuracy.rational)
    try:
        choice = choose(experiment, accuracy, loads=loads, beyond=beyond, observer=observer)
    except ConfigError as error:
        raise error.at(experiment.source) from None
    keys = [text for text in choice.setting.overrides() if text[11:].partition("=")[0] not in given]
    return parse_saved(experiment.text, source=experiment.source, overrides=keys), choice


def choose(
    experiment: Experiment,
    accuracy: float,
    *,
    loads: Sequence[Any] = (),
    beyond: Setting | None = None,
    observer: Observer | None = None,
) -> Choice:
    """The cheapest setting whose forecast keeps an accuracy, within what the config leaves open.

    Args:
        accuracy: rad, at the end.
        beyond, observer: as of ``chosen``.

    Raises:
        ConfigError: none does.
    """
    pilots = Pilots(experiment, accuracy, loads, observer)
    known = pilots.known
    candidates = _candidates(experiment, known)
    candidates.sort(key=lambda s: cost(s, known.steps, pilots.samples))
    most = accuracy / _SAFETY
    hope = accuracy * (_HOPE_LONG if pilots.part < 1 else _HOPE)
    if beyond is not None:
        hope = 0.0
        most = min(most, _PROGRESS * pilots.error(beyond))
        spent = cost(beyond, known.steps, pilots.samples)
        candidates = [s for s in candidates if cost(s, known.steps, pilots.samples) > spent]
    while True:
        choice = _first(pilots, candidates, most, hope)
        if choice is None:
            reached = min(candidates, key=pilots.error, default=None)
            raise ConfigError(Problem("[integrator] accuracy", _unreachable(pilots, reached, accuracy)))
        if not pilots.measure(choice.setting):
            return choice  # it was tried, or is too dear to be


def _first(pilots: Pilots, candidates: list[Setting], most: float, hope: float) -> Choice | None:
    """The first of the candidates that is forecast to be within ``most``, or within ``hope`` where only
    another precision would do better.
    """
    steps = int(pilots.known.steps)
    for n, setting in enumerate(candidates):
        error = pilots.error(setting)
        if error <= most:
            return Choice(setting, error, steps, pilots.why(setting), pilots.known)
        dearer = all(s.precision != setting.precision for s in candidates[n + 1 :] if s.method == "taylor")
        if dearer and setting.method == "taylor" and error <= hope:
            why = f"{pilots.why(setting)}; the next precision costs ten times as much"
            return Choice(setting, error, steps, why, pilots.known)
    return None


def cost(setting: Setting, steps: float, samples: int) -> float:
    """In steps of double precision at its epsilon, roughly: a count, so that no clock decides.

    A step's work goes with the square of the Taylor order; steps are about as long at any tolerance.

    Args:
        steps: natural steps of the run; of no account to a closed form.
        samples: of the run; they cost next to nothing where steps are taken.
    """
    if setting.method == "closed_form":
        return _closed_cost(setting.precision, samples)
    step = _STEP_COST.get(setting.precision, 0.0)
    if isinstance(setting.precision, int):
        step = _DIGITS_STEP * max(1.0, setting.precision / 50)
    return steps * step * (taylor_order(setting) / 20) ** 2 * (_HELD if setting.hold_invariants else 1.0)


def _closed_cost(precision: str | int, samples: int) -> float:
    if working_bits(precision) <= 53:
        return _CLOSED_START + samples * _CLOSED_SAMPLE
    if isinstance(precision, int):
        return samples * _DIGITS_CLOSED_SAMPLE * max(1.0, precision / 50)
    return samples * _WIDE_CLOSED_SAMPLE


def taylor_order(setting: Setting) -> int:
    """Of the series that a tolerance needs: Jorba and Zou 2005, eq. 11."""
    auto = auto_tolerance(epsilon(setting.precision))
    return max(2, math.ceil(1 - math.log(setting.tolerance or auto) / 2))


def _candidates(experiment: Experiment, known: Forecast) -> list[Setting]:
    """All that the config leaves open."""
    integrator = experiment.config.integrator
    given = integrator.model_fields_set
    formulation = integrator.formulation
    charts = formulation not in ("auto", "rates", "quaternion")
    precisions = (integrator.precision,) if "precision" in given else _LADDER
    found: list[Setting] = []
    if integrator.method == "closed_form" or "method" not in given:
        open_ = known.closed and not charts and not experiment.config.events
        open_ = open_ and not (integrator.hold_invariants and "hold_invariants" in given)
        found += [Setting(p, method="closed_form") for p in precisions if p != "extended" and open_]
    if "method" in given and integrator.method == "closed_form":
        return found
    plain = Setting(formulation=formulation if charts else "quaternion")
    holds = [integrator.hold_invariants] if "hold_invariants" in given else [False, True]
    looser = 13
    for precision in precisions:
        finest = math.floor(-math.log10(epsilon(precision)))
        digits = _DIGITS.get(precision, range(looser, finest + 1))
        tolerances: list[float | None] = [None, *(float(f"1e-{d}") for d in digits)]
        if "tolerance" in given:
            tolerances = [_own_tolerance(experiment)]
        looser = finest
        found += [
            replace(plain, precision=precision, tolerance=tolerance, hold_invariants=held)
            for tolerance in tolerances
            for held in holds
            if known.holds or not held or "hold_invariants" in given
        ]
    return found


def _own_tolerance(experiment: Experiment) -> float | None:
    tolerance = experiment.config.integrator.tolerance
    return None if isinstance(tolerance, str) else float(tolerance.rational)


def _unreachable(pilots: Pilots, best: Setting | None, accuracy: float) -> str:
    if best is None:
        return f"given {accuracy:.3g} rad, but the other keys of [integrator] leave no setting to choose from"
    known = pilots.known
    seconds = cost(best, known.steps, pilots.samples) * _SECONDS_PER_STEP
    reached = pilots.error(best)
    what = f"would be right to about {reached:.2g} rad" if reached < 1 else "would keep no digit"
    text = (
        f"given {accuracy:.3g} rad at the end, which no setting open to it reaches; the best, {best.title}, "
        f"{what}, in about {seconds:.2g} s"
    )
    if known.growth is not None and known.growth.rate > 0:
        text += f"; errors here grow e-fold every {1 / known.growth.rate:.3g} s, so choose a nearer end"
    return text + "; ask for less, or leave precision, tolerance and method open"
