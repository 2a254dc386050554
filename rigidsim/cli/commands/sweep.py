"""The command ``sweep``, and the sweeps of ``run --sweep``."""

from collections.abc import Sequence
from pathlib import Path

import rigidsim.workflows.sweeps.sweep as workflow
from rigidsim.cli.exits import refuse_options
from rigidsim.cli.screens.page import answer
from rigidsim.cli.screens.sweeps import SweepProgress, print_sweep
from rigidsim.errors import RigidsimError
from rigidsim.scene.config import Experiment
from rigidsim.scene.sweep import scanned
from rigidsim.session.progress import meter
from rigidsim.store.sweeps.saved import SavedSweep
from rigidsim.workflows.read import load


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
    code = ended(result, as_json)
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
        worst = worst or ended(result, as_json)
    return worst


def ended(result: SavedSweep, as_json: bool) -> int:
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
