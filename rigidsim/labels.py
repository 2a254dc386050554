"""What a run's files say of it beside the numbers: root attributes, and its end in words."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

import rigidsim.summary as summaries
from rigidsim.prepare import Prepared
from rigidsim.solve.advance import Progress
from rigidsim.solve.evaluate import Evaluator
from rigidsim.solve.lyapunov import LyapunovSpectrum
from rigidsim.solve.rhythm import Rhythm
from rigidsim.solve.status import Status
from rigidsim.solve.stepper import Stepper
from rigidsim.store import provenance
from rigidsim.store.variables import SCHEMA_VERSION, Extra


def root_attributes(prepared: Prepared, stepper: Stepper, run_id: str) -> dict[str, Any]:
    """Root attributes of segments and dataset; ``run_id`` tells this run from all others."""
    scene, system = prepared.scene, prepared.system
    found = {f"version_{k}": v for k, v in provenance.versions().items()}
    found |= {f"code_{k}": v for k, v in provenance.code_target(stepper.integrator).items()}
    return {
        "Conventions": "CF-1.11",
        "title": scene.name,
        "comment": scene.description,
        "source": "rigidsim",
        "run_id": run_id,
        "schema_version": SCHEMA_VERSION,
        "status": Status.RUNNING.value,
        "config": prepared.experiment.text,
        "config_sha256": prepared.experiment.sha256,
        "formulation": system.requirements.formulation,
        "euler_sequence": system.sequence,
        "euler_partner_sequence": "" if system.partner is None else system.partner.sequence,
        "states": " ".join(system.states),
        "precision": prepared.precision.name,
        "precision_bits": prepared.precision.bits,
        "tolerance": prepared.effective_tolerance,
        "integrator": "heyoka Taylor, natural steps, dense output"
        if prepared.closed is None
        else prepared.closed.title,
        "method": scene.config.integrator.method,
        "hold_invariants": int(prepared.holds_invariants),
        "taylor_order": int(stepper.integrator.order),
        "compact_mode": int(prepared.precision.compact or system.wide),
        "high_accuracy": 0,
        "batch_size": 1,
        "unit_exponents": json.dumps(
            {"time": system.scaling.time, "inertia": system.scaling.inertia,
             "states": system.state_exponents}
        ),
        "principal_moments": json.dumps([float(m) for m in scene.body.principal_moments]),
        "principal_axes": json.dumps([[float(x) for x in a] for a in scene.body.principal_axes]),
        "inertia_tensor": json.dumps([[float(x) for x in row] for row in scene.body.inertia]),
        "body_source": scene.body.source,
        "drawing": json.dumps(scene.body.drawing),
        "python_loads": " ".join(type(load).__name__ for load in prepared.python_loads),
        "cpu_model": provenance.cpu_model(),
        "started_at": provenance.now(),
        **found,
    }  # fmt: skip


def repeated(attributes: dict[str, Any]) -> dict[str, Any]:
    """The attributes that the summary repeats."""
    kept = ("config_sha256", "cpu_model", "started_at", "taylor_order", "compact_mode", "unit_exponents")
    return {k: v for k, v in attributes.items() if k in kept or k.startswith(("version_", "code_"))}


def closing_words(prepared: Prepared, progress: Progress, evaluator: Evaluator) -> str:
    """The status in words, with where and why for a run that broke down."""
    text = progress.status.message
    if progress.status not in (Status.NON_FINITE, Status.COLLAPSED):
        return text
    text += f"; last good state at {progress.time:.9g} s after {progress.steps} steps"
    if progress.last_good is None:
        return text
    state = np.array([progress.last_good.mark.state], dtype=prepared.precision.scalar)
    factors = evaluator.singular_factors(state, progress.last_good.turns[None, :])
    if factors is not None and abs(float(factors[0])) < summaries.NEAR_SINGULAR:
        middle = float(state[0][prepared.system.states.index("theta")])
        text += (
            f"; the middle Euler angle theta = {middle:.9g} rad came within {abs(float(factors[0])):.2g} of "
            f'the singularity of {prepared.system.sequence}: choose formulation = "quaternion"'
        )
    else:
        largest = int(np.argmax(np.abs(state[0].astype(np.float64))))
        text += f"; the largest state there was {prepared.system.states[largest]}"
    return text


def chart_changes(prepared: Prepared, rhythm: Rhythm) -> dict[str, Any] | None:
    """How often a run in Euler angles went from one chart to the other; None for other formulations."""
    system = prepared.system
    if rhythm.charts is None or system.partner is None:
        return None
    return {
        "count": int(rhythm.charts.changes[0]),
        "sequence": system.sequence,
        "partner": system.partner.sequence,
    }


def lyapunov_variables(spectrum: LyapunovSpectrum | None) -> list[Extra]:
    """The convergence of the exponents, as variables of the dataset."""
    if spectrum is None:
        return []
    along = {"units": "s", "long_name": "time since the run's start, of the estimates"}
    what = {
        "units": "s-1",
        "long_name": "Lyapunov exponents of the scaled states so far, largest first",
        "states": " ".join(spectrum.states),
    }
    return [
        Extra("lyapunov_time", ("lyapunov_time",), spectrum.times, along),
        Extra("lyapunov_exponents", ("lyapunov_time", "lyapunov_index"), spectrum.exponents, what),
    ]
