"""One session of a run: integrate and save segments; if it ended, complete its files, and say how, at what
cost, and how far it can be trusted.
"""

import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidsim.accuracy.estimates import CLOSED_FORM, UNCERTAIN, Estimate, estimate_errors, label_rounding
from rigidsim.accuracy.modelling import Unmeasured, measure_modelling, modelling_of
from rigidsim.errors import VIEW, ConfigError, StoppedWritingError
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.choices import FULL, REDUCED
from rigidsim.scene.readable import TimeWords, span_text
from rigidsim.scene.schema import Output
from rigidsim.session import dataset, lyapunov
from rigidsim.session.dataset import unused_variables
from rigidsim.session.session import (
    AdviceLimits,
    Checkpoints,
    Guards,
    Interruption,
    Observer,
    Recorder,
    SampleStatistics,
    Session,
)
from rigidsim.session.understood import cautions_of, time_words, understood
from rigidsim.solve.assembly import Assembly, assemble
from rigidsim.solve.corrected_stepper import CorrectedStepper
from rigidsim.solve.effects.charts import Charts
from rigidsim.solve.effects.waypoints import SampleTrail
from rigidsim.solve.events import EventLog
from rigidsim.solve.lyapunov import LyapunovSpectrum
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.solve.projection import LATE
from rigidsim.solve.sampler import Progress
from rigidsim.solve.status import ENDED, Status
from rigidsim.solve.stepper import OwnErrors
from rigidsim.store import provenance
from rigidsim.store.folder import RunFolder
from rigidsim.store.provenance import repeated
from rigidsim.store.run import MemoryRun, MemoryWriter, Run, SavedRun
from rigidsim.store.segments import Arrays, Chain, SegmentWriter
from rigidsim.store.summary import (
    Accuracy,
    Advice,
    AdviceCode,
    BitForBit,
    ChartChanges,
    Cost,
    InvariantDrift,
    Lyapunov,
    Modelling,
    Summary,
    TableErrors,
    UnmeasuredCode,
    as_fields,
)
from rigidsim.store.variables import Extra

if TYPE_CHECKING:
    from rigidsim.look.thinning import Thinning

NEAR_SINGULAR = 1e-3
"""Singular factor below which Euler angles lose digits near their singularity."""
_STEPS_TO_SINGULARITY = math.e**2  # a Taylor step is e^-2 of the way to it (Jorba & Zou 2005)


@dataclass(frozen=True)
class Diagnostics:
    """Evidence on a run's errors from its steps, its samples and the motion itself: the estimate at its end,
    the error of a reduced model, or why it isn't known, and an averaged model that would have sufficed.
    """

    prepared: InitialValueProblem
    progress: Progress
    statistics: SampleStatistics
    estimate: Estimate | None = None
    modelling: Modelling | None = None
    unmeasured: Unmeasured | None = None
    cheaper: Advice | None = None

    @property
    def drift_bound(self) -> float:
        """Relative drift that rounding alone explains."""
        return float(self.prepared.drift_bound(self.progress.steps))

    def estimated(
        self,
        trail: SampleTrail | None = None,
        corrected: CorrectedStepper | None = None,
        go_on: Callable[[], bool] = lambda: True,
        own: Callable[[], OwnErrors | None] = lambda: None,
    ) -> "Diagnostics":
        """The diagnostics with an estimate of the errors; a ``go_on`` that gives False ends it without a
        result.
        """
        progress, beside = self.progress, ""
        if self.prepared.algorithm.own_errors:
            errors = own()
            return self if errors is None else replace(self, estimate=Estimate(**vars(errors)))
        if corrected is not None:
            acting = [one.registered for one in corrected.effects if one.registered and not one.rewrites]
            if acting:  # which a closed form knows nothing of
                trail, beside = None, f"; the closed form lacks the effects {', '.join(acting)}"
        last = float(self.prepared.scene.samples.last)
        found = estimate_errors(
            self.prepared,
            progress.steps,
            min(progress.time, last, key=lambda time: abs(time - float(self.prepared.scene.start))),
            trail=trail,
            corrected=corrected,
            go_on=go_on,
        )
        if found is not None and beside:
            found = replace(found, how=found.how + beside)
        return replace(self, estimate=found)

    def modelled(self, trail: SampleTrail | None, go_on: Callable[[], bool] = lambda: True) -> "Diagnostics":
        """The diagnostics with the error of a reduced model; arguments as for ``estimated``."""
        try:
            return replace(self, modelling=measure_modelling(self.prepared, trail, go_on).modelling)
        except Unmeasured as why:
            return replace(self, unmeasured=why)

    def cautions(self) -> list[Caution]:
        """Reasons not to trust the result; empty for a sound run."""
        return [
            *self._drifts(),
            *self._singularity(),
            *self._digits(),
            *self._joining(),
            *self._undefined(),
            *self._modelling(),
        ]

    @property
    def _words(self) -> TimeWords:
        return time_words(self.prepared.scene)

    def _drifts(self) -> Iterator[Caution]:
        for name, drift in self.statistics.largest.items():
            if math.isinf(drift):
                yield Caution(
                    WarningCode.DRIFT,
                    f"{name} has no finite value at some samples, so its drift isn't known; find the NaN in "
                    "the dataset, and correct the expression or leave it out",
                )
            elif not drift <= self.drift_bound:
                yield Caution(
                    WarningCode.DRIFT,
                    f"{name} drifted by {drift:.2g}, more than {self.drift_bound:.2g} = 50 tolerance "
                    "sqrt(steps), which rounding alone explains; choose a tighter tolerance, a higher "
                    "precision or another formulation",
                )
        for name, size in self.statistics.put_back.items():
            if not abs(size) <= self.drift_bound:
                yield Caution(
                    WarningCode.DRIFT,
                    f"{name} was corrected by {abs(size):.2g} in all, more than {self.drift_bound:.2g} = 50 "
                    "tolerance sqrt(steps), which rounding alone explains; choose a tighter tolerance or a "
                    "higher precision, or set hold_invariants = false to see how it drifts",
                )

    def _singularity(self) -> Iterator[Caution]:
        system, seen, passed = self.prepared.system, self.statistics, self._passed()
        if seen.nearest_singularity < NEAR_SINGULAR:
            where = (
                f" (factor {seen.nearest_singularity:.2g} at {self._words.moment(seen.singularity_time, 6)})"
            )
        elif system.singular_factor is not None and passed < NEAR_SINGULAR:
            where = f" between two samples (within about {passed:.1g} rad, by the shortest step)"
        else:
            return
        yield Caution(
            WarningCode.SINGULARITY,
            f"the Euler angles came near the singularity of {system.sequence}{where}, where they lose "
            'digits; choose formulation = "quaternion"',
        )

    def _digits(self) -> Iterator[Caution]:
        found = self.estimate
        if found is None or found.leading <= UNCERTAIN:
            return
        if found.attitude is None:
            code = WarningCode.RATES_UNCERTAIN
            what = f"the angular velocity is uncertain by about {found.rates:.2g} of its size"
        else:
            code = WarningCode.ATTITUDE_UNCERTAIN
            what = f"the attitude is uncertain by about {found.attitude:.2g} rad"
        loose = self.prepared.law_tolerance > float(self.prepared.precision.epsilon)
        given = loose and self.prepared.scene.config.integrator.tolerance != "auto"
        remedy = 'tolerance = "auto"' if given else "a higher precision"
        yield Caution(
            code,
            f"{what} at the end, so its digits are gone{self._since(found)}; choose {remedy} or a nearer end",
        )

    def _modelling(self) -> Iterator[Caution]:
        found = self.modelling
        if self.unmeasured is not None:
            yield Caution(
                WarningCode.MODEL_UNMEASURED,
                f"no error of the averaged model is known, since {self.unmeasured}; choose a less averaged "
                "level, or compare the directions with a run of the full model",
            )
        asked = self.prepared.scene.config.integrator.accuracy_axis
        averaged = not self.prepared.system.formulation.resolves_rotation
        ended = self.progress.status.exit_code == 0
        if found is None and averaged and ended and asked is not None:
            yield Caution(
                WarningCode.NOT_CERTIFIED,
                f"accuracy_axis = {float(asked):.3g} rad was asked for, but the error of the averaged model "
                "wasn't measured",
            )
        if found is None:
            return
        relative = max(found.angular_momentum_norm or 0.0, found.energy or 0.0)
        if relative > UNCERTAIN:
            yield Caution(
                WarningCode.MODEL_UNCERTAIN,
                f'[model] level = "{found.level}" leaves the momentum\'s norm or the energy uncertain by a '
                f"fraction of about {relative:.2g} at the end; choose a less averaged level, or a nearer end",
            )
        worst, most = found.worst or 0.0, UNCERTAIN
        if asked is not None:  # of the axes, by whatever cause
            most = float(asked)
            worst += (self.estimate.attitude or 0.0) if self.estimate is not None else 0.0
        if worst <= most:
            return
        # which isn't below it when it is rounded to a digit
        enough = (
            f", or ask for accuracy_axis = {1.5 * worst:.1g} if that is enough"
            if asked is None and worst < _DIRECTED
            else ""
        )
        yield Caution(
            WarningCode.MODEL_UNCERTAIN,
            f'[model] level = "{found.level}" leaves directions uncertain by about {worst:.2g} rad at the end'
            + ("" if asked is None else f", where accuracy_axis = {most:.2g} rad was asked for")
            + f"; choose a less averaged level{enough}",
        )

    def _joining(self) -> Iterator[Caution]:
        system = self.prepared.system
        turns = float(system.rate_bound) * self.prepared.scene.samples.largest_spacing / math.pi
        joined = [r.name for r in system.recorded if r.continuity == "nearest"]
        lost = self.statistics.angles_wrapped_from
        if not math.isnan(lost):
            names = [r.name for r in system.recorded if r.continuity == "unwrap"]
            yield Caution(
                WarningCode.NOT_JOINED,
                f"the turns of {' and '.join(names)} aren't known from {self._words.moment(lost, 6)} on; "
                'later angles are within one turn; sample more often, or choose method = "taylor"',
            )
        if joined and turns > 1:
            yield Caution(
                WarningCode.NOT_JOINED,
                f"{' and '.join(joined)} can't be joined with certainty: the body may turn by "
                f"{turns * 180:.3g} degrees between samples; sample more often, or choose the formulation "
                "that carries them",
            )

    def _undefined(self) -> Iterator[Caution]:
        """Warnings of variables that become undefined on the way; those undefined from the start belong to
        the scene, like the node of a sleeping top.
        """
        conventions = {r.name: r.attributes.get("convention", "") for r in self.prepared.system.recorded}
        for name, seen in self.statistics.undefined.items():
            if seen.count > seen.leading:
                why = conventions.get(name, "")
                yield Caution(
                    WarningCode.UNDEFINED,
                    f"{name} isn't defined, and recorded as NaN, at {seen.count} of "
                    f"{self.progress.next_sample} samples, first at {self._words.moment(seen.since, 6)}"
                    + (f" (its convention: {why})" if why else ""),
                )

    def _since(self, found: Estimate) -> str:
        if found.predictable_seconds is None or found.growth_rate == 0.0:
            return ""
        scene = self.prepared.scene
        since = float(scene.start) + scene.samples.direction * found.predictable_seconds
        folding = span_text(1 / found.growth_rate)
        return f" from about {self._words.moment(since, 3)} on (errors grow e-fold every {folding})"

    def _passed(self) -> float:
        """Estimate from the shortest step of how near a chart's singularity the motion came between samples,
        rad.
        """
        system = self.prepared.system
        shortest = math.ldexp(self.progress.smallest_step, system.scaling.time)
        return shortest * float(system.rate_bound) * _STEPS_TO_SINGULARITY


_DIRECTED = 0.3
"""Error of a direction (rad) from which on it is of no use to anyone."""
_LONG = 8192
"""Steps from which projecting invariants pays off (experiments/README.md: from 1e4 rad on,
some 2500 steps in double precision).
"""
_HELD = 3.0
"""tolerance sqrt(steps): attitude error with projected invariants, which grows as in a random walk.
Over free bodies and heavy symmetric tops it was 1 to 2 of that at 1e7 rad (``experiments.long_horizon``).
"""
_WORTH, _FAR = 30.0, 1000.0
"""Factors by which an error must shrink to be worth advice: by a switch, and by another method."""


def advice_on(found: Diagnostics) -> tuple[Advice, ...]:
    """Settings that would have given a far better attitude at the same cost or less, the best last.

    Only what was measured is promised: projecting invariants removes the errors of integrable motions (those
    with a closed form), whose frequencies depend on the projected invariants alone.
    """
    prepared, estimate = found.prepared, found.estimate
    if found.cheaper is not None:
        return (found.cheaper,)
    if estimate is None or not estimate.closed_form or estimate.attitude is None:
        return ()
    config, formulation = prepared.scene.config, prepared.system.formulation
    if not formulation.variables.in_closed_form or config.integrator.accuracy is not None:
        return ()
    now, advice = estimate.attitude, []
    held = _HELD * prepared.law_tolerance * math.sqrt(found.progress.steps) * estimate.amplification
    # sample times are rounded to doubles, which every estimate includes
    held += label_rounding(prepared, estimate.seconds) * float(prepared.system.rate_bound)
    if not prepared.holds_invariants and found.progress.steps >= _LONG and now > _WORTH * held:
        advice.append(Advice(code=AdviceCode.HOLD_INVARIANTS.value, now=now, then=held))
    exact = CLOSED_FORM * float(prepared.precision.epsilon)
    stepped = bool(config.events) or config.output.lyapunov or config.integrator.hold_invariants is True
    if not stepped and now > _FAR * exact:
        advice.append(Advice(code=AdviceCode.CLOSED_FORM.value, now=now, then=exact))
    return tuple(advice)


def cheaper_model(found: Diagnostics, limits: AdviceLimits, go_on: Callable[[], bool]) -> Advice | None:
    """The most averaged model that keeps the axes accurate, measured over the beginning of the run; None if
    none does, the run is short, or what is recorded needs every rotation.
    """
    prepared, estimate = found.prepared, found.estimate
    config, loads = prepared.scene.config, prepared.system.plan.loads
    suited = bool(loads) and all(load.gradient_source is not None for load in loads)
    short = found.progress.steps < limits.steps or estimate is None
    if short or not suited or config.model.level != FULL or config.output.record is None:
        return None
    for level in reversed(REDUCED):
        keys = [f'model.level="{level}"', "model.short_period=true"]
        try:
            other = prepare(prepared.experiment.with_overrides(keys), loads=prepared.python_loads)
            error = measure_modelling(other, go_on=go_on)
        except ConfigError:  # no such average exists, or it can't provide what is recorded
            continue
        except Unmeasured:
            return None
        if error.worst <= limits.apart:
            assert estimate is not None
            code, now = AdviceCode.AVERAGED.value, estimate.leading
            return Advice(code=code, now=now, then=error.worst, level=level, share=error.share)
    return None


def time_reached(prepared: InitialValueProblem, progress: Progress, log: EventLog) -> float:
    """Time of the last sample, or of the event that ended the run, s; the start time before the first
    sample.
    """
    clock = prepared.clock
    if progress.status in (Status.EVENT, *ENDED) and log.stop is not None:
        return clock.seconds(log.stop)
    done = progress.next_sample
    return float(clock.labels(done - 1, done)[0]) if done else clock.seconds(clock.start)


def status_message(prepared: InitialValueProblem, progress: Progress, parts: Assembly) -> str:
    """The status in words: which event ended the run and when, or where and why it broke down."""
    log = parts.log
    text, words = progress.status.message, time_words(prepared.scene)
    if progress.status is Status.EVENT:
        ending = log.ending
        assert ending is not None
        name, when = prepared.system.crossings[ending.index].name, prepared.clock.seconds(ending.time)
        return f"{text}: {name} at {words.moment(when)}"
    if progress.status in ENDED and log.stop is not None:
        return f"{text}: {log.why_impossible} at {words.moment(prepared.clock.seconds(log.stop))}"
    if progress.status is Status.UNRESOLVED:
        return f"{text}: {progress.detail} (at {words.moment(progress.time)}, after {progress.steps} steps)"
    if progress.status not in (Status.NON_FINITE, Status.COLLAPSED):
        return text
    text += f"; last good state at {words.moment(progress.time)} after {progress.steps} steps"
    if progress.last_good is None:
        return text
    state = np.array([progress.last_good.state], dtype=prepared.precision.scalar)
    factors = parts.evaluator.singular_factors(state, np.array([parts.stepper.chart]))  # where it stands
    if factors is not None and abs(float(factors[0])) < NEAR_SINGULAR:
        middle = float(state[0][prepared.system.states.index("theta")])
        text += (
            f"; the middle Euler angle theta = {middle:.9g} rad came within {abs(float(factors[0])):.2g} of "
            f"the singularity of {prepared.system.sequence}"
        )
        if progress.status is Status.NON_FINITE and prepared.precision.name == "single":
            # they go with the distance to the power of the order, and some
            text += ", where coefficients of the series exceed the range of single precision (3.4e38)"
        text += ': choose formulation = "quaternion"'
    else:
        largest = prepared.system.states[int(np.argmax(np.abs(state[0].astype(np.float64))))]
        spacing = float(prepared.precision.epsilon) * abs(progress.time)
        text += (
            f"; the largest state there was {largest}. A load may change there within less than "
            f"{spacing:.2g} s, the resolution of time in {prepared.precision.name} precision, or exceed the "
            "precision's range: choose a higher precision, a wider change, or smaller functions. Or a norm "
            "vanishes, and a root of zero has no series: add a small number under the root"
        )
    return text


def chart_changes(prepared: InitialValueProblem, parts: Assembly) -> ChartChanges | None:
    """How often a run in Euler angles changed charts; None for other formulations."""
    system = prepared.system
    if system.partner is None:
        return None
    charts = parts.corrected.effect(Charts)
    return ChartChanges(
        count=0 if charts is None else charts.changes,
        sequence=system.sequence,
        partner=system.partner.sequence,
    )


_NOT_CERTIFIED = "not certified against an independent solution"


def summarise(run: "_ActiveRun", found: Diagnostics, spectrum: LyapunovSpectrum | None) -> Summary:
    """The summary without the digests of files that are still to be written. Remarks on how the session began
    precede the warnings.
    """
    prepared, progress, log = run.prepared, run.progress, run.parts.log
    scene, system = prepared.scene, prepared.system
    return Summary(
        name=scene.name,
        description=scene.description,
        status=progress.status.value,
        message=status_message(prepared, progress, run.parts),
        exit_code=progress.status.exit_code,
        **as_fields([*run.session.remarks, *cautions_of(scene), *found.cautions()]),
        samples=progress.next_sample,
        samples_planned=progress.samples,
        time_reached=time_reached(prepared, progress, log),
        engine_time=progress.time,
        formulation=system.formulation.name,
        states=tuple(system.states),
        precision=prepared.precision.name,
        tolerance=prepared.effective_tolerance,
        cost=run.cost(),
        method=scene.config.integrator.method,
        hold_invariants=prepared.holds_invariants,
        hold_from_step=LATE if prepared.holds_late else None,
        invariants=_invariants(found, run.parts.evaluator.initial_invariants()),
        unwatched=system.unwatched,
        accuracy=_accuracy(found),
        modelling=_modelling(found),
        tables=_tables(found),
        **_tides(found),
        lyapunov=_lyapunov(found, spectrum),
        **understood(prepared, sizes=False),
        bit_for_bit=_bit_for_bit(prepared, progress, run.attributes.get("mixed_provenance")),
        provenance=repeated(run.attributes),
        events={c.name: len(log.occurrences(i, run.last_time)) for i, c in enumerate(system.events)},
        event_times=dataset.event_times(prepared, log, run.last_time),
        chart_changes=chart_changes(prepared, run.parts),
        advice=advice_on(found),
        undefined_samples={name: seen.count for name, seen in found.statistics.undefined.items()},
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


def _tides(found: Diagnostics) -> dict[str, Any]:
    scene, average = found.prepared.scene, found.prepared.system.formulation.average
    words = None if average is None else average.tidal_words(scene, float(scene.end - scene.start))
    return {} if words is None else {"tides": words}


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


def execute(
    session: Session, prepared: InitialValueProblem, folder: RunFolder | None, chain: Chain | None = None
) -> Run:
    """Integrate to the end, or to whatever ends it, and complete the files, if there is a folder.

    Raises:
        RunFolderError: the folder can't be written, or the checkpoint belongs to another system.
    """
    run = _ActiveRun(session, prepared, folder, chain)
    with run.interruption.watching():
        run.integrate()
        spectrum = run.spectrum()
        found = run.diagnosed()
    summary = summarise(run, found, spectrum)
    extras = dataset.event_variables(prepared, run.parts.log, run.parts.evaluator, run.last_time)
    if spectrum is not None:
        extras += lyapunov.lyapunov_variables(spectrum)
    if isinstance(run.writer, MemoryWriter):
        unused = dataset.unused_variables(prepared, run.progress.steps)
        variables = [variable for variable in run.variables if variable.name not in unused]
        return MemoryRun(summary, variables, run.writer.blocks, extras, run.ended(summary))
    assert folder is not None
    if run.progress.status.final:
        summary = _completed(run, folder, run.writer, extras, summary)
    summary = summary.having(cost=run.cost())
    folder.write_summary(summary)
    return SavedRun(folder, summary)


class _ActiveRun:
    """A run under way in one session: its compiled parts, what records them, and where they stand."""

    def __init__(
        self, session: Session, prepared: InitialValueProblem, folder: RunFolder | None, chain: Chain | None
    ) -> None:
        self.session, self.prepared, self._folder = session, prepared, folder
        self.parts = parts = assemble(prepared)
        system, progress = prepared.system, Progress(prepared.clock.count)
        statistics = SampleStatistics([i.name for i in system.invariants], [r.name for r in system.recorded])
        trail = SampleTrail(prepared.precision)
        session.watch.progress = progress
        beside = None
        if prepared.sensitivity_keys:
            from rigidsim.session.sensitivity import Sensitivity  # which few runs need

            beside = Sensitivity(prepared)
        more = {} if beside is None else {"sensitivity": beside}
        self.checkpoints = Checkpoints(parts, statistics=statistics, cost=session.watch, trail=trail, **more)
        start = None if chain is None else self.checkpoints.restore(chain)
        self._run_id = os.urandom(8).hex() if chain is None else chain.run
        self.attributes = dataset.root_attributes(prepared, parts, self._run_id, session.mixed)
        self.variables = dataset.dataset_variables(prepared)
        self.writer: SegmentWriter | MemoryWriter = MemoryWriter()
        if folder is not None:
            described, limits = self.attributes, session.tuning.segments
            self.writer = SegmentWriter(folder.segments, self.variables, described, chain, limits)
        self.recorder = Recorder(
            prepared, parts.evaluator, self.writer, statistics, trail, self.checkpoints, start, beside
        )
        self.interruption = Interruption()
        if beside is not None:
            beside.go_on = self._wanted
        session.watch.next("build")
        session.observer.started(prepared, None if folder is None else folder.path)
        session.observer.phase("integrate")
        guards = Guards(prepared, statistics, self.interruption, session.observer)
        most = prepared.scene.config.limits.max_steps  # of natural steps; it starts anew in each session
        if most is not None and start is not None:
            most += start.steps
        pacing = session.tuning.pacing
        self.driver = parts.driver(self.recorder, guards, start, pacing, most, progress)
        if start is not None:
            session.observer.resumed(progress)

    @property
    def progress(self) -> Progress:
        """How far it is, and how it ended."""
        return self.driver.progress

    @property
    def last_time(self) -> float:
        """Time of the last sample, internal units."""
        return float(self.prepared.clock.at(self.prepared.clock.count - 1))

    def cost(self) -> Cost:
        """Cost of the run so far, all of its sessions together."""
        progress, exponent = self.progress, self.prepared.system.scaling.time
        return Cost(
            steps=progress.steps,
            steps_redone=progress.redone_steps,
            smallest_step=_seconds(progress.smallest_step, exponent),
            largest_step=_seconds(progress.largest_step, exponent),
            **self.session.watch.as_dict(progress.integration_seconds),
        )

    def save(self) -> None:
        """Save where it stands, to go on from there."""
        self.recorder.save(self.driver.position())

    def integrate(self) -> None:
        """Integrate to the end, or until something ends it, and save what isn't complete."""
        progress = self.driver.run()
        if not progress.status.final:
            self.save()
        self.session.watch.next("integrate_and_record")
        self.session.observer.progressed(progress)

    def spectrum(self) -> LyapunovSpectrum | None:
        """Lyapunov exponents, if they are asked for and the run reached its end."""
        if not self.prepared.scene.config.output.lyapunov or self.progress.status is not Status.FINISHED:
            return None
        session, spectrum = self.session, None
        session.observer.phase("lyapunov")
        with suppress(KeyboardInterrupt):  # while its equations were compiled
            seconds = session.tuning.segments.seconds
            spectrum = lyapunov.spectrum_of(
                self.prepared, self._folder, self._run_id, self.interruption, seconds
            )
        session.watch.next("lyapunov")
        self._heed_interruption()
        return spectrum

    def diagnosed(self) -> Diagnostics:
        """The run's own diagnostics: drifts, and its errors if they are to be estimated."""
        prepared, session, parts = self.prepared, self.session, self.parts
        found = Diagnostics(prepared, self.progress, self.recorder.statistics)
        if not prepared.scene.config.output.estimate or not self.progress.status.final:
            return found
        trail = self.recorder.trail
        session.observer.phase("estimate")
        with self.interruption.dispensable():
            found = found.estimated(trail, parts.corrected, self._wanted, self.parts.stepper.errors)
            found = replace(found, cheaper=cheaper_model(found, session.tuning.advice, self._wanted))
        session.watch.next("estimate")
        if not prepared.system.formulation.resolves_rotation and self.progress.status is Status.FINISHED:
            session.observer.phase("modelling")
            with self.interruption.dispensable():
                found = found.modelled(trail, self._wanted)
            session.watch.next("modelling")
        self._heed_interruption()
        return found

    def _wanted(self) -> bool:
        """Whether nobody has asked for its end."""
        return not self.interruption.requested

    def _heed_interruption(self) -> None:
        """After what can be left out: the run is interrupted if that was asked for meanwhile."""
        if self.interruption.requested:
            self.progress.status = Status.INTERRUPTED
            self.save()

    def ended(self, summary: Summary) -> dict[str, Any]:
        """Attributes of the dataset."""
        wrapped_from = self.recorder.statistics.angles_wrapped_from
        return dataset.of_complete(self.attributes, summary, wrapped_from)


def _completed(
    run: _ActiveRun, folder: RunFolder, writer: SegmentWriter, extras: Sequence[Extra], summary: Summary
) -> Summary:
    """Complete the files of a run that has ended; after a Ctrl-C, leave a state that can be resumed from and
    return a summary that says so.
    """
    session = run.session
    last: tuple[Path, Arrays, Arrays] | None = None

    def conclude() -> None:
        """Write what remains once the dataset is in place and the segments are still there."""
        nonlocal summary
        summary = summary.having(cost=run.cost(), dataset_sha256=writer.dataset_sha256)
        folder.write_summary(summary)

    try:
        session.observer.phase("dataset")
        if run.progress.status is Status.FINISHED:
            position, kept = run.driver.position(), run.checkpoints
            last = folder.checkpoint, kept.packed(position), kept.events(position)
        unused = dataset.unused_variables(run.prepared, run.progress.steps)
        attributes = run.ended(summary)
        output, shown = run.prepared.scene.config.output, None
        if output.timeline and writer.rows > output.timeline_rows:
            from rigidsim.look.thinning import Thinning  # which loads xarray

            shown = Thinning(writer.rows, output.timeline_rows)
        writer.complete(
            folder.dataset, attributes, extras,
            unused=unused, checkpoint=last, conclude=conclude, watch=None if shown is None else shown.add,
        )  # fmt: skip
        session.watch.next("dataset")
        summary = with_timeline(summary, folder, output, session.observer, shown)
        if summary.timeline_sha256 is not None:
            session.watch.next("timeline")
    except KeyboardInterrupt:
        done = "the dataset is complete, the timeline is missing"
        if folder.segments.exists():
            run.save()
            done = "all samples are saved as segments"
        summary = summary.having(
            status=Status.INTERRUPTED.value,
            message=f"interrupted after the integration; {done}",
            exit_code=Status.INTERRUPTED.exit_code,
        )
    return summary


def with_timeline(
    summary: Summary, folder: RunFolder, output: Output, observer: Observer, shown: "Thinning | None" = None
) -> Summary:
    """Draw a complete dataset's timeline, if requested, of the rows shown, if they are known; returns the
    summary with its digest.
    """
    if not output.timeline or not summary.samples:
        return summary
    from rigidsim.look.timeline import write_timeline
    from rigidsim.store.reader import open_dataset

    path = folder.timeline
    observer.phase("timeline")
    try:
        with open_dataset(folder.dataset, indexed=False) as found:
            write_timeline(found, path, rows=output.timeline_rows, known=shown)
    except (OSError, RuntimeError) as error:  # rerun raises its own on a full disk
        why = error.strerror if isinstance(error, OSError) else None
        raise StoppedWritingError(
            f"{path}: can't be written: {why or error}; the dataset is complete, and {VIEW} draws "
            "the timeline once that is possible"
        ) from None
    return summary.having(timeline_sha256=provenance.file_sha256(path))
