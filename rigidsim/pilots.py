"""Short trials of settings over a motion's beginning, and what they say of the errors at its end.

Laws: errors of rounding grow like t^1.5 (Brouwer 1937), or t where invariants are held; those of the series
at most like t^2; both times the motion's own growth. Short motions are tried whole.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from rigidsim.errors import ConfigError
from rigidsim.guards import Observer
from rigidsim.prepare import Prepared, double_twin, prepare_scene
from rigidsim.scene.context import working_bits
from rigidsim.scene.reading import Experiment
from rigidsim.solve.growth import Growth, measure_growth
from rigidsim.solve.status import Status
from rigidsim.summary import round_off_law
from rigidsim.trial import Setting, Trial, angles_between, compactly, spread_times, trial_scene, try_setting

_PILOT_STEPS = 20_000  # of double precision at its epsilon: some tens of milliseconds
_PILOT_TIMES = 200
_CLOSED_TIMES = 17
_BASE_TOLERANCE = 1e-8
_SATURATED = 0.05  # rad: past it errors are no longer small, and don't scale
_CLOSED_FLOOR = 8.0  # roundings of a closed form
_EXPONENTIAL = 5.0  # power of time past which growth is none
_POWER = 2.0  # of time, at most, where it is one
_LARGEST_EXPONENT = 600.0  # keeps products within doubles
_CLEARLY = 20.0  # the law of rounding, below the accuracy: then nobody needs to measure it


def epsilon(precision: str | int) -> float:
    """Of a precision, kept within doubles."""
    return 2.0 ** max(1 - working_bits(precision), -1000)


@dataclass(frozen=True)
class Forecast:
    """What is known of a motion before its long run.

    Attributes:
        steps: of double precision at its epsilon, over the whole run.
        rate: bound of the angular velocity, rad/s.
        seconds: the run's length.
        growth: of errors by the motion itself.
        holds: whether it has invariants to hold, be it the quaternion's norm alone.
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

    def rounding(self, precision: str | int) -> float:
        """Attitude error of rounding at the end, rad: the law, and no less than the initial values' own."""
        steps = max(int(self.steps), 16)
        return round_off_law(epsilon(precision), steps, self.rate, self.seconds) * self.amplification()


def forecast(experiment: Experiment, *, loads: Sequence[Any] = ()) -> Forecast:
    """Look at the beginning of a motion (some tens of milliseconds)."""
    from rigidsim.solve.closed import closed_form_of

    scene = trial_scene(experiment, Setting())
    prepared = compactly(prepare_scene(experiment, scene, loads=loads))
    clock = prepared.clock
    begin, end = float(clock.start), float(clock.at(clock.count - 1))
    closed = not isinstance(closed_form_of(scene, driven=bool(loads)), str)
    return Forecast(
        steps=_steps(prepared),
        rate=float(prepared.system.rate_bound),
        seconds=float(scene.samples.last - scene.start),
        growth=measure_growth(double_twin(prepared), prepared.precision, begin, end),
        holds=any(i.name != "energy_balance" for i in prepared.system.invariants),
        closed=closed,
    )


def _steps(prepared: Prepared) -> float:
    """Natural steps of the whole run, from its first thousands."""
    from rigidsim.solve.stepper import Stepper

    clock = prepared.clock
    begin, end = float(clock.start), float(clock.at(clock.count - 1))
    stepper = Stepper(prepared.system, prepared.precision, None, clock.start)
    while stepper.steps < _PILOT_STEPS and float(stepper.time) < end and stepper.skip(64):
        pass
    done = max(float(stepper.time) - begin, 1e-300)
    return max(1.0, stepper.steps * (end - begin) / done)


class Pilots:
    """Errors of settings, measured where that is cheap, and forecast from what was measured elsewhere.

    Attributes:
        known: of the motion.
        samples: of the run.
        part: of the run that is tried.
    """

    def __init__(
        self,
        experiment: Experiment,
        accuracy: float,
        loads: Sequence[Any] = (),
        observer: Observer | None = None,
    ) -> None:
        from rigidsim.scene.scene import build_scene

        self._experiment, self._accuracy, self._loads = experiment, accuracy, loads
        self._observer = observer or Observer()
        self.known = forecast(experiment, loads=loads)
        self.samples = build_scene(experiment).samples.count
        self.part = min(1.0, _PILOT_STEPS / self.known.steps)
        self._times = spread_times(experiment, _PILOT_TIMES, self.part)
        self._measured: dict[Setting, float] = {}
        self._references: dict[Setting, Trial | None] = {}

    def error(self, setting: Setting) -> float:
        """Forecast at the run's end, rad; measures what it needs."""
        if setting.method == "closed_form":
            return self._closed_error(setting)
        rounding = self._rounding(setting)
        if setting.tolerance is None:
            return rounding
        return max(rounding, self._series(setting))

    def measure(self, setting: Setting) -> bool:
        """Try a setting itself, if that is worth it; False where nothing new can be learnt."""
        if setting.method == "closed_form" or setting.tolerance is None or setting in self._measured:
            return False
        if working_bits(setting.precision) > 53:
            return False
        self._measured[setting] = self._try(setting)
        return True

    def why(self, setting: Setting) -> str:
        """Where the forecast is from, for the summary."""
        known = self.known
        if setting.method == "closed_form":
            return "its solution in closed form costs less than its steps"
        if setting.tolerance is None and self._obvious(setting):
            return "by the law of rounding errors"
        extent = "whole run" if self.part >= 1 else f"first {self.part * known.seconds:.3g} s"
        if working_bits(setting.precision) <= 53:
            return f"tried over the {extent} against a better solution"
        return f"from trials in double precision over the {extent}, whose errors shrink with epsilon"

    def _closed_error(self, setting: Setting) -> float:
        """Of a closed form against itself with more digits; it costs the same at any horizon."""
        if setting not in self._measured:
            floor = _CLOSED_FLOOR * epsilon(setting.precision)
            self._measured[setting] = math.inf
            if floor <= self._accuracy:
                bits = working_bits(setting.precision)
                better = Setting("quadruple" if bits < 100 else int(bits / 3) + 20, method="closed_form")
                times = spread_times(self._experiment, _CLOSED_TIMES)
                one, other = self._trial(setting, times), self._trial(better, times)
                if one is not None and other is not None:
                    found = float(angles_between(one.attitudes, other.attitudes).max())
                    self._measured[setting] = max(found, floor)
        return self._measured[setting]

    def _obvious(self, setting: Setting) -> bool:
        return self.known.rounding(setting.precision) * _CLEARLY <= self._accuracy

    def _rounding(self, setting: Setting) -> float:
        if self._obvious(setting):
            return self.known.rounding(setting.precision)
        base = Setting(formulation=setting.formulation, hold_invariants=setting.hold_invariants)
        if base not in self._measured:
            self._measured[base] = self._try(base)
        return self._measured[base] * epsilon(setting.precision) / epsilon("double")

    def _series(self, setting: Setting) -> float:
        """Error of a tolerance: measured, or in proportion to the nearest one measured."""
        if setting in self._measured:
            return self._measured[setting]
        assert setting.tolerance is not None
        alike = replace(setting, precision="double", tolerance=_BASE_TOLERANCE)
        if alike not in self._measured:
            self._measured[alike] = self._try(alike)
        same = [
            s
            for s in self._measured
            if s.tolerance is not None
            and (s.formulation, s.hold_invariants) == (setting.formulation, setting.hold_invariants)
        ]
        wanted = math.log(setting.tolerance)
        nearest = min(same, key=lambda s: abs(math.log(s.tolerance or 1.0) - wanted))
        return self._measured[nearest] * setting.tolerance / (nearest.tolerance or 1.0)

    def _try(self, setting: Setting) -> float:
        """Error at the run's end, from that over the part tried."""
        exact = working_bits(setting.precision) <= 53 and not self._obvious(setting)
        reference = self._reference("extended" if exact else "double", setting.formulation)
        trial = self._trial(setting, self._times)
        if trial is None or reference is None:
            return math.inf
        errors = angles_between(trial.attitudes, reference.attitudes)
        late = float(errors.max())
        if late > _SATURATED:  # no longer small: only the law knows how large it would be
            tolerance = setting.tolerance or epsilon(setting.precision)
            return max(late, self.known.rounding("double") * tolerance / epsilon("double"))
        late = max(late, epsilon(setting.precision))
        if self.part >= 1.0:
            return late
        early = max(float(errors[: len(errors) // 4].max()), late * 1e-300)
        power = math.log(late / early) / math.log(4)
        if power > _EXPONENTIAL:
            left = (1 / self.part - 1) / 0.75 * math.log(late / early)
            return late * math.exp(min(left, _LARGEST_EXPONENT))
        law = 1.2 if setting.tolerance is not None else 1.0 if setting.hold_invariants else 1.5
        return late * (1 / self.part) ** max(law, min(power, _POWER))

    def _reference(self, precision: str, formulation: str) -> Trial | None:
        held = precision != "double" and self.known.holds
        setting = Setting(precision, formulation=formulation, hold_invariants=held)
        if setting not in self._references:
            self._references[setting] = self._trial(setting, self._times)
        return self._references[setting]

    def _trial(self, setting: Setting, times: list[Any]) -> Trial | None:
        try:
            trial = try_setting(
                self._experiment,
                setting,
                times,
                loads=self._loads,
                compact=True,
                told=self._observer.trying,
            )
        except ConfigError:
            return None
        return trial if trial.status is Status.FINISHED and trial.rows == len(times) else None
