"""References against which solutions are held: one policy for choices, certificates, and the bench.

A reference never shares the arithmetic of what it judges. It is the closed form with more digits, or an
integration with more digits, or, where both would take too long, an equal in other variables. All solutions
go along the same motion, which amplifies their errors alike, however strongly: the error of one is to its
difference from another as their errors per step are, but for scatter.
"""

import math
from dataclasses import replace

from rigidsim.accuracy.motion import KnownMotion
from rigidsim.accuracy.setting import Setting, epsilon
from rigidsim.scene.arithmetic import working_bits
from rigidsim.scene.choices import DEFAULT_FORMULATION, variables_named

LEAST_DIGITS = 50
"""Least digits of a multi-precision reference: 16 beyond quadruple precision."""
_SPARE_DIGITS = 20  # of a reference for digits, beyond theirs
MANY_STEPS = 1e5
"""Steps that take a second in extended precision, and a minute in quadruple."""
_CLEARLY = 0.01  # error of a reference with many digits, over the accuracy or the run's errors per step


def scatter_of(setting: Setting, steps: float) -> float:
    """Ratio of two settings' errors over that of their errors per step, after so many steps: more per square
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
    tolerance = _CLEARLY * accuracy / max(1.0, motion.error(1.0))
    tolerance /= scatter_of(replace(reference, tolerance=1.0), motion.steps)
    tolerance = min(tolerance, _CLEARLY * setting.level)
    return replace(reference, tolerance=tolerance) if tolerance > epsilon(reference.precision) else reference
