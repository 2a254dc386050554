"""``rigidsim plan``: what would be integrated and why, and what it will cost, from a short pilot."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidsim.accuracy import chosen
from rigidsim.prepare import Prepared, motion_growth, prepare
from rigidsim.scene.reading import Experiment
from rigidsim.solve.closed import closed_form_of
from rigidsim.solve.evaluate import Evaluator
from rigidsim.solve.rhythm import Rhythm
from rigidsim.solve.stepper import Stepper
from rigidsim.solve.winding import Winding
from rigidsim.summary import round_off_law

if TYPE_CHECKING:
    from rigidsim.model.loads import LoadModel

PILOT_SECONDS = 0.5
_PILOT_STEPS = 20_000
_SHRINK = 0.9  # gzip on doubles whose low bits are noise; measured 0.85 to 0.95
_TIMELINE_ROW_BYTES = 260.0  # measured; falls with repeated values
_BASE_MEMORY = 250e6  # interpreter, libraries and compiled code


def plan(experiment: Experiment, *, loads: Sequence[LoadModel] = ()) -> dict[str, Any]:
    """Explain and predict a run; integrates for about half a second and writes nothing.

    Args:
        loads: loads of one's own, as of ``rigidsim.run``.

    Returns:
        A JSON-like dictionary: states, reasons, invariants, steps, seconds, bytes.

    Raises:
        ConfigError: the config can't be run.
    """
    experiment, choice = chosen(experiment, loads=loads)
    prepared = prepare(experiment, loads=loads)
    closed = closed_form_of(prepared.scene, driven=bool(loads))
    started = time.perf_counter()
    winding = Winding(prepared.system.angle_states, prepared.precision, prepared.scene.context)
    stepper = Stepper(prepared.system, prepared.precision, prepared.tolerance, prepared.clock.start)
    evaluator = Evaluator(prepared.system, prepared.precision, winding)
    compile_seconds = time.perf_counter() - started
    pilot = _pilot(prepared, Rhythm(stepper, winding), evaluator)
    duration = float(prepared.scene.samples.last - prepared.scene.start)
    steps = max(1.0, duration / pilot["step"])
    samples = prepared.clock.count
    row = 8.0 * sum(v.parts * math.prod(v.shape) for v in prepared.variables())
    rows_shown = min(samples, prepared.scene.config.output.timeline_rows)
    integrate = steps * pilot["seconds_per_step"]
    record = samples * pilot["seconds_per_sample"]
    system = prepared.system
    rate = float(system.rate_bound)
    growth = motion_growth(prepared)
    return {
        "name": prepared.scene.name,
        "formulation": system.requirements.formulation,
        "euler_sequence": system.sequence if system.angle_states else None,
        "euler_partner_sequence": None if system.partner is None else system.partner.sequence,
        "states": system.states,
        "state_count": len(system.states),
        "reasons": [{"states": s, "why": w} for s, w in system.requirements.reasons],
        "left_out": [{"what": s, "why": w} for s, w in system.requirements.left_out],
        "equations": [f"{v}' = {rhs}" for v, rhs in system.equations],
        "internal_units": {
            "time_s": math.ldexp(1.0, system.scaling.time),
            "inertia_kg_m2": math.ldexp(1.0, system.scaling.inertia),
        },
        "recorded": [v.name for v in prepared.variables()],
        "invariants": [{"name": i.name, "why": i.why, "numerical": i.numerical} for i in system.invariants],
        "precision": prepared.precision.name,
        "tolerance": prepared.effective_tolerance,
        "method": prepared.scene.config.integrator.method,
        "closed_form": None if isinstance(closed, str) else closed.title,
        "closed_form_why_not": closed if isinstance(closed, str) else None,
        "hold_invariants": prepared.holds_invariants,
        "accuracy": None
        if choice is None
        else {"chosen": choice.setting.title, "why": choice.why, "forecast": choice.forecast},
        "taylor_order": int(stepper.integrator.order),
        "pilot": pilot,
        "predicted": {
            "steps": steps,
            "integration_seconds": integrate,
            "recording_seconds": record,
            "total_seconds": compile_seconds + integrate + record,
            "memory_bytes": _BASE_MEMORY + min(samples * row, 64e6) * 3,
            "dataset_bytes": samples * row * _SHRINK,
            "timeline_bytes": rows_shown * _TIMELINE_ROW_BYTES
            if prepared.scene.config.output.timeline
            else 0.0,
            "attitude_error_rad": None
            if system.requirements.formulation == "rates"
            else round_off_law(prepared.law_tolerance, int(steps), rate, duration) * growth.at(duration),
            "amplification": growth.at(duration),
        },
        "body": {
            "source": prepared.scene.body.source,
            "principal_moments": [float(m) for m in prepared.scene.body.principal_moments],
            "principal_axes": [[float(x) for x in a] for a in prepared.scene.body.principal_axes],
        },
    }


def _pilot(prepared: Prepared, rhythm: Rhythm, evaluator: Evaluator) -> dict[str, float]:
    """Mean step (s) and costs, from as many steps as half a second and the run's length allow."""
    stepper = rhythm.stepper
    begin = float(stepper.time)
    last = float(prepared.clock.at(prepared.clock.count - 1))
    spent, count = 0.0, 1
    while spent < PILOT_SECONDS and stepper.steps < _PILOT_STEPS and float(stepper.time) < last:
        started = time.perf_counter()
        fine = rhythm.skip(count)
        spent += time.perf_counter() - started
        if not fine or stepper.largest <= 0:
            break
        count = min(2 * count, 1024)
    steps = max(stepper.steps, 1)
    step = math.ldexp((float(stepper.time) - begin) / steps, prepared.system.scaling.time)
    states = np.repeat(prepared.precision.array(prepared.system.initial)[None, :], 4096, axis=0)
    if not prepared.precision.cheap:
        states = states[:16]
    turns = np.zeros((len(states), len(prepared.system.angle_states)), dtype=np.int64)
    started = time.perf_counter()
    evaluator.evaluate(states, turns)
    evaluation = (time.perf_counter() - started) / len(states)
    row = 8.0 * sum(v.parts * math.prod(v.shape) for v in prepared.variables())
    compression = row * 2.5e-8  # gzip 4 with shuffle writes about 40 MB/s
    return {
        "steps": float(steps),
        "step": step,
        "seconds_per_step": spent / steps,
        "seconds_per_sample": evaluation + compression + 2e-7,
    }
