"""A run whose shadow ensemble is followed to learn how its errors grow, and what was learnt."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from rigidsim.solve.effects.waypoints import Waypoints
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.shadow.measures import Spread
from rigidsim.solve.taylor_stepper import TaylorStepper

UNCERTAIN = 1e-2
"""Error (rad, or relative to the rates) above which a result counts as lost."""


@dataclass(frozen=True)
class Course:
    """A run whose errors are to be followed.

    Attributes:
        start, end: times, internal units.
        steps: steps that it took.
        waypoints: some of its step boundaries; None if there are none.
        stepper: the run's stepper; it, or copies of its engine, are used if good enough.
        nearest: smallest singular factor of the run's chart; 1 for charts that are changed.
        uneven: ratio of its longest step to its shortest.
        lost: errors in epsilons past which nothing can be learnt.
    """

    prepared: InitialValueProblem
    start: float
    end: float
    steps: int
    waypoints: Waypoints | None
    stepper: TaylorStepper | None
    nearest: float
    uneven: float
    lost: float

    def at(self, share: float) -> float:
        """The time at a share of the run."""
        return self.end if share >= 1 else self.start + (self.end - self.start) * share

    @property
    def carried(self) -> bool:
        """Whether the run carries an attitude."""
        return self.prepared.system.requirements.attitude

    @property
    def loose(self) -> bool:
        """Whether the tolerance allows larger step errors than rounding causes."""
        return self.prepared.effective_tolerance > 2 * float(self.prepared.precision.epsilon)

    @property
    def same_states(self) -> bool:
        """Whether the ensemble has the run's states, which it does unless a loose tolerance would run into
        singularities of these.
        """
        return self.prepared.system.formulation.variables.regular

    @property
    def own(self) -> TaylorStepper | None:
        """The run's stepper if it can carry the ensemble; None otherwise."""
        single = self.prepared.system.partner is None and self.prepared.precision.name == "double"
        return self.stepper if single else None

    def leading(self, spread: Spread) -> np.ndarray:
        """Errors of the attitude, or of the rates if no attitude is carried."""
        return spread.along("attitude" if self.carried else "rates")

    def suspicious(self, spread: Spread, start: float, power: float) -> bool:
        """Whether errors grow faster than a power of time since a start, or couldn't be followed."""
        times = spread.along("time") - start
        if not (spread.whole[0] and len(times)):
            return not spread.whole[0]
        found = [self.leading(spread)]
        if spread.largest("distance")[0] > 0:
            found.append(spread.along("position"))
        return any(power_of_time(times, errors) > power for errors in found)


@dataclass(frozen=True)
class Followed:
    """Result of following an ensemble.

    Attributes:
        share: share of the run's time over which it was carried from its start, possibly until no digit is
            left.
        windows, in_windows: windows examined beyond that, and the part of the run they cover.
        more: how much more errors grow in these than in as much of the beginning, root mean square, by
            quantity; 1 if they don't.
    """

    spread: Spread
    share: float
    windows: int = 0
    in_windows: float = 0.0
    more: dict[str, float] = field(default_factory=dict)


def power_of_time(times: np.ndarray, errors: np.ndarray) -> float:
    """Power of time with which errors grew over the last three quarters."""
    largest = np.maximum.accumulate(errors)
    early = int(np.searchsorted(times, times[-1] / 4))
    if not (0 < largest[early] < math.inf and times[early] < times[-1] and largest[-1] < math.inf):
        return math.inf if largest[-1] > 0 else 0.0
    return float(math.log(largest[-1] / largest[early]) / math.log(times[-1] / times[early]))


def exponential_growth(
    times: np.ndarray, errors: np.ndarray, exponent: int, stable: float, least: float
) -> tuple[float, float | None]:
    """Rate of exponential growth, 1/s, and when digits are gone, seconds after the start; 0 and None if
    growth isn't exponential.

    Args:
        times: times since the start, internal units, whose binary exponent is ``exponent``.
        errors: rad, or relative.
        stable: power of time with which errors of stable motions grow.
        least: power of time up to which growth doesn't count as exponential.
    """
    largest = np.maximum.accumulate(errors)
    gone = int(np.searchsorted(largest, UNCERTAIN))
    last = min(gone, len(times) - 1)
    if last < 2 or power_of_time(times[: last + 1], largest[: last + 1]) < least:
        return 0.0, None
    early = int(np.searchsorted(times, times[last] / 4))
    if not largest[early] > 0:  # errors begin where a load does: they have not grown from anything
        return 0.0, None
    span = math.ldexp(float(times[last] - times[early]), exponent)
    ratio = min(largest[last], 1e300) / largest[early]
    rate = (math.log(ratio) - stable * math.log(times[last] / times[early])) / span
    seconds = math.ldexp(float(times[last]), exponent)
    if rate > 0 and gone >= len(times):
        seconds += math.log(UNCERTAIN / largest[last]) / rate
    return max(rate, 0.0), seconds
