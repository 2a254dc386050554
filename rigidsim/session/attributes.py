"""Filling in the root attributes of a run's files."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from rigidsim.session.timings import Effort
from rigidsim.solve.assembly import Assembly
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.projection import LATE
from rigidsim.solve.status import Status
from rigidsim.store import provenance
from rigidsim.store.attributes import RootAttributes
from rigidsim.store.summary import Summary
from rigidsim.store.summary_parts import TableErrors
from rigidsim.store.variables import SCHEMA_VERSION


def root_attributes(
    prepared: InitialValueProblem, parts: Assembly, run_id: str, mixed: str = ""
) -> RootAttributes:
    """Attributes of segments, and of a dataset before the end of its run is known.

    Args:
        parts: what it was compiled to.
        mixed: what changed in versions or machine since the run began; empty if nothing did.
    """
    scene, system = prepared.scene, prepared.system
    platform: dict[str, Any] = {f"version_{k}": v for k, v in provenance.versions().items()}
    platform |= {f"code_{k}": v for k, v in provenance.code_target(parts.evaluator.code).items()}
    exponents = {
        "time": system.scaling.time,
        "inertia": system.scaling.inertia,
        "states": system.state_exponents,
    }
    return RootAttributes(
        title=scene.name,
        comment=scene.description,
        source="rigidsim",
        run_id=run_id,
        schema_version=SCHEMA_VERSION,
        status=Status.RUNNING.value,
        config=prepared.experiment.text,
        config_sha256=prepared.experiment.sha256,
        config_given=prepared.experiment.given,
        config_set="\n".join(prepared.experiment.settings),
        formulation=system.requirements.formulation,
        euler_sequence=system.sequence,
        euler_partner_sequence="" if system.partner is None else system.partner.sequence,
        states=" ".join(system.states),
        precision=prepared.precision.name,
        precision_bits=prepared.precision.bits,
        tolerance=prepared.effective_tolerance,
        integrator=prepared.algorithm.title,
        method=scene.config.integrator.method,
        hold_invariants=int(prepared.holds_invariants),
        hold_from_step=LATE if prepared.holds_late else None,
        taylor_order=parts.order,
        compact_mode=int(prepared.precision.compact or system.wide),
        high_accuracy=0,
        batch_size=1,
        unit_exponents=json.dumps(exponents),
        principal_moments=json.dumps([float(m) for m in scene.body.principal_moments]),
        principal_axes=json.dumps([[float(x) for x in a] for a in scene.body.principal_axes]),
        inertia_tensor=json.dumps([[float(x) for x in row] for row in scene.body.inertia]),
        body_source=scene.body.source,
        drawing=json.dumps(scene.body.drawing),
        center_of_mass=json.dumps([float(x) for x in scene.body.center_of_mass]),
        mass=None if scene.body.mass is None else float(scene.body.mass),
        surroundings=json.dumps(_surroundings(prepared)),
        axes=scene.axes,
        epoch=None if scene.epoch is None else str(scene.epoch),
        time_unit=scene.config.time.unit,
        recorded=" ".join(variable.name for variable in system.recorded),
        python_loads=" ".join(type(load).__name__ for load in prepared.python_loads),
        cpu_model=provenance.cpu_model(),
        started_at=provenance.now(),
        **platform,
        mixed_provenance=mixed or None,
    )


def _surroundings(prepared: InitialValueProblem) -> list[dict[str, Any]]:
    """Gravity and the pictured objects of every load."""
    scene = prepared.scene
    shown = [load.pictured() for load in (*scene.loads, *prepared.python_loads)]
    if scene.gravity is not None:
        shown.append({"what": "gravity", "acceleration": [float(g) for g in scene.gravity]})
    return [one for one in shown if one is not None]


def _as_json(tables: Mapping[str, TableErrors]) -> str | None:
    """Tables as JSON text; None if there are none."""
    return json.dumps({name: found.as_dict() for name, found in tables.items()}) if tables else None


def of_complete(
    attributes: RootAttributes, summary: Summary, effort: Effort, angles_wrapped_from: float = math.nan
) -> RootAttributes:
    """Attributes of the dataset of a run that ended."""
    put_back = {name: row.put_back for name, row in summary.invariants.items()}
    return attributes.having(
        status=summary.status,
        status_message=summary.message,
        warnings="\n".join(summary.warnings),
        steps=summary.cost.steps,
        wall_seconds=effort.wall,
        cpu_seconds=effort.cpu,
        finished_at=provenance.now(),
        put_back=json.dumps(put_back) if summary.held else None,
        attitude_error=summary.accuracy.estimated_attitude_error,
        modelling_error=None if summary.modelling is None else summary.modelling.worst,
        table_errors=_as_json(summary.tables),
        angles_wrapped_from=None if math.isnan(angles_wrapped_from) else angles_wrapped_from,
    )
