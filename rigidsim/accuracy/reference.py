"""References against which solutions are held: one policy for choices, certificates, and the bench.

A reference never shares the arithmetic of what it judges. It is the closed form with more digits, or an
integration with more digits, or, where both would take too long, an equal in other variables. All solutions
go along the same motion, which amplifies their errors alike, however strongly: the error of one is to its
difference from another as their errors per step are, but for scatter.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum

from rigidsim.accuracy.motion import KnownMotion
from rigidsim.accuracy.setting import Setting, epsilon
from rigidsim.scene.arithmetic import working_bits
from rigidsim.scene.choices import DEFAULT_FORMULATION, variables_named

LEAST_DIGITS = 50
"""Least digits of a multi-precision reference: 16 beyond quadruple precision."""
_SPARE_DIGITS = 20  # of a reference for digits, beyond theirs
_EXTENDED_STEPS, _WIDE_STEPS = 1e5, 1e5
"""Steps past which extended precision (a second) isn't the first choice, quadruple (a minute) isn't used."""
_CLEARLY = 0.01  # error of a reference with many digits, over the accuracy or the run's errors per step


def scatter_of(setting: Setting, steps: float) -> float:
    """Ratio of two settings' errors over that of their errors per step, after so many steps: more per square
    root of these if truncation errors add up while rounding errors walk at random.
    """
    return 100.0 if setting.tolerance is None else 100.0 + 10.0 * math.sqrt(steps)


class ReferenceKind(Enum):
    """Kind of a reference."""

    CLOSED_FORM = "closed form"
    FINER = "smaller errors per step"
    PEER = "an equal in other variables"


@dataclass(frozen=True)
class Reference:
    """A reference against which a solution may be held."""

    setting: Setting
    kind: ReferenceKind = ReferenceKind.FINER

    @property
    def how(self) -> str:
        """Description for the summary."""
        if self.kind is ReferenceKind.CLOSED_FORM:
            return f"against the closed form, {self.setting.precision}"
        if self.kind is ReferenceKind.PEER:
            return f"against {self.setting.title}, which is independent but no more accurate"
        return f"against {self.setting.title}"


def references(setting: Setting, motion: KnownMotion, accuracy: float) -> list[Reference]:
    """References for a whole run, from cheap to costly, as good as an accuracy (rad) needs."""
    loose = setting.has_steps and setting.tolerance is not None
    stepped: list[str | int] = []
    if setting.bits <= 53 and loose and motion.steps > _EXTENDED_STEPS:
        stepped.append("double")
    if setting.bits <= 53 and (motion.steps <= _EXTENDED_STEPS or not motion.exact):
        stepped.append("extended")
    costly: list[Reference] = []
    if motion.exact and setting.has_steps:
        costly.append(exact_beyond(setting.precision, motion.exact))
    elif motion.steps <= _WIDE_STEPS:
        stepped += ["quadruple"] * (setting.bits <= 64)
        stepped.append(digits_beyond(setting.precision))
    elif motion.exact:  # too long for steps: the closed form must check itself, with many more digits
        costly.append(exact_to(digits_beyond(setting.precision), motion.exact))
    else:
        other = variables_named(setting.formulation).checked_by
        peer = replace(setting, formulation=other, tolerance=None)
        costly.append(Reference(peer, ReferenceKind.PEER))
    finer = [stepped_reference(p, motion, motion.steps) for p in stepped]
    return [
        *(Reference(_only_as_good(s, setting, motion, accuracy)) for s in finer),
        *costly,
    ]


def digits_beyond(precision: str | int) -> int:
    """Digits of a reference for a precision."""
    return max(LEAST_DIGITS, int(working_bits(precision) * 0.302) + _SPARE_DIGITS)


def exact_beyond(precision: str | int, method: str) -> Reference:
    """The closed form with more digits than a precision; it costs the same at any horizon."""
    return exact_to("quadruple" if working_bits(precision) <= 64 else digits_beyond(precision), method)


def stepped_reference(
    precision: str | int,
    motion: KnownMotion,
    steps: float,
    formulation: str = DEFAULT_FORMULATION,
) -> Setting:
    """An integration at a precision's epsilon. Invariants are projected where that is right: with more digits
    than 64 bits rounding doesn't matter, nor does it over a short way in double precision.
    """
    projected = working_bits(precision) <= 64 and (precision != "double" or steps > _EXTENDED_STEPS)
    return Setting(precision, formulation=formulation, hold_invariants=projected and motion.holds)


def _only_as_good(reference: Setting, setting: Setting, motion: KnownMotion, accuracy: float) -> Setting:
    """A multi-precision reference with no more accuracy than needed."""
    if reference.bits <= 64:
        return reference
    tolerance = _CLEARLY * accuracy / max(1.0, motion.error(1.0))
    tolerance /= scatter_of(replace(reference, tolerance=1.0), motion.steps)
    tolerance = min(tolerance, _CLEARLY * setting.level)
    return replace(reference, tolerance=tolerance) if tolerance > epsilon(reference.precision) else reference


def exact_to(precision: str | int, method: str) -> Reference:
    """The closed form in a precision, or to so many digits."""
    return Reference(Setting(precision, method=method), ReferenceKind.CLOSED_FORM)
