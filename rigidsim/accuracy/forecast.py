"""Forecasts of settings' errors at a run's end, from short trials over its beginning.

Laws: errors of rounding grow like t^1.5 (Brouwer 1937), or t with projected invariants; those of the series
at most like t^2; both times the motion's own growth. Short motions are tried whole.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from rigidsim.accuracy.comparison import spread_times
from rigidsim.accuracy.motion import PILOT_STEPS, motion_of
from rigidsim.accuracy.reference import exact_beyond, stepped_reference
from rigidsim.accuracy.setting import Setting, epsilon
from rigidsim.accuracy.trial import TrialProgress, Trials
from rigidsim.model.load import Load
from rigidsim.scene.config import Experiment
from rigidsim.scene.readable import span_text
from rigidsim.scene.scene import build_scene

_BASE_TOLERANCE = 1e-8  # of the trial that all other tolerances are first forecast from
_LARGEST_EXPONENT = 600.0  # keeps products within doubles


# With these 96 of 100 choices cost at most twice the cheapest setting of a full search, and 199 of 200 were
# kept (``experiments/accuracy_certificates.py``).
_TIMES, _CLOSED_TIMES = 200, 17  # compared; fewer of a closed form, whose samples may take milliseconds
_SATURATED = 0.05  # rad: past which errors are no longer small, and don't scale
_CLOSED_FLOOR = 8.0  # least error of a closed form, in roundings
_CLEARLY = 20.0  # ratio of accuracy to round-off law from which rounding needn't be measured
_EXPONENTIAL, _POWER = 5.0, 2.0  # powers of time: past which growth is exponential; largest of any other
_SERIES, _PROJECTED, _ROUNDING = 1.2, 1.0, 1.5
"""Least powers of time for errors of series, and of rounding with projected invariants and without."""


def _at_end(early: float, late: float, part: float, setting: Setting) -> float:
    """Error at a run's end, rad, from the largest over the first quarter of a trial and over all of it."""
    early = max(early, late * 1e-300)
    power = math.log(late / early) / math.log(4)
    if power > _EXPONENTIAL:
        left = (1 / part - 1) / 0.75 * math.log(late / early)
        return late * math.exp(min(left, _LARGEST_EXPONENT))
    law = _SERIES if setting.tolerance is not None else _PROJECTED if setting.hold_invariants else _ROUNDING
    return late * (1 / part) ** max(law, min(power, _POWER))


class Forecasts:
    """Errors of settings, measured if that is cheap, otherwise forecast from what was measured."""

    def __init__(
        self,
        experiment: Experiment,
        accuracy: float,
        loads: Sequence[Load] = (),
        told: TrialProgress | None = None,
    ) -> None:
        """Examine a motion's beginning."""
        self._experiment, self._accuracy = experiment, accuracy
        self._trials = Trials(experiment, loads, told)
        self.motion = motion_of(experiment, loads=loads)
        self.samples = build_scene(experiment).samples.count
        self.part = min(1.0, PILOT_STEPS / self.motion.steps)
        self._times = spread_times(experiment, _TIMES, self.part)
        self._measured: dict[Setting, float] = {}

    def error(self, setting: Setting) -> float:
        """Forecast error at the run's end, rad; measures what it needs."""
        if not setting.has_steps:
            return self._closed_error(setting)
        rounding = self._rounding(setting)
        if setting.tolerance is None:
            return rounding
        return max(rounding, self._series(setting))

    def measure(self, setting: Setting) -> bool:
        """Try a setting itself, if worthwhile; False if nothing new can be learnt."""
        if not setting.has_steps or setting.tolerance is None or setting in self._measured:
            return False
        if setting.bits > 53:
            return False
        self._measured[setting] = self._try(setting)
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

    def _closed_error(self, setting: Setting) -> float:
        """Error of a closed form, compared over the whole run since it costs the same at any horizon."""
        if setting not in self._measured:
            floor = _CLOSED_FLOOR * epsilon(setting.precision)
            self._measured[setting] = math.inf
            if floor <= self._accuracy:
                times = spread_times(self._experiment, _CLOSED_TIMES)
                better = exact_beyond(setting.precision, setting.method).setting
                errors = self._trials.compare(setting, better, times)
                if errors is not None:
                    self._measured[setting] = max(float(errors.max()), floor)
        return self._measured[setting]

    def _obvious(self, setting: Setting) -> bool:
        """Whether rounding is clearly negligible."""
        return self.motion.rounding(setting.precision) * _CLEARLY <= self._accuracy

    def _rounding(self, setting: Setting) -> float:
        if self._obvious(setting):
            return self.motion.rounding(setting.precision)
        base = Setting(formulation=setting.formulation, hold_invariants=setting.hold_invariants)
        if base not in self._measured:
            self._measured[base] = self._try(base)
        return self._measured[base] * epsilon(setting.precision) / epsilon(base.precision)

    def _series(self, setting: Setting) -> float:
        """Error of a tolerance: measured, or in proportion to the nearest one measured."""
        if setting in self._measured:
            return self._measured[setting]
        alike = replace(setting, precision="double", tolerance=_BASE_TOLERANCE)
        if alike not in self._measured:
            self._measured[alike] = self._try(alike)
        same = [
            (s, s.tolerance)
            for s in self._measured
            if s.tolerance is not None
            and (s.formulation, s.hold_invariants) == (setting.formulation, setting.hold_invariants)
        ]
        wanted = math.log(setting.step_tolerance)
        nearest, tolerance = min(same, key=lambda s: abs(math.log(s[1]) - wanted))
        return self._measured[nearest] * setting.step_tolerance / tolerance

    def _try(self, setting: Setting) -> float:
        """Error at the run's end, from that over the part tried."""
        errors = self._trials.compare(setting, self._reference(setting), self._times)
        if errors is None:
            return math.inf
        late = float(errors.max())
        if late > _SATURATED:  # no longer small: only the law tells how large it would be
            return max(late, self.motion.error(setting.level))
        late = max(late, epsilon(setting.precision))
        if self.part >= 1.0:
            return late
        return _at_end(float(errors[: len(errors) // 4].max()), late, self.part, setting)

    def _reference(self, setting: Setting) -> Setting:
        """The setting against whose trial another's is compared: in double precision if rounding is
        negligible.
        """
        precision = "double" if self._obvious(setting) else "extended"
        steps = self.motion.steps * self.part
        return stepped_reference(precision, self.motion, steps, setting.formulation)
