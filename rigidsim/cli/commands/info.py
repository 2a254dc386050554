"""``rigidsim info``: the summary of a run or a sweep."""

from pathlib import Path

from rigidsim.cli.screens.page import Page, print_json
from rigidsim.cli.screens.summary import print_summary
from rigidsim.store.run import open_run
from rigidsim.store.sweeps.folder import is_sweep


def info(run_path: Path, as_json: bool) -> None:
    """Print what is saved."""
    if is_sweep(run_path):
        from rigidsim.cli.commands import sweep

        sweep.info(run_path, as_json)
        return
    opened = open_run(run_path)
    if as_json:
        print_json(opened.summary)
        opened.refuse_damaged()
        return
    on = Page()
    print_summary(opened.outcome, str(opened.folder.path), loads=True)
    if not opened.saved:
        on.say("dataset  nothing was saved yet")
        return
    with opened.dataset as dataset:
        names = ", ".join(map(str, dataset.data_vars))
        on.say(f"dataset  {dataset.sizes['time']:,} samples of {names}")
