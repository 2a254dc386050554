"""Ctrl-C, SIGTERM and SIGKILL in the middle of a run: prompt, and nothing that was integrated is lost."""

import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from support import cases, same_bits

import rigidsim

pytestmark = pytest.mark.optimised  # as the processes that these are held against

Config = Callable[..., str]
Start = Callable[..., subprocess.Popen[str]]

FOREVER = 1e9
GUARDED = "[limits]\nwall_time = 3600"  # a run that may be stopped isn't refused for want of room
PATIENCE = 2.0  # seconds; half a second is promised, measured are 0.2 to 0.4, and machines are noisy


def integrating(process: subprocess.Popen[str]) -> None:
    """Wait until the run says that it integrates."""
    assert process.stderr is not None
    for line in process.stderr:
        if "integrating into" in line:
            return
    raise AssertionError("the run ended before it began")


def assert_first_samples(partial: xarray.Dataset, full: xarray.Dataset) -> int:
    """As many samples as both have are bit for bit the same; returns how many.

    Only a run that came to the step from which invariants are projected says what was put back: nothing yet,
    in the samples that it shares with a run that didn't.
    """
    count = min(partial.sizes["time"], full.sizes["time"])
    one, other = (dataset.isel(time=slice(count)).load() for dataset in (partial, full))
    alone = {str(name) for name in set(one.variables) ^ set(other.variables)}
    assert all(name.endswith("_put_back") for name in alone)
    for name in alone:
        assert not np.any((one if name in one else other)[name].values)
    same_bits(one.drop_vars(alone, errors="ignore"), other.drop_vars(alone, errors="ignore"))
    return count


LONG = [("50", 0.125, signal.SIGINT), ('"double"', 512.0, signal.SIGTERM)]


@pytest.mark.parametrize("case", cases(LONG, LONG[1:]))
def test_an_interrupted_run_keeps_what_it_has(
    case: tuple[str, float, signal.Signals], config: Config, start: Start
) -> None:
    """And the whole command ends."""
    precision, spacing, number = case
    long = f"end = {FOREVER}\nevery = {spacing}"
    name = config(time=long, integrator=f"precision = {precision}", rest=GUARDED)
    process = start("run", name, config("next"))
    integrating(process)
    time.sleep(0.6)
    sent = time.monotonic()
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    latency = time.monotonic() - sent
    assert process.returncode == 130
    assert latency < PATIENCE
    assert "free  interrupted" in out
    assert "rigidsim: the run was interrupted; what was integrated is kept" in err
    assert "Traceback" not in err
    assert not Path("runs/next").exists()

    run = rigidsim.open_run("runs/free")
    assert run.status == "interrupted"
    assert run.summary["exit_code"] == 130
    assert run.summary["bit_for_bit"]["claim"] is False
    assert not run.folder.dataset.exists()
    assert not list(run.folder.path.rglob("*.partial"))
    # the same motion to a nearer end: samples never steer the steps, so these are the first of the full run
    full = config(
        "full", time=f"end = {4 * spacing}\nevery = {spacing}", integrator=f"precision = {precision}"
    )
    with run.dataset as partial, rigidsim.run(full).dataset as whole:
        assert partial.sizes["time"] == run.summary["samples"]
        np.testing.assert_array_equal(partial.time, np.arange(partial.sizes["time"]) * spacing)
        assert partial.attrs["status"] == "interrupted"
        assert assert_first_samples(partial, whole) > 1


@pytest.mark.slow
def test_ctrl_c_while_the_engine_is_compiled(config: Config, start: Start) -> None:
    """Which takes seconds, and here a minute: nobody waits for it."""
    prelude = (
        "import sys, time, heyoka\n"
        "def slow(*_, **__):\n"
        "    print('compiling: integrating into', file=sys.stderr, flush=True)\n"
        "    time.sleep(60)\n"
        "heyoka.taylor_adaptive = slow"
    )
    process = start("run", config(), prelude=prelude)
    integrating(process)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert "rigidsim: interrupted" in err
    assert "Traceback" not in err
    assert rigidsim.resume("runs/free").status == "finished"


def test_ctrl_c_while_the_dataset_is_written(config: Config, monkeypatch: pytest.MonkeyPatch) -> None:
    """All is still in segments; what a timeline left out is in workflows/test_resume.py."""
    from rigidsim.store.segments import SegmentWriter

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(SegmentWriter, "complete", interrupted)
    experiment = rigidsim.load(config(), overrides=["output.timeline=true"])
    run = rigidsim.run(experiment)
    assert run.status == "interrupted"
    assert run.summary["exit_code"] == 130
    assert run.summary == rigidsim.open_run("runs/free").summary
    assert not run.folder.dataset.exists()
    assert "all samples are saved as segments" in run.summary["message"]
    with run.dataset as dataset:
        assert dataset.sizes["time"] == 49
