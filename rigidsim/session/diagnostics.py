"""Trustworthiness of a run: its errors as the error laws estimate them, all warnings, and settings that would
have done better at about the same cost.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from rigidsim.accuracy.error_law import CLOSED_FORM
from rigidsim.accuracy.estimates.estimate import UNCERTAIN, Estimate, estimate_errors, label_rounding
from rigidsim.accuracy.modelling import Unmeasured, measure_modelling
from rigidsim.errors import ConfigError
from rigidsim.scene.cautions import Caution, WarningCode
from rigidsim.scene.choices import FULL, REDUCED
from rigidsim.scene.readable import TimeWords, span_text
from rigidsim.session.recorder import SampleStatistics
from rigidsim.session.session import AdviceLimits
from rigidsim.session.understood import time_words
from rigidsim.solve.corrected_stepper import CorrectedStepper
from rigidsim.solve.effects.waypoints import SampleTrail
from rigidsim.solve.problem import InitialValueProblem, prepare
from rigidsim.solve.sampler import Progress
from rigidsim.solve.stepper import OwnErrors
from rigidsim.store.summary_parts import Advice, AdviceCode, Modelling

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
            told = own()
            return self if told is None else replace(self, estimate=Estimate(**vars(told)))
        if corrected is not None:
            acting = [one.registered for one in corrected.effects if one.registered and not one.rewrites]
            if acting:  # which a closed form knows nothing of
                trail, beside = None, f"; they are without the effects {', '.join(acting)}"
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
                    f"{name} has no finite value at some samples, so that its drift isn't known; see where "
                    "it is NaN in the dataset, and mend its expression or leave it out",
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
                f'[model] level = "{found.level}" leaves the momentum\'s size or the energy uncertain by '
                f"about {relative:.2g} of itself at the end; choose a less averaged level, or a nearer end",
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
                f"the turns of {' and '.join(names)} aren't known from {self._words.moment(lost, 6)} on, "
                'where they are recorded within one turn; sample more often, or choose method = "taylor"',
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
"""tolerance sqrt(steps): attitude error with projected invariants, whose growth is that of a random walk.
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
            other = prepare(prepared.experiment.having(keys), loads=prepared.python_loads)
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
