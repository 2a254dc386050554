"""The command ``fit``, and what ``resume``, ``verify`` and ``info`` do with a fit's folder."""

import sys
from pathlib import Path

from rigidsim.cli.screens.fit import print_fit
from rigidsim.cli.screens.page import answer
from rigidsim.cli.screens.summary import print_verdict
from rigidsim.store.outputs import refuse_loss, writing
from rigidsim.workflows.fit import fitting
from rigidsim.workflows.fit.result import FitResult
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
    result = fitting.fit(experiment, out=out, force=force, told=_report)
    if write is not None:
        with writing(write) as new:
            new.write_text(result.experiment.text, encoding="utf-8")
    return _print(result, as_json)


def resume(path: Path, as_json: bool) -> int:
    """Go on with an interrupted fit."""
    return _print(fitting.resume_fit(path, told=_report), as_json)


def verify(path: Path, as_json: bool) -> int:
    """Fit again and compare every number."""
    verdict = fitting.verify_fit(path, told=_report)
    answer(as_json, verdict.as_dict(), print_verdict, verdict.as_dict(), "variable")
    return 0 if verdict.identical else 1


def info(path: Path, as_json: bool) -> None:
    """Print a fit's summary as it was saved."""
    saved = fitting.FitFolder.of(path).read_result()
    answer(as_json, saved.as_dict(), print_fit, saved)


def _print(result: FitResult, as_json: bool) -> int:
    answer(as_json, result.as_dict(), print_fit, result)
    return 0 if result.converged else 1


def _report(line: str) -> None:
    print(f"fit: {line}", file=sys.stderr, flush=True)
