"""Execution of ``rigidsim run``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rigidsim.cli.machine import print_json
from rigidsim.errors import RigidsimError

if TYPE_CHECKING:
    from rigidsim.scene.config import Experiment
    from rigidsim.store.run import Run


def run_all(
    configs: Sequence[Path] | None = None,
    dataset: Path | None = None,
    out: Path = Path("runs"),
    overrides: list[str] | None = None,
    scan: list[str] | None = None,
    member: int | None = None,
    force: bool = False,
    as_json: bool = False,
) -> int:
    """Integrate, write the run folders, print summaries; see ``rigidsim.cli.commands.run`` for the arguments.

    Returns:
        The exit code, that of the first run that didn't finish.

    Raises:
        RigidsimError: a config can't be run, or the arguments contradict each other.
    """
    from rigidsim.scene.config import has_earlier_settings
    from rigidsim.session import progress
    from rigidsim.workflows.read import load
    from rigidsim.workflows.run import run as run_experiment

    experiments = [load(path, overrides=overrides or []) for path in configs or []]
    if dataset is not None:
        from rigidsim.workflows.verify import embedded

        experiments.append(embedded(dataset, overrides=overrides or []))
    if scan and member is not None:
        raise RigidsimError("run: --member is one of a config's [sweep], --sweep makes another: give one")
    if scan:
        return _scanned(experiments, scan, out, force=force, as_json=as_json)
    if not experiments:
        raise RigidsimError("run: give a CONFIG, or --from a dataset; rigidsim run --help shows an example")
    if member is not None:
        from rigidsim.workflows.sweeps.members import single_member

        experiments = [single_member(experiment, member) for experiment in experiments]
    for experiment in experiments:
        if has_earlier_settings(experiment.given):
            print(
                f"rigidsim: {experiment.source}: #:set comments at its end set nothing (an earlier version "
                "kept there what --set had replaced); write the values where their keys stand",
                file=sys.stderr,
            )
    worst = 0
    for experiment in experiments:
        _warn(experiment)
        with progress.observer() as observer:
            result = run_experiment(experiment, out=out, force=force, observer=observer)
        code = print_run(result, as_json)
        worst = worst or code
        if code == 130:
            break
    return worst


def _warn(experiment: Experiment) -> None:
    """Say what in a config may mean something else, before time is spent on it."""
    from rigidsim.scene.scene import build_scene
    from rigidsim.session.understood import cautions_about, cautions_of

    config = experiment.config
    acting = bool(config.loads or config.events) and config.sweep is None  # a sweep is refused later
    for caution in cautions_of(build_scene(experiment)) if acting else cautions_about(config):
        print(f"rigidsim: warning: {experiment.source}: {caution.text}", file=sys.stderr)


def print_run(result: Run, as_json: bool) -> int:
    """Print a run's summary; returns its exit code."""
    from rigidsim.cli.screens import summary as tables

    if as_json:
        print_json(result.summary)
    else:
        tables.print_summary(result.outcome, result.place)
    code = result.outcome.exit_code
    if code:
        print(f"rigidsim: {result.outcome.message}", file=sys.stderr)
    return code


def _scanned(experiments: list[Experiment], scan: list[str], out: Path, *, force: bool, as_json: bool) -> int:
    """Sweep each config over the axes that ``--sweep`` gives; returns the exit code."""
    from rigidsim.cli.screens.sweeps import observer, print_sweep
    from rigidsim.workflows.sweeps.scan import scanned
    from rigidsim.workflows.sweeps.sweep import sweep

    worst = 0
    for experiment in experiments:
        with observer() as watching:
            result = sweep(scanned(experiment, scan), out=out, force=force, observer=watching)
        if as_json:
            print_json(result.summary)
        else:
            print_sweep(result)
        worst = worst or int(result.summary["exit_code"])
    return worst
