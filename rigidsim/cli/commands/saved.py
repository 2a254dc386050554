"""Commands on a run, a sweep or a fit as it is saved, whichever it is: ``info``, ``resume``, ``verify``."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidsim.cli.exits import refuse_options
from rigidsim.cli.screens.page import Page, answer, print_json, reporting
from rigidsim.cli.screens.summary import arcsec_text, print_run, print_summary, print_verdict
from rigidsim.session.progress import meter, watched
from rigidsim.store.folder import FitFolder, SweepFolder, folder_at
from rigidsim.store.run import open_run

if TYPE_CHECKING:
    import xarray


def resume(
    run_path: Path, until: str | None, overrides: list[str] | None, workers: int | None, as_json: bool,
    verbose: bool,
) -> int:  # fmt: skip
    """Go on with it."""
    of_runs, folder = {"until": until, "set": overrides, "verbose": verbose}, folder_at(run_path)
    if isinstance(folder, FitFolder):
        refuse_options(f"is for runs and sweeps; {run_path} is a fit, which resumes with its options",
                       **of_runs, workers=workers)  # fmt: skip
        from rigidsim.cli.commands import fit  # which few need

        return fit.ended(fit.fitting.resume_fit(run_path, told=reporting("fit")), as_json)
    if isinstance(folder, SweepFolder):
        what = f"is for runs, and {run_path} is a sweep; change its config and give rigidsim sweep CONFIG"
        refuse_options(f"{what} again (that computes only what is new)", **of_runs)
        from rigidsim.cli.commands import sweep

        with meter() as shown:
            observer = sweep.SweepProgress(shown)
            done = sweep.workflow.resume_sweep(run_path, workers=workers or 1, observer=observer)
        return sweep.ended(done, as_json)
    refuse_options(f"is for sweeps; {run_path} is a run, which one process integrates", workers=workers)
    if as_json:
        refuse_options("is for people, and --json always prints everything", verbose=verbose)
    from rigidsim.workflows import run as running  # which loads what integrates

    with watched(None, True) as watching:
        run = running.resume(run_path, until=until, overrides=overrides or [], observer=watching)
    return print_run(run, as_json, verbose=verbose)


def verify(run_path: Path, members: int | None, back: bool, as_json: bool) -> int:
    """Make it again and compare."""
    from rigidsim.workflows import verify as verifying  # which loads what integrates

    kinds: dict[Any, str] = {FitFolder: "variable", SweepFolder: "member"}
    what = kinds.get(type(folder_at(run_path)), "sample")
    with watched(None, what == "sample") as observer:
        found = verifying.verify(
            run_path, reversed=back, members=members, observer=observer, report=reporting("fit")
        )
    shown = found.as_dict()
    answer(as_json, shown, print_verdict, shown, what)
    return 0 if found.identical else 1


def info(run_path: Path, as_json: bool) -> None:
    """Print what is saved."""
    folder = folder_at(run_path)
    if isinstance(folder, SweepFolder):
        from rigidsim.cli.commands import sweep
        from rigidsim.store.sweeps.saved import open_sweep

        swept = open_sweep(run_path)
        sweep.ended(swept, as_json)
        swept.refuse_damaged()
        return
    if isinstance(folder, FitFolder):
        from rigidsim.cli.commands import fit

        fit.ended(fit.fitting.read_result(folder), as_json)
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
