"""Advice on settings that would have done better at about the same cost; the wording is elsewhere."""

from __future__ import annotations

import math

from rigidsim.accuracy.error_law import CLOSED_FORM
from rigidsim.accuracy.estimates.estimate import label_rounding
from rigidsim.session.diagnostics import Diagnostics
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
    prepared, estimate, cheaper = found.prepared, found.estimate, found.cheaper
    if estimate is not None and cheaper is not None:
        now = estimate.leading
        averaged = Advice(
            code=AdviceCode.AVERAGED.value,
            now=now,
            then=cheaper.error,
            level=cheaper.level,
            share=cheaper.share,
        )
        return (averaged,)
    if estimate is None or not estimate.closed_form or estimate.attitude is None:
        return ()
    formulation, config = prepared.system.requirements.formulation, prepared.scene.config
    if formulation != "quaternion" or config.integrator.accuracy is not None:
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
