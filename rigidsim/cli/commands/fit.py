"""The command ``fit``."""

from pathlib import Path

from rigidsim.cli.screens.fit import print_fit
from rigidsim.cli.screens.page import answer, reporting
from rigidsim.store.outputs import refuse_loss, writing
from rigidsim.workflows.fit import fitting
from rigidsim.workflows.fit.fitting import FitResult
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
