"""``rigidsim info``: the summary of a run or a sweep."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.cli.screens.page import Page, print_json
from rigidsim.cli.screens.summary import arcsec_text, print_summary
from rigidsim.store.fits import is_fit
from rigidsim.store.run import open_run
from rigidsim.store.sweeps.folder import is_sweep

if TYPE_CHECKING:
    import xarray


def info(run_path: Path, as_json: bool) -> None:
    """Print what is saved."""
    if is_sweep(run_path):
        from rigidsim.cli.commands import sweep

        sweep.info(run_path, as_json)
        return
    if is_fit(run_path):
        from rigidsim.cli.commands import fit

        fit.info(run_path, as_json)
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
        if "published_angle" in dataset:
            on.line("published", _published(dataset))


def _published(dataset: "xarray.Dataset") -> str:
    angle = np.rad2deg(dataset["published_angle"]) * 3600
    kernel, most, mean = dataset.attrs["orientation_kernel"], float(angle.max()), float(angle.mean())
    return f"at most {arcsec_text(most)} from the attitude in {kernel}, {arcsec_text(mean)} on average"
