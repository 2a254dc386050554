"""``rigidsim info``: the summary of a run."""

from __future__ import annotations

from rigidsim.cli.machine import print_json
from rigidsim.cli.options import JsonOption, RunPath


def info(run_path: RunPath, as_json: JsonOption = False) -> None:
    """Summary of a run, finished or partial; exit code 2 if its dataset is damaged or was edited.

    Example: rigidsim info runs/intermediate_axis
    """
    from rigidsim.cli.screens import summary as tables
    from rigidsim.cli.screens.page import page
    from rigidsim.store.run import open_run
    from rigidsim.store.sweeps.folder import is_sweep

    if is_sweep(run_path):
        from rigidsim.cli.screens.sweeps import print_sweep
        from rigidsim.store.sweeps.run import open_sweep

        found = open_sweep(run_path)
        if as_json:
            print_json(found.summary)
        else:
            print_sweep(found)
        found.refuse_damaged()
        return
    opened = open_run(run_path)
    if as_json:
        print_json(opened.summary)
        opened.refuse_damaged()
        return
    tables.print_summary(opened.outcome, str(opened.folder.path), loads=True)
    if not opened.saved:
        page().say("dataset  nothing was saved yet")
        return
    with opened.dataset as dataset:
        page().say(f"dataset  {dataset.sizes['time']:,} samples of {', '.join(map(str, dataset.data_vars))}")
