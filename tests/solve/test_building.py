"""Compiling doesn't keep Ctrl-C waiting."""

from __future__ import annotations

import os
import signal
import threading
from pathlib import Path
from typing import Any

import heyoka as hy
import pytest
from support import config, run_text, same_bits

import rigidsim
from rigidsim.solve.compiled import compiled_engine

PLAIN = "estimate = false"
AWAKE = 60.0  # seconds that nobody waits for


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
