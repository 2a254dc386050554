"""Commands on what may be a sweep: ``sweep``, ``resume``, ``verify``; and what others do with sweeps."""

from collections.abc import Sequence
from pathlib import Path

import rigidsim.workflows.resume as resuming
import rigidsim.workflows.sweeps.sweep as workflow
import rigidsim.workflows.verify as verifying
from rigidsim.cli.exits import refuse_options
from rigidsim.cli.screens.page import answer
from rigidsim.cli.screens.summary import print_run, print_verdict
from rigidsim.cli.screens.sweeps import SweepProgress, print_sweep
from rigidsim.errors import RigidsimError
from rigidsim.scene.config import Experiment
from rigidsim.scene.sweep import scanned
from rigidsim.session.progress import meter, watched
from rigidsim.store.fits import is_fit
from rigidsim.store.sweeps.folder import SavedSweep, is_sweep, open_sweep
from rigidsim.workflows.read import load
from rigidsim.workflows.sweeps.verify import MEMBERS, verify_sweep


def sweep(
    config: Path, out: Path, overrides: list[str] | None, workers: int | None, scheduler: str | None,
    tiles: str | None, force: bool, as_json: bool,
) -> int:  # fmt: skip
    """Run all members, or a share of them."""
    share = None if tiles is None else _share(tiles)
    if scheduler is not None:
        refuse_options("is for processes of this machine, and --scheduler has its own", workers=workers)
    experiment = load(config, overrides=overrides or [])
    with meter() as shown:
        result = workflow.sweep(
            experiment, out=out, force=force, workers=workers or 1, scheduler=scheduler, tiles=share,
            observer=SweepProgress(shown),
        )  # fmt: skip
    code = _print(result, as_json)
    return 0 if result.finished or share is not None else code


def run_scanned(
    experiments: Sequence[Experiment], scan: list[str], out: Path, *, force: bool, as_json: bool
) -> int:
    """Sweep each config over the axes of ``run --sweep``."""
    worst = 0
    for experiment in experiments:
        with meter() as shown:
            motion = experiment if experiment.config.fit is None else experiment.having(["fit="])
            result = workflow.sweep(
                scanned(motion, scan), out=out, force=force, observer=SweepProgress(shown)
            )
        worst = worst or _print(result, as_json)
    return worst


def resume(
    run_path: Path, until: str | None, overrides: list[str] | None, workers: int | None, as_json: bool,
    verbose: bool,
) -> int:  # fmt: skip
    """Go on with a run, a sweep or a fit."""
    of_runs = {"until": until, "set": overrides, "verbose": verbose}
    if is_fit(run_path):
        refuse_options(f"is for runs and sweeps; {run_path} is a fit, which goes on as it was begun",
                       **of_runs, workers=workers)  # fmt: skip
        from rigidsim.cli.commands import fit  # which few need

        return fit.resume(run_path, as_json)
    if not is_sweep(run_path):
        refuse_options(f"is for sweeps; {run_path} is a run, which one process integrates", workers=workers)
        if as_json:
            refuse_options("is for people, and --json always prints everything", verbose=verbose)
        with watched(None, True) as observer:
            run = resuming.resume(run_path, until=until, overrides=overrides or [], observer=observer)
        return print_run(run, as_json, verbose=verbose)
    what = f"is for runs, and {run_path} is a sweep; change its config and give rigidsim sweep CONFIG again"
    refuse_options(f"{what} (that computes only what is new)", **of_runs)
    with meter() as shown:
        result = workflow.resume_sweep(run_path, workers=workers or 1, observer=SweepProgress(shown))
    return _print(result, as_json)


def verify(run_path: Path, members: int | None, back: bool, as_json: bool) -> int:
    """Integrate again and compare."""
    if not is_sweep(run_path):
        refuse_options(f"is for sweeps; {run_path} is compared as a whole", members=members)
    if is_sweep(run_path) or is_fit(run_path):
        refuse_options(f"is for single runs, and {run_path} is none", reversed=back)
    if is_fit(run_path):
        from rigidsim.cli.commands import fit

        return fit.verify(run_path, as_json)
    if is_sweep(run_path):
        verdict, what = verify_sweep(run_path, members=MEMBERS if members is None else members), "member"
    else:
        with watched(None, True) as observer:
            verdict, what = verifying.verify(run_path, reversed=back, observer=observer), "sample"
    report = verdict.as_dict()
    answer(as_json, report, print_verdict, report, what)
    return 0 if verdict.identical else 1


def info(path: Path, as_json: bool) -> None:
    """Print how a sweep's members ended."""
    found = open_sweep(path)
    _print(found, as_json)
    found.refuse_damaged()


def _print(result: SavedSweep, as_json: bool) -> int:
    """Print a sweep; returns its exit code."""
    answer(as_json, result.summary, print_sweep, result)
    return int(result.summary.get("exit_code", 0))


def _share(text: str) -> tuple[int, int]:
    first, colon, stop = text.partition(":")
    if not (colon and first.isdigit() and stop.isdigit() and int(first) < int(stop)):
        raise RigidsimError(
            f"--tiles: given {text!a}; two whole numbers A:B are allowed, A below B, counted from 0, such as "
            "0:25 (rigidsim plan says how many tiles there are)"
        )
    return int(first), int(stop)
