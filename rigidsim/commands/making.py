"""Commands that integrate, or say what would be integrated: run, resume, verify, plan, tradeoff, schema."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rigidsim.commands.shared import ConfigPath, JsonOption, RunPath, SetOption
from rigidsim.errors import RigidsimError

if TYPE_CHECKING:
    from rigidsim.archive import Run


def run(
    configs: Annotated[
        list[Path] | None, typer.Argument(metavar="CONFIG...", help="TOML files.", show_default=False)
    ] = None,
    dataset: Annotated[
        Path | None,
        typer.Option("--from", metavar="DATASET", help="Run the config that a dataset embeds."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the run folders.")] = Path(
        "runs"
    ),
    overrides: SetOption = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a run of the same name.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Integrate, write the run folder, print a summary of invariants and cost.

    Example: rigidsim run configs/intermediate_axis.toml --set time.end=100
    """
    from rigidsim import progress
    from rigidsim.runner import run as run_experiment
    from rigidsim.scene.reading import load

    experiments = [load(path, overrides=overrides or []) for path in configs or []]
    if dataset is not None:
        from rigidsim.verification import embedded

        experiments.append(embedded(dataset, overrides=overrides or []))
    if not experiments:
        raise RigidsimError("run: give a CONFIG, or --from a dataset; rigidsim run --help shows an example")
    worst = 0
    for experiment in experiments:
        with progress.observer() as observer:
            result = run_experiment(experiment, out=out, force=force, observer=observer)
        code = _told(result, as_json)
        worst = worst or code
        if code == 130:
            break
    raise typer.Exit(worst)


def _told(result: Run, as_json: bool) -> int:
    """Print a run's summary; returns its exit code."""
    from rigidsim import report

    if as_json:
        print(json.dumps(result.summary))
    else:
        report.print_summary(result.summary, str(result.folder.path))
    code = int(result.summary["exit_code"])
    if code:
        print(f"rigidsim: {result.summary['message']}", file=sys.stderr)
    return code


def resume(
    run_path: RunPath,
    until: Annotated[
        str | None, typer.Option("--until", metavar="END", help='A later end, such as "2 h" or 5000.')
    ] = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="A guard of this session, such as limits.max_steps=1000000."
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Go on with an interrupted, killed or guarded run; the result is bit for bit the uninterrupted one.

    Example: rigidsim resume runs/intermediate_axis
    """
    from rigidsim import progress
    from rigidsim.resuming import resume as go_on

    with progress.observer() as observer:
        result = go_on(run_path, until=until, overrides=overrides or [], observer=observer)
    raise typer.Exit(_told(result, as_json))


def verify(run_path: RunPath, as_json: JsonOption = False) -> None:
    """Integrate the embedded config again and compare: identical, or what differs first. Exit code 1 then.

    Example: rigidsim verify runs/intermediate_axis
    """
    from rigidsim import progress, report
    from rigidsim.verification import verify as compare

    with progress.observer() as observer:
        verdict = compare(run_path, observer=observer)
    if as_json:
        print(json.dumps(verdict.as_dict()))
    else:
        report.print_verdict(verdict.as_dict())
    raise typer.Exit(0 if verdict.identical else 1)


def plan(config: ConfigPath, overrides: SetOption = None, as_json: JsonOption = False) -> None:
    """Explain what would be integrated and why; predict steps, time, memory and file sizes.

    Example: rigidsim plan configs/heavy_top_nutating.toml
    """
    from rigidsim import report
    from rigidsim.planner import plan as make_plan
    from rigidsim.scene.reading import load

    made = make_plan(load(config, overrides=overrides or []))
    if as_json:
        print(json.dumps(made))
    else:
        report.print_plan(made)


def tradeoff(
    config: ConfigPath,
    overrides: SetOption = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the run folders.")] = Path(
        "runs"
    ),
    budget: Annotated[
        float, typer.Option("--budget", metavar="SECONDS", help="Time that it may take, roughly.")
    ] = 90.0,
    repeats: Annotated[
        int, typer.Option("--repeats", metavar="N", help="Fresh processes in which speeds are taken.")
    ] = 3,
    full: Annotated[
        bool, typer.Option("--full", help="Every tolerance in every formulation; needs a larger budget.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier measurement.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Measure speed against accuracy of a scene: what to use for which accuracy. Dataset and figure in
    NAME_tradeoff.

    Example: rigidsim tradeoff configs/asymmetric_top.toml
    """
    from rigidsim import report
    from rigidsim.scene.reading import load
    from rigidsim.tradeoff import tradeoff as measure

    experiment = load(config, overrides=overrides or [])

    def told(text: str) -> None:
        print(f"{experiment.config.name}: {text}", file=sys.stderr, flush=True)

    result = measure(
        experiment, out=out, budget=budget, repeats=repeats, full=full, force=force, told=told
    ).as_dict()
    if as_json:
        print(json.dumps(result))
    else:
        report.print_tradeoff(result)


def schema() -> None:
    """Print the config's JSON schema, for editors.

    Example: rigidsim schema > rigidsim.schema.json
    """
    from rigidsim.scene.schema import Config

    print(json.dumps(Config.model_json_schema(), indent=2))
