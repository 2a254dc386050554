"""The honest summary of a run: cost, drifts against the round-off law, and everything to be wary of."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from rigidsim.prepare import Prepared
from rigidsim.solve.advance import Progress
from rigidsim.solve.growth import Growth
from rigidsim.solve.lyapunov import LyapunovSpectrum
from rigidsim.solve.status import Status

DRIFT_FACTOR = 50.0
"""A sound run keeps relative drifts below this times tolerance times sqrt(steps): rounding errors of the
steps add up like a random walk (Brouwer 1937), with a few roundings per step."""

_LOST_DIGITS = 1e-2  # rad; an attitude this uncertain is no result any more
UNCERTAIN = "the attitude is uncertain"
NEAR_SINGULAR = 1e-3
"""Factor from which Euler angles lose digits to their singularity."""

CLOSED_FORM = 50.0
"""eps: rounding of a sample from a closed form, thirty operations and sines right to 4 ulp, at any time."""

_STEPS_TO_SINGULARITY = math.e**2  # a Taylor step is e^-2 of the way to it (Jorba & Zou 2005)


@dataclass
class Watch:
    """What is followed over all samples.

    Attributes:
        largest, final: drifts by invariant.
        put_back: of those held, what was put back before the latest sample.
        nearest_singularity: smallest absolute singular factor at a sample, and its time.
    """

    largest: dict[str, float] = field(default_factory=dict)
    final: dict[str, float] = field(default_factory=dict)
    put_back: dict[str, float] = field(default_factory=dict)
    nearest_singularity: float = math.inf
    singularity_time: float = math.nan

    def see(self, invariant: str, drifts: np.ndarray) -> None:
        """Follow one invariant through a block of samples."""
        size = np.abs(drifts)
        self.largest[invariant] = float(max(self.largest.get(invariant, 0.0), np.max(size)))
        self.final[invariant] = float(drifts[-1])

    def see_singular(self, factors: np.ndarray, times: np.ndarray) -> None:
        """Follow the distance from a formulation's singularity."""
        size = np.abs(factors.astype(np.float64))
        nearest = int(np.argmin(size))
        if size[nearest] < self.nearest_singularity:
            self.nearest_singularity = float(size[nearest])
            self.singularity_time = float(times[nearest])


def round_off_law(tolerance: float, steps: int, rate: float, duration: float) -> float:
    """Attitude error (rad) of a good integration: (eps / 2) sqrt(steps) |w| t / sqrt 3.

    Rounding lets the frequencies wander as a random walk, and the phase integrates the walk (Brouwer 1937).
    Motions near an unstable axis amplify errors further: see ``rigidsim.solve.growth``.
    """
    return tolerance / 2 * math.sqrt(max(steps, 1)) * rate * duration / math.sqrt(3)


def invariant_table(
    prepared: Prepared,
    watch: Watch,
    steps: int,
    initial: dict[str, list[float]],
) -> dict[str, Any]:
    """One entry per invariant."""
    bound = DRIFT_FACTOR * prepared.law_tolerance * math.sqrt(max(steps, 1))
    table = {}
    for invariant in prepared.system.invariants:
        values = initial[invariant.name]
        table[invariant.name] = {
            "initial": values[0] if len(values) == 1 else values,
            "units": invariant.units,
            "scale": float(invariant.scale),
            "scale_name": invariant.scale_name,
            "largest_drift": watch.largest.get(invariant.name),
            "final_drift": watch.final.get(invariant.name),
            "bound": bound,
            "put_back": watch.put_back.get(invariant.name),
            "why": invariant.why,
            "numerical": invariant.numerical,
        }
    return table


def warnings(prepared: Prepared, progress: Progress, watch: Watch, growth: Growth | None) -> list[str]:
    """Reasons not to trust the result; empty for a sound run."""
    found = []
    system = prepared.system
    bound = DRIFT_FACTOR * prepared.law_tolerance * math.sqrt(max(progress.steps, 1))
    for name, drift in watch.largest.items():
        if not drift <= bound:
            found.append(
                f"{name} drifted by {drift:.2g}, more than {bound:.2g} = 50 tolerance sqrt(steps), which "
                "rounding alone explains; choose a tighter tolerance, a higher precision or another "
                "formulation"
            )
    passed = _passed(prepared, progress)
    if watch.nearest_singularity < NEAR_SINGULAR:
        found.append(
            f"the Euler angles came near the singularity of {system.sequence} (factor "
            f"{watch.nearest_singularity:.2g} at {watch.singularity_time:.6g} s), where they lose digits; "
            'choose formulation = "quaternion"'
        )
    elif system.singular_factor is not None and passed < NEAR_SINGULAR:
        found.append(
            f"the Euler angles came near the singularity of {system.sequence} between two samples (within "
            f"about {passed:.1g} rad, by the shortest step), where they lose digits; choose formulation = "
            '"quaternion"'
        )
    scene = prepared.scene
    if scene.gravity is not None and not scene.free_flight and scene.torque_arm is None:
        found.append(
            "uniform_gravity has no effect, since the body turns about its centre of mass; give [body] "
            "reference or center_of_mass for a top, or [initial] position for free flight"
        )
    estimate = estimated_error(prepared, progress, growth, watch)
    if system.requirements.formulation == "rates":
        if estimate is not None and estimate > _LOST_DIGITS:
            found.append(
                f"the angular velocity is uncertain by about {min(estimate, 2.0):.2g} of its size at "
                f"the end, so its digits are gone{_since(prepared, progress, growth)}; choose a higher "
                "precision or a nearer end"
            )
    elif estimate is not None and estimate > _LOST_DIGITS:
        found.append(
            f"{UNCERTAIN} by about {min(estimate, math.pi):.2g} rad at the end, so its "
            f"digits are gone{_since(prepared, progress, growth)}; choose a higher precision or a nearer end"
        )
    turns = float(system.rate_bound) * largest_spacing(prepared) / math.pi
    joined = [r.name for r in system.recorded if r.continuity in ("unwrap", "nearest")]
    if joined and turns > 1:
        found.append(
            f"{' and '.join(joined)} can't be joined with certainty: the body may turn by {turns * 180:.3g} "
            "degrees between samples; sample more often, or choose the formulation that carries them"
        )
    return found


def _with_spectrum(growth: Growth | None, spectrum: LyapunovSpectrum | None, rate: float) -> Growth | None:
    """What the whole run's exponents say stands above what the beginning alone showed."""
    if growth is None or spectrum is None:
        return growth
    if spectrum.chaotic(rate):
        return replace(growth, factor=1.0, window=0.0, rate=spectrum.largest)
    return replace(growth, rate=0.0)


def _lyapunov(
    prepared: Prepared, progress: Progress, growth: Growth | None, spectrum: LyapunovSpectrum | None
) -> dict[str, Any] | None:
    if spectrum is None:
        return None
    chaotic = spectrum.chaotic(float(prepared.system.rate_bound))
    return {
        "chaotic": chaotic,
        "largest_exponent": spectrum.largest,
        "moved_over_second_half": spectrum.spread,
        "e_folding_seconds": 1 / spectrum.largest if chaotic else None,
        "predictable_seconds": predictable_seconds(prepared, progress, growth),
        "exponents": [float(x) for x in spectrum.exponents[-1]],
        "states": list(spectrum.states),
        "units": "s-1",
    }


def _since(prepared: Prepared, progress: Progress, growth: Growth | None) -> str:
    horizon = predictable_seconds(prepared, progress, growth)
    if horizon is None or growth is None:
        return ""
    start = float(prepared.scene.start)
    since = start + max(horizon, 0.0)
    return f" from about {since:.3g} s on (errors grow e-fold every {1 / growth.rate:.3g} s)"


def largest_spacing(prepared: Prepared) -> float:
    """Between neighbouring samples, seconds."""
    samples = prepared.scene.samples
    if samples.times is not None:
        pairs = pairwise(samples.times)
        return max((float(b - a) for a, b in pairs), default=0.0)
    return float(samples.span / samples.intervals)


def _passed(prepared: Prepared, progress: Progress) -> float:
    """About how near a chart's singularity the motion came between two samples, by the shortest step, rad."""
    shortest = math.ldexp(progress.smallest_step, prepared.system.scaling.time)
    return shortest * float(prepared.system.rate_bound) * _STEPS_TO_SINGULARITY


def _condition(prepared: Prepared, progress: Progress, watch: Watch) -> float:
    """What the formulation itself makes of a rounding error.

    Rates from canonical momenta are I^-1 K^T p: a rounded momentum is of the size of the largest moment and
    is divided by the smallest, and K has the inverse of the singular factor in it.
    """
    if prepared.system.requirements.formulation != "canonical":
        return 1.0
    moments = [m for m in prepared.scene.body.principal_moments if m != 0]
    nearest = min(watch.nearest_singularity, _passed(prepared, progress), 1.0)
    return float(max(moments) / min(moments)) / max(nearest, sys.float_info.min)


def attitude_error(
    prepared: Prepared, progress: Progress, growth: Growth | None, watch: Watch
) -> float | None:
    """``estimated_error``; None without an attitude."""
    rates = prepared.system.requirements.formulation == "rates"
    return None if rates else estimated_error(prepared, progress, growth, watch)


def estimated_error(
    prepared: Prepared, progress: Progress, growth: Growth | None, watch: Watch
) -> float | None:
    """Estimate at the end, rad (of rates: relative to their size): the round-off law times the growth by the
    motion and by the formulation; a few roundings for a closed form.
    """
    if growth is None:
        return None
    if prepared.closed is not None:
        return CLOSED_FORM * float(prepared.precision.epsilon)
    duration = abs(progress.time - float(prepared.scene.start))
    rate = float(prepared.system.rate_bound)
    law = round_off_law(prepared.law_tolerance, progress.steps, rate, duration)
    estimate = law * growth.at(duration) * _condition(prepared, progress, watch)
    return estimate if math.isfinite(estimate) else sys.float_info.max


def predictable_seconds(prepared: Prepared, progress: Progress, growth: Growth | None) -> float | None:
    """Time after the start from which the attitude's digits are gone, by the estimate.

    None for motions whose errors don't grow exponentially.
    """
    if growth is None or growth.rate == 0.0:
        return None
    duration = abs(progress.time - float(prepared.scene.start))
    rate = float(prepared.system.rate_bound)
    law = round_off_law(prepared.law_tolerance, progress.steps, rate, duration)
    if law == 0.0:
        return None
    horizon = duration
    for _ in range(50):  # a contraction: the law grows like t^1.5, the motion's growth exponentially
        seed = law * (max(horizon, 1e-3 * duration) / duration) ** 1.5 * growth.factor
        seed = min(seed, sys.float_info.max)  # of a motion that broke down where growth was measured
        horizon = growth.window + math.log(_LOST_DIGITS / seed) / growth.rate
    return max(horizon, 0.0)


def summarise(
    prepared: Prepared,
    progress: Progress,
    watch: Watch,
    growth: Growth | None,
    spectrum: LyapunovSpectrum | None,
    *,
    message: str,
    initial: dict[str, list[float]],
    seconds: dict[str, float],
    cpu_seconds: float,
    provenance: dict[str, Any],
    remarks: Sequence[str] = (),
    mixed: str = "",
) -> dict[str, Any]:
    """The content of ``summary.json``."""
    scene, system = prepared.scene, prepared.system
    growth = _with_spectrum(growth, spectrum, float(system.rate_bound))
    estimate = attitude_error(prepared, progress, growth, watch)
    duration = abs(progress.time - float(scene.start))
    return {
        "name": scene.name,
        "description": scene.description,
        "status": progress.status.value,
        "message": message,
        "exit_code": progress.status.exit_code,
        "warnings": [*remarks, *warnings(prepared, progress, watch, growth)],
        "samples": progress.next_sample,
        "samples_planned": progress.samples,
        "time_reached": progress.time,
        "formulation": system.requirements.formulation,
        "states": system.states,
        "precision": prepared.precision.name,
        "tolerance": prepared.effective_tolerance,
        "cost": {
            "steps": progress.steps,
            "steps_redone": progress.redone_steps,
            "smallest_step": _seconds(progress.smallest_step, system.scaling.time),
            "largest_step": _seconds(progress.largest_step, system.scaling.time),
            "seconds": seconds,
            "cpu_seconds": cpu_seconds,
        },
        "method": scene.config.integrator.method,
        "hold_invariants": prepared.holds_invariants,
        "invariants": invariant_table(prepared, watch, progress.steps, initial),
        "accuracy": {
            "requested": None,
            "estimated_attitude_error": estimate,
            "estimated_how": "round-off law (tolerance/2) sqrt(steps) |w| t / sqrt 3, times amplification",
            "amplification": None if growth is None else min(growth.at(duration), sys.float_info.max),
            "error_growth_rate": None if growth is None else growth.rate,
            "predictable_seconds": predictable_seconds(prepared, progress, growth),
            "amplification_seconds": None if growth is None else growth.seconds,
            "amplification_how": "growth of small offsets over the linear growth of a stable motion, "
            "measured on the beginning of the motion; 1 for a stable one",
            "certified": None,
            "how": "not certified against an independent solution",
        },
        "lyapunov": _lyapunov(prepared, progress, growth, spectrum),
        "body": {
            "source": scene.body.source,
            "principal_moments": [float(m) for m in scene.body.principal_moments],
            "principal_axes": [[float(x) for x in axis] for axis in scene.body.principal_axes],
            "mass": None if scene.body.mass is None else float(scene.body.mass),
        },
        "bit_for_bit": _bit_for_bit(prepared, progress, mixed),
        "provenance": provenance,
    }


def _bit_for_bit(prepared: Prepared, progress: Progress, mixed: str) -> dict[str, Any]:
    holds_for = "the same config, versions and CPU features as recorded in provenance"
    if prepared.python_loads:
        holds_for = "nothing: loads given from Python are not in the config"
    elif mixed:
        holds_for = f"nothing: the run was resumed on another machine or version ({mixed})"
    claim = progress.status in (Status.FINISHED, Status.EVENT) and not prepared.python_loads and not mixed
    return {"claim": claim, "holds_for": holds_for}


def _seconds(step: float, exponent: int) -> float | None:
    value = math.ldexp(step, exponent) if math.isfinite(step) else math.inf
    return value if math.isfinite(value) else None
