"""``resume``, ``verify`` and ``run --from`` as commands: exit codes, messages, signals to real processes."""

import json
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support import OFTEN, cases, same_bits

import rigidsim

pytestmark = pytest.mark.optimised  # as the processes that these are held against

Config = Callable[..., str]
Command = Callable[..., Any]
Start = Callable[..., subprocess.Popen[str]]


@pytest.mark.slow
def test_resume_goes_on_and_verify_agrees(config: Config, rigidsim_command: Command) -> None:
    name = config(time="end = 3000\nsamples = 31", rest="[limits]\nmax_steps = 50")
    stopped = rigidsim_command("run", name)
    assert stopped.exit_code == 3
    done = rigidsim_command("resume", "runs/free", "--set", "limits.max_steps=1000000", "--json")
    assert done.exit_code == 0, done.output
    verified = rigidsim_command("verify", "runs/free", "--json")
    assert verified.exit_code == 0
    assert json.loads(verified.stdout)["identical"] is True
    again = rigidsim_command("resume", "runs/free")
    assert again.exit_code == 0
    assert "nothing is left to do: the run reached its last sample" in again.stderr
    later = rigidsim_command("resume", "runs/free", "--until", "4000", "--set", "limits.max_steps=1000000")
    assert later.exit_code == 0, later.output
    with rigidsim.open_run("runs/free").dataset as dataset:
        assert dataset.sizes["time"] == 41


@pytest.mark.parametrize("number", cases([signal.SIGTERM, signal.SIGKILL], [signal.SIGKILL]))
def test_a_process_that_was_ended_is_resumed(number: int, config: Config, start: Start) -> None:
    """With the bits of a run in one go."""
    time_table = "end = 6000\nsamples = 601"
    process = start("run", config(time=time_table, integrator='precision = "extended"'), prelude=OFTEN)
    deadline = time.monotonic() + 60
    while len(list(Path("runs/free/segments").glob("[0-9]*.h5"))) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.005)
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert process.returncode == (-9 if number == signal.SIGKILL else 130)
    assert "Traceback" not in err
    with rigidsim.open_run("runs/free").dataset as partial:
        assert 0 < partial.sizes["time"] < 601
    resumed = rigidsim.resume("runs/free")
    whole = rigidsim.run("free.toml", out="whole")
    same_bits(resumed, whole)


def test_two_processes_on_one_folder(config: Config, start: Start, rigidsim_command: Command) -> None:
    process = start("run", config(time="end = 1e9\nevery = 1", rest="[limits]\nwall_time = 3600"))
    deadline = time.monotonic() + 60
    while not Path("runs/free/segments").exists():
        assert time.monotonic() < deadline
        time.sleep(0.005)
    for command in (["resume", "runs/free"], ["run", "free.toml", "--force"]):
        second = rigidsim_command(*command)
        assert second.exit_code == 2
        assert "another process is at work there; wait for it" in second.stderr
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 130
