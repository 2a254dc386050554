"""Commands on saved runs and sweeps: ``resume``, ``verify``."""

from pathlib import Path

import rigidsim.workflows.resume as resuming
import rigidsim.workflows.verify as verifying
from rigidsim.cli.commands import sweep as sweeps
from rigidsim.cli.commands.run import print_run
from rigidsim.cli.screens.page import answer
from rigidsim.cli.screens.summary import print_verdict
from rigidsim.errors import RigidsimError
from rigidsim.session import progress
from rigidsim.store.sweeps.folder import is_sweep
from rigidsim.workflows.sweeps.verify import verify_sweep


def resume(
    run_path: Path, until: str | None, overrides: list[str] | None, workers: int, as_json: bool
) -> int:
    """Go on with a run or a sweep."""
    if not is_sweep(run_path):
        with progress.observer() as observer:
            result = resuming.resume(run_path, until=until, overrides=overrides or [], observer=observer)
        return print_run(result, as_json)
    if until is not None or overrides:
        raise RigidsimError(
            "resume: --until and --set are for single runs; change the config of a sweep and give rigidsim "
            "sweep CONFIG again, which computes only what is new"
        )
    return sweeps.resume(run_path, workers, as_json)


def verify(run_path: Path, members: int, as_json: bool) -> int:
    """Integrate again and compare."""
    if is_sweep(run_path):
        verdict, what = verify_sweep(run_path, members=members), "member"
    else:
        with progress.observer() as observer:
            verdict, what = verifying.verify(run_path, observer=observer), "sample"
    told = verdict.as_dict()
    answer(as_json, told, print_verdict, told, what)
    return 0 if verdict.identical else 1
