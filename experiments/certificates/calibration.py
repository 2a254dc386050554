"""What counted costs rest on, measured: CPU per step of each precision, and per sample of the closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import rigidsim
from rigidsim.accuracy.setting import Setting, cost
from rigidsim.accuracy.trial import Trial, try_setting

_REPEATS = 5
_OFF = 1.3  # times: counted costs are within that of the measured ones, or want correcting
_SAMPLES = (10, 2000)
_WIDE_SAMPLES = (10, 60)
BODY = """name = "calibration"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.3, 1.0, 0.5]
"""
_ENDS: dict[str | int, float] = {"single": 2e4, "double": 2e4, "extended": 8e3, "quadruple": 300, 50: 150}
_LOOSER = {"single": 1e-4, "double": 1e-8, "extended": 1e-12, "quadruple": 1e-20, 50: 1e-30}


@dataclass(frozen=True)
class Unit:
    """A cost in steps of double precision at its epsilon.

    Attributes:
        what: of one step, or of so many samples.
        measured: median.
        counted: by ``rigidsim.accuracy.setting.cost``.
    """

    what: str
    measured: float
    counted: float

    @property
    def off(self) -> bool:
        """Whether the count wants correcting."""
        return not 1 / _OFF <= self.counted / self.measured <= _OFF

    @property
    def line(self) -> str:
        """For the terminal."""
        verdict = f"  off by {self.counted / self.measured:.2f}" if self.off else ""
        return f"{self.what:50} measured {self.measured:9.3g}  counted {self.counted:9.3g}{verdict}"


def calibrate() -> list[Unit]:
    """Of a free asymmetric body, medians of five; about half a minute.

    Long enough, with so few samples, that steps are what takes the time. Each repeat is compiled anew, since
    integrators differ in speed for their whole life. Units are those of the same minute.
    """
    found = []
    step = _per_step(Setting())
    for precision in _ENDS:
        for tolerance in (None, _LOOSER[precision]):
            for held in (False, True):
                setting = Setting(precision, tolerance, hold_invariants=held)
                found.append(Unit(f"step, {setting.title}", _per_step(setting) / step, cost(setting, 1, 0)))
    for digits in ("double", "quadruple", 50, 100):
        closed = Setting(digits, method="closed_form")
        for samples in _SAMPLES if digits == "double" else _WIDE_SAMPLES:
            cpu = np.median([t.cpu_seconds for t in _trials(closed, 1e3, samples)])
            found.append(
                Unit(f"{samples} samples, {closed.title}", float(cpu) / step, cost(closed, 0, samples))
            )
    return found


def _per_step(setting: Setting) -> float:
    """CPU seconds."""
    trials = _trials(setting, _ENDS[setting.precision], 9)
    assert trials[0].order == setting.taylor_order
    return float(np.median([t.cpu_seconds / t.steps for t in trials]))


def _trials(setting: Setting, end: float, samples: int) -> list[Trial]:
    experiment = rigidsim.parse(BODY, overrides=[f"time.end={end!r}", f"time.samples={samples}"])
    return [try_setting(experiment, setting) for _ in range(_REPEATS)]
