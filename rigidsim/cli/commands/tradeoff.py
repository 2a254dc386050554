"""``rigidsim tradeoff``: speed against accuracy of a scene."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from rigidsim.cli.machine import print_json
from rigidsim.cli.options import ConfigPath, JsonOption, SetOption


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
    from rigidsim.cli.screens.tradeoff import print_tradeoff
    from rigidsim.workflows.read import load
    from rigidsim.workflows.tradeoff import tradeoff as measure

    experiment = load(config, overrides=overrides or [])

    def told(text: str) -> None:
        print(f"{experiment.config.name}: {text}", file=sys.stderr, flush=True)

    result = measure(
        experiment, out=out, budget=budget, repeats=repeats, full=full, force=force, told=told
    ).as_dict()
    if as_json:
        print_json(result)
    else:
        print_tradeoff(result)
