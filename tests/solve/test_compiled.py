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
import numpy as np
import pytest
from support import config, run_text, same_bits

import rigidsim
from rigidsim.solve.compiled import DISK_LIMIT, compiled_engine, compiled_function, limit_disk_cache

pytestmark = pytest.mark.optimised

x, v = hy.make_vars("x", "v")


def test_functions_are_told_apart_by_the_sign_of_a_zero() -> None:
    """Expressions that differ in nothing else count as equal."""
    zeros = [hy.expression(0.0), hy.expression(-0.0)]
    assert zeros[0] == zeros[1]
    signs = [np.signbit(compiled_function([zero], [x])(np.array([1.0]))[0]) for zero in zeros]
    assert signs == [False, True]


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


def test_the_cache_on_disk_stays_small_unless_somebody_set_its_limit() -> None:
    compiled_function([x * v], [x, v])
    assert hy.llvm_state.get_diskcache_limit() == DISK_LIMIT
    try:
        for limit in (DISK_LIMIT * 3, 0):
            hy.llvm_state.set_diskcache_limit(limit)
            limit_disk_cache.cache_clear()
            compiled_function([x * v + limit], [x, v])
            assert hy.llvm_state.get_diskcache_limit() == limit
    finally:
        hy.llvm_state.set_diskcache_limit(DISK_LIMIT)


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


@pytest.mark.slow
def test_ctrl_c_while_another_chart_is_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the middle of a chunk of steps: what was integrated before it is kept, and resumed with the bits of
    a run in one go.
    """
    text = config(time="end = 60\nsamples = 241", integrator='formulation = "euler_angles"', output=PLAIN)
    whole = run_text(text, out=tmp_path / "whole")
    assert whole.summary["chart_changes"]["count"] > 0
    never, charts = threading.Event(), []

    def interrupted(equations: Any, *given: Any, **options: Any) -> Any:
        charts.append(equations)
        if len(charts) == 2:
            os.kill(os.getpid(), signal.SIGINT)
            never.wait(AWAKE)
        return compiled_engine(equations, *given, **options)

    with monkeypatch.context() as patch:
        patch.setattr("rigidsim.solve.taylor_stepper.compiled_engine", interrupted)
        run = run_text(text, out=tmp_path / "cut")
    never.set()
    assert run.status == "interrupted"
    assert run.summary["samples"] < 241
    same_bits(rigidsim.resume(run.folder.path), whole)


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


def test_charts_that_turns_are_counted_in_are_compiled_beside_the_main_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A signal would wait for two charts of Euler angles in code of their own."""
    where: list[bool] = []
    cfunc = hy.cfunc

    def noted(expressions: Any, *given: Any, **options: Any) -> Any:
        if len(expressions) == len(["wx", "wy", "wz", "qw", "qx", "qy", "qz"]):
            where.append(threading.current_thread() is threading.main_thread())
        return cfunc(expressions, *given, **options)

    monkeypatch.setattr(hy, "cfunc", noted)
    run_text(
        config(
            time="end = 60\nsamples = 3",
            integrator='formulation = "euler_angles"',
            output=f'record = ["rotation_angle"]\n{PLAIN}',
        ),
        out=tmp_path,
    )
    assert where == [False, False]
