"""Filling in the summary of a run once its end is known: cost, drifts, accuracy, warnings."""

import math
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from rigidsim.accuracy.modelling import modelling_of
from rigidsim.scene.cautions import Caution
from rigidsim.session.dataset import unused_variables
from rigidsim.session.diagnostics import Diagnostics, advice_on
from rigidsim.session.session import Stopwatch
from rigidsim.session.understood import body_of, cautions_of, span_of, start_of, told_loads
from rigidsim.solve.lyapunov import LyapunovSpectrum
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.projection import LATE
from rigidsim.solve.sampler import Progress
from rigidsim.solve.status import Status
from rigidsim.store.provenance import Attributes, repeated
from rigidsim.store.summary import Summary, as_fields
from rigidsim.store.summary_parts import (
    Accuracy,
    BitForBit,
    Cost,
    InvariantDrift,
    Lyapunov,
    Modelling,
    TableErrors,
    UnmeasuredCode,
)

_NOT_CERTIFIED = "not certified against an independent solution"


def summarise(
    found: Diagnostics,
    spectrum: LyapunovSpectrum | None,
    *,
    remarks: Sequence[Caution],
    initial: Mapping[str, list[float]],
    attributes: Attributes,
    **ended: Any,
) -> Summary:
    """The summary without the digests of files that are still to be written. Remarks on how the session began
    precede the warnings; ``initial``: components of the invariants; ``ended``: how it ended, and its cost.
    """
    prepared, progress = found.prepared, found.progress
    scene, system = prepared.scene, prepared.system
    return Summary(
        name=scene.name,
        description=scene.description,
        status=progress.status.value,
        exit_code=progress.status.exit_code,
        **as_fields([*remarks, *cautions_of(scene), *found.cautions()]),
        samples=progress.next_sample,
        samples_planned=progress.samples,
        engine_time=progress.time,
        formulation=system.formulation.name,
        states=tuple(system.states),
        precision=prepared.precision.name,
        tolerance=prepared.effective_tolerance,
        method=scene.config.integrator.method,
        hold_invariants=prepared.holds_invariants,
        hold_from_step=LATE if prepared.holds_late else None,
        invariants=_invariants(found, initial),
        unwatched=system.unwatched,
        accuracy=_accuracy(found),
        modelling=_modelling(found),
        tables=_tables(found),
        lyapunov=_lyapunov(found, spectrum),
        body=body_of(scene),
        start=start_of(scene),
        time=span_of(scene),
        loads=told_loads(prepared, sizes=False),
        bit_for_bit=_bit_for_bit(prepared, progress, attributes.get("mixed_provenance")),
        provenance=repeated(attributes),
        advice=advice_on(found),
        undefined_samples={name: seen.count for name, seen in found.statistics.undefined.items()},
        **ended,
    )


def cost_so_far(prepared: InitialValueProblem, progress: Progress, watch: Stopwatch) -> Cost:
    """Cost of the run so far."""
    exponent = prepared.system.scaling.time
    return Cost(
        steps=progress.steps,
        steps_redone=progress.redone_steps,
        smallest_step=_seconds(progress.smallest_step, exponent),
        largest_step=_seconds(progress.largest_step, exponent),
        **watch.as_dict(progress.integration_seconds),
    )


def _seconds(step: float, exponent: int) -> float | None:
    value = math.ldexp(step, exponent) if math.isfinite(step) else math.inf
    return value if math.isfinite(value) else None


def _invariants(found: Diagnostics, initial: Mapping[str, list[float]]) -> dict[str, InvariantDrift]:
    statistics, table = found.statistics, {}
    held = not unused_variables(found.prepared, found.progress.steps)
    for invariant in found.prepared.system.invariants:
        name, values = invariant.name, initial[invariant.name]
        table[name] = InvariantDrift(
            initial=values[0] if len(values) == 1 else tuple(values),
            units=invariant.units,
            scale=float(invariant.scale),
            scale_name=invariant.scale_name,
            largest_drift=_finite(statistics.largest.get(name)),
            final_drift=_finite(statistics.final.get(name)),
            bound=found.drift_bound,
            put_back=statistics.put_back.get(name) if held else None,
            why=invariant.why,
            numerical=invariant.numerical,
        )
    return table


def _finite(drift: float | None) -> float | None:
    return drift if drift is not None and math.isfinite(drift) else None


def _accuracy(found: Diagnostics) -> Accuracy:
    estimate, output = found.estimate, found.prepared.scene.config.output
    uncertified: dict[str, Any] = {"requested": None, "certified": None, "how": _NOT_CERTIFIED}
    if estimate is None:
        why = "the run has not ended" if output.estimate else "[output] estimate = false"
        if output.estimate and found.progress.status.final and found.prepared.algorithm.own_errors:
            why = "its method reports no errors"
        unknown: dict[str, Any] = dict.fromkeys(("estimated_attitude_error", "amplification"))
        return Accuracy(**uncertified, **unknown, estimated_how=f"not estimated: {why}")
    caveat = found.prepared.system.formulation.variables.caveat
    return Accuracy(
        **uncertified,
        estimated_attitude_error=estimate.attitude,
        estimated_position_error=estimate.position,
        estimated_velocity_error=estimate.velocity,
        estimated_how=estimate.how + (f"; {caveat}" if caveat else ""),
        amplification=min(estimate.amplification, sys.float_info.max),
        error_growth_rate=estimate.growth_rate,
        predictable_seconds=estimate.predictable_seconds,
        amplification_seconds=estimate.seconds,
        examined_share=estimate.share,
        amplification_how="of the estimated error over a stable motion's, whose rounding errors grow "
        "as (eps/2) sqrt(steps) sqrt(4 + (|w| t)^2 / 3), and what the tolerance cuts off; 1 for a stable one",
    )


def _tables(found: Diagnostics) -> dict[str, TableErrors]:
    orbits = [load.table for load in found.prepared.system.plan.loads]
    return {orbit.name: TableErrors(**vars(orbit.error)) for orbit in orbits if orbit is not None}


def _modelling(found: Diagnostics) -> Modelling | None:
    prepared = found.prepared
    if found.modelling is not None or prepared.system.formulation.average is None:
        return found.modelling
    code, why = UnmeasuredCode.NOT_ENDED, "the run has not reached its end"
    if not prepared.scene.config.output.estimate:
        code, why = UnmeasuredCode.NOT_ASKED, "[output] estimate = false"
    elif found.unmeasured is not None:
        code, why = found.unmeasured.code, str(found.unmeasured)
    return modelling_of(prepared, how=f"not measured: {why}", unmeasured=code.value)


def _lyapunov(found: Diagnostics, spectrum: LyapunovSpectrum | None) -> Lyapunov | None:
    if spectrum is None:
        return None
    chaotic = spectrum.chaotic(float(found.prepared.system.rate_bound))
    return Lyapunov(
        chaotic=chaotic,
        largest_exponent=spectrum.largest,
        moved_over_second_half=spectrum.spread,
        e_folding_seconds=1 / spectrum.largest if chaotic else None,
        predictable_seconds=None if found.estimate is None else found.estimate.predictable_seconds,
        exponents=tuple(float(x) for x in spectrum.exponents[-1]),
        states=spectrum.states,
        units="s-1",
    )


def _bit_for_bit(prepared: InitialValueProblem, progress: Progress, mixed: str | None) -> BitForBit:
    holds_for = "the same config, versions and CPU features as recorded in provenance"
    if prepared.python_loads:
        holds_for = "nothing: loads given from Python are not in the config"
    elif mixed:
        holds_for = f"nothing: the run was resumed on another machine or version ({mixed})"
    claim = progress.status in (Status.FINISHED, Status.EVENT) and not prepared.python_loads and not mixed
    return BitForBit(claim=claim, holds_for=holds_for)
