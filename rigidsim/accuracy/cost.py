"""Cost of a setting as a count, so that no clock decides what is chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from rigidsim.accuracy.setting import Setting

_STEPS: Mapping[str | int, float] = MappingProxyType(
    {"single": 1.25, "double": 1.0, "extended": 9.0, "quadruple": 135.0}
)


@dataclass(frozen=True)
class UnitCosts:
    """Costs in steps of double precision at its epsilon.

    The defaults were measured by ``experiments/accuracy_certificates.py --calibrate``, which says where they
    are off by more than 1.3.

    Attributes:
        steps: cost of a step over the square of its Taylor order, relative to double precision.
        digits_step: the same at 50 digits, proportional to the digits beyond.
        projected: cost factor of a step after which invariants are projected.
        closed_start, closed_sample: cost of a closed form's first sample, and of each one, to 53 bits.
        wide_closed_sample, digits_closed_sample: cost of each to 64 or 113 bits, and to 50 digits.
        seconds: duration of the unit for a free body on one core; for messages only.
    """

    steps: Mapping[str | int, float] = field(default_factory=lambda: _STEPS)
    digits_step: float = 155.0
    projected: float = 1.05
    closed_start: float = 800.0
    closed_sample: float = 0.4
    wide_closed_sample: float = 1400.0
    digits_closed_sample: float = 1900.0
    seconds: float = 1e-6


MEASURED = UnitCosts()


def cost(setting: Setting, steps: float, samples: int, *, units: UnitCosts = MEASURED) -> float:
    """Approximate cost in steps of double precision at its epsilon.

    A step's work goes with the square of the Taylor order; steps are about as long at any tolerance.

    Args:
        steps: natural steps of the run; irrelevant for a closed form.
        samples: samples of the run; they cost next to nothing if steps are taken.
    """
    digits = max(1.0, setting.precision / 50) if isinstance(setting.precision, int) else None
    if not setting.has_steps:
        if setting.bits <= 53:
            return units.closed_start + samples * units.closed_sample
        if digits is not None:
            return samples * units.digits_closed_sample * digits
        return samples * units.wide_closed_sample
    step = units.steps[setting.precision] if digits is None else units.digits_step * digits
    projected = units.projected if setting.hold_invariants else 1.0
    return steps * step * (setting.taylor_order / 20) ** 2 * projected
