"""``rigidsim plan``: what would be integrated, and what it would cost."""

from __future__ import annotations

from pathlib import Path

from rigidsim.cli.machine import print_json
from rigidsim.cli.options import ConfigPath, JsonOption, OutOption, SetOption


def plan(
    config: ConfigPath,
    overrides: SetOption = None,
    out: OutOption = Path("runs"),
    as_json: JsonOption = False,
) -> None:
    """Explain what would be integrated and why; predict steps, time, memory and file sizes.

    Example: rigidsim plan configs/heavy_top_nutating.toml
    """
    from rigidsim.cli.screens import summary as tables
    from rigidsim.workflows.plan import plan as make_plan
    from rigidsim.workflows.read import load

    experiment = load(config, overrides=overrides or [])
    if experiment.config.sweep is not None:
        from rigidsim.cli.screens.sweeps import print_sweep_plan
        from rigidsim.scene.sweeps.sweep import Sweep
        from rigidsim.workflows.sweeps.plan import plan_sweep

        whole = plan_sweep(Sweep.of(experiment))
        if as_json:
            print_json(whole)
            return
        print_sweep_plan(whole)
        made = whole["member"]
    else:
        made = make_plan(experiment, out=out)
    if as_json:
        print_json(made)
    else:
        tables.print_plan(made)
