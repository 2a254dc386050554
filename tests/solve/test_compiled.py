"""What is compiled is compiled once, and serves only what asks for the very same."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import heyoka as hy
import pytest
from support import config, run_text, same_bits

import rigidsim

pytestmark = pytest.mark.optimised

x, v = hy.make_vars("x", "v")


def test_a_second_run_compiles_nothing_and_is_the_same(
    monkeypatch: pytest.MonkeyPatch, free_body: Callable[..., str]
) -> None:
    experiment = rigidsim.parse(free_body())
    first = rigidsim.run(experiment, out=None)

    def compiled(*_: Any, **__: Any) -> None:
        raise AssertionError("compiled again")

    monkeypatch.setattr(hy, "taylor_adaptive", compiled)
    monkeypatch.setattr(hy, "cfunc", compiled)
    same_bits(first, rigidsim.run(experiment, out=None))


def test_a_cache_that_cannot_be_written_stops_no_run(tmp_path: Path) -> None:
    """As on a full disk; a file in the cache's place does the same. The cache is chosen once per process."""
    (tmp_path / "file").touch()
    script = (
        "import warnings, heyoka as hy\n"
        "from rigidsim.solve.compiled import compiled_function\n"
        "x = hy.make_vars('x')\n"
        "with warnings.catch_warnings(record=True) as told:\n"
        "    warnings.simplefilter('always')\n"
        "    print(compiled_function([x * x], [x])([3.0])[0], [str(w.message) for w in told])\n"
    )
    cache = {"HEYOKA_CACHE_DIR": str(tmp_path / "file" / "cache")}
    found = subprocess.run(
        [sys.executable, "-c", script], env=os.environ | cache, capture_output=True, text=True, check=True
    )
    assert found.stdout.startswith("9.0 [\"compiled code isn't kept for the next process")


# ---- compiling doesn't keep Ctrl-C waiting

PLAIN = "estimate = false"
AWAKE = 60.0  # seconds that nobody waits for


def test_ctrl_c_while_what_counts_turns_is_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """While samples are handed over: those that wait are left to the next session, with the same bits."""
    text = config(time="end = 600\nsamples = 61", output=f'record = ["euler_angles"]\n{PLAIN}')
    whole = run_text(text, out=tmp_path / "whole")
    assert abs(whole.dataset["euler_angles"].values).max() > 100  # turns are counted
    never = threading.Event()

    def interrupted(*_: Any, **__: Any) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        never.wait(AWAKE)

    with monkeypatch.context() as patch:
        patch.setattr("rigidsim.solve.turns.count.compiled_function", interrupted)
        run = run_text(text, out=tmp_path / "cut")
    never.set()
    assert run.status == "interrupted"
    assert run.summary["samples"] < 61
    same_bits(rigidsim.resume(run.folder.path), whole)
