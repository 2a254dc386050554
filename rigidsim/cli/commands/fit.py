"""The command ``fit``."""

from __future__ import annotations

import math
from pathlib import Path

from rigidsim.cli.screens.page import Page, Styled, answer, reporting
from rigidsim.scene.readable import span_text
from rigidsim.store.outputs import refuse_loss, writing
from rigidsim.workflows.fit import fitting
from rigidsim.workflows.fit.fitting import FitResult, FittedData, digits_text
from rigidsim.workflows.read import load


def fit(
    config: Path, out: Path, overrides: list[str] | None, write: Path | None, member: int | None,
    force: bool, as_json: bool,
) -> int:  # fmt: skip
    """Fit, save, print."""
    experiment = load(config, overrides=overrides or [])
    if member is not None:
        from rigidsim.workflows.sweeps.members import single_member  # which few fits need

        experiment = single_member(experiment, member)
    if write is not None:
        refuse_loss([write], experiment.files, force=force)
    result = fitting.fit(experiment, out=out, force=force, told=reporting("fit"))
    if write is not None:
        with writing(write) as new:
            new.write_text(result.experiment.text, encoding="utf-8")
    return ended(result, as_json)


def ended(result: FitResult, as_json: bool) -> int:
    """Print a fit; returns its exit code."""
    answer(as_json, result.as_dict(), print_fit, result)
    return 0 if result.converged else 1


# --- output -------------------------------------------------------------------------------------------------

_MOST_OUTLIERS = 10
_CLOSE = 0.95  # correlations from which on two parameters are named together
_MOST_CLOSE = 6


def print_fit(found: FitResult) -> None:
    """Print a fit."""
    on = Page()
    on.say((found.name, "bold"), f"  {found.sentence}")
    if not found.converged:
        on.line("warning", "the fit has not converged: start nearer, or try several starts", "bold yellow")
    rows: list[list[Styled]] = []
    for one in found.parameters:
        sigma = "undetermined" if one.sigma is None else f"{one.sigma:.2g}"
        scaled = "" if one.scaled_sigma is None else f"{one.scaled_sigma:.2g}"
        value = digits_text(one.value, one.sigma or 0.0) if one.sigma else f"{one.value:.6g}"
        rows.append([one.key, value, sigma, scaled, f"{one.start:.6g}", "" if one.unit == "1" else one.unit])
    on.table(["parameter", "value", "sigma", "scaled", "start", ""], rows)
    on.lines("unknown", (unknown.text for unknown in found.undetermined), "bold yellow")
    _tell_correlations(on, found)
    for effect in found.considered:
        on.line("consider", f"{effect.key} = {effect.value:.6g} +- {effect.sigma:.2g}, not estimated")
    on.table(["data", "observable", "used", "rms", "in sigmas"], [_of_data(one) for one in found.data])
    for outlier in found.outliers[:_MOST_OUTLIERS]:
        place = f"data {outlier.data}, {outlier.row}, at {span_text(outlier.time)}"
        on.line("left out", f"{place}: {outlier.observable}, {outlier.sigmas:.3g} sigmas")
    if len(found.outliers) > _MOST_OUTLIERS:
        on.line("", f"and {len(found.outliers) - _MOST_OUTLIERS} more")
    on.lines("note", found.told)
    if found.derivatives != "variational equations":
        on.line("note", f"derivatives by {found.derivatives}")
    if found.folder:
        on.line("folder", found.folder)
        on.line("next", f"rigidsim plot {found.folder}", "cyan")
        on.line("", f"rigidsim view {found.folder}", "cyan")
        on.line("", f"rigidsim run {found.folder}/fitted.toml", "cyan")


def _tell_correlations(on: Page, found: FitResult) -> None:
    """Pairs that are nearly one: the data determine them together better than each."""
    pairs = []
    for i, row in enumerate(found.correlations):
        for j, value in enumerate(row[:i]):
            if value is not None and abs(value) >= _CLOSE:
                pairs.append(
                    (abs(value), f"{found.parameters[j].key} and {found.parameters[i].key} {value:.4f}")
                )
    if pairs:
        pairs.sort(reverse=True)
        on.line("together", "correlations: " + "; ".join(text for _, text in pairs[:_MOST_CLOSE]))


def _of_data(one: FittedData) -> list[Styled]:
    rms = f"{one.rms:.3g} {one.unit}"
    if one.unit == "rad":
        rms += f" ({math.degrees(one.rms):.3g} deg)"
    return [
        f"{one.number} {one.file}",
        one.observable,
        f"{one.used:,} of {one.rows:,}",
        rms,
        f"{one.sigmas:.3g}",
    ]
