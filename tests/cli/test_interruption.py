"""Ctrl-C, SIGTERM and SIGKILL in the middle of a run: prompt, and nothing that was integrated is lost."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from support import OFTEN, cases, same_bits

import rigidsim
from rigidsim.cli.app import exit_code

pytestmark = pytest.mark.optimised  # as the processes that these are held against

Config = Callable[..., str]
Start = Callable[..., subprocess.Popen[str]]

FOREVER = 1e9
GUARDED = "[limits]\nwall_time = 3600"  # a run that may be stopped isn't refused for want of room
PATIENCE = 2.0  # seconds; half a second is promised, measured are 0.2 to 0.4, and machines are noisy

# precision, spacing of the samples in seconds, signal
LONG = {
    "double, dense": ('"double"', 0.0625, signal.SIGINT),
    "double, a sample per many steps": ('"double"', 16.0, signal.SIGINT),
    "double, sparse": ('"double"', 8192.0, signal.SIGTERM),
    "quadruple, dense": ('"quadruple"', 0.125, signal.SIGINT),
    "50 digits, dense": ("50", 0.125, signal.SIGTERM),
    "50 digits, sparse": ("50", 16.0, signal.SIGINT),
}


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


@pytest.mark.parametrize("case", cases(LONG, ("double, sparse",)))
def test_an_interrupted_run_keeps_what_it_has(case: str, config: Config, start: Start) -> None:
    precision, spacing, number = LONG[case]
    long = f"end = {FOREVER}\nevery = {spacing}"
    name = config(time=long, integrator=f"precision = {precision}", rest=GUARDED)
    process = start("run", name)
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

    run = rigidsim.open_run("runs/free")
    assert run.status == "interrupted"
    assert run.summary["exit_code"] == 130
    assert run.summary["bit_for_bit"]["claim"] is False
    assert not run.folder.dataset.exists()
    assert not list(run.folder.path.rglob("*.partial"))
    # the same motion to a nearer end: samples never steer the steps, so these are the first of the full run
    full = config(
        "full", time=f"end = {24 * spacing}\nevery = {spacing}", integrator=f"precision = {precision}"
    )
    with run.dataset as partial, rigidsim.run(full).dataset as whole:
        assert partial.sizes["time"] == run.summary["samples"]
        np.testing.assert_array_equal(partial.time, np.arange(partial.sizes["time"]) * spacing)
        assert partial.attrs["status"] == "interrupted"
        assert assert_first_samples(partial, whole) > 1


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


@pytest.mark.slow
def test_an_interruption_ends_the_whole_command(config: Config, start: Start) -> None:
    long = config("a", time=f"end = {FOREVER}\nevery = 1", rest=GUARDED)
    process = start("run", long, config("b"))
    integrating(process)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    assert process.returncode == 130
    assert not Path("runs/b").exists()


@pytest.mark.slow
def test_a_killed_run_opens_as_running(config: Config, start: Start) -> None:
    """Before its first segment, when nothing is saved yet."""
    process = start("run", config(time=f"end = {FOREVER}\nevery = 1", rest=GUARDED))
    integrating(process)
    time.sleep(0.2)
    process.send_signal(signal.SIGKILL)
    process.wait(timeout=10)
    for path in (["runs/free"], ["runs/free", "--json"]):
        info = start("info", *path)
        out, err = info.communicate(timeout=30)
        assert info.returncode == 0, err
        assert "running" in out
    assert json.loads(out) == {"status": "running", "message": "the run is under way, or was killed"}


@pytest.mark.slow
def test_a_killed_run_keeps_its_segments(config: Config, start: Start) -> None:
    process = start(
        "run",
        config(time=f"end = {FOREVER}\nevery = 0.125", integrator='precision = "quadruple"', rest=GUARDED),
        prelude=OFTEN,
    )
    integrating(process)
    deadline = time.monotonic() + 30
    while len(list(Path("runs/free/segments").glob("[0-9]*.h5"))) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait(timeout=10)
    info = start("info", "runs/free")
    out, err = info.communicate(timeout=30)
    assert info.returncode == 0, err
    assert "running" in out
    assert " samples of " in out
    run = rigidsim.open_run("runs/free")
    assert run.status == "running"
    full = config("full", time="end = 8\nevery = 0.125", integrator='precision = "quadruple"')
    with run.dataset as partial, rigidsim.run(full).dataset as whole:
        np.testing.assert_array_equal(partial.time, np.arange(partial.sizes["time"]) / 8)
        assert assert_first_samples(partial, whole) > 20


@pytest.mark.parametrize("phase", ["dataset", "timeline"])
def test_ctrl_c_after_the_integration(phase: str, config: Config, monkeypatch: pytest.MonkeyPatch) -> None:
    """The dataset is either whole or still in segments, and the message says which."""
    import rigidsim.look.timeline as timeline
    from rigidsim.store.segments import SegmentWriter

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    if phase == "dataset":
        monkeypatch.setattr(SegmentWriter, "complete", interrupted)
    else:
        monkeypatch.setattr(timeline, "write_timeline", interrupted)
    experiment = rigidsim.load(config(), overrides=["output.timeline=true"])
    run = rigidsim.run(experiment)
    assert run.status == "interrupted"
    assert run.summary["exit_code"] == 130
    assert run.summary == rigidsim.open_run("runs/free").summary
    assert run.folder.dataset.exists() == (phase == "timeline")
    said = {"dataset": "all samples are saved as segments", "timeline": "the dataset is complete"}
    assert said[phase] in run.summary["message"]
    with run.dataset as dataset:
        assert dataset.sizes["time"] == 49


# ---- exit codes of commands that Ctrl-C ends, wherever it finds them


def interrupted_as(kind: type[Exception]) -> int:
    """What a library does to Ctrl-C that comes while it works."""
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as signal:
        raise kind("initialization failed") from signal


def test_an_import_that_was_interrupted_is_an_interruption(capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_code(lambda: interrupted_as(ImportError)) == 130
    assert capsys.readouterr().err == "rigidsim: interrupted\n"


def test_what_goes_wrong_after_an_interruption_is_not_hidden() -> None:
    with pytest.raises(ValueError, match="initialization failed"):
        exit_code(lambda: interrupted_as(ValueError))


def test_a_library_that_cannot_be_loaded_is_not_an_interruption() -> None:
    def command() -> int:
        raise ImportError("no such library")

    with pytest.raises(ImportError, match="no such library"):
        exit_code(command)
