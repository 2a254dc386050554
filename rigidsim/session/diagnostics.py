"""How far a run is to be trusted: its errors as the laws estimate them, and all that there is to warn of."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

from rigidsim.accuracy.error_law import CLOSED_FORM, DRIFT_FACTOR, round_off_law
from rigidsim.session.statistics import SampleStatistics
from rigidsim.solve.error_growth import Growth
from rigidsim.solve.loop import Progress
from rigidsim.solve.lyapunov import LyapunovSpectrum
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.store.summary import Caution, WarningCode

NEAR_SINGULAR = 1e-3
"""Factor from which Euler angles lose digits to their singularity."""
_LOST_DIGITS = 1e-2  # rad; an attitude this uncertain is no result any more
_STEPS_TO_SINGULARITY = math.e**2  # a Taylor step is e^-2 of the way to it (Jorba & Zou 2005)


def growth_by_spectrum(growth: Growth, spectrum: LyapunovSpectrum | None, rate: float) -> Growth:
    """What the whole run's exponents say stands above what the beginning alone showed.

    Args:
        rate: of the motion, rad/s.
    """
    if spectrum is None:
        return growth
    if spectrum.chaotic(rate):
        return replace(growth, factor=1.0, window=0.0, rate=spectrum.largest)
    return replace(growth, rate=0.0)


@dataclass(frozen=True)
class Diagnostics:
    """What a run's steps, its samples and the motion itself say of its errors.

    Attributes:
        growth: of errors by the motion.
    """

    prepared: InitialValueProblem
    progress: Progress
    statistics: SampleStatistics
    growth: Growth

    @property
    def duration(self) -> float:
        """That the run got to, seconds."""
        return abs(self.progress.time - float(self.prepared.scene.start))

    @property
    def drift_bound(self) -> float:
        """Relative drift that rounding alone explains."""
        return DRIFT_FACTOR * self.prepared.law_tolerance * math.sqrt(max(self.progress.steps, 1))

    @property
    def amplification(self) -> float:
        """Of rounding errors by the motion, up to the end."""
        return min(self.growth.at(self.duration), sys.float_info.max)

    @property
    def estimated_error(self) -> float:
        """At the end, rad (of rates: relative to their size): the round-off law times the growth by the
        motion and by the formulation; a few roundings for a closed form.
        """
        if self.prepared.closed is not None:
            return CLOSED_FORM * float(self.prepared.precision.epsilon)
        estimate = self._law() * self.growth.at(self.duration) * self._condition()
        return estimate if math.isfinite(estimate) else sys.float_info.max

    @property
    def attitude_error(self) -> float | None:
        """``estimated_error``; None without an attitude."""
        rates = self.prepared.system.requirements.formulation == "rates"
        return None if rates else self.estimated_error

    @property
    def predictable_seconds(self) -> float | None:
        """Time after the start from which the attitude's digits are gone, by the estimate.

        None for motions whose errors don't grow exponentially.
        """
        growth, duration, law = self.growth, self.duration, self._law()
        if growth.rate == 0.0 or law == 0.0:
            return None
        horizon = duration
        for _ in range(50):  # a contraction: the law grows like t^1.5, the motion's growth exponentially
            seed = law * (max(horizon, 1e-3 * duration) / duration) ** 1.5 * growth.factor
            seed = min(seed, sys.float_info.max)  # of a motion that broke down where growth was measured
            horizon = growth.window + math.log(_LOST_DIGITS / seed) / growth.rate
        return max(horizon, 0.0)

    def cautions(self) -> list[Caution]:
        """Reasons not to trust the result; empty for a sound run."""
        return [
            *self._drifts(),
            *self._singularity(),
            *self._gravity(),
            *self._digits(),
            *self._joining(),
        ]

    def _drifts(self) -> Iterator[Caution]:
        for name, drift in self.statistics.largest.items():
            if not drift <= self.drift_bound:
                yield Caution(
                    WarningCode.DRIFT,
                    f"{name} drifted by {drift:.2g}, more than {self.drift_bound:.2g} = 50 tolerance "
                    "sqrt(steps), which rounding alone explains; choose a tighter tolerance, a higher "
                    "precision or another formulation",
                )

    def _singularity(self) -> Iterator[Caution]:
        system, seen, passed = self.prepared.system, self.statistics, self._passed()
        if seen.nearest_singularity < NEAR_SINGULAR:
            where = f" (factor {seen.nearest_singularity:.2g} at {seen.singularity_time:.6g} s)"
        elif system.singular_factor is not None and passed < NEAR_SINGULAR:
            where = f" between two samples (within about {passed:.1g} rad, by the shortest step)"
        else:
            return
        yield Caution(
            WarningCode.SINGULARITY,
            f"the Euler angles came near the singularity of {system.sequence}{where}, where they lose "
            'digits; choose formulation = "quaternion"',
        )

    def _gravity(self) -> Iterator[Caution]:
        scene = self.prepared.scene
        if scene.gravity is not None and not scene.free_flight and scene.torque_arm is None:
            yield Caution(
                WarningCode.NO_EFFECT,
                "uniform_gravity has no effect, since the body turns about its centre of mass; give [body] "
                "reference or center_of_mass for a top, or [initial] position for free flight",
            )

    def _digits(self) -> Iterator[Caution]:
        estimate = self.estimated_error
        if estimate <= _LOST_DIGITS:
            return
        if self.prepared.system.requirements.formulation == "rates":
            code = WarningCode.RATES_UNCERTAIN
            what = f"the angular velocity is uncertain by about {min(estimate, 2.0):.2g} of its size"
        else:
            code = WarningCode.ATTITUDE_UNCERTAIN
            what = f"the attitude is uncertain by about {min(estimate, math.pi):.2g} rad"
        yield Caution(
            code,
            f"{what} at the end, so its digits are gone{self._since()}; choose a higher precision or a "
            "nearer end",
        )

    def _joining(self) -> Iterator[Caution]:
        system = self.prepared.system
        turns = float(system.rate_bound) * largest_spacing(self.prepared) / math.pi
        joined = [r.name for r in system.recorded if r.continuity == "nearest"]
        lost = self.statistics.angles_wrapped_from
        if not math.isnan(lost):
            names = " and ".join(r.name for r in system.recorded if r.continuity == "unwrap")
            yield Caution(
                WarningCode.NOT_JOINED,
                f"the turns of {names} aren't known from {lost:.6g} s on, where they are recorded within one "
                'turn; sample more often, or choose formulation = "euler_angles", which carries them',
            )
        if joined and turns > 1:
            yield Caution(
                WarningCode.NOT_JOINED,
                f"{' and '.join(joined)} can't be joined with certainty: the body may turn by "
                f"{turns * 180:.3g} degrees between samples; sample more often, or choose the formulation "
                "that carries them",
            )

    def _law(self) -> float:
        """Of rounding, up to the end, rad."""
        rate = float(self.prepared.system.rate_bound)
        return round_off_law(self.prepared.law_tolerance, self.progress.steps, rate, self.duration)

    def _since(self) -> str:
        horizon = self.predictable_seconds
        if horizon is None:
            return ""
        since = float(self.prepared.scene.start) + horizon
        return f" from about {since:.3g} s on (errors grow e-fold every {1 / self.growth.rate:.3g} s)"

    def _passed(self) -> float:
        """About how near a chart's singularity the motion came between two samples, by the shortest step,
        rad.
        """
        system = self.prepared.system
        shortest = math.ldexp(self.progress.smallest_step, system.scaling.time)
        return shortest * float(system.rate_bound) * _STEPS_TO_SINGULARITY

    def _condition(self) -> float:
        """What the formulation itself makes of a rounding error.

        Rates from canonical momenta are I^-1 K^T p: a rounded momentum is of the size of the largest moment
        and is divided by the smallest, and K has the inverse of the singular factor in it.
        """
        if self.prepared.system.requirements.formulation != "canonical":
            return 1.0
        moments = [m for m in self.prepared.scene.body.principal_moments if m != 0]
        nearest = min(self.statistics.nearest_singularity, self._passed(), 1.0)
        return float(max(moments) / min(moments)) / max(nearest, sys.float_info.min)


def largest_spacing(prepared: InitialValueProblem) -> float:
    """Between neighbouring samples, seconds."""
    samples = prepared.scene.samples
    if samples.times is not None:
        pairs = pairwise(samples.times)
        return max((float(b - a) for a, b in pairs), default=0.0)
    return float(samples.step)
