"""Summary of all members of a sweep: how they ended, warnings, errors, and the cost."""

from collections import Counter

import numpy as np

from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.session.members import ENDED_WELL, OUTCOMES, WARNINGS
from rigidsim.store.sweeps.run import ErrorsOfMembers, SweepCost, SweepSummary
from rigidsim.store.sweeps.sources import Gathered, Sources
from rigidsim.store.sweeps.tiles import Kept
from rigidsim.workflows.sweeps.fits import fitted_of

_DECIDING = ("version_", "cpu_model", "ephemeris_", "orientation_")  # what decides on bits
_ERRORS = {
    "attitude": ("attitude_error", "rad"),
    "position": ("position_error", "m"),
    "modelling": ("modelling_error", "rad"),
    "modelling_norm": ("modelling_error_norm", "1"),
    "modelling_energy": ("modelling_error_energy", "1"),
}
"""Announced errors of members: their variables and units."""


def summary_of(wanted: Sweep, sources: Sources, found: Gathered, wall: float, cpu: float) -> SweepSummary:
    """Contents of ``summary.json`` for a complete sweep; seconds of this process."""
    ended_as, warned_of = np.zeros(len(OUTCOMES), dtype=np.int64), np.zeros(len(WARNINGS), dtype=np.int64)
    steps = 0
    worst: dict[str, float] = {}
    estimated: dict[str, list[np.ndarray]] = {name: [] for name in _ERRORS}
    fits: list[tuple[Kept, np.ndarray]] = []
    for tile, _, rows in sources.parts():
        arrays = {name: variable.values[rows] for name, variable in tile.kept.items()}
        ended_as += np.bincount(arrays["status"], minlength=len(OUTCOMES))
        if wanted.fits:
            fits.append((tile.kept, rows))
            continue
        bits = arrays["warnings"]
        warned_of += np.array([int((bits >> bit & 1).sum()) for bit in range(len(WARNINGS))])
        steps += int(arrays["steps"].sum())
        for name, seen in estimated.items():
            if (variable := _ERRORS[name][0]) in arrays:
                values = arrays[variable]
                seen.append(values[~np.isnan(values)])
        for name, values in arrays.items():
            if name.endswith("_drift_largest"):
                largest = np.nanmax(values, initial=0.0)
                drift = name.removesuffix("_largest")
                worst[drift] = max(worst.get(drift, 0.0), float(largest))
    outcomes = {OUTCOMES[i]: int(n) for i, n in enumerate(ended_as) if n}
    failing = wanted.count - sum(outcomes.get(status, 0) for status in ENDED_WELL)
    warned = {WARNINGS[i]: int(n) for i, n in enumerate(warned_of) if n}
    warnings = {code: f"{number:,} members are warned of: {code}" for code, number in warned.items()}
    if failing:
        said = f"{failing:,} members didn't end well; failed_member and failed_reason say which"
        warnings = {"members_failed": said, **warnings}
    fitted, of_fits = fitted_of(fits)
    warnings |= of_fits
    engines: Counter[str] = Counter()
    for made in found.made:
        engines.update(made["engines"])
    kinds = [{k: v for k, v in made.items() if k.startswith(_DECIDING)} for made in found.made]
    differing = sorted({k for kind in kinds for k, v in kind.items() if v != kinds[0].get(k)})
    mixed = ", ".join(differing) or None
    if mixed:
        said = f"tiles were computed with different {mixed}: members may differ in their last bits"
        warnings["mixed_provenance"] = said
    return SweepSummary(
        kind="sweep",
        name=wanted.experiment.config.name,
        description=wanted.experiment.config.description,
        status="finished",
        message=f"all {wanted.count:,} members were {'fitted' if wanted.fits else 'run'}",
        exit_code=0,
        members=wanted.count,
        shape=dict(zip(wanted.dims, wanted.shape, strict=True)),
        axes={axis.name: axis.key for axis in wanted.axes},
        keep=list(wanted.table.keep),
        outcomes=outcomes,
        warned=warned,
        warnings=list(warnings.values()),
        warning_codes=list(warnings),
        engines=dict(engines),
        why_alone=next((made["why_alone"] for made in found.made if made.get("why_alone")), None),
        cost=SweepCost(
            steps=steps,
            cpu_seconds=sum(made["cpu_seconds"] for made in found.made),
            wall_seconds_of_tiles=sum(made["wall_seconds"] for made in found.made),
            tiles=len(found.made),
            estimate_cpu_seconds=sum(made.get("estimate_cpu_seconds", 0.0) for made in found.made),
            session_wall_seconds=wall,
            session_cpu_seconds=cpu,
        ),
        largest_drifts=worst,
        estimated_errors={
            name: ErrorsOfMembers(
                members=len(values),
                median=float(np.median(values)),
                largest=float(values.max()),
                units=_ERRORS[name][1],
            )
            for name, parts in estimated.items()
            if len(values := np.concatenate([np.zeros(0), *parts]))
        },
        fitted=fitted,
        config_sha256=wanted.experiment.sha256,
        provenance=kinds[0] if kinds else {},
        mixed_provenance=mixed,
    )
