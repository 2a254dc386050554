"""``rigidsim run``: integrate configs, and print how each run ended."""

import sys
from pathlib import Path

import rigidsim.workflows.run as workflow
from rigidsim.cli.exits import refuse_options
from rigidsim.cli.screens.summary import print_run
from rigidsim.errors import RigidsimError
from rigidsim.scene.scene import build_scene
from rigidsim.session.progress import watched
from rigidsim.session.understood import cautions_about, cautions_of
from rigidsim.store.outputs import refuse_inputs
from rigidsim.workflows.read import embedded, load


def run(
    configs: list[Path] | None, dataset: Path | None, out: Path, overrides: list[str] | None,
    scan: list[str] | None, member: int | None, force: bool, as_json: bool, verbose: bool,
) -> int:  # fmt: skip
    """Read every config before any of them is run; the first that didn't finish gives the exit code."""
    experiments = [load(path, overrides=overrides or []) for path in configs or []]
    if dataset is not None:
        experiments.append(embedded(dataset, overrides=overrides or []))
    if scan:
        refuse_options("is for runs, and --sweep makes a sweep", member=member, verbose=verbose)
    if as_json:
        refuse_options("is for people, and --json always prints everything", verbose=verbose)
    read = [path for experiment in experiments for path in experiment.files]
    refuse_inputs([out / experiment.config.name for experiment in experiments], read)
    if scan:
        from rigidsim.cli.commands import sweep as sweeps  # a separate module

        return sweeps.run_scanned(experiments, scan, out, force=force, as_json=as_json)
    if member is not None:
        from rigidsim.workflows.sweeps.members import single_member

        experiments = [single_member(experiment, member) for experiment in experiments]
    if not experiments:
        raise RigidsimError("run: give a CONFIG, or --from a dataset; rigidsim run --help shows an example")
    worst = 0
    for experiment in experiments:
        # what may mean something else is said before time is spent on it; a sweep is refused later
        config = experiment.config
        acting = bool(config.loads or config.events) and config.sweep is None
        for caution in cautions_of(build_scene(experiment)) if acting else cautions_about(config):
            print(f"rigidsim: warning: {experiment.source}: {caution.text}", file=sys.stderr)
        with watched(None, True) as observer:
            result = workflow.run(experiment, out=out, force=force, observer=observer)
        code = print_run(result, as_json, verbose=verbose)
        worst = worst or code
        if code == 130:
            break
    return worst
