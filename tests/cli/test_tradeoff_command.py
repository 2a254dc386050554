"""``rigidsim tradeoff`` from the command line: table, files, refusals."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import xarray


@pytest.mark.slow
def test_table_dataset_and_figure(config: Callable[..., str], rigidsim_command: Callable[..., Any]) -> None:
    name = config(time="end = 20\nsamples = 5", rest='record = ["angular_velocity"]')
    told = rigidsim_command("tradeoff", name, "--budget", "10", "--repeats", "1", "--json")
    assert told.exit_code == 0, told.stderr
    result = json.loads(told.stdout)
    with xarray.open_dataset("runs/free_tradeoff/tradeoff.h5") as data:
        assert data.sizes["setting"] == len(result["settings"])
    assert Path("runs/free_tradeoff/tradeoff.png").stat().st_size > 20_000
    levels = [row["at_most"] for row in result["advice"]]
    costs = [row["cost"] for row in result["advice"]]
    assert levels == sorted(levels, reverse=True)
    assert costs == sorted(costs)
    assert "attitudes" in result["compared"]
    # the cheapest come first, in two processes: of one more than the first that is left out nothing is known
    statuses = [row["status"] for row in result["settings"]]
    if "left out" in statuses:
        assert set(statuses[statuses.index("left out") + 2 :]) <= {"left out"}
    assert all(row["reason"] for row in result["settings"] if row["status"] == "left out")

    again = rigidsim_command("tradeoff", name, "--budget", "25")
    assert again.exit_code == 2
    assert "tradeoff.h5: exists; --force replaces it" in again.stderr

    # what it advises can be run
    for row in result["advice"][:2]:
        keys = [f"--set=integrator.{key.replace(' ', '')}" for key in row["keys"]]
        ran = rigidsim_command("run", name, "--force", *keys)
        assert ran.exit_code == 0, ran.stderr
