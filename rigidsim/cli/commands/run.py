"""``rigidsim run``: integrate configs."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigidsim.cli.options import JsonOption, OutOption, SetOption, print_run
from rigidsim.errors import RigidsimError

if TYPE_CHECKING:
    from rigidsim.scene.config import Experiment


def run(
    configs: Annotated[
        list[Path] | None, typer.Argument(metavar="CONFIG...", help="TOML files.", show_default=False)
    ] = None,
    dataset: Annotated[
        Path | None,
        typer.Option("--from", metavar="DATASET", help="Run the config that a dataset embeds."),
    ] = None,
    out: OutOption = Path("runs"),
    overrides: SetOption = None,
    scan: Annotated[
        list[str] | None,
        typer.Option(
            "--sweep",
            metavar="KEY=SPEC",
            help="Run once for each value of a key, time.end=[1,2] or KEY=linspace(0,1,11); repeatable.",
        ),
    ] = None,
    member: Annotated[
        int | None,
        typer.Option("--member", metavar="N", min=0, help="Of a sweep: member N by itself, counted from 0."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a run of the same name.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Integrate, write the run folder, print a summary of invariants and cost.

    Example: rigidsim run configs/intermediate_axis.toml --set time.end=100
    """
    from rigidsim.scene.config import has_earlier_settings
    from rigidsim.scene.suspicions import suspicious_angles, suspicious_end
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
        raise typer.Exit(_scanned(experiments, scan, out, force=force, as_json=as_json))
    if not experiments:
        raise RigidsimError("run: give a CONFIG, or --from a dataset; rigidsim run --help shows an example")
    if member is not None:
        from rigidsim.workflows.sweep_members import single_member

        experiments = [single_member(experiment, member) for experiment in experiments]
    for experiment in experiments:
        if has_earlier_settings(experiment.given):
            print(
                f"rigidsim: {experiment.source}: #:set comments at its end set nothing (an earlier version "
                "kept there what --set had replaced); write the values where their keys stand",
                file=sys.stderr,
            )
        for problem in (*suspicious_angles(experiment.config), *suspicious_end(experiment.config)):
            print(f"rigidsim: warning: {experiment.source}: {problem}", file=sys.stderr)
    worst = 0
    for experiment in experiments:
        with progress.observer() as observer:
            result = run_experiment(experiment, out=out, force=force, observer=observer)
        code = print_run(result, as_json)
        worst = worst or code
        if code == 130:
            break
    raise typer.Exit(worst)


def _scanned(experiments: list[Experiment], scan: list[str], out: Path, *, force: bool, as_json: bool) -> int:
    """Each config swept over what ``--sweep`` says; the exit code."""
    from rigidsim.cli.sweep_screens import observer, print_sweep
    from rigidsim.workflows.sweep import scanned
    from rigidsim.workflows.sweep import sweep as run_all

    worst = 0
    for experiment in experiments:
        with observer() as watching:
            result = run_all(scanned(experiment, scan), out=out, force=force, observer=watching)
        if as_json:
            print(json.dumps(result.summary))
        else:
            print_sweep(result)
        worst = worst or int(result.summary["exit_code"])
    return worst
