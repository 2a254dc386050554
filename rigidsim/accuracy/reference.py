"""References against which solutions are held, and their own errors: one policy for choices, certificates,
and the bench.

A reference never shares the arithmetic of what it judges. It is the closed form with more digits, or an
integration with more digits, or, where both would take too long, an equal in other variables. All solutions
go along the same motion, which amplifies their errors alike, however strongly: the error of one is to its
difference from another as their errors per step are, but for scatter.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from rigidsim.accuracy.motion import KnownMotion
from rigidsim.accuracy.setting import Setting, epsilon
from rigidsim.scene.arithmetic import working_bits
from rigidsim.scene.choices import DEFAULT_FORMULATION, variables_named

INCOMPARABLE = 0.5
"""Difference (rad) past which all digits are gone."""
LEAST_DIGITS = 50
"""Least digits of a multi-precision reference: 16 beyond quadruple precision."""
_SPARE_DIGITS = 20  # of a reference for digits, beyond theirs
_SECOND: dict[str | int, float] = {"quadruple": 1e-30, LEAST_DIGITS: 1e-44}
"""Tolerances of the second best of a precision: a thousand epsilons or more, so that it is another solution;
in extended and double precision "auto" without projected invariants is.
"""
_SAME_VARIABLES = 10.0
"""Ratio of the common error of solutions in the same variables to their distance."""


# With these no certificate of 200 random scenes was exceeded by the true error, and 199 of these runs were
# certified as they asked (``experiments/accuracy_certificates.py``).
TIMES, WIDE_TIMES = 4096, 129
"""Largest number of times compared; the latter for a closed form, which takes milliseconds per sample."""
_EXTENDED_STEPS, _WIDE_STEPS = 1e5, 1e5
"""Steps past which extended precision (a second) isn't the first choice, quadruple (a minute) isn't used."""
SAFETY, PICKED_SAFETY, PEER_SAFETY = 1.25, 2.0, 5.0
"""Factors on the largest difference: if all samples were compared; if only the fastest of each stretch, since
errors along the motion are largest where it is fastest; if the reference is no better than the run.
"""
AS_BAD = 3.0
"""Error of a reference no better than the run, over the difference."""
_CLEARLY = 0.01  # error of a reference with many digits, over the accuracy or the run's errors per step
_MUCH_BETTER = 1e-2  # ratio of errors per step to the run's below which a reference's own hardly matter


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


# --- which references there are --------------------------------------------------------------------------


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


def best_and_second(precision: str | int) -> tuple[Setting, Setting]:
    """The best setting of a precision, and the second best, from which the error of the best is known."""
    return Setting(precision, hold_invariants=True), Setting(precision, _SECOND.get(precision))


def equals_of(best: Setting, there: Iterable[Setting]) -> list[Setting]:
    """Solutions as good as a precision's best, or nearly so: in extended and double precision also those with
    rotation-matrix states, which round other initial values and coefficients.
    """
    second = _SECOND.get(best.precision)
    peers = (variables_named(best.formulation).checked_by,) if second is None else ()
    return [
        other
        for other in there
        if other != best
        and (other.precision, other.method, other.tolerance) == (best.precision, best.method, second)
        and other.formulation in (best.formulation, *peers)
    ]


# --- how wrong they are ----------------------------------------------------------------------------------


def errors_of_best(best: Setting, distances: Mapping[Setting, np.ndarray]) -> np.ndarray:
    """Errors (samples,), rad, of the best solution of a precision: its largest distance so far from equally
    good ones.

    Those in the same variables have begun with the same rounded values, and take the same steps until
    invariants are first projected: such a distance alone was up to six times (13 once) too small.

    They (at least one) aren't scaled by the errors per step, as in ``own_error``: a series keeps its
    tolerance by orders of magnitude, so that rounding can dominate in both (near a separatrix, in quadruple
    precision and at 1e-30, scaled errors were 70 times too small, held against 70 digits).
    """
    independent = best.precision in _SECOND or any(s.formulation != best.formulation for s in distances)
    largest = np.max(list(distances.values()), axis=0) * (1.0 if independent else _SAME_VARIABLES)
    return np.maximum(np.maximum.accumulate(largest), epsilon(best.precision))


def closed_form_error(digits: int) -> float:
    """Error of a closed form to so many digits, rad: two of them are left to rounding."""
    return 10.0 ** (2 - digits)


def own_error(
    reference: Reference,
    setting: Setting,
    difference: float,
    motion: KnownMotion,
    distance: Callable[[Setting], float],
) -> float:
    """Bound of a reference's own error, rad. A pilot may not have seen how strongly the motion amplifies
    errors; differences have, as the reference's largest distance from another setting's solution (inf without
    one).
    """
    if reference.kind is ReferenceKind.CLOSED_FORM:
        return 0.0  # dozens of digits more than the run
    own = reference.setting
    level = own.level * scatter_of(own, motion.steps)
    estimate = math.inf
    if setting.has_steps:
        estimate = difference * min(AS_BAD, level / setting.level)
        if own.bits <= setting.bits:  # rounded coefficients and initial values are the same in both
            return max(estimate, motion.rounding(own.precision))
        if level <= _MUCH_BETTER * setting.level:
            return estimate
    for precision in ("double", "extended"):
        probe = Setting(precision)
        if own.level > _MUCH_BETTER * probe.level:
            break
        found = distance(probe)
        if found < INCOMPARABLE:
            return min(estimate, max(found, probe.level) * level / probe.level)
    return min(estimate, motion.error(level))
