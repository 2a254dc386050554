"""Advice on settings that would have done better at about the same cost; the wording is elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable

from rigidsim.accuracy.error_law import CLOSED_FORM
from rigidsim.accuracy.estimates.estimate import label_rounding
from rigidsim.accuracy.models.modelling import measure_modelling
from rigidsim.accuracy.models.side_by_side import Unmeasured
from rigidsim.errors import ConfigError
from rigidsim.model.capabilities import gradient_source_of
from rigidsim.scene.choices import FULL, REDUCED
from rigidsim.session.diagnostics import Diagnostics
from rigidsim.session.session import AdviceLimits
from rigidsim.solve.problem import prepare
from rigidsim.store.summary_parts import Advice, AdviceCode

_LONG = 8192
"""Steps from which projecting invariants pays off (``experiments/precision_tradeoff.py``: from 1e4 rad on,
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
    suited = bool(loads) and all(gradient_source_of(load) is not None for load in loads)
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
            share = error.windows[0].reduced_steps / error.windows[0].steps
            code, now = AdviceCode.AVERAGED.value, estimate.leading
            return Advice(code=code, now=now, then=error.worst, level=level, share=share)
    return None
