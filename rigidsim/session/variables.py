"""Variables that a run's dataset holds along time: names, labels and origin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rigidsim.model.outputs import Invariant
from rigidsim.session.dates import Dates
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.projection import LATE
from rigidsim.store.variables import Variable, time_variable

LYAPUNOV_NAMES = ("lyapunov_time", "lyapunov_index", "lyapunov_exponents")
"""Names of variables and dimensions."""


def drift_name(invariant: str) -> str:
    """Name of the variable that holds an invariant's drift; its attribute ``drift_of`` names the
    invariant.
    """
    return f"{invariant}_drift"


def put_back_name(invariant: str) -> str:
    """Name of the variable with the corrections put back into a projected invariant, which its attribute
    ``put_back_of`` names.
    """
    return f"{invariant}_put_back"


def dataset_variables(prepared: InitialValueProblem) -> list[Variable]:
    """Time first, then dates if known, recorded variables, each invariant's drift, and the corrections put
    back into projected ones.
    """
    system, projected = prepared.system, prepared.projected_scalars
    time, *recorded = recorded_variables(prepared)
    found = [
        *recorded,
        *(_drift(invariant) for invariant in system.invariants),
        *(_put_back(invariant, projected) for invariant in system.invariants if invariant.name in projected),
    ]
    dates = dates_of(prepared)
    if dates is None:
        return [time, *found]
    beside = " ".join(name for variable in dates.variables for name in variable.part_names())
    dated = [replace(v, attributes={**v.attributes, "coordinates": beside}) for v in found]
    return [time, *dates.variables, *dated]


def unused_variables(prepared: InitialValueProblem, steps: int) -> set[str]:
    """Variables of corrections put back, if the run ended before the step at which projection begins.

    Args:
        steps: steps that the run took.
    """
    if not prepared.holds_late or steps > LATE:
        return set()
    return {put_back_name(name) for name in prepared.projected_scalars}


def dates_of(prepared: InitialValueProblem) -> Dates | None:
    """Dates of samples; None if the date of time 0 is unknown."""
    scene = prepared.scene
    return None if scene.epoch is None else Dates(scene.epoch, scene.samples)


def recorded_variables(prepared: InitialValueProblem) -> list[Variable]:
    """Time and the recorded variables; each with residuals beyond double precision.

    In single precision time has one too, since its labels are exact to a double.
    """
    parts, bodies = prepared.precision.part_count, prepared.scene.bodies
    result = [time_variable(prepared.clock.part_count)]
    for recorded in prepared.system.recorded:
        attributes: dict[str, Any] = {"units": recorded.units, "long_name": recorded.long_name}
        if recorded.frame:
            attributes["frame"] = recorded.frame
        if recorded.name == "euler_angles":
            attributes["euler_sequence"] = prepared.system.sequence
            attributes["convention"] = "intrinsic"
        if recorded.continuity == "unwrap":
            attributes["angle"] = "continuous"
        attributes |= recorded.attributes
        if recorded.invariant:
            attributes["invariant"] = 1
        own = {"point_mass": bodies.names} if bodies is not None and "point_mass" in recorded.dims else {}
        result.append(Variable(recorded.name, recorded.dims, attributes, parts, own))
    return result


def _drift(invariant: Invariant) -> Variable:
    several = len(invariant.expressions) > 1
    attributes = {
        "units": "1",
        "long_name": f"drift of the {invariant.long_name}",
        **_scale(invariant),
        "definition": "norm of (value - initial) / scale" if several else "(value - initial) / scale",
        "drift_of": invariant.name,
    }
    return Variable(drift_name(invariant.name), (), attributes)


def _put_back(invariant: Invariant, projected: Sequence[str]) -> Variable:
    """Variable of the corrections put back into a projected invariant along time.

    Args:
        projected: the invariant that each projected scalar belongs to.
    """
    what = "norm of the sum of the changes" if projected.count(invariant.name) > 1 else "sum of the changes"
    attributes = {
        "units": "1",
        "long_name": f"what was put back of the {invariant.long_name}",
        **_scale(invariant),
        "definition": f"{what} of (value - initial) / scale from one correction to the next, up to the "
        "last one before each sample: to first order what the drift would have been without them",
        "put_back_of": invariant.name,
    }
    return Variable(put_back_name(invariant.name), (), attributes)


def _scale(invariant: Invariant) -> dict[str, Any]:
    """Attributes with the scale that its drifts are relative to."""
    return {
        "scale": float(invariant.scale),
        "scale_units": invariant.units,
        "scale_name": invariant.scale_name,
    }
