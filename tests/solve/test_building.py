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
from rigidsim.solve.compiled import building, compiled_engine, give_up, interruptible, take_up

PLAIN = "estimate = false"
AWAKE = 60.0  # seconds that nobody waits for


def test_a_signal_ends_the_wait() -> None:
    never, before = threading.Event(), signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        threading.Timer(0.05, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            interruptible(lambda: never.wait(AWAKE))
        assert building()
    finally:
        signal.signal(signal.SIGINT, before)
        never.set()


def test_what_is_made_or_raised_comes_back() -> None:
    assert interruptible(threading.current_thread) is not threading.main_thread()
    with pytest.raises(ZeroDivisionError):
        interruptible(lambda: 1 // 0)
    inside: list[bool] = []

    def work() -> None:  # signals reach the main thread alone
        inside.append(interruptible(threading.current_thread) is threading.current_thread())

    other = threading.Thread(target=work)
    other.start()
    other.join()
    assert inside == [True]


def test_nothing_more_is_begun_that_nobody_waits_for() -> None:
    give_up()
    try:
        with pytest.raises(KeyboardInterrupt):
            interruptible(lambda: 1)
    finally:
        take_up()
    assert interruptible(lambda: 1) == 1


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
